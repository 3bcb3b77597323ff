"""Inner folds: the training part, parted as its own test part was held out.

What the outer split holds out (objects, sessions, later trials) is what the inner folds hold
out, too; a choice that is made on neighbours of its own training trials is a choice for
neighbours. Where later trials are tested, each inner fold learns from what came before it.
Knows nothing about windows or models.

Source: docs/decisions/0039.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from taxel.errors import BadSplit
from taxel.labels.trials import SESSIONS, TIME, USUAL_GROUPS, Trial, as_numbers, group_value
from taxel.plain_text import number_of, several

FOLDS = 5
"""Inner folds of successive trials. Source: our choice, 0039."""
GROUP_FOLDS = 3
"""Inner folds of whole groups: with a third of them held out at once, those that are left are
about as far from them as groups to come will be. Source: our choice, 0039."""
FIRST_TESTED = 2
"""Of successive blocks, the first that is tested where later ones are held out: two of five are
the least to learn from. Source: our choice, 0039."""
LEAST_GROUPS = 3
"""Values of a group that are learned from, at least, for the group to be held out where the split
does not name it. Source: our choice, 0039."""
LEAST_JUDGED = 0.5
"""Share of the trials that must be judged for folds of whole groups. Source: our choice, 0039."""
_FINE = ("trial", "recording", "file")
"""Groups that are new on the other side of any split of trials."""


@dataclass(frozen=True, slots=True)
class Held:
    """What a split holds out."""

    key: str | None
    """A group of which whole values are held out; None for single trials."""
    ordered: bool = False
    """Whether what is held out comes after what is learned from, by numbers."""
    new: str | None = None
    """A group such as sessions whose new values are tested although too few were learned from to
    hold one out: no inner fold shows what a new one does."""
    single: bool = False
    """Whether inner folds hold out single trials, as whole groups cannot be."""

    @property
    def words(self) -> str:
        """Return it in words."""
        few = f" (too few {several(self.new)} to hold one out)" if self.new else ""
        if self.key is None or self.single:
            return f"successive trials{few}"
        return f"{'successive' if self.ordered else 'whole'} {several(self.key)}{few}"


def groups_of(trials: Sequence[Trial], held: Held) -> NDArray[np.intp]:
    """Return what must be taken as a whole when scores are compared, a number a trial."""
    _, index = np.unique(_values(trials, held.key or "trial"), return_inverse=True)
    return np.asarray(index, np.intp)


def _values(trials: Sequence[Trial], key: str) -> NDArray[np.str_]:
    """Return a group's value of each trial; one that lacks it, as a table of folds may leave out,
    stands alone.
    """
    found = ((group_value(trial, key), trial.groups["trial"]) for trial in trials)
    return np.array([alone if value is None else value for value, alone in found])


def what_is_held(
    trials: Sequence[Trial],
    y: NDArray[np.intp],
    train: Sequence[int],
    test: Sequence[int],
    named: str | None = None,
) -> Held:
    """Return the group of which a split holds out whole values: the one it names, or the coarsest.

    The authors' own parts of a data set may be new on the test side, too, although the split is by
    object: the group that the split names comes first, and is held out also where only two of its
    values are left to learn from: single trials would be judged beside others of their own group.
    Of groups that part the trials alike, as a session and its temperature do, a usual one. Later
    trials are held out where in each class the group's values are numbers, and the tested ones
    larger than all that are learned from.

    Args:
        trials: All of them.
        y: Their class numbers, shape (trials,).
        train: Indices of the training side.
        test: Indices of the other.
        named: The group that the split was asked to hold out, if any.
    """
    common = set.intersection(*(set(trials[i].groups) for i in (*train, *test)))
    keys = []
    common |= {TIME} & {named}
    for key in sorted(common - set(_FINE)):
        trained = {group_value(trials[i], key) for i in train}
        others = {group_value(trials[i], key) for i in test}
        ordered = _later(key, trials, y, train, test)
        least = 2 if key == named else LEAST_GROUPS
        grouped = least <= len(trained) <= len(train) / 2
        if not trained & others and (grouped or (ordered and len(trained) >= 3)):
            keys.append((key != named, len(trained), key not in USUAL_GROUPS, key, ordered))
    kinds = {key for i in train for key in trials[i].groups if key.lower() in SESSIONS}
    few = [key for key in sorted(kinds) if _is_new_to_few(key, trials, train, test)]
    new = named if named in few else next(iter(few), None)
    if not keys:
        return Held(None, new=new)
    *_, key, ordered = min(keys)
    return Held(key, ordered, None if key.lower() in SESSIONS else new)


def _is_new_to_few(
    key: str, trials: Sequence[Trial], train: Sequence[int], test: Sequence[int]
) -> bool:
    """Return whether a group's test values are new, and too few others are learned from; trials
    that name none say nothing.
    """
    trained, tested = (
        {trials[i].groups[key] for i in own if key in trials[i].groups} for own in (train, test)
    )
    few = 0 < len(trained) < LEAST_GROUPS and len(trained) <= len(train) / 2
    return few and bool(tested) and trained.isdisjoint(tested)


def _later(
    key: str,
    trials: Sequence[Trial],
    y: NDArray[np.intp],
    train: Sequence[int],
    test: Sequence[int],
) -> bool:
    """Return whether in each class on both sides a group's test values are the larger numbers."""
    try:
        values = as_numbers(group_value(trial, key) or "nan" for trial in trials)
    except ValueError:
        return False
    learned, tested = np.asarray(train, np.intp), np.asarray(test, np.intp)
    common = np.intersect1d(y[learned], y[tested])
    return len(common) > 0 and all(
        values[tested[y[tested] == own]].min() > values[learned[y[learned] == own]].max()
        for own in common
    )


def with_all(
    trials: Sequence[Trial], train: Sequence[int], learned: Sequence[int], held: Held
) -> Held:
    """Return what inner folds hold out where more is learned from than in an outer fold: of two
    sessions each outer fold learns from one, in the end both are learned from.

    Args:
        trials: All of them.
        train: Indices of those that an outer fold learns from.
        learned: Indices of those that are learned from in the end.
        held: What the outer fold holds out.
    """
    if held.new is None or held.ordered:
        return held
    before, values = ({trials[i].groups.get(held.new) for i in own} for own in (train, learned))
    more = None not in values and len(values) > len(before)
    return Held(held.new) if more else held


def with_few(
    trials: Sequence[Trial], y: NDArray[np.intp], train: Sequence[int], held: Held
) -> Held:
    """Return what is held out, with what inner folds cannot hold out: single trials are, then.

    Args:
        trials: All of them.
        y: Their class numbers.
        train: Indices of those that may be used.
        held: What the outer split holds out.
    """
    if held.key is None or held.ordered:
        return held
    names = _values([trials[i] for i in train], held.key)
    if _by_groups(names, y[np.asarray(train, np.intp)]) is not None:
        return held
    new = held.key if held.key.lower() in SESSIONS else held.new
    return replace(held, single=True, new=new)


def inner_folds(
    trials: Sequence[Trial], y: NDArray[np.intp], train: Sequence[int], held: Held
) -> NDArray[np.intp]:
    """Return each training trial's inner fold, shape (len(train),).

    Whole values of the group are held out, spread so that folds are alike in size and classes;
    where later ones are held out, in their order. Without a group, or with one of too few values,
    each class's trials are parted into successive blocks, so that a fold is tested on what was
    recorded at another time.

    Args:
        trials: All of them.
        y: Their class numbers.
        train: Indices of those that may be used.
        held: What the outer split holds out.

    Raises:
        BadSplit: Fewer than two classes have two trials.
    """
    trained = np.asarray(train, np.intp)
    counts = np.bincount(y[trained])
    if (counts >= 2).sum() < 2:
        raise BadSplit(
            "at least two training trials of two classes, to learn from and to choose on",
            number_of(len(trained), "trial"), "record more of them",
        )  # fmt: skip
    if held.key is not None:
        if held.ordered:  # what lacks the number comes last
            numbers = as_numbers(group_value(trials[i], held.key) or "nan" for i in trained)
            return later_blocks(numbers, y[trained])
        fold = _by_groups(_values([trials[i] for i in trained], held.key), y[trained])
        if fold is not None:
            return fold
    return _by_blocks(np.array([_order(trials[i]) for i in trained]), y[trained])


def tested_folds(fold: NDArray[np.intp], *, ordered: bool) -> list[int]:
    """Return the inner folds that are tested: all, or those with enough before them."""
    numbers = [int(number) for number in np.unique(fold)]
    return numbers[min(FIRST_TESTED, len(numbers) - 1) :] if ordered else numbers


def learned_from(fold: NDArray[np.intp], number: int, *, ordered: bool) -> NDArray[np.bool_]:
    """Return what is learned from before an inner fold is tested, shape (n,).

    Args:
        fold: Inner fold of each trial or window, shape (n,).
        number: The fold that is tested.
        ordered: Whether what is held out comes after what is learned from.
    """
    return np.asarray(fold < number if ordered else fold != number)


def judged(
    fold: NDArray[np.intp], y: NDArray[np.intp], *, ordered: bool = False
) -> NDArray[np.bool_]:
    """Return what can be judged, shape (n,): whose class is also learned from for its fold,
    beside another.

    Args:
        fold: Inner fold of each trial or window, shape (n,).
        y: Class of each, shape (n,).
        ordered: Whether what is held out comes after what is learned from.
    """
    found = np.zeros(len(y), bool)
    for number in tested_folds(fold, ordered=ordered):
        learned = np.unique(y[learned_from(fold, number, ordered=ordered)])
        if len(learned) > 1:
            found |= (fold == number) & np.isin(y, learned)
    return found


def _by_groups(groups: NDArray[np.str_], y: NDArray[np.intp]) -> NDArray[np.intp] | None:
    """Return folds of whole groups; None where most trials' classes have one group only.

    The largest groups are dealt first, each to the fold that has fewest of its classes. Where a
    class's groups are all in one fold, its trials there are not judged.
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
        cost = []
        for held_out in range(folds):
            after = held + np.where(np.arange(folds) == held_out, 1.0, 0.0)[:, None] * share[number]
            cost.append((after**2).sum() + (after.sum(axis=1) ** 2).sum() / classes)
        place[number] = int(np.argmin(cost))
        held[place[number]] += share[number]
    fold = place[index]
    if len(set(fold)) < 2 or judged(fold, y).mean() < LEAST_JUDGED:
        return None
    return np.asarray(fold, np.intp)


def later_blocks(values: NDArray[np.float64], y: NDArray[np.intp]) -> NDArray[np.intp]:
    """Return folds of successive values of each class, whole ones unless these are so few that a
    class would not be judged.

    Args:
        values: Shape (n,): a group's numbers, or times.
        y: Class numbers, shape (n,).
    """
    parted = _by_blocks(values, y)
    whole = parted.copy()
    for number in np.unique(y):
        for value in np.unique(values[y == number]):
            own = (y == number) & ((values == value) | (np.isnan(values) & np.isnan(value)))
            whole[own] = parted[own].min()
    found, wanted = (np.unique(y[judged(fold, y, ordered=True)]) for fold in (whole, parted))
    return whole if np.array_equal(found, wanted) else parted


def _by_blocks(order: NDArray[np.float64], y: NDArray[np.intp]) -> NDArray[np.intp]:
    """Return folds of successive trials of each class; equal numbers stay as they are stored."""
    fold = np.zeros(len(y), np.intp)
    for number in np.unique(y):
        mine = np.flatnonzero(y == number)
        mine = mine[np.argsort(order[mine], kind="stable")]
        fold[mine] = np.arange(len(mine)) * min(FOLDS, len(mine)) // len(mine)
    return fold


def _order(trial: Trial) -> float:
    """Return a trial's number where its groups give one, else 0: then the order stored stays."""
    for key in ("order", "trial_number", "index", "number"):
        try:
            return float(trial.groups[key])
        except (KeyError, ValueError):
            continue
    return 0.0
