"""Rows of speed: an epoch's time without the start, and no figure from a busy machine."""

import os

import pytest

from taxel.bench import scale_speed
from taxel.bench.scale_plan import WORKS


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
    assert asked[1:] == [(1, 1), (1, 3), (2, 1), (2, 3)]


def test_a_start_that_drowns_the_epochs_gives_no_figure(monkeypatch, tmp_path):
    """As on a busy machine: the longer training was over sooner."""
    pytest.importorskip("lightning_fabric")
    monkeypatch.setattr(scale_speed, "_train", lambda _, __, ___, epochs: 30.0 - epochs)
    row = scale_speed.training_row(tmp_path, tmp_path)
    assert row.value is None
    assert "measure again" in row.note


def test_a_busy_machine_gives_no_figure(monkeypatch):
    monkeypatch.setattr(os, "getloadavg", lambda: (9.0, 9.0, 9.0))
    rows = scale_speed.speed_rows()
    assert [row.name for row in rows] == [name for name, _ in WORKS.values()]
    assert all(row.value is None and "measure again" in row.note for row in rows)
