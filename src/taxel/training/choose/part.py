"""The training part of a choice in one way to cut, and a candidate tried on it.

Knows nothing about how long anything may take.

Source: docs/decisions/0039.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from taxel.training.choose.base import Base
from taxel.training.choose.candidates import Candidate, Sets, feature_sets
from taxel.training.choose.inner_folds import judged
from taxel.training.choose.preparations import Prepared


@dataclass(frozen=True, slots=True)
class Part:
    """The training part of one choice, in one way to cut."""

    prepared: Prepared
    rows: NDArray[np.intp]
    """Kept windows of training trials, as places in `Prepared.kept`."""
    fold: NDArray[np.intp]
    """Inner fold of each, shape (rows,)."""
    y: NDArray[np.intp]
    """Class of each, shape (rows,)."""
    scored: NDArray[np.bool_]
    """Which of them are scored: those that overlap no earlier one, shape (rows,)."""
    classes: int
    ordered: bool = False
    """Whether a fold is tested on what was learned from earlier folds alone."""
    quick: Sets | None = None
    """Feature sets without what takes longer than a window may; None: all are quick enough."""
    slow: tuple[str, ...] = ()
    """Blocks of features that take too long."""
    every: int = 1
    """Of so many stretches of windows it has one: enough to compare ways to cut."""

    @property
    def name(self) -> str:
        """Return its windows in words, as "400 rows, 1 of 5" where it has a fifth of them."""
        return f"{self.prepared.name}{f', 1 of {self.every}' if self.every > 1 else ''}"

    @property
    def windows(self) -> NDArray[np.intp]:
        """Return the windows' places in the data set, shape (rows,)."""
        return self.prepared.kept[self.rows]

    @property
    def steps(self) -> int:
        """Return the rows of a window."""
        return int(self.prepared.dataset.windows.values.shape[1])

    @property
    def values(self) -> int:
        """Return how many values a window has."""
        _, steps, channels = self.prepared.dataset.windows.values.shape
        return int(steps * channels)

    def feature_sets(self) -> dict[str, tuple[str, ...]]:
        """Return the feature sets that windows of this size have, and that are quick enough."""
        if self.quick is not None:
            return self.quick
        windows = self.prepared.dataset.windows
        _, steps, channels = windows.values.shape
        return feature_sets(
            steps, channels, padded=bool(windows.padded), grids=bool(self.prepared.grids),
            starts=self.prepared.starts,
        )  # fmt: skip


@dataclass(frozen=True, slots=True)
class Tried:
    """A candidate with its predictions on inner folds."""

    candidate: Candidate
    probabilities: NDArray[np.float64]
    """Calibrated, of the scored windows, shape (scored, classes)."""
    sharpness: float
    loss: float
    accuracy: float
    seconds: float


def training_part(
    base: Base,
    prepared: Prepared,
    train: Sequence[int],
    fold_of: NDArray[np.intp],
    *,
    ordered: bool,
) -> Part:
    """Return the kept windows of some trials, with their inner folds and classes."""
    fold = np.full(len(base.trials), -1, np.intp)
    fold[np.asarray(train, np.intp)] = fold_of
    own = fold[prepared.trial[prepared.kept]]
    rows = np.flatnonzero(own >= 0)
    windows = prepared.kept[rows]
    y = base.y[prepared.trial[windows]]
    scored = prepared.scored[windows] & judged(own[rows], y, ordered=ordered)
    classes = len(base.dataset.classes(base.target))
    return Part(prepared, rows, own[rows], y, scored, classes, ordered)
