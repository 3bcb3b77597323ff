"""Curves of training: what is watched changes nothing, and the gap is held out less learned."""

import json
import math
from dataclasses import replace

import numpy as np
import pytest
import torch

from taxel.models.cnn2d import Cnn2d
from taxel.training.augment import Augment
from taxel.training.curves import (
    WATCHED,
    Curve,
    Epoch,
    curves_from_json,
    curves_to_json,
    thinned,
)
from taxel.training.frames.heads import HeadConfig, Track, fit_head
from taxel.training.loop import Labelled, TrainConfig, fit, new_network

CONFIG = TrainConfig(epochs=3, batch=16, augment=Augment(noise=0.05))


def data(seed: int, n: int = 48) -> Labelled:
    values = np.random.default_rng(seed).random((n, 6, 4), dtype=np.float32)
    return Labelled(values, np.ones((n, 6), bool), (values[:, 0, 0] > 0.5).astype(np.intp))


def test_what_is_watched_changes_nothing_that_is_learned() -> None:
    alone, watched = (new_network(lambda: Cnn2d(6, 4, 2), seed=3) for _ in range(2))
    plain = fit(alone, data(0), CONFIG)
    history = fit(watched, data(0), CONFIG, validation=data(1))

    for a, b in zip(alone.parameters(), watched.parameters(), strict=True):
        assert torch.equal(a, b)
    assert [epoch.loss for epoch in plain] == [epoch.loss for epoch in history]
    assert all(epoch.training_loss is None for epoch in plain)
    assert all(epoch.training_loss is not None for epoch in history)


def test_a_head_that_is_watched_learns_the_same_numbers() -> None:
    random = np.random.default_rng(0)
    rows = np.arange(40)[:, None].repeat(2, axis=1)
    tracks = [
        Track(random.random((40, 5), dtype=np.float32), rows, (np.arange(40) > 20).astype(np.int8))
        for _ in range(3)
    ]
    config = HeadConfig(epochs=2, frames=4)
    plain = fit_head(tracks[:2], config)
    watched = fit_head(tracks[:2], config, watched=tracks[2:])

    for a, b in zip(plain.module.parameters(), watched.module.parameters(), strict=True):
        assert torch.equal(a, b)
    assert all(epoch.validation_accuracy is not None for epoch in watched.history)
    assert [epoch.loss for epoch in plain.history] == [epoch.loss for epoch in watched.history]


def test_the_last_epoch_gives_exactly_what_is_measured_afterwards() -> None:
    from taxel.training.loop import evaluate

    network = new_network(lambda: Cnn2d(6, 4, 2), seed=3)
    (last,) = fit(network, data(0), replace(CONFIG, epochs=1), validation=data(1))

    assert (last.validation_loss, last.validation_accuracy) == evaluate(network, data(1))
    assert (last.training_loss, last.training_accuracy) == evaluate(network, data(0))


def test_the_gap_is_above_0_where_the_network_does_better_on_what_it_learned() -> None:
    epochs = (Epoch(1, 1.0), Epoch(2, 0.5, 0.75, 0.5, 0.25, 0.875))

    assert Curve("a", epochs).gap == (0.5, 0.375)
    assert all(map(math.isnan, Curve("b", epochs[:1]).gap))


def test_curves_come_back_from_json_and_other_json_is_refused() -> None:
    curves = (Curve("a", (Epoch(1, 1.0, 0.5, 0.25, 0.125, 1.0), Epoch(2, 0.5))),)

    assert curves_from_json(json.loads(json.dumps(curves_to_json(curves)))) == curves
    for bad in ({}, [{"name": "a"}], [{"name": 1, "epochs": []}], [{"name": "a", "epochs": 3}]):
        with pytest.raises(ValueError, match="curve"):
            curves_from_json(bad)


@pytest.mark.parametrize("count", [1, WATCHED, WATCHED + 1, 10_000])
def test_what_is_looked_at_is_spread_over_all(count: int) -> None:
    part = thinned(count)

    assert len(part) == min(count, WATCHED)
    assert (part[0], part[-1]) == (0, count - 1)
