"""Splits as types: which trials, or which windows, a model may see.

A `TrialFold` moves whole trials, so no window of a trial can stand on both
sides. A `WindowFold` moves single windows, as the TENG thesis seems to (it names
no split; its figures fit this one, docs/decisions/0042); its name says that it
leaks, and every table that uses it prints that name. scikit-learn is imported where it
shuffles: a worker that holds out whole groups starts sooner without it. Knows nothing
about models or metrics.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from taxel.errors import BadSplit
from taxel.evaluation.first_share import by_class_too, first_share, group_numbers, names_share
from taxel.labels.class_order import figures_as_classes
from taxel.labels.joined import with_joined_label
from taxel.plain_text import number_of
from taxel.windows.checks import MORE_WINDOWS, labels_of, no_window
from taxel.windows.dataset import Dataset

NAMED = "random, group:KEY, order:KEY:LAST, order:KEY:LAST:END or order:KEY:70%[:by-class]"
"""What may be named."""
WHOLE_SPLITS = "choose group:KEY or order:KEY:70%"
"""What to do where whole trials are needed and single windows are split."""
_TRIES = 50
"""Seeds tried until every training part holds every class."""


@dataclass(frozen=True, slots=True)
class TrialFold:
    """Whole trials, of arrays or of cameras, on either side."""

    name: str
    train: frozenset[int]
    """Indices into the trials, such as `Dataset.trials`."""
    test: frozenset[int]
    """Indices into the trials."""
    validation: frozenset[int] = frozenset()
    """Those to choose by: neither trained on nor tested; none in taxel's own splits."""

    def __post_init__(self) -> None:
        both = (self.train & self.test) | ((self.train | self.test) & self.validation)
        if both:
            raise BadSplit(
                "trials on one side only",
                f"{len(both)} on both sides of {self.name}",
                "assign each trial once",
            )

    @staticmethod
    def of(name: str, train: NDArray[np.intp], test: NDArray[np.intp]) -> TrialFold:
        """Return the fold of two sides given by their trials' indices, shape (n,) each.

        Raises:
            BadSplit: A trial is on both.
        """
        return TrialFold(name, frozenset(train.tolist()), frozenset(test.tolist()))

    @property
    def train_rows(self) -> NDArray[np.intp]:
        """Indices of the training trials, ascending, shape (trials,)."""
        return np.array(sorted(self.train), np.intp)

    @property
    def test_rows(self) -> NDArray[np.intp]:
        """Indices of the test trials, ascending, shape (trials,)."""
        return np.array(sorted(self.test), np.intp)

    def windows(self, dataset: Dataset) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
        """Return the training and the test windows' indices, ascending, shape (windows,) each."""
        train = np.isin(dataset.trial, sorted(self.train))
        test = np.isin(dataset.trial, sorted(self.test))
        return np.flatnonzero(train), np.flatnonzero(test)

    def validation_windows(self, dataset: Dataset) -> NDArray[np.intp]:
        """Return the indices of the windows to choose by, ascending, shape (windows,)."""
        return np.flatnonzero(np.isin(dataset.trial, sorted(self.validation)))


@dataclass(frozen=True, slots=True)
class WindowFold:
    """Single windows on either side: neighbours of one grasp land on both (leaks)."""

    name: str
    train: NDArray[np.intp]
    """Indices into the data set's windows."""
    test: NDArray[np.intp]
    """Indices into the data set's windows."""

    def windows(self, dataset: Dataset) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
        """Return the training and the test windows' indices, shape (windows,) each.

        Raises:
            BadSplit: The windows overlap, so that one value would stand on both sides.
        """
        if dataset.config.stride < dataset.config.steps:
            raise BadSplit(
                "windows without overlap for a split by random windows",
                f"a stride of {dataset.config.stride} for {dataset.config.steps} rows",
                "choose a stride as long as the window, or split by group",
            )
        return self.train, self.test


_fold = TrialFold.of
Fold = TrialFold | WindowFold


@dataclass(frozen=True, slots=True)
class Split:
    """Folds for cross-validation, and a last fold whose test part no fold has seen."""

    name: str
    """Printed beside every accuracy, such as "session held out"."""
    folds: tuple[Fold, ...]
    final: Fold | None
    """Development part against the test part; None where all data is in the folds."""
    key: str | None = None
    """The group that it was asked to hold out, such as "session"; None where it names none."""
    notes: tuple[str, ...] = ()
    """What a reader must know: a table's idle lines, or why sessions are not held out."""

    @property
    def trial_folds(self) -> tuple[TrialFold, ...]:
        """Its folds that move whole trials: all of them, or none of a split by random windows."""
        return tuple(fold for fold in self.folds if isinstance(fold, TrialFold))

    def whole_trials(self, purpose: str, mend: str) -> tuple[TrialFold, ...]:
        """Return its folds, which must all move whole trials.

        Args:
            purpose: What they are needed for, such as "to choose on".
            mend: What to do where they do not.

        Raises:
            BadSplit: A fold moves single windows.
        """
        if len(self.trial_folds) < len(self.folds):
            raise BadSplit(f"a split of whole trials, {purpose}", self.name, mend)
        return self.trial_folds


def random_windows(dataset: Dataset, target: str, folds: int, seed: int, test: float) -> Split:
    """Split single windows at random, as the TENG thesis seems to (0042). It leaks.

    Args:
        dataset: Windows to split.
        target: The label that each part holds in equal shares.
        folds: How many folds.
        seed: Seed of the order.
        test: Share of windows kept out of all folds for the last test, 0.5 at most and so large
            that it holds a window of each class; 0 keeps none.

    Raises:
        BadSplit: Fewer than two folds, a class of fewer windows, or a share out of its range.
    """
    from sklearn.model_selection import StratifiedKFold

    _check_folds(folds)
    y = dataset.class_numbers(target)
    rest, held = np.arange(len(y)), np.zeros(0, np.intp)
    if test:
        _check_share(y, dataset.classes(target), test)
        splitter = StratifiedKFold(round(1 / test), shuffle=True, random_state=seed)
        rest, held = next(iter(splitter.split(y, y)))
    _check_count(y[rest], dataset.classes(target), folds)
    inner = StratifiedKFold(folds, shuffle=True, random_state=seed + 1)
    parts = tuple(
        WindowFold(f"fold {i}", rest[train], rest[out])
        for i, (train, out) in enumerate(inner.split(rest, y[rest]), 1)
    )
    final = WindowFold("test", rest, held) if test else None
    return Split("random windows (leaks)", parts, final)


def by_group(
    dataset: Dataset, target: str, key: str, folds: int, seed: int, *, final: bool = False
) -> Split:
    """Hold out whole groups, such as sessions: the honest split.

    With no more groups than folds, each group is held out once.

    Args:
        dataset: Windows to split.
        target: The label; every class needs at least two groups.
        key: The group that must not stand on both sides.
        folds: How many folds.
        seed: Seed of the assignment.
        final: True keeps the last group (by name) out of all folds for a last test.

    Raises:
        BadSplit: Fewer than two folds, or more than the windows of every class; a class has one
            group only, or a training part would lack a class.
    """
    _check_folds(folds)
    groups = dataset.group(key)
    classes = labels_of(dataset.trials, target)
    empty = [with_joined_label(trial, target) for trial in dataset.empty]
    for name in sorted(set(classes)):
        own = sorted({g for g, c in zip(groups, classes, strict=True) if c == name})
        lost = [t for t in empty if t.labels.get(target) == name and t.groups.get(key) not in own]
        if len(own) < 2 and lost:
            raise BadSplit(
                f"windows of at least two groups {key!r} for every class of {target!r}",
                f"one ({own[0]}) for {name!r}: {no_window(lost, 'its other groups')}",
                MORE_WINDOWS,
            )
        if classes.count(name) < 2:
            alone = dataset.trials[classes.index(name)]
            unseen = [t for t in empty if t.labels.get(target) == name]
            raise BadSplit(
                f"at least two trials of every class of {target!r}, to learn from and to test",
                f"one of {name!r} ({alone.recording}, from {alone.start_s:.1f} s)"
                + (f": {no_window(unseen, 'its other trials')}" if unseen else ""),
                MORE_WINDOWS
                if unseen
                else figures_as_classes(classes, target)
                or f"record {name!r} again, or leave that trial out",
            )
        if len(own) < 2:
            raise BadSplit(
                f"at least two groups {key!r} for every class of {target!r}",
                f"one ({own[0]}) for {name!r}",
                f"record {name!r} in another {key} too, or hold out another group",
            )
    everyone = np.arange(len(groups))
    last = max(groups.tolist()) if final else None
    rest = everyone[groups != last] if final else everyone
    parts = _group_folds(dataset, target, groups, rest, folds, seed)
    final_fold = _fold("test", rest, everyone[groups == last]) if final else None
    return Split(f"{key} held out", parts, final_fold, key)


def by_order(dataset: Dataset, target: str, key: str, last: float, end: float = np.inf) -> Split:
    """Train on groups numbered up to `last`, test on those above it and up to `end`.

    Raises:
        BadSplit: The group is not a number, one side is empty, or a class is tested and not trained
            on.
    """
    numbers = group_numbers(key, dataset.group(key))
    everyone = np.arange(len(numbers))
    before = everyone[numbers <= last]
    after = everyone[(numbers > last) & (numbers <= end)]
    if not len(before) or not len(after):
        raise BadSplit(
            f"trials on both sides of {key} = {last:g}", f"{len(before)} and {len(after)}",
            f"choose a number between {numbers.min():g} and {numbers.max():g}",
        )  # fmt: skip
    name = f"{key} up to {last:g} → above" + (f", up to {end:g}" if np.isfinite(end) else "")
    fold = _fold(name, before, after)
    check_classes(dataset, target, fold, by_class_too(key))
    return Split(name, (fold,), None, key)


def by_share(
    dataset: Dataset, target: str, key: str, text: str, *, by_class: bool = False
) -> Split:
    """Train on the first of the numbered groups, a share of the trials; test on the later ones.

    Args:
        dataset: Windows to split.
        target: The label.
        key: A group of numbers.
        text: The share, such as "70%".
        by_class: Whether the first of each class are taken, by its own numbers.

    Raises:
        BadSplit: As `first_share`.
    """
    y = np.array([trial.labels[target] for trial in dataset.trials])
    first, name = first_share(key, dataset.group(key), y, text, by_class=by_class)
    return Split(name, (_fold(name, np.flatnonzero(first), np.flatnonzero(~first)),), None, key)


def check_classes(dataset: Dataset, target: str, fold: TrialFold, also: str = "") -> None:
    """Refuse a fold that tests a class which its training part lacks, or trains one class only.

    Args:
        dataset: The trials.
        target: The label.
        fold: To be checked.
        also: What else mends a class that is not trained on.

    Raises:
        BadSplit: So it is.
    """
    trained, tested = ({dataset.trials[i].labels[target] for i in side}
                       for side in (fold.train, fold.test))  # fmt: skip
    if lacking := sorted(tested - trained):
        raise BadSplit(
            f"every tested class of {target!r} in the training part of {fold.name}",
            f"none of {', '.join(lacking)}",
            f"train on it too, or leave it out of the test part{also}",
        )  # fmt: skip
    if len(trained) < 2:
        raise BadSplit(f"at least two classes of {target!r} to train on in {fold.name}",
                       f"{', '.join(trained)} only", "add recordings of another")  # fmt: skip


def parse_split(text: str, dataset: Dataset, target: str, folds: int, seed: int) -> Split:
    """Return the split that a text names: "random", "group:KEY", "order:KEY:LAST[:END]" or
    "order:KEY:70%[:by-class]".

    Raises:
        BadSplit: The text names none, or the data cannot be split so.
    """
    words = text.split(":")
    if words == ["random"]:
        return random_windows(dataset, target, folds, seed, test=0.0)
    if words[0] == "group" and len(words) == 2:
        return by_group(dataset, target, words[1], folds, seed)
    if names_share(words):
        return by_share(dataset, target, words[1], words[2], by_class=len(words) == 4)
    if words[0] == "order" and len(words) in (3, 4):
        try:
            limits = [float(word) for word in words[2:]]
        except ValueError:
            limits = []
        if limits:
            return by_order(dataset, target, words[1], *limits)
    known = sorted(set.intersection(*(set(trial.groups) for trial in dataset.trials)))
    raise BadSplit(
        f"a split: {NAMED}", repr(text),
        f"say group:{text}" if text in known else f"for group:KEY, groups are {', '.join(known)}",
    )  # fmt: skip


def _group_folds(
    dataset: Dataset,
    target: str,
    groups: NDArray[np.str_],
    rest: NDArray[np.intp],
    folds: int,
    seed: int,
) -> tuple[TrialFold, ...]:
    own = groups[rest]
    names = sorted(set(own))
    if len(names) < 2:
        raise BadSplit("at least two groups to hold out", f"{len(names)}", "record more of them")
    if len(names) <= folds:
        parts = [_fold(f"without {n}", rest[own != n], rest[own == n]) for n in names]
        if _all_classes(dataset, target, parts):
            return tuple(parts)
    from sklearn.model_selection import StratifiedGroupKFold

    windows = np.flatnonzero(np.isin(dataset.trial, rest))
    y = dataset.class_numbers(target)[windows]
    owners = groups[dataset.trial[windows]]
    most, count = int(np.bincount(y).max()), min(folds, len(names))
    if count > most:  # scikit-learn refuses that too
        raise BadSplit(f"at least {count} windows of a class for {count} folds",
                       f"{most} at most", f"choose at most {most} folds")  # fmt: skip
    for attempt in range(_TRIES):
        splitter = StratifiedGroupKFold(count, shuffle=True, random_state=seed + 1000 * attempt)
        held = [set(owners[out]) for _, out in splitter.split(y, y, owners)]
        sides = [np.isin(own, list(out)) for out in held]
        parts = [_fold(f"fold {i}", rest[~out], rest[out]) for i, out in enumerate(sides, 1)]
        if all(held) and _all_classes(dataset, target, parts):
            return tuple(parts)
    raise BadSplit(
        "every class in every training part",
        f"none of {_TRIES} ways to make {folds} folds gives that",
        "choose fewer folds, or record more groups of each class",
    )


def _all_classes(dataset: Dataset, target: str, parts: list[TrialFold]) -> bool:
    every = set(dataset.classes(target))
    labels = [trial.labels[target] for trial in dataset.trials]
    return all({labels[i] for i in part.train} == every for part in parts)


def _check_folds(folds: int) -> None:
    if folds < 2:
        raise BadSplit("at least two folds", str(folds), "choose more folds")


def _check_share(y: NDArray[np.intp], classes: list[str], test: float) -> None:
    fewest = int(np.bincount(y, minlength=len(classes)).min())
    if not 0 < test <= 0.5 or 1 / test > fewest + 0.5:
        least = f", or {1 / fewest:.2g} to 0.5" if fewest > 1 else ""
        raise BadSplit(
            f"a test share of 0{least}, with {number_of(fewest, 'window')} of the rarest class",
            f"{test:g}", "choose another share",
        )  # fmt: skip


def _check_count(y: NDArray[np.intp], classes: list[str], folds: int) -> None:
    counts = np.bincount(y, minlength=len(classes))
    if counts.min() < folds:
        rare = classes[int(counts.argmin())]
        raise BadSplit(f"at least {folds} windows of each class for {folds} folds",
                       f"{counts.min()} of {rare!r}",
                       "record more, or choose fewer folds")  # fmt: skip
