"""Inner folds of camera trials: the training side, parted as its own test trials were held out.

Groups are held out whole; where later trials are tested, each fold learns from what came before it.
Knows nothing about crops or models.

Source: docs/decisions/0041.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray
from sklearn.model_selection import StratifiedGroupKFold

from taxel.training.choose.inner_folds import FIRST_TESTED, FOLDS, later_blocks

INNER_FOLDS: Final = 5
"""Over groups. Source: our choice, decision 41."""
_TRIES: Final = 50
Parts = list[tuple[NDArray[np.intp], NDArray[np.intp]]]
"""Training and test trials of each fold."""


@dataclass(frozen=True, slots=True)
class HeldOut:
    """What inner folds hold out."""

    parts: Parts
    as_to_come: bool
    """Whether it is as what is to come, as far as is known."""
    single: bool
    """Whether it is single trials, though those to come may be of other sessions."""


def held_out_parts(
    y: NDArray[np.intp], groups: NDArray[np.str_], order: NDArray[np.float64] | None, seed: int
) -> HeldOut:
    """Return inner folds.

    Later trials are held out where such are tested; else groups; else, where no folds over groups
    can be made (a class of one group only), single trials, which flatter unless every class is a
    group of its own.

    Args:
        y: Shape (trials,): class of those that are learned from.
        groups: Shape (trials,).
        order: As in `Learning`.
        seed: Of the folds.
    """
    if order is not None and (parts := later_folds(y, order)):
        return HeldOut(parts, as_to_come=True, single=False)
    if parts := inner_folds(y, groups, seed):
        return HeldOut(parts, as_to_come=True, single=len(set(groups.tolist())) == len(y))
    parts = inner_folds(y, np.arange(len(y)).astype(str), seed)
    known = classes_are_groups(y, groups)
    return HeldOut(parts, as_to_come=known, single=not known)


def later_folds(y: NDArray[np.intp], order: NDArray[np.float64]) -> Parts:
    """Return folds that learn from earlier trials and are tested on the next; maybe none.

    Each class is parted into five successive blocks, of which the last three are tested. A trial
    whose class is not among the earlier ones is left out.

    Args:
        y: Shape (trials,): class.
        order: Shape (trials,): numbers that grow from earlier to later trials.
    """
    block = later_blocks(order, y)
    parts = []
    for number in range(FIRST_TESTED, FOLDS):
        train = np.flatnonzero(block < number)
        test = np.flatnonzero((block == number) & np.isin(y, y[train]))
        if len(test) and len(set(y[train].tolist())) > 1:
            parts.append((train, test))
    return parts


def inner_folds(
    y: NDArray[np.intp], groups: NDArray[np.str_], seed: int, folds: int = INNER_FOLDS
) -> list[tuple[NDArray[np.intp], NDArray[np.intp]]]:
    """Return train and test trials of folds over groups; none where they cannot be made.

    Args:
        y: Shape (trials,): class.
        groups: Shape (trials,).
        seed: Of the folds.
        folds: How many, where there are so many groups.
    """
    folds = min(folds, len(set(groups.tolist())), int(np.bincount(y)[np.unique(y)].min()))
    if folds < 2:
        return []
    for attempt in range(_TRIES):
        splitter = StratifiedGroupKFold(folds, shuffle=True, random_state=seed + 1000 * attempt)
        parts = [(np.asarray(a), np.asarray(b)) for a, b in splitter.split(y, y, groups)]
        if all(len(b) and set(y[a].tolist()) == set(y.tolist()) for a, b in parts):
            return parts
    return []


def classes_are_groups(y: NDArray[np.intp], groups: NDArray[np.str_]) -> bool:
    """Return whether each class is one group, as where the object is named by which trials group.

    Then whoever asks shows an object that was learned, and trials held out are as what is to come.
    Where only some classes are one group, or one session holds all classes, other groups will come,
    and trials held out flatter.

    Args:
        y: Shape (trials,): class.
        groups: Shape (trials,).
    """
    pairs = set(zip(y.tolist(), groups.tolist(), strict=True))
    return len(pairs) == len(set(y.tolist())) == len(set(groups.tolist()))
