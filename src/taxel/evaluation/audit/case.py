"""One audit under way: the trials, their pieces, and how nuisances are cross-validated.

Knows nothing about single checks.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from taxel.evaluation.audit.evidence import Fold, LabelEvidence
from taxel.evaluation.audit.finding import ALARMS, Finding, Verdict
from taxel.evaluation.audit.sides import Sides
from taxel.evaluation.audit.touch_set import Pieces, TouchSet


@dataclass(frozen=True, slots=True, kw_only=True)
class Case:
    """Input of every check: trials, split, folds and the evidence computed so far."""

    touch: TouchSet
    pieces: Pieces
    """What the split moves; windows where there is none."""
    sides: Sides | None
    """The split; None where the recordings are audited by themselves."""
    key: str | None
    """The group that is held out whole where the split does not say; None for trials."""
    folds: list[Fold]
    """Trials on either side, for what a trial shows: the split's own where it moves whole trials,
    else folds that hold out `key`."""
    plain: list[Fold]
    """The same for what a trial is called: the split's own, else folds of single trials."""
    seed: int
    steps: int
    """Rows of a window."""
    known: dict[str, LabelEvidence] = field(default_factory=dict, compare=False, repr=False)
    """What several checks ask for, by name, kept once it is computed."""

    @property
    def groups(self) -> NDArray[np.str_] | None:
        """Shape (trials,): what is held out whole."""
        return None if self.key is None else self.touch.group(self.key)

    @property
    def whole(self) -> bool:
        """Whether a split is given that moves whole trials only."""
        return self.sides is not None and self.sides.whole_trials(self.pieces)


@dataclass(frozen=True, slots=True, kw_only=True)
class Reading:
    """A nuisance's figure, whose verdict waits for the correction of all p values."""

    kind: str
    evidence: LabelEvidence
    decide: Callable[[bool], tuple[Verdict, str, str]]
    """Whether it counts → verdict, what is said, and what to do."""
    examples: tuple[str, ...] = ()
    mended: Callable[[], tuple[float, str]] | None = None
    """What cheap trees still reach once this is tared or cropped away, and a sentence on it."""
    same: bool = False
    """Whether it is the same in all trials, so that more trials would not make it evidence."""
    over_all: Callable[[], LabelEvidence | None] = lambda: None
    """How well it predicts the label without the split, where that trains on few trials."""

    def finding(self, p: float, tests: int = 1) -> Finding:
        """Return the finding, given p after correction for so many tests."""
        verdict, message, mend = self.decide(self.evidence.counts(p))
        left = None
        if verdict in ALARMS and self.mended is not None:
            left, sentence = self.mended()
            message = f"{message} {sentence}"
        if verdict == "clear" and not self.same and not self.evidence.could_count(tests):
            verdict, own = "too few", self.evidence
            if own.accuracy > (1.0 + own.majority) / 2.0:
                message = f"Alone it reaches {own.accuracy:.3f} (majority {own.majority:.3f}), " \
                          "but of so few trials even that could be chance."  # fmt: skip
            else:
                message = f"{message.rstrip('.')} as far as so few trials show: even a leak that " \
                          "goes half of the way to certainty could be chance."  # fmt: skip
        elif verdict == "clear" and (whole := self.over_all()) and whole.counts(tests * whole.p):
            verdict = "too few"
            message = f"Learned from the few trials that this split trains on, it reaches " \
                      f"{self.evidence.accuracy:.3f} alone; without the split it predicts the " \
                      f"label ({whole.accuracy:.3f}, majority {whole.majority:.3f})."  # fmt: skip
            mend = "audit without the split, and mend what is found there"
        return Finding(
            kind=self.kind, verdict=verdict, message=message, mend=mend,
            alone=self.evidence.accuracy, majority=self.evidence.majority, auc=self.evidence.auc,
            p=p, examples=self.examples, left=left,
        )  # fmt: skip


def rows_folds(folds: list[Fold], trial: NDArray[np.intp]) -> list[Fold]:
    """Return folds of trials as folds of rows that belong to trials.

    Folds that have no row to train on, or none to test, are left out.

    Args:
        folds: Of trials.
        trial: Each row's trial, shape (rows,).
    """
    found = [
        (np.flatnonzero(np.isin(trial, train)), np.flatnonzero(np.isin(trial, test)))
        for train, test in folds
    ]
    return [(train, test) for train, test in found if len(train) and len(test)]
