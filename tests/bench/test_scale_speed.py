"""Rows of speed: an epoch's time without the start, and no figure from a busy machine."""

import os

import pytest

from taxel.bench.scale import speed as scale_speed
from taxel.bench.scale.plan import WORKS


def test_an_epochs_time_is_free_of_start_and_features(monkeypatch, tmp_path):
    """Start 20 s (features 100 s more the first time), an epoch 30 s alone and 20 s with two."""
    asked = []

    def train(pours, folder, processes, epochs):
        asked.append((processes, epochs))
        return 20.0 + 100.0 * (len(asked) == 1) + epochs * {1: 30.0, 2: 20.0}[processes]

    monkeypatch.setattr(scale_speed, "_train", train)
    pytest.importorskip("lightning_fabric")
    row = scale_speed.training_row(tmp_path, tmp_path)
    assert row.value == pytest.approx(1.5)
    assert row.name == WORKS["training"][0]
    assert asked[1:] == [(1, 1), (1, 11), (2, 1), (2, 11)]


def test_a_start_that_drowns_the_epochs_gives_no_figure(monkeypatch, tmp_path):
    """As on a busy machine: the longer training was over sooner."""
    pytest.importorskip("lightning_fabric")
    monkeypatch.setattr(scale_speed, "_train", lambda _, __, ___, epochs: 30.0 - epochs)
    row = scale_speed.training_row(tmp_path, tmp_path)
    assert row.value is None
    assert "measure again" in row.note


def test_a_busy_machine_gives_no_figure(monkeypatch):
    monkeypatch.setattr(os, "getloadavg", lambda: (9.0, 9.0, 9.0))
    monkeypatch.setattr(scale_speed, "_PATIENCE_S", 0.0)
    rows = [row for _, measure in scale_speed.full_steps() for row in measure()]
    assert [row.name for row in rows] == [name for name, _ in WORKS.values()]
    assert all(row.value is None and "measure again" in row.note for row in rows)


def test_the_load_of_the_measurement_before_is_waited_for(monkeypatch):
    loads = iter([1.9, 0.8, 0.2])
    slept = []
    monkeypatch.setattr(os, "getloadavg", lambda: (next(loads), 9.0, 9.0))
    monkeypatch.setattr(scale_speed, "sleep", slept.append)
    assert scale_speed._load_at_rest() == 0.2
    assert len(slept) == 2


def test_the_median_of_the_rounds_is_given(monkeypatch):
    """One core takes 10 s each time; two take 5, 10 and 4 s: ratios 2, 1 and 2.5."""
    took = iter([10.0, 5.0, 10.0, 10.0, 10.0, 4.0])
    now = [0.0]
    asked = []

    def work(name, workers):
        asked.append((name, workers))
        now[0] += next(took)

    monkeypatch.setattr(scale_speed, "perf_counter", lambda: now[0])
    row = scale_speed._speed("simulation", work)
    assert row.value == pytest.approx(2.0)
    assert "1.00 to 2.50" in row.note
    assert len({name for name, _ in asked}) == 6
    assert [workers for _, workers in asked] == [1, 2] * 3
