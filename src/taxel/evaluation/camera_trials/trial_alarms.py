"""A recogniser of camera trials as an alarm: in which trials it is raised, and when.

An alarm is a verdict so far that names one class with a least confidence, as a station's table of
rules raises it (decision 46). Knows nothing about models, images or screens.

Background of our choices: docs/decisions/0041.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from taxel.decisions.trial_course import TrialCourse
from taxel.evaluation.intervals import Interval, at_least_exact, ratio_interval
from taxel.evaluation.rank_area import area

LEVELS: Final = (0.5, 0.6, 0.7, 0.8, 0.9, 0.95, 0.99)
"""Least confidences that are compared. Source: our choice; a station answers UNKNOWN below 0.5
unless --least-confidence says otherwise."""


@dataclass(frozen=True, slots=True, kw_only=True)
class AlarmShare:
    """Trials with an alarm among some."""

    alarmed: int
    of: int
    interval: Interval
    """95 % of the share: the wider of groups resampled and exact binomial; NaN without trials."""


@dataclass(frozen=True, slots=True, kw_only=True)
class AlarmLevel:
    """What a least confidence gives."""

    least_confidence: float
    right: AlarmShare
    """Of trials of the class."""
    false: AlarmShare
    """Of all others."""
    first_median_s: float
    """First alarm in trials of the class that have one, since the trial's first image, median,
    seconds; NaN without any."""


@dataclass(frozen=True, slots=True, kw_only=True)
class TrialAlarms:
    """A recogniser as an alarm for one class."""

    label: str
    levels: tuple[AlarmLevel, ...]
    silent: int
    """Trials without a verdict while they run, which are shorter than a crop: no alarm is possible,
    and they count as trials without one."""
    area: float
    """AUC of the largest probability of the class within the length that all trials have; NaN
    where the class or all others lack, or there is a trial without a verdict so early."""
    within_s: float
    """That length, seconds."""
    length_area: float
    """AUC of a trial's length, which sees no image, in the better direction."""


def trial_alarms(
    courses: Sequence[TrialCourse],
    own: NDArray[np.bool_],
    groups: Sequence[str],
    label: str,
    column: int,
) -> TrialAlarms:
    """Return in which trials an alarm for a class is raised while they run.

    Args:
        courses: One for each trial.
        own: Whether the trial is of the class, shape (trials,).
        groups: What intervals are resampled by, one for each trial.
        label: The class.
        column: Its number among the bundle's classes.
    """
    names = np.asarray(groups)
    firsts = [_first_alarms(course, label) for course in courses]
    levels = []
    for number, least in enumerate(LEVELS):
        first_s = np.array([first[number] for first in firsts])
        alarmed = np.isfinite(first_s)
        times = first_s[own & alarmed]
        levels.append(
            AlarmLevel(
                least_confidence=least,
                right=_share(alarmed[own], names[own]),
                false=_share(alarmed[~own], names[~own]),
                first_median_s=float(np.median(times)) if len(times) else float("nan"),
            )
        )
    within_s = min(course.length_s for course in courses)
    y = own.astype(np.intp)
    largest = np.array([_largest(course, column, within_s) for course in courses])
    seen = bool(np.isfinite(largest).all())
    length = _area(y, np.array([course.length_s for course in courses]))
    return TrialAlarms(
        label=label,
        levels=tuple(levels),
        silent=sum(not np.isfinite(course.probabilities).any() for course in courses),
        area=_area(y, largest) if seen else float("nan"),
        within_s=within_s,
        length_area=max(length, 1.0 - length),
    )


def _first_alarms(course: TrialCourse, label: str) -> list[float]:
    """Return for each of `LEVELS` when an alarm is first raised, seconds; NaN where never."""
    named = np.array([own == label for own in course.labels], bool)
    found = []
    for least in LEVELS:
        at = np.flatnonzero(named & (course.confidences >= least))
        found.append(float(course.time_s[at[0]]) if len(at) else float("nan"))
    return found


def _largest(course: TrialCourse, column: int, within_s: float) -> float:
    early = course.probabilities[course.time_s <= within_s + 1e-9, column]
    early = early[np.isfinite(early)]
    return float(early.max()) if len(early) else float("nan")


def _share(alarmed: NDArray[np.bool_], groups: NDArray[np.str_]) -> AlarmShare:
    hits, total = int(alarmed.sum()), len(alarmed)
    if not total:
        return AlarmShare(alarmed=0, of=0, interval=(float("nan"), float("nan")))
    names = np.unique(groups)
    part = np.array([alarmed[groups == name].sum() for name in names])
    whole = np.array([(groups == name).sum() for name in names])
    interval = at_least_exact(ratio_interval(part, whole), hits, total)
    return AlarmShare(alarmed=hits, of=total, interval=interval)


def _area(y: NDArray[np.intp], values: NDArray[np.float64]) -> float:
    return area(y, np.stack([-values, values], axis=1))
