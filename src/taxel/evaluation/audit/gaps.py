"""What a cheap strong model gains where windows of one trial, or trials of one session, stand on
both sides.

The same model reads the same windows three ways: windows dealt out at random, whole trials held
out, whole sessions (or what else is named) held out. Knows nothing about nuisances.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from taxel.evaluation.audit.case import Case, rows_folds
from taxel.evaluation.audit.evidence import (
    SURE,
    Array,
    gap_p,
    majority,
    predict,
    trial_folds,
)
from taxel.evaluation.audit.finding import Finding, Verdict
from taxel.evaluation.audit.nuisances import sum_up
from taxel.evaluation.audit.touch_set import Pieces, TouchSet, cut_pieces
from taxel.plain_text import several

GAP = 0.03
"""Accuracy that a careless split must add. Our choice, docs/decisions/0023."""
MOST = 3000
"""Windows that are read; beyond, an even choice of trials, with all of their windows."""
_UNITS = 10
"""Groups from which a gap is judged by group; with fewer, by trial."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Gap:
    """One careless way of splitting beside a careful one."""

    kind: str
    of: str
    """What the careless way has on both sides: trial, session …"""
    high: float
    """Accuracy the careless way, 0…1."""
    low: float
    """Accuracy the careful way, 0…1."""
    majority: float
    p: float
    """Chance of so large a difference, before any correction."""
    loosely: str
    strictly: str
    mend: str
    split_does: bool | None
    """Whether the split given is the careless way; None without a split."""
    units: int
    """Trials or groups whose differences are judged."""

    def finding(self, p: float, tests: int = 1) -> Finding:
        """Return the finding, given p after correction for so many tests."""
        words = f"Small trees reach {self.high:.3f} with {self.loosely}, {self.low:.3f} with " \
               f"{self.strictly}"  # fmt: skip
        verdict: Verdict = "hazard" if self.split_does is None else "leak"
        clear = p >= SURE or self.high - self.low < GAP
        rule = self.split_does and self.of == "trial"
        if clear and rule:
            words = f"{words}; this split divides trials, which leaks by rule."
        elif clear and 2.0**-self.units >= SURE / tests:
            verdict, words = "too few", f"{words}: {self.units} cannot show a difference."
        elif clear:
            verdict, words = "clear", f"{words}: no clear difference."
        elif self.split_does is False:
            verdict, words = "clear", f"{words}; this split keeps them apart."
        else:
            words = f"{words}: {100 * (self.high - self.low):.1f} points that will not be " \
                   f"reached on a new {self.of}."  # fmt: skip
        return Finding(
            kind=self.kind, verdict=verdict, message=words, alone=self.high, majority=self.majority,
            mend="" if verdict == "clear" else self.mend, p=None if rule else p,
        )  # fmt: skip


def measure_gaps(case: Case) -> list[Gap]:
    """Return the window leak and the session leak, where the recordings can show them."""
    touch = case.touch
    pieces = _fewer(touch, cut_pieces(touch, case.steps, case.steps))
    y = touch.y[pieces.trial]
    values = np.stack(
        [sum_up(touch.rows[t][a:b]) for t, a, b in
         zip(pieces.trial, pieces.first, pieces.stop, strict=True)]
    )  # fmt: skip
    by_trial = rows_folds(trial_folds(touch.y, None, case.seed), pieces.trial)
    held = predict(values, y, by_trial, case.seed)
    gaps = []
    if np.bincount(pieces.trial, minlength=len(touch)).max() > 1:
        at_random = trial_folds(y, None, case.seed)
        loose = predict(values, y, at_random, case.seed)
        high, low, p = _compare(loose, held, y, pieces.trial, case.seed)
        gaps.append(
            Gap(
                kind="window leak", of="trial", high=high, low=low, p=p,
                majority=majority(y, by_trial), units=len(set(pieces.trial)),
                loosely="the windows of a trial split at random",
                strictly="whole trials held out",
                mend="split whole trials, and cut windows afterwards",
                split_does=None if case.sides is None else not case.whole,
            )
        )  # fmt: skip
    groups = case.touch.group(case.key) if case.key is not None else None
    if groups is not None:
        by_group = rows_folds(trial_folds(touch.y, groups, case.seed), pieces.trial)
        strict = predict(values, y, by_group, case.seed)
        names, index = np.unique(groups, return_inverse=True)
        units = index[pieces.trial] if len(names) >= _UNITS else pieces.trial
        high, low, p = _compare(held, strict, y, np.asarray(units, np.intp), case.seed)
        gaps.append(
            Gap(
                kind=f"{case.key} leak", of=str(case.key), high=high, low=low, p=p,
                majority=majority(y, by_group), units=len(set(units)),
                loosely=f"trials of one {case.key} on both sides",
                strictly=f"whole {several(str(case.key))} held out",
                mend=f"hold out whole {several(str(case.key))} and quote that figure",
                split_does=None if case.sides is None else _shares(case, groups),
            )
        )  # fmt: skip
    return gaps


def _compare(
    loose: Array, strict: Array, y: NDArray[np.intp], units: NDArray[np.intp], seed: int
) -> tuple[float, float, float]:
    """Return both accuracies, and the chance of their difference over units."""
    right = [predicted.argmax(axis=1) == y for predicted in (loose, strict)]
    size = np.bincount(units)
    each = [np.bincount(units, weights=hits)[size > 0] / size[size > 0] for hits in right]
    return float(right[0].mean()), float(right[1].mean()), gap_p(each[0] - each[1], seed)


def _fewer(touch: TouchSet, pieces: Pieces) -> Pieces:
    """Return the pieces of so many trials that at most about `MOST` remain."""
    if len(pieces) <= MOST:
        return pieces
    order = np.lexsort((np.arange(len(touch)), touch.y))  # an even choice within each class
    count = max(1, round(len(touch) * MOST / len(pieces)))
    chosen = order[np.unique(np.linspace(0, len(order) - 1, count).round().astype(int))]
    kept = np.isin(pieces.trial, chosen)
    return Pieces(trial=pieces.trial[kept], first=pieces.first[kept], stop=pieces.stop[kept],
                  view=pieces.view[kept], label_s=pieces.label_s[kept])  # fmt: skip


def _shares(case: Case, groups: NDArray[np.str_]) -> bool:
    """Return whether a group stands on both sides of a fold of the split given."""
    assert case.sides is not None
    own = groups[case.pieces.trial]
    return any(set(own[train]) & set(own[test]) for train, test in case.sides.folds)
