"""Crops of camera trials to learn from, a trial's kept together.

Knows nothing about images, models or folds.
"""

from __future__ import annotations

from dataclasses import dataclass, field

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
class Moved:
    """Crops as a camera that sits a little differently would have shown them, of some views."""

    rows: Rows
    """Shape (n, columns): those views side by side."""
    crop: NDArray[np.intp]
    """Shape (n,): which crop each is a copy of."""
    columns: NDArray[np.intp]
    """Shape (columns,): where they stand among the columns of all views."""

    def copies(self, rows: Rows, seen: NDArray[np.intp]) -> Rows:
        """Return all copies as a model sees them, shape (n, seen): what no camera's place changes
        is that of the crops.

        Args:
            rows: Shape (crops, all columns): the crops.
            seen: Which columns the model sees.
        """
        place = np.full(rows.shape[1], -1)
        place[self.columns] = np.arange(len(self.columns))
        found = rows[np.ix_(self.crop, seen)]
        own = place[seen] >= 0
        found[:, own] = self.rows[:, place[seen][own]]
        return np.asarray(found, np.float32)


@dataclass(frozen=True, slots=True)
class Extras:
    """What helps to learn, beside the crops that trials are judged by."""

    further: Crops | None = None
    """Learned from: crops between the places at which trials are judged, and of a camera alone."""
    moved: Moved | None = None
    """Learned from: shifted copies."""
    asked: Moved | None = None
    """A shifted copy of each crop, on which members are compared, too, where inner folds can hold
    out single trials only: those of sessions to come will be shifted. None where single trials of
    known sessions are tested."""

    def part(self, number: NDArray[np.intp], kept: NDArray[np.bool_]) -> Extras:
        """Return those of some trials.

        Args:
            number: Shape (trials,): each one's new number, or -1.
            kept: Shape (crops,): which crops remain.
        """
        return Extras(
            self.further and _some(self.further, number),
            self.moved and _moved(self.moved, kept),
            self.asked and _moved(self.asked, kept),
        )


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
    extras: Extras = field(default_factory=Extras)
    order: NDArray[np.float64] | None = None
    """Shape (trials,): numbers that grow from earlier to later trials, where later ones are tested;
    None where groups are."""

    def part(self, trials: NDArray[np.intp]) -> Learning:
        """Return some trials, each numbered by its place in `trials`, indices of shape (n,)."""
        number = np.full(len(self.y), -1)
        number[trials] = np.arange(len(trials))
        own = _some(Crops(self.rows, self.trial), number)
        extras = self.extras.part(number, number[self.trial] >= 0)
        order = None if self.order is None else self.order[trials]
        return Learning(
            own.rows, own.trial, self.y[trials], self.groups[trials], self.classes, extras, order
        )


def _some(crops: Crops, number: NDArray[np.intp]) -> Crops:
    """Return crops of some trials; `number`, shape (trials,), is each one's new one or -1."""
    kept = number[crops.trial] >= 0
    return Crops(crops.rows[kept], number[crops.trial[kept]].astype(np.intp))


def _moved(moved: Moved, kept: NDArray[np.bool_]) -> Moved:
    """Return copies of some crops; `kept`, shape (crops,), says which remain, in their order."""
    number = np.where(kept, np.cumsum(kept) - 1, -1)
    own = number[moved.crop] >= 0
    return Moved(moved.rows[own], number[moved.crop[own]].astype(np.intp), moved.columns)
