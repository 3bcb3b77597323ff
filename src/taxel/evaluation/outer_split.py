"""The outer split of a training that chooses: one of taxel's own, a table's, or the usual one.

Knows nothing about how anything is chosen.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from taxel.errors import BadSplit
from taxel.evaluation.shared_values import named_by_unseen
from taxel.evaluation.splits import Fold, Split, TrialFold, check_classes, parse_split
from taxel.evaluation.table_split import OWN_SPLIT, GivenSplit, split_elsewhere
from taxel.evaluation.usual_split import usual_split
from taxel.plain_text import number_of
from taxel.training.choose.base import Base

FOLDS = 5
"""Source: our choice, docs/decisions/0039."""


@dataclass(frozen=True, slots=True, kw_only=True)
class OuterSplit:
    """How the outer folds are made: a named split, one from elsewhere, or the usual one."""

    named: str | None = None
    """As `parse_split` takes it; unless given the other folder, or else the coarsest groups."""
    given: GivenSplit = OWN_SPLIT
    folds: int = FOLDS
    seed: int = 0

    @property
    def leaves_unseen(self) -> bool:
        """Return whether a single test part stays unseen by what is trained in the end."""
        return self.given.table is not None

    def of(self, base: Base) -> Split:
        """Return the folds of recordings.

        A table's validation trials are learned from: inner folds choose.

        Raises:
            BadSplit: They cannot be split so.
            BadTable: The table cannot be read, or names what is not there.
        """
        if self.folds < 2:
            raise BadSplit("at least two folds", str(self.folds), "choose more folds")
        if self.given.table is not None:
            split = split_elsewhere(base.path, base.dataset, base.target, self.given)[1]
            return replace(split, folds=tuple(_with_validation(fold) for fold in split.folds))
        if self.named is None and base.test is not None:
            return _other_folder(base, base.test)
        if self.named is None:
            return usual_split(base.dataset, base.target, self.folds, self.seed)
        return parse_split(self.named, base.dataset, base.target, self.folds, self.seed)


USUAL = OuterSplit()
"""The coarsest groups held out."""


def _with_validation(fold: Fold) -> Fold:
    """Return a fold whose validation trials are in its training part."""
    if not isinstance(fold, TrialFold):
        return fold
    return TrialFold(fold.name, fold.train | fold.validation, fold.test)


def check_training_parts(base: Base, split: Split, given: OuterSplit = USUAL) -> None:
    """Refuse a split that leaves too few trials of a class to learn from and to choose on.

    Args:
        base: The recordings.
        split: Its folds.
        given: How they were made, which decides what would help.

    Raises:
        BadSplit: In the training part of a fold fewer than two classes have two trials.
    """
    for fold in split.trial_folds:
        counts = np.bincount(base.y[sorted(fold.train)])
        if (counts >= 2).sum() < 2:
            raise BadSplit(
                "at least two trials of two classes in each training part, to learn from and to "
                "choose on",
                f"{_of_each(counts)} in the training part {fold.name!r} ({split.name})",
                _to_train_on_more(base, given),
            )  # fmt: skip


def _to_train_on_more(base: Base, given: OuterSplit) -> str:
    """Return how training parts get more trials."""
    if given.given.table is not None:
        return f"record more of each class, or train on more of them in {given.given.table.name}"
    if base.test is not None:
        return "record more of each class to train on"
    if (given.named or "").startswith("order:"):
        return "record more of each class, or name another split"
    return ("record more of each class, hold out another group, or hold out fewer at a time with "
            "a larger --fold-count")  # fmt: skip


def _of_each(counts: NDArray[np.intp]) -> str:
    """Return how many trials the classes have, in words."""
    held = counts[counts > 0]
    few, most = int(held.min()), int(held.max())
    each = f"{few} of a class" if few == most else f"{few} to {most} of a class"
    return f"{number_of(int(held.sum()), 'trial')} of {number_of(len(held), 'class')}, {each},"


def _other_folder(base: Base, folder: Path) -> Split:
    """Return the split that tests the other folder's trials."""
    own = frozenset(base.own)
    fold = TrialFold("test", own, frozenset(range(len(base.trials))) - own)
    check_classes(base.dataset, base.target, fold)
    split = Split(f"trained elsewhere, tested on {folder.name or folder}", (fold,), None)
    return named_by_unseen(split, base.trials)
