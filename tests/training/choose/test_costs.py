"""A blend's cost is measured once for all folds, and never guessed the wrong way."""

from __future__ import annotations

import numpy as np
import pytest
import torch

from taxel.models.blend import Blend, Part, Plan
from taxel.models.heads import LinearHead
from taxel.training.choose import costs
from taxel.training.choose.costs import RUNS, Cost, KnownCosts, quietest_us

MEANS, SHAPE, COURSE = (
    Part("linear", ("mean",)),
    Part("linear", ("shape",)),
    Part("linear", ("course",)),
)
PADS = (0, 0)


def blend_of(*parts: Part, steps: int = 20) -> Blend:
    """Return a blend of linear heads that name two classes."""
    blank = Blend(Plan(steps, PADS, 2, parts))
    heads = []
    for features in (blank.features[blank._seen[i]] for i in range(len(parts))):
        with torch.inference_mode():
            width = features(
                torch.zeros(1, steps, 2), torch.ones(1, steps, dtype=torch.bool)
            ).shape[1]
        heads.append(
            LinearHead(offset=torch.zeros(width), factor=torch.ones(width),
                       weight=torch.zeros(width, 2), bias=torch.zeros(2))
        )  # fmt: skip
    even = tuple(1.0 / len(parts) for _ in parts)
    return Blend(Plan(steps, PADS, 2, parts), tuple(heads), even, tuple(1.0 for _ in parts))


def counted(us: float) -> tuple[KnownCosts, list[int]]:
    """Return costs whose every measurement gives `us` a part, and what was measured."""
    measured: list[int] = []

    def measure(blend: Blend, prepared: object) -> Cost:
        measured.append(len(blend.heads))
        return Cost(1.0, us * len(blend.heads))

    return KnownCosts(1000.0, measure), measured


def test_a_part_of_what_was_quick_enough_is_not_timed_again():
    costs, measured = counted(400.0)

    whole = costs(blend_of(MEANS, SHAPE), None)
    less = costs(blend_of(SHAPE), None)

    assert measured == [2]
    assert (whole.us, less.us) == (800.0, 800.0)  # no more than the whole
    assert 0.0 < less.mb < 0.01


def test_what_holds_more_than_a_quick_blend_is_timed():
    costs, measured = counted(400.0)
    costs(blend_of(MEANS, SHAPE), None)

    assert costs(blend_of(MEANS, SHAPE, COURSE), None).us == 1200.0
    assert measured == [2, 3]


def test_what_holds_a_slow_blend_is_slow_and_a_part_of_it_is_timed():
    costs, measured = counted(600.0)
    costs(blend_of(MEANS, SHAPE), None)

    assert costs(blend_of(SHAPE, COURSE, MEANS), None).us == 1200.0
    assert measured == [2]
    assert costs(blend_of(MEANS), None).us == 600.0
    assert measured == [2, 1]


def test_windows_of_another_length_are_timed_anew():
    costs, measured = counted(400.0)
    costs(blend_of(MEANS), None)
    costs(blend_of(MEANS, steps=40), None)

    assert measured == [1, 1]
    assert np.isfinite(costs(blend_of(MEANS, steps=40), None).us)
    assert measured == [1, 1]


def test_a_slow_moment_of_the_machine_does_not_count(monkeypatch: pytest.MonkeyPatch):
    """Three stretches at 2 ms a window, the last one at 1 ms; by hand, with no time lost."""
    now_s, ran, waits = 0.0, 0, []

    def run(values: np.ndarray, mask: np.ndarray) -> None:
        nonlocal now_s, ran
        ran += 1
        now_s += 0.001 if ran > 3 * RUNS else 0.002

    monkeypatch.setattr(costs, "perf_counter", lambda: now_s)
    monkeypatch.setattr(costs, "sleep", waits.append)

    found = quietest_us(run, np.zeros((3, 5, 2), np.float32), np.ones((3, 5), bool))

    assert found == pytest.approx(1000.0)
    assert waits == [costs.APART_S] * 3
