"""What logs of grasps say of people: how often they react to an alarm, how fast, what came of it.

Knows nothing about files or pages.

Background of our choices: docs/decisions/0046.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from taxel.recordings.trial_log import OUTCOMES, GraspTrial

_RESAMPLES = 2000
"""Draws of an interval. Source: our choice, as for accuracies."""
_LEAST_LOGS = 5
"""Logs from which on whole logs are drawn again, as sessions are; with fewer, single grasps.
Source: our choice, docs/decisions/0046."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ReactionTimes:
    """All grasps of some logs."""

    grasps: int
    warned: int
    """With an alarm."""
    reacted: int
    """Of those, with a reaction after it."""
    before: int
    """Of those, with a reaction before it."""
    times_s: tuple[float, ...]
    """From alarm to reaction, seconds, of those that reacted after it; sorted."""
    median_s: float
    """NaN where nobody reacted."""
    interval_s: tuple[float, float]
    """95 % of the median; NaN with fewer than two."""
    drawn: str
    """What was drawn again for that: "log" or "grasp"."""
    outcomes: Mapping[str, Mapping[str, int]]
    """Kind of grasp (`KINDS`) → outcome, or "unknown" → grasps."""


KINDS = ("alarm, then a reaction", "a reaction before the alarm", "alarm, no reaction", "no alarm")
"""A reaction before the alarm has another reason: what came of it is no outcome of a warning."""


def reaction_times(logs: Sequence[Sequence[GraspTrial]], seed: int = 0) -> ReactionTimes:
    """Return what logs say.

    Args:
        logs: The grasps of each.
        seed: Of the resampling.
    """
    every = [trial for log in logs for trial in log]
    times = [_times(log) for log in logs]
    joined = np.concatenate([np.zeros(0), *times])
    counts = {kind: dict.fromkeys((*OUTCOMES, "unknown"), 0) for kind in KINDS}
    for trial in every:
        counts[_kind(trial)][trial.outcome or "unknown"] += 1
    by_log = sum(len(own) > 0 for own in times) >= _LEAST_LOGS
    parts = [own for own in times if len(own)] if by_log else [joined[i : i + 1] for i in
                                                              range(len(joined))]  # fmt: skip
    return ReactionTimes(
        grasps=len(every),
        warned=sum(trial.alarm_s is not None for trial in every),
        reacted=len(joined),
        before=sum((trial.reaction_time_s or 0.0) < 0 for trial in every),
        times_s=tuple(sorted(joined.tolist())),
        median_s=float(np.median(joined)) if len(joined) else math.nan,
        interval_s=_interval(parts, seed),
        drawn="log" if by_log else "grasp",
        outcomes=counts,
    )


def _times(log: Sequence[GraspTrial]) -> NDArray[np.float64]:
    found = [trial.reaction_time_s for trial in log]
    return np.array([value for value in found if value is not None and value >= 0], np.float64)


def _kind(trial: GraspTrial) -> str:
    if trial.alarm_s is None:
        return "no alarm"
    if not trial.reaction:
        return "alarm, no reaction"
    before = (trial.reaction_time_s or 0.0) < 0
    return "a reaction before the alarm" if before else "alarm, then a reaction"


def _interval(parts: Sequence[NDArray[np.float64]], seed: int) -> tuple[float, float]:
    """Return 95 % of the median when parts are drawn again."""
    if len(parts) < 2:
        return math.nan, math.nan
    random = np.random.default_rng(seed)
    drawn = random.integers(0, len(parts), (_RESAMPLES, len(parts)))
    medians = [np.median(np.concatenate([parts[i] for i in own])) for own in drawn]
    low, high = np.percentile(medians, [2.5, 97.5])
    return float(low), float(high)
