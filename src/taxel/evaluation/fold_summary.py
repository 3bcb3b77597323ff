"""What a split holds out: each fold's values, and its trials or windows of each class by side.

Knows nothing about how a split is made, nor about models.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from taxel.evaluation.fold_table import GROUP, write_fold_table
from taxel.evaluation.splits import Split, TrialFold
from taxel.labels.class_order import in_order
from taxel.labels.trials import group_value
from taxel.recordings.imports.spelling import by_numbers
from taxel.windows.dataset import Dataset


@dataclass(frozen=True, slots=True, kw_only=True)
class FoldSummary:
    """One fold; each side as class → how many, 0 for a class that it lacks."""

    name: str
    held_out: tuple[str, ...]
    """Values of the split's group that are tested, by name and number; none where one of them is
    trained on as well, or where the split names no group."""
    train: Mapping[str, int]
    validation: Mapping[str, int]
    """To choose by; all 0 where such are trained on."""
    test: Mapping[str, int]


@dataclass(frozen=True, slots=True, kw_only=True)
class SplitSummary:
    """A split in figures."""

    target: str
    split: str
    """Its name, as beside an accuracy: "session held out"."""
    group: str | None
    """What `held_out` are values of; None where the split names no group."""
    counted: str
    """What is counted: "trial", or "window" where single windows are split."""
    total: int
    """How many there are, on a side or on none."""
    left_out: int
    """Those that stand on no side of any fold."""
    folds: tuple[FoldSummary, ...]
    notes: tuple[str, ...] = ()
    """Why sessions are not held out, where they are not; none of a table."""


def summary_of(dataset: Dataset, target: str, split: Split) -> SplitSummary:
    """Return what a split of recordings of an array holds out.

    Raises:
        BadSplit: It splits windows that overlap.
    """
    labels = [trial.labels[target] for trial in dataset.trials]
    whole = split.trial_folds
    if whole:
        key = split.key
        values = [key and group_value(trial, key) for trial in dataset.trials]
        return summary_of_trials(target, split.name, whole, labels, key, values)
    own = [labels[trial] for trial in dataset.trial.tolist()]
    sides = [(fold.name, fold.windows(dataset)) for fold in split.folds]
    folds = [_fold(name, (train.tolist(), (), test.tolist()), own, [None] * len(own))
             for name, (train, test) in sides]  # fmt: skip
    return SplitSummary(target=target, split=split.name, group=None, counted="window",
                        total=len(own), left_out=0, folds=tuple(folds))  # fmt: skip


def summary_of_trials(
    target: str,
    name: str,
    folds: Sequence[TrialFold],
    labels: Sequence[str],
    group: str | None,
    values: Sequence[str | None],
) -> SplitSummary:
    """Return what folds of whole trials hold out, be it of arrays or of cameras.

    Args:
        target: The label that is predicted.
        name: The split's.
        folds: Its folds.
        labels: Each trial's class.
        group: The group that the split names, if it names one.
        values: Each trial's value of that group; None where it has none.
    """
    sides = [(fold.train, fold.validation, fold.test) for fold in folds]
    named = frozenset[int]().union(*(side for own in sides for side in own))
    return SplitSummary(
        target=target, split=name, group=group, counted="trial", total=len(labels),
        left_out=len(labels) - len(named),
        folds=tuple(_fold(fold.name, own, labels, values)
                    for fold, own in zip(folds, sides, strict=True)),
    )  # fmt: skip


def write_split(path: Path, dataset: Dataset, split: Split) -> int:
    """Write a split of taxel's own as a table of folds; return its number of rows.

    Groups that are held out whole have a row each, else recordings; of a recording of several
    trials, each trial, with the moment where it starts.

    Raises:
        BadSplit: It splits single windows.
        RecordingFailed: The disk refused.
    """
    folds = split.whole_trials("to write it as a table", "choose another, or leave --output out")
    often = Counter(t.recording for t in (*dataset.trials, *dataset.unlabelled, *dataset.empty))
    trials = [(trial.groups["recording"], trial.start_s if often[trial.recording] > 1 else None)
              for trial in dataset.trials]  # fmt: skip
    groups = [trial.groups for trial in dataset.trials]
    return write_folds_of(path, folds, trials, groups, split.key)


def write_folds_of(
    path: Path,
    folds: Sequence[TrialFold],
    trials: Sequence[tuple[str, float | None]],
    groups: Sequence[Mapping[str, str]],
    key: str | None,
) -> int:
    """Write folds as a table of the group's values where these are held out whole, else of trials.

    Args:
        path: The table.
        folds: Of whole trials.
        trials: Each trial's recording, and where it starts, if that is needed to name it.
        groups: Of each trial.
        key: The group that the split names, if it names one.

    Returns:
        How many rows it has.
    """
    values = [own.get(key or "") for own in groups]
    whole = [value for value in values if value is not None]
    if key is None or len(whole) < len(values) or not all(_apart(fold, values) for fold in folds):
        return write_fold_table(path, folds, "recording", trials)
    column = key if key == "recording" else f"{GROUP}{key}"
    return write_fold_table(path, folds, column, [(value, None) for value in whole])


def _apart(fold: TrialFold, values: Sequence[str | None]) -> bool:
    """Return whether each value stands on one side, or on none."""
    sides = [{values[i] for i in side} for side in (fold.train, fold.validation, fold.test)]
    named = fold.train | fold.validation | fold.test
    sides.append({value for i, value in enumerate(values) if i not in named})
    return sum(map(len, sides)) == len(set().union(*sides))


def _fold(
    name: str,
    sides: tuple[Collection[int], Collection[int], Collection[int]],
    labels: Sequence[str],
    values: Sequence[str | None],
) -> FoldSummary:
    train, validation, test = sides
    seen = {values[i] for i in (*train, *validation)}
    tested = {values[i] or "" for i in test}
    apart = None not in {values[i] for i in test} and not seen & tested
    classes = in_order(labels)
    counts = [Counter(labels[i] for i in side) for side in sides]
    each = [{own: count[own] for own in classes} for count in counts]
    return FoldSummary(
        name=name, held_out=tuple(sorted(tested, key=by_numbers)) if apart else (),
        train=each[0], validation=each[1], test=each[2],
    )  # fmt: skip
