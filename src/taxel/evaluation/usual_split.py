"""What is held out where no split is named: the coarsest groups of the recordings that allow it.

`train` without a recipe, and a recipe that names no split of its own, ask here, so that they hold
out the same. Knows nothing about models.

Background of our choices: docs/decisions/0039.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from taxel.errors import BadInput, BadSplit
from taxel.evaluation.splits import Split, parse_split
from taxel.labels.trials import OBJECTS, USUAL_GROUPS, Trial, coarsest_group
from taxel.plain_text import noun_of, several
from taxel.recordings.imports.own_groups import CUT_FROM
from taxel.windows.dataset import Dataset

IN_WORDS = "sessions, else objects, persons …, else files"
"""What is held out, for lists of recipes."""
_FEWEST_OBJECTS = 3
"""Objects from which on they are held out unless a split is named. Source: our choice, 0039."""


def recipe_split(named: str | None, dataset: Dataset, target: str, folds: int, seed: int) -> Split:
    """Return the split of a recipe: the one that it names, else the usual one.

    A recipe measures on new sessions where there are some, and is refused where they cannot be held
    out: a finer split would not say what it is for.

    Args:
        named: As `parse_split` takes it; None holds out what is usual.
        dataset: What is split.
        target: The label that is predicted.
        folds: How many folds, at most.
        seed: Of the groups' assignment.

    Raises:
        BadSplit: The text names none, or the data cannot be split so.
        BadDataset: A trial lacks the group that is named.
    """
    if named is None and coarsest_group(dataset.trials) == "session":
        named = "group:session"
    if named is None:
        return usual_split(dataset, target, folds, seed)
    return parse_split(named, dataset, target, folds, seed)


def usual_split(dataset: Dataset, target: str, folds: int, seed: int) -> Split:
    """Return folds that hold out the coarsest groups.

    Objects that were touched several times come first, unless there are sessions; then sessions, or
    where there are none what else people part trials by, such as persons; then files. Of pieces
    (the import table's column of that name) all those of a whole are on one side. A note of the
    split names sessions or others that come before but cannot be held out, and why.

    Args:
        dataset: What is split, in windows of any length.
        target: The label that is predicted.
        folds: How many folds, at most.
        seed: Of the groups' assignment.

    Raises:
        BadSplit: No group can be held out whole.
    """
    order = _order(dataset.trials, [trial.labels[target] for trial in dataset.trials])
    pieces = all(CUT_FROM in trial.groups for trial in dataset.trials)
    if pieces:  # never some pieces of a whole with the others of it in training
        order.remove("trial")
    refused: tuple[str, BadInput] | None = None
    for key in order[: None if pieces else -1]:
        try:
            split = parse_split(f"group:{key}", dataset, target, folds, seed)
        except BadInput as refusal:
            refused = refused or (key, refusal)
            continue
        return replace(split, notes=_passed_over(dataset.trials, refused, key))
    if pieces:
        raise BadSplit(
            f"pieces of several recordings or stretches of each {target}, to hold out whole ones",
            "pieces of too few of them",
            "import more recordings, or test the later pieces by --split order:piece_number:70%",
        )
    split = parse_split(f"group:{order[-1]}", dataset, target, folds, seed)
    return replace(split, notes=_passed_over(dataset.trials, refused, order[-1]))


def _passed_over(
    trials: Sequence[Trial], refused: tuple[str, BadInput] | None, key: str
) -> tuple[str, ...]:
    """Return a note on several sessions, objects or persons that cannot be held out, if any.

    Args:
        trials: All of them.
        refused: The first group that could not be held out, and why.
        key: The group that is held out instead.
    """
    if refused is None:
        return ()
    first, why = refused
    if first not in USUAL_GROUPS or len({trial.groups[first] for trial in trials}) < 2:
        return ()
    return (
        f"{several(first)} cannot be held out: needed {why.needed}; got {why.got}; so "
        f"{several(key)} are, and in a new {noun_of(first)} accuracy may be lower",
    )


def _order(trials: Sequence[Trial], labels: Sequence[str]) -> list[str]:
    """Return the groups that all trials have, in the order in which `usual_split` tries them."""
    key = coarsest_group(trials)
    parts = ("session", "file", "recording", CUT_FROM, "trial")
    finer = (name for name in parts if name != key)
    first = ("object",) if key != "session" and _has_objects(trials, labels) else ()
    others = () if key == "session" else _parting(trials)
    order = [*first, *others, key, *finer]
    return [name for name in order if all(name in trial.groups for trial in trials)]


def _parting(trials: Sequence[Trial]) -> list[str]:
    """Return sittings, days or persons, of which each trial has one: the fewest first."""
    counts = {
        name: len({trial.groups[name] for trial in trials})
        for name in USUAL_GROUPS
        if name not in OBJECTS and all(name in trial.groups for trial in trials)
    }
    parting = [name for name, count in counts.items() if 1 < count < len(trials)]
    return sorted(parting, key=lambda name: (counts[name], name))


def _has_objects(trials: Sequence[Trial], labels: Sequence[str]) -> bool:
    """Return whether objects can be held out whole: several trials each, several of each class."""
    names = [trial.groups.get("object") for trial in trials]
    if None in names or len(set(names)) < _FEWEST_OBJECTS or 2 * len(set(names)) > len(names):
        return False
    pairs = set(zip(labels, names, strict=True))
    return all(sum(own == label for own, _ in pairs) > 1 for label in set(labels))
