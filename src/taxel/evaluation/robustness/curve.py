"""One point of a robustness curve: how bad it was, and what was still predicted correctly.

Knows nothing about faults, recordings or models.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from taxel.evaluation.intervals import draw_clusters, percentile_interval
from taxel.evaluation.metrics import accuracy_interval, by_trial

CLEAN = "none"
"""Name of the point without any fault."""
_SINGULAR = {"channels": "channel", "pairs": "pair", "stops": "stop", "scratches": "scratch"}
"""Units that are counted; others, such as ms, stay."""
FALL = 0.05
"""Loss of accuracy at which a fault counts as reached, 0…1. Source: docs/decisions/0029."""


@dataclass(frozen=True, slots=True, kw_only=True)
class FaultPoint:
    """One point of a robustness curve: scores at one level of one fault."""

    fault: str
    """Its name; "none" where nothing was changed."""
    level: float
    """How bad, in `unit`."""
    unit: str
    accuracy: float
    """Share right of the windows that were answered, 0…1; of cameras: balanced over stable and
    unstable moments. NaN where none was."""
    low: float
    """95 % interval by resampling whole sessions or cups; NaN where there is one only."""
    high: float
    answered: float
    """Share of the windows that were answered, not UNKNOWN, 0…1; NaN without windows."""
    windows: int
    """Windows (of cameras: moments) inside a touch of known kind."""
    grasps: float
    """Share right of all grasps, each by its answered windows joined; one of which nothing was
    answered is not right. Of cameras: share of the slips that were warned of in time. NaN where
    there is none."""
    grasps_answered: float
    """Share of the grasps (of cameras: recordings) of which anything was answered, 0…1."""
    outside: float
    """Windows cut where nothing was touched, a minute of recording; of cameras: false alarms a
    minute of grasps that hold."""
    draws: int = 1
    """Passes over the recordings, each with other random choices; their windows are pooled."""
    base: float | None = None
    """Accuracy without the fault, of as many first windows of each touch as the fault leaves,
    0…1; None where all of them are compared."""

    def beside(self, base: float) -> float:
        """Return the accuracy as it compares with that of all windows without the fault, 0…1."""
        return self.accuracy if self.base is None else self.accuracy + base - self.base


@dataclass(frozen=True, slots=True)
class SessionAnswers:
    """A recogniser's answers on a set of recordings."""

    y: NDArray[np.intp]
    """Shape (n,): true class of each window."""
    probabilities: NDArray[np.float64]
    """Shape (n, classes)."""
    answered: NDArray[np.bool_]
    """Shape (n,): False where live the answer is UNKNOWN."""
    trial: NDArray[np.intp]
    """Shape (n,): each window's touch."""
    session: NDArray[np.str_]
    """Shape (n,)."""
    grasps: NDArray[np.str_]
    """Shape (touches,): the session of each touch that was to be recognised, windows or not."""
    outside: int
    """Windows cut outside any touch."""
    minutes: float
    """Length of the recordings."""
    known: NDArray[np.bool_] | None = None
    """Shape (n,): False where live the whole touch is UNKNOWN to the test of its bundle; None where
    none is."""

    @staticmethod
    def join(parts: Sequence[SessionAnswers]) -> SessionAnswers:
        """Return the answers of several passes over the same recordings as one."""
        return SessionAnswers(
            np.concatenate([part.y for part in parts]),
            np.concatenate([part.probabilities for part in parts]),
            np.concatenate([part.answered for part in parts]),
            _apart([part.trial for part in parts]),
            np.concatenate([part.session for part in parts]),
            np.concatenate([part.grasps for part in parts]),
            sum(part.outside for part in parts),
            sum(part.minutes for part in parts),
            np.concatenate(
                [np.ones(len(part.y), bool) if part.known is None else part.known for part in parts]
            ),
        )

    @property
    def right(self) -> NDArray[np.bool_]:
        """Shape (n,): True where the likeliest class is the true one."""
        found: NDArray[np.bool_] = self.probabilities.argmax(axis=1) == self.y
        return found

    def answered_grasps(self) -> tuple[NDArray[np.bool_], NDArray[np.str_]]:
        """Return whether each grasp with an answered window is right by all of them joined, and
        its session, shape (grasps,) each.
        """
        counted = self.answered if self.known is None else self.answered & self.known
        if not counted.any():
            return np.zeros(0, bool), np.zeros(0, str)
        _, y, joined = by_trial(self.trial[counted], self.y[counted], self.probabilities[counted])
        _, first = np.unique(self.trial[counted], return_index=True)
        return joined.argmax(axis=1) == y, self.session[counted][first]

    def counts(self, names: Sequence[str], *, grasps: bool) -> NDArray[np.float64]:
        """Return how many are right and how many there are in each session, shape (sessions, 2).

        Args:
            names: The sessions.
            grasps: True counts all grasps, False answered windows.
        """
        if grasps:
            right, own = self.answered_grasps()
            every = self.grasps
        else:
            right, own = self.right[self.answered], self.session[self.answered]
            every = own
        return np.array(
            [[right[own == name].sum(), (every == name).sum()] for name in names], float
        )


@dataclass(frozen=True, slots=True)
class Loss:
    """What a condition costs against the base, on the same sessions."""

    base: float
    """Share right without it, 0…1."""
    worse: float
    """Share right with it, 0…1; 0 where nothing is answered."""
    low: float
    """95 % interval of base − worse, whole sessions resampled, 0…1."""
    high: float

    @property
    def points(self) -> float:
        """What is lost, percentage points; negative where there is a gain."""
        return 100 * (self.base - self.worse)


def loss_between(base: SessionAnswers, worse: SessionAnswers, *, grasps: bool) -> Loss:
    """Return what is lost from one set of answers to another of the same sessions.

    Args:
        base: Answers without the condition.
        worse: Answers with it.
        grasps: True compares whole grasps, False answered windows.
    """
    names = sorted(set(base.grasps.tolist()))
    both = np.stack([answers.counts(names, grasps=grasps) for answers in (base, worse)])
    share = _share(both[:, draw_clusters(len(names))].sum(axis=2))
    first, second = _share(both.sum(axis=1))
    return Loss(float(first), float(second), *percentile_interval(share[0] - share[1]))


def _share(counts: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.asarray(counts[..., 0] / np.maximum(counts[..., 1], 1.0))


def shared_accuracy(base: SessionAnswers, worse: SessionAnswers) -> float | None:
    """Return the accuracy of as many first windows of each touch of `base` as `worse` has, 0…1;
    None where it has all of them.
    """
    left = Counter(worse.trial.tolist())
    kept = []
    for trial in base.trial.tolist():
        kept.append(left[trial] > 0)
        left[trial] -= 1
    return None if all(kept) else _mean(base.right[base.answered & np.array(kept, bool)])


def point_of(
    answers: SessionAnswers,
    fault: str,
    level: float,
    unit: str,
    draws: int = 1,
    base: float | None = None,
) -> FaultPoint:
    """Return the point that answers make.

    Args:
        answers: On all windows.
        fault: Its name.
        level: How bad.
        unit: Of the level.
        draws: How many passes are joined in the answers.
        base: As `FaultPoint.base` says.
    """
    answered, right = answers.answered, answers.right
    low, high = float("nan"), float("nan")
    if answered.any():
        low, high = accuracy_interval(right[answered], answers.session[answered])
    whole_grasps, grasps = answers.answered_grasps()[0], len(answers.grasps)
    return FaultPoint(
        fault=fault,
        level=level,
        unit=unit,
        accuracy=_mean(right[answered]),
        low=low,
        high=high,
        answered=_mean(answered),
        windows=len(answered),
        grasps=int(whole_grasps.sum()) / grasps if grasps else float("nan"),
        grasps_answered=len(whole_grasps) / grasps if grasps else float("nan"),
        outside=answers.outside / answers.minutes if answers.minutes else float("nan"),
        draws=draws,
        base=base,
    )


def mildest_first(given: Sequence[float], own: Sequence[float]) -> tuple[float, ...]:
    """Return levels in the order in which `reached` reads them, each once.

    Args:
        given: Levels of one fault, in any order.
        own: The fault's own, the mildest first.
    """
    rising = own[0] < own[-1]
    return tuple(sorted(set(given), key=abs if rising else lambda level: -level))


def reached(points: Sequence[FaultPoint], base: float, fall: float = FALL) -> float | None:
    """Return the first level at which accuracy has fallen, by straight lines between points.

    Args:
        points: Of one fault, the mildest first.
        base: Accuracy without the fault, 0…1.
        fall: How far, 0…1.

    Returns:
        None where it never falls so far within the levels, or where nothing is answered.
    """
    level, value = None, base
    for point in points:
        if np.isnan(point.accuracy):
            return None
        accuracy = point.beside(base)
        if accuracy <= base - fall:
            if level is None:
                return point.level
            share = (value - (base - fall)) / (value - accuracy)
            return level + share * (point.level - level)
        level, value = point.level, accuracy
    return None


def fall_text(points: Sequence[FaultPoint], base: float) -> str:
    """Return in words where accuracy has fallen by five points, or answers end.

    Args:
        points: Of one fault, the mildest first.
        base: Accuracy without the fault, 0…1.
    """
    if np.isnan(base):
        return "not known: nothing is answered without it either"
    unit = points[0].unit
    level = reached(points, base)
    if level is not None:
        return level_text(level, unit, ".3g")
    silent = [point.level for point in points if np.isnan(point.accuracy)]
    if silent:
        return f"not before {level_text(silent[0], unit)}, where nothing is answered"
    return f"not up to {level_text(points[-1].level, unit)}"


def level_text(level: float, unit: str, form: str = "g") -> str:
    """Return a level with its unit: "1 channel", "2 channels", "19.2 dB"."""
    number = f"{level:{form}}"
    return f"{number} {_SINGULAR.get(unit, unit) if number == '1' else unit}"


def _mean(flags: NDArray[np.bool_]) -> float:
    return float(flags.mean()) if len(flags) else float("nan")


def _apart(numbers: list[NDArray[np.intp]]) -> NDArray[np.intp]:
    """Return the numbers of several passes, none shared between two passes."""
    top = 1 + max((int(number.max()) for number in numbers if len(number)), default=0)
    return np.concatenate([number + index * top for index, number in enumerate(numbers)])
