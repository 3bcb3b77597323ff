"""The outer split of a training that chooses: one of taxel's own, a table's, or the usual one.

Knows nothing about how anything is chosen.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from taxel.errors import BadInput, BadSplit
from taxel.evaluation.splits import Split, TrialFold, parse_split
from taxel.evaluation.table_split import OWN_SPLIT, Elsewhere, split_elsewhere
from taxel.labels.trials import OBJECTS, USUAL_GROUPS, coarsest_group
from taxel.training.choose.preparations import Base

FOLDS = 5
"""Source: our choice, docs/decisions/0039."""
_FEWEST_OBJECTS = 3
"""Objects from which on they are held out unless a split is named. Source: our choice, 0039."""


@dataclass(frozen=True, slots=True, kw_only=True)
class OuterSplit:
    """What the outer folds are made by."""

    named: str | None = None
    """As `parse_split` takes it; the coarsest groups are held out unless given."""
    given: Elsewhere = OWN_SPLIT
    folds: int = FOLDS
    seed: int = 0

    @property
    def leaves_unseen(self) -> bool:
        """Return whether a single test part stays unseen by what is trained in the end."""
        return self.given.table is not None

    def of(self, base: Base) -> Split:
        """Return the folds of recordings.

        Raises:
            BadSplit: They cannot be split so.
            BadTable: The table cannot be read, or names what is not there.
        """
        if self.folds < 2:
            raise BadSplit("at least two folds", str(self.folds), "choose more folds")
        if self.given.table is not None:
            return split_elsewhere(base.path, base.dataset, base.target, self.given)[1]
        if self.named is not None:
            return parse_split(self.named, base.dataset, base.target, self.folds, self.seed)
        return _usual(base, self.folds, self.seed)


USUAL = OuterSplit()
"""The coarsest groups held out."""


def check_training_parts(base: Base, split: Split) -> None:
    """Refuse a split that leaves too few trials of a class to learn from and to choose on.

    Raises:
        BadSplit: In the training part of a fold fewer than two classes have two trials.
    """
    for fold in split.folds:
        if not isinstance(fold, TrialFold):
            continue
        counts = np.bincount(base.y[sorted(fold.train)])
        if (counts >= 2).sum() < 2:
            raise BadSplit(
                "at least two trials of two classes in each training part, to learn from and to "
                "choose on",
                f"{_of_each(counts)} in the training part {fold.name!r} ({split.name})",
                "record more of each class, hold out another group, or hold out fewer at a time "
                "with a larger --fold-count",
            )  # fmt: skip


def _of_each(counts: NDArray[np.intp]) -> str:
    """Return how many trials the classes have, in words."""
    held = counts[counts > 0]
    few, most = int(held.min()), int(held.max())
    each = f"{few} of a class" if few == most else f"{few} to {most} of a class"
    return f"{int(held.sum())} trials of {len(held)} classes, {each},"


def _usual(base: Base, folds: int, seed: int) -> Split:
    """Hold out the coarsest groups; where another folder is to be tested on, that.

    Objects that were touched several times come first, unless there are sessions; then sessions, or
    where there are none what else people part trials by, such as persons; then files.
    """
    if base.test is not None:
        own = frozenset(base.own)
        fold = TrialFold("test", own, frozenset(range(len(base.trials))) - own)
        return Split(f"trained elsewhere, tested on {base.test.name}", (fold,), None)
    key = coarsest_group(base.trials)
    finer = (name for name in ("session", "file", "recording", "trial") if name != key)
    first = ("object",) if key != "session" and _has_objects(base) else ()
    others = () if key == "session" else _parting(base)
    order = [*first, *others, key, *finer]
    known = [name for name in order if all(name in trial.groups for trial in base.trials)]
    for name in known[:-1]:
        try:
            return parse_split(f"group:{name}", base.dataset, base.target, folds, seed)
        except BadInput:
            continue
    return parse_split(f"group:{known[-1]}", base.dataset, base.target, folds, seed)


def _parting(base: Base) -> list[str]:
    """Return sittings, days or persons, of which each trial has one: the fewest first."""
    counts = {
        name: len({trial.groups[name] for trial in base.trials})
        for name in USUAL_GROUPS
        if name not in OBJECTS and all(name in trial.groups for trial in base.trials)
    }
    parting = [name for name, count in counts.items() if 1 < count < len(base.trials)]
    return sorted(parting, key=lambda name: (counts[name], name))


def _has_objects(base: Base) -> bool:
    """Return whether objects can be held out whole: several trials each, several of each class."""
    names = [trial.groups.get("object") for trial in base.trials]
    if None in names or len(set(names)) < _FEWEST_OBJECTS or 2 * len(set(names)) > len(names):
        return False
    pairs = set(zip(base.y.tolist(), names, strict=True))
    return all(sum(y == number for y, _ in pairs) > 1 for number in set(base.y.tolist()))
