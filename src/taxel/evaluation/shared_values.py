"""Values of a group, such as objects, on both sides of a split: said beside the accuracy.

Knows nothing about how a split was made, nor about windows or models.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from taxel.bundles.contract import value_fingerprint
from taxel.evaluation.splits import Split, TrialFold
from taxel.labels.trials import OBJECTS, USUAL_GROUPS, Trial, held_out
from taxel.plain_text import number_of, several


def can_be_held_out(values: Sequence[str], y: NDArray[np.intp]) -> bool:
    """Return whether each class has several values of a group: where an object is the class, none
    can be held out.

    Args:
        values: Each trial's value of the group.
        y: Class of each, shape (trials,).
    """
    names = np.array(values)
    return all(len(set(names[y == number].tolist())) > 1 for number in set(y.tolist()))


def on_both_sides(
    key: str, values: Sequence[str], y: NDArray[np.intp], folds: Sequence[TrialFold]
) -> str | None:
    """Return a warning where test trials share values of a group with training.

    Args:
        key: The group.
        values: Each trial's value of it.
        y: Class of each, shape (trials,).
        folds: Whole trials on either side.
    """
    tested: set[str] = set()
    both: set[str] = set()
    for fold in folds:
        own = {values[i] for i in fold.test}
        tested |= own
        both |= own & {values[i] for i in fold.train | fold.validation}
    if not both or not can_be_held_out(values, y):
        return None
    every, are = number_of(len(tested), f"tested {key}"), "is" if len(both) == 1 else "are"
    return (
        f"{len(both)} of {every} {are} on both sides: the accuracy "
        f"holds for {several(key)} that were learned from; --split group:{key} holds them out"
    )


def objects_on_both(trials: Sequence[Trial], y: NDArray[np.intp], split: Split) -> list[str]:
    """Return notes of objects that a split of recordings puts on both sides.

    A split that names what it holds out says by that what it leaves on both sides.

    Args:
        trials: All of them.
        y: Class of each, shape (trials,).
        split: Such as a table's.
    """
    if held_out(split.name, trials) is not None:
        return []
    folds = split.trial_folds
    lines = [
        on_both_sides(key, [trial.groups[key] for trial in trials], y, folds)
        for key in OBJECTS
        if all(key in trial.groups for trial in trials)
    ]
    return [line for line in lines if line]


def named_by_unseen(split: Split, trials: Sequence[Trial]) -> Split:
    """Return a split of recordings whose name says which objects, persons … it tests unseen.

    Args:
        split: Such as that of another folder, or of a table.
        trials: All of them.
    """
    if held_out(split.name, trials) is not None:
        return split
    counts = {
        key: _unseen([trial.groups[key] for trial in trials], split.trial_folds)
        for key in _usual(trials)
    }
    return replace(split, name=_named(split.name, counts))


def name_by_unseen(
    name: str, tested: Sequence[Trial], learned: Sequence[Mapping[str, Collection[str]]]
) -> str:
    """Return a split's name, with the objects, persons … that trained recognisers are tested on
    unseen.

    Args:
        name: The split's; empty where there is none.
        tested: Trials of recordings that are tested.
        learned: Of each recogniser, the `learned_groups` of its contract.
    """
    if held_out(name, tested) is not None:
        return name
    counts = {}
    for key in _usual(tested):
        own = {value_fingerprint(trial.groups[key]) for trial in tested}
        unseen = all(key in groups and own.isdisjoint(groups[key]) for groups in learned)
        counts[key] = len(own) if unseen else 0
    return _named(name, counts)


def _usual(trials: Sequence[Trial]) -> list[str]:
    return [key for key in USUAL_GROUPS if all(key in trial.groups for trial in trials)]


def _named(name: str, unseen: Mapping[str, int]) -> str:
    """Return a split's name with the group that its intervals must draw as a whole.

    Nobody named it, as where the test recordings lie in a folder of their own; but trials of one
    object are alike. Of several such groups that is the coarsest, of those of which several values
    are tested. Sessions are drawn without being named: if they are of one person only, the name
    says that, so that the interval is not taken for one over persons.

    Args:
        name: The split's.
        unseen: Group → how many values are tested that were not trained on.
    """
    several_of = [key for key, count in unseen.items() if count > 1]
    lone = [key for key, count in unseen.items() if count == 1]
    found = min(several_of, key=lambda key: unseen[key], default=None)
    if lone and found in (None, "session"):
        found = lone[0]
    return name if found is None else f"{name}, {found} held out"


def _unseen(values: Sequence[str], folds: Sequence[TrialFold]) -> int:
    """Return how many values of a group are tested; 0 where a fold has one on both sides."""
    tested: set[str] = set()
    for fold in folds:
        own = {values[i] for i in fold.test}
        if own & {values[i] for i in fold.train | fold.validation}:
            return 0
        tested |= own
    return len(tested)
