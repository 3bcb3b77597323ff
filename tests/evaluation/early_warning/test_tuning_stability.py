"""Tuning warns as early as the limits allow, and says so where they cannot be kept."""

import numpy as np
import pytest

from taxel.decisions.stability import StabilityConfig
from taxel.errors import BadInput
from taxel.evaluation.early_warning.tuning_stability import (
    ProbabilityTrack,
    TuningGoal,
    TuningGrid,
    tune,
)

TIME = np.arange(360) / 60
GRID = TuningGrid(warn=(0.2, 0.5, 0.8), raise_s=(0.0, 0.1), clear_s=(0.3,))
BASE = StabilityConfig(frozen_s=float("inf"))


def slips(rng: np.random.Generator) -> ProbabilityTrack:
    """The probability rises from 0 at 3 s to 1 at 4 s, the event."""
    rise = np.clip(TIME - 3.0, 0.0, 1.0) + rng.uniform(0, 0.01, 360)
    return ProbabilityTrack(
        probabilities=np.minimum(rise, 1.0), time_s=TIME, onset_s=3.0, event_s=4.0
    )


def holds(level: float, frames: int = 360) -> ProbabilityTrack:
    """A run that holds, whose probability stands at a level for some frames."""
    p = np.where((np.arange(360) >= 100) & (np.arange(360) < 100 + frames), level, 0.01)
    return ProbabilityTrack(probabilities=p, time_s=TIME, onset_s=None, event_s=None)


def tracks(*calm: ProbabilityTrack) -> list[ProbabilityTrack]:
    rng = np.random.default_rng(0)
    return [*(slips(rng) for _ in range(5)), *calm]


def test_the_lowest_threshold_that_keeps_quiet_is_chosen() -> None:
    """Pours that hold reach 0.3, so 0.2 cries wolf and 0.8 warns later than 0.5."""
    found = tune(tracks(*[holds(0.3)] * 5), base=BASE, grid=GRID)

    assert (found.config.warn, found.config.raise_s) == (0.5, 0.0)
    assert found.within
    assert found.lead_median_s == pytest.approx(0.5, abs=0.03)
    assert found.false_alarms_per_min == 0.0


def test_debounce_is_chosen_against_glitches() -> None:
    found = tune(tracks(*[holds(0.99, frames=3)] * 5), base=BASE, grid=GRID)

    assert (found.config.warn, found.config.raise_s) == (0.2, 0.1)
    assert found.within


def test_limits_that_cannot_be_kept_are_reported() -> None:
    found = tune(tracks(*[holds(0.99)] * 5), base=BASE, grid=GRID)

    assert not found.within
    assert found.missed_share == 0.0
    assert found.false_alarms_per_min > TuningGoal().false_alarms_per_min


def test_both_kinds_of_run_are_needed() -> None:
    with pytest.raises(BadInput, match="runs that hold"):
        tune(tracks())
    with pytest.raises(BadInput, match="0 with it"):
        tune([holds(0.3)])
