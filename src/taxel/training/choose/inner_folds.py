"""Inner folds: the training part, parted as its own test part was held out.

What the outer split holds out (objects, sessions, later trials) is what the inner folds hold
out, too; a choice that is made on neighbours of its own training trials is a choice for
neighbours. Knows nothing about windows or models.

Source: docs/decisions/0039.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from taxel.errors import BadSplit
from taxel.labels.trials import Trial

FOLDS = 5
"""Inner folds of successive trials. Source: our choice, 0039."""
GROUP_FOLDS = 3
"""Inner folds of whole groups: with a third of them held out at once, those that are left are
about as far from them as groups to come will be. Source: our choice, 0039."""
_FINE = ("trial", "recording", "file")
"""Groups that are new on the other side of any split of trials."""


@dataclass(frozen=True, slots=True)
class Held:
    """What a split holds out."""

    key: str | None
    """A group of which whole values are held out; None for single trials."""
    ordered: bool = False
    """Whether what is held out comes after what is learned from, by numbers."""

    @property
    def words(self) -> str:
        """Return it in words."""
        if self.key is None:
            return "successive trials"
        return f"successive {self.key}s" if self.ordered else f"whole {self.key}s"


def groups_of(trials: Sequence[Trial], held: Held) -> NDArray[np.intp]:
    """Return what must be taken as a whole when scores are compared, a number a trial."""
    values = [one.groups["trial"] if held.key is None else one.groups[held.key] for one in trials]
    _, index = np.unique(np.array(values), return_inverse=True)
    return np.asarray(index, np.intp)


def what_is_held(trials: Sequence[Trial], train: Sequence[int], test: Sequence[int]) -> Held:
    """Return the coarsest group of which a split holds out whole values.

    Args:
        trials: All of them.
        train: Indices of the training side.
        test: Indices of the other.
    """
    common = set.intersection(*(set(trials[i].groups) for i in (*train, *test)))
    found = []
    for key in sorted(common - set(_FINE)):
        own = {trials[i].groups[key] for i in train}
        others = {trials[i].groups[key] for i in test}
        if len(own) >= 3 and not own & others:
            found.append((len(own), key, _above(others, own)))
    if not found:
        return Held(None)
    _, key, ordered = min(found)
    return Held(key, ordered)


def _above(later: set[str], earlier: set[str]) -> bool:
    """Return whether all values are numbers, and the later ones larger."""
    try:
        return min(map(float, later)) > max(map(float, earlier))
    except ValueError:
        return False


def inner_folds(
    trials: Sequence[Trial], y: NDArray[np.intp], train: Sequence[int], held: Held
) -> NDArray[np.intp]:
    """Return each training trial's inner fold, shape (len(train),).

    Whole values of the group are held out, spread so that folds are alike in size and classes;
    without a group, with one of too few values, or where later ones are held out, each class's
    trials are parted into successive blocks, so that a fold is tested on what was recorded at
    another time.

    Args:
        trials: All of them.
        y: Their class numbers.
        train: Indices of those that may be used.
        held: What the outer split holds out.

    Raises:
        BadSplit: There are fewer than two trials of some class.
    """
    own = np.asarray(train, np.intp)
    counts = np.bincount(y[own])
    if counts[counts > 0].min() < 2:
        raise BadSplit(
            "at least two training trials of each class, to choose on one and learn from the other",
            "one of some class", "record more trials",
        )  # fmt: skip
    if held.key is not None:
        values = np.array([trials[i].groups[held.key] for i in own])
        if held.ordered:
            return _by_blocks(values.astype(float), y[own])
        fold = _by_groups(values, y[own])
        if fold is not None:
            return fold
    return _by_blocks(np.array([_order(trials[i]) for i in own]), y[own])


def _by_groups(groups: NDArray[np.str_], y: NDArray[np.intp]) -> NDArray[np.intp] | None:
    """Return folds of whole groups; None where a class would be missing from a training part.

    A fold's training part must hold each class; the largest groups are dealt first, each to the
    fold that has fewest of its classes.
    """
    names, index = np.unique(groups, return_inverse=True)
    classes = int(y.max()) + 1
    table = np.zeros((len(names), classes))
    np.add.at(table, (index, y), 1.0)
    folds = min(GROUP_FOLDS, len(names))
    if folds < 2:
        return None
    share = table / np.maximum(table.sum(axis=0), 1.0)
    held = np.zeros((folds, classes))
    place = np.zeros(len(names), np.intp)
    for number in np.argsort(-share.sum(axis=1), kind="stable"):
        after = held + share[number]
        spread = np.array(
            [
                (np.where(np.arange(folds)[:, None] == f, after, held) ** 2).sum()
                for f in range(folds)
            ]
        )
        place[number] = int(spread.argmin())
        held[place[number]] += share[number]
    fold = place[index]
    whole = set(y)
    if any(set(y[fold != number]) != whole for number in set(fold)) or len(set(fold)) < 2:
        return None
    return np.asarray(fold, np.intp)


def _by_blocks(order: NDArray[np.float64], y: NDArray[np.intp]) -> NDArray[np.intp]:
    """Return folds of successive trials of each class; equal numbers stay as they are stored."""
    fold = np.zeros(len(y), np.intp)
    for number in np.unique(y):
        mine = np.flatnonzero(y == number)
        mine = mine[np.argsort(order[mine], kind="stable")]
        fold[mine] = np.arange(len(mine)) * min(FOLDS, len(mine)) // len(mine)
    return fold


def _order(trial: Trial) -> float:
    """Return a trial's number where its groups tell one, else 0: then the order stored stays."""
    for key in ("order", "trial_number", "index", "number"):
        try:
            return float(trial.groups[key])
        except (KeyError, ValueError):
            continue
    return 0.0
