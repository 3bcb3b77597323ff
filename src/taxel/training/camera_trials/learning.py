"""Crops of camera trials to learn from, a trial's kept together.

Knows nothing about images, models or folds.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Rows = NDArray[np.float32]


@dataclass(frozen=True, slots=True)
class Crops:
    """Further crops of trials, which are learned from and never asked about."""

    rows: Rows
    """Shape (n, columns): views side by side, all or the first."""
    trial: NDArray[np.intp]
    """Shape (n,): which trial a crop is of."""


@dataclass(frozen=True, slots=True)
class Learning:
    """Crops to learn from."""

    rows: Rows
    """Shape (n, columns): all views side by side."""
    trial: NDArray[np.intp]
    """Shape (n,): which trial a crop is of, 0 to trials - 1."""
    y: NDArray[np.intp]
    """Shape (trials,): class."""
    groups: NDArray[np.str_]
    """Shape (trials,): what is held out whole."""
    classes: int
    further: Crops | None = None
    """Of the same trials: between the places at which they are judged, and of a camera alone."""
    order: NDArray[np.float64] | None = None
    """Shape (trials,): numbers that grow from earlier to later trials, where later ones are tested;
    None where groups are."""

    def part(self, trials: NDArray[np.intp]) -> Learning:
        """Return some trials, each numbered by its place in `trials`, indices of shape (n,)."""
        number = np.full(len(self.y), -1)
        number[trials] = np.arange(len(trials))
        own = _some(Crops(self.rows, self.trial), number)
        further = self.further and _some(self.further, number)
        order = None if self.order is None else self.order[trials]
        return Learning(
            own.rows, own.trial, self.y[trials], self.groups[trials], self.classes, further, order
        )


def _some(crops: Crops, number: NDArray[np.intp]) -> Crops:
    """Return crops of some trials; `number`, shape (trials,), is each one's new one or -1."""
    kept = number[crops.trial] >= 0
    return Crops(crops.rows[kept], number[crops.trial[kept]].astype(np.intp))
