"""Inner folds of a network run in any thread, end alike, and keep to their time."""

from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from taxel.training.choose.base import load_base
from taxel.training.choose.budget import Budget
from taxel.training.choose.candidates import Candidate
from taxel.training.choose.inner_folds import Held, inner_folds
from taxel.training.choose.network_folds import NetworkFolds
from taxel.training.choose.part import Part, training_part
from taxel.training.choose.preparations import prepare_all

NETWORK = Candidate("network", "touchnet", "")
TRAIN = list(range(16))


@pytest.fixture(scope="module")
def part(recordings: Path) -> Part:
    base = load_base(recordings, "kind")
    (prepared, *_) = prepare_all(base)
    return training_part(base, prepared, TRAIN, inner_folds(base.trials, base.y, TRAIN,
                         Held("session")), ordered=False)  # fmt: skip


class Clock:
    def __init__(self) -> None:
        self.now = 0.0

    def __call__(self) -> float:
        return self.now


def begun(seconds: float, clock: Clock) -> Budget:
    budget = Budget(seconds, clock=clock)
    budget.begin()
    return budget


@pytest.mark.slow
def test_side_by_side_gives_what_one_after_another_gives(part: Part):
    alone, beside = (
        NetworkFolds(part, NETWORK, 3, begun(1e6, Clock()), must=False) for _ in range(2)
    )
    for fold in alone.folds:
        alone.run(fold)
    with ThreadPoolExecutor(2) as pool:
        list(pool.map(beside.run, beside.folds))

    first, second = alone.logits(), beside.logits()

    assert first is not None
    assert second is not None
    assert np.array_equal(first, second)
    assert np.isfinite(first).all()
    assert len(first) == int(part.scored.sum())


@pytest.mark.parametrize(
    ("allowed_s", "must", "tried"), [(40.0, False, True), (5.0, False, False), (5.0, True, True)]
)
def test_what_would_outlast_its_time_is_broken_off(
    part: Part, monkeypatch: pytest.MonkeyPatch, allowed_s: float, must: bool, tried: bool
):
    """Each fold takes 10 s; two run at a time, so that four take about 20 s."""
    clock = Clock()
    budget = Budget(allowed_s / 0.75, clock=clock)
    budget.begin()
    folds = NetworkFolds(part, NETWORK, 0, budget, must=must)
    trained: list[int] = []

    def train(*_: object) -> None:
        trained.append(1)
        clock.now += 10.0

    monkeypatch.setattr("taxel.training.choose.network_folds.train_network", train)
    for fold in folds.folds:
        folds.run(fold)

    assert (folds.logits() is not None) is tried
    assert len(trained) == (len(folds.folds) if tried else 1)
    assert folds.seconds == 10.0 * len(trained)


@pytest.mark.parametrize(
    ("allowed_s", "must", "tried"), [(40.0, False, True), (9.0, False, False), (9.0, True, True)]
)
def test_what_will_take_far_too_long_is_broken_off_within_its_first_fold(
    part: Part, monkeypatch: pytest.MonkeyPatch, allowed_s: float, must: bool, tried: bool
):
    """After two of eight epochs a fold is seen to take 10 s, so that two turns will take 20."""
    clock = Clock()
    budget = Budget(allowed_s / 0.75, clock=clock)
    budget.begin()
    folds = NetworkFolds(part, NETWORK, 0, budget, must=must)

    def train(*given: Any) -> None:
        for epoch in range(1, 9):
            clock.now += 10.0 / 8
            given[-1](epoch / 8)

    monkeypatch.setattr("taxel.training.choose.network_folds.train_network", train)
    for fold in folds.folds:
        folds.run(fold)

    assert (folds.logits() is not None) is tried
    assert folds.seconds == pytest.approx(10.0 * len(folds.folds) if tried else 2.5)


def test_what_was_seen_to_take_too_long_does_not_begin(part: Part):
    clock = Clock()
    budget = begun(20.0, clock)
    folds = NetworkFolds(part, NETWORK, 0, budget, must=False)
    budget.took(folds.name, 60.0)

    for fold in folds.folds:
        folds.run(fold)

    assert folds.logits() is None
    assert folds.seconds == 0.0
