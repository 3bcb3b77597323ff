"""Somebody else's split of a data set: whole trials, so that no window can stand on both sides.

A row that starts within a trial moves the whole of it. Knows nothing about how tables are written.

Background of our choices: docs/decisions/0040.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from taxel.errors import BadSplit, BadTable
from taxel.evaluation.fold_table import FoldRow, FoldTable, RowFold, read_fold_table, refuse_twice
from taxel.evaluation.shared_values import named_by_unseen, objects_on_both
from taxel.evaluation.splits import Split, TrialFold, check_classes
from taxel.labels.trials import Trial, span_at
from taxel.plain_text import figures, number_of
from taxel.recordings.reader import list_recordings
from taxel.windows.dataset import LABEL_THEM, Dataset
from taxel.windows.joining import join_datasets

_SLACK_S = 1e-3
"""A row may start this much before its trial, seconds: tables round. Source: our choice."""
MOST_KNOWN = 12
"""Values of a group that a message lists. Source: our choice, docs/decisions/0040."""
_NO_WINDOW = "gave no window", "choose shorter windows, or other trials"
"""Why a row moves no trial, and what helps."""


@dataclass(frozen=True, slots=True, kw_only=True)
class GivenSplit:
    """A split that the user gives: a table of folds, or another folder to test on.

    At most one of them; neither means one of taxel's own splits.
    """

    table: Path | None = None
    """A table of folds, see `fold_table`."""
    test: Path | None = None
    """A folder of recordings that are tested, and never trained on."""

    def __bool__(self) -> bool:
        return self.table is not None or self.test is not None


OWN_SPLIT = GivenSplit()
"""Nothing is given: one of taxel's own splits is taken."""


def split_elsewhere(
    path: Path, dataset: Dataset, target: str, given: GivenSplit
) -> tuple[Dataset, Split]:
    """Return a data set under a split that came from elsewhere; the test folder's windows joined.

    Args:
        path: Where `dataset` was loaded from.
        dataset: All windows of that folder.
        target: The label that is predicted.
        given: Where the split is from.

    Raises:
        BadTable: The table cannot be read, or names what is not there.
        BadSplit: A trial stands on both sides, there is nothing to test, or a class that is
            tested is never trained.
        BadDataset: The test folder's recordings do not fit.
    """
    if given.table is not None and given.test is not None:
        raise BadSplit("a table of folds or a folder to test on", "both", "give one of them")
    if given.test is not None:
        return _test_folder(dataset, target, given.test)
    assert given.table is not None
    table = read_fold_table(given.table)
    known = {file.name.removesuffix(".mcap") for file in list_recordings(path)}
    split = split_by_table(table, dataset, target, known)
    labels = [trial.labels[target] for trial in dataset.trials]
    both = objects_on_both(dataset.trials, np.unique(labels, return_inverse=True)[1], split)
    notes = (*dataset.notes, *split.notes, *both)
    return replace(dataset, notes=notes), named_by_unseen(split, dataset.trials)


def training_part(path: Path, dataset: Dataset, target: str, given: GivenSplit) -> Dataset:
    """Return what may be learned from for use.

    A table of folds with one training and one test part keeps its test part (and validation)
    back, so that the run can still be scored on it; with several folds nothing is kept back.

    Args:
        path: Where `dataset` was loaded from.
        dataset: All windows of that folder.
        target: The label that is predicted.
        given: Where the split is from.
    """
    if given.table is None:
        return dataset
    _, split = split_elsewhere(path, dataset, target, given)
    match split.folds:
        case (TrialFold(train=train),):
            return dataset.only_trials(train)
    return dataset


def split_by_table(
    table: FoldTable, dataset: Dataset, target: str, recordings: Collection[str]
) -> Split:
    """Return the split that a table names.

    Args:
        table: Rows and folds.
        dataset: Windows to split.
        target: The label; every class that a fold tests must be in its training part.
        recordings: Names of all recordings of the folder, also of those that gave no window.

    Raises:
        BadTable: A row names no recording or group of the folder, or a moment outside its
            recording.
        BadSplit: A trial stands on both sides of a fold or is tested twice, or there is nothing
            to train on or to test.
    """
    left_out = (*dataset.unlabelled, *dataset.empty)
    owners = [trials_of_row(row, table, dataset.trials, recordings, left_out)
              for row in table.rows]  # fmt: skip
    idle = rows_in_no_trial(table, dataset)
    lacking = {i for i, row in enumerate(table.rows) if _moved(row, dataset.unlabelled)}
    folds = []
    for fold in table.folds:
        sides = _sides(table, fold, dict(enumerate(owners)), dataset.trials)
        _refuse_both(table, dataset.trials, fold.name, sides)
        folds.append(TrialFold(fold.name, sides[0], sides[2], sides[1]))
        if any(_all(owners[i] for i in rows) and not side
               for rows, side in ((fold.train, sides[0]), (fold.test, sides[2]))):  # fmt: skip
            raise _all_unused(table, fold)
        _refuse_empty(table, fold, folds[-1], lacking, target)
        check_classes(dataset, target, folds[-1])
    refuse_twice(table.name, [trial.groups["trial"] for trial in dataset.trials],
                 [sum(i in fold.test for fold in folds) for i in range(len(dataset.trials))],
                 )  # fmt: skip
    split = Split(table.split, tuple(folds), None, table.rows[0].key)
    return replace(split, notes=(*_left_out(dataset, split), *idle_note(table, idle)))


def trials_to_score(
    table: FoldTable, trials: Sequence[Trial], recordings: Collection[str]
) -> frozenset[int]:
    """Return the trials of a table's only test part, as indices, to score what is trained already.

    Rows of the other sides may name what is not there: a folder may hold the test part alone.

    Args:
        table: Rows and one fold, as it is read to score.
        trials: Those that are there.
        recordings: Names of all recordings that are there, also of those that gave no window.

    Raises:
        BadTable: A row to test names no recording or group that is there.
        BadSplit: A trial stands on both sides, or there is nothing to test.
    """
    (fold,) = table.folds
    own = _tested_by_row(table, fold, trials, recordings)
    others = {i: _moved(table.rows[i], trials) for i in (*fold.train, *fold.validation)}
    sides = _sides(table, fold, own | others, trials)
    _refuse_both(table, trials, fold.name, sides)
    if not sides[2] and any(own[i] for i in fold.test):
        raise _all_unused(table, fold)
    if not sides[2]:
        raise _nothing_to("test", table, fold.name, _NO_WINDOW)
    return sides[2]


def trials_tested(
    table: FoldTable, trials: Sequence[Trial], recordings: Collection[str]
) -> frozenset[int]:
    """Return the trials that any fold of a table tests, as indices; see `trials_to_score`."""
    return _all(
        _sides(table, replace(fold, train=(), validation=()),
               _tested_by_row(table, fold, trials, recordings), trials)[2]
        for fold in table.folds
    )  # fmt: skip


def _tested_by_row(
    table: FoldTable, fold: RowFold, trials: Sequence[Trial], recordings: Collection[str]
) -> dict[int, frozenset[int]]:
    """Return the trials of each row of a fold that is tested, which must be there, or unused."""
    found = {i: trials_of_row(table.rows[i], table, trials, recordings) for i in fold.test}
    return found | {i: _moved(table.rows[i], trials) for i in fold.unused}


def _test_folder(dataset: Dataset, target: str, folder: Path) -> tuple[Dataset, Split]:
    joined = join_datasets(dataset, folder, target)
    first = len(dataset.trials)
    fold = TrialFold("test", frozenset(range(first)), frozenset(range(first, len(joined.trials))))
    check_classes(joined, target, fold)
    split = Split(f"trained elsewhere, tested on {folder.name or folder}", (fold,), None)
    return joined, named_by_unseen(split, joined.trials)


def trials_of_row(
    row: FoldRow,
    table: FoldTable,
    trials: Sequence[Trial],
    recordings: Collection[str],
    left_out: Sequence[Trial] = (),
) -> frozenset[int]:
    """Return the trials that a row moves, as indices; none where they gave no window or no label.

    Args:
        row: One of the table's.
        table: It.
        trials: Those that it may move.
        recordings: Names of all recordings that are there.
        left_out: Trials that are there and lack the label, or gave no window.

    Raises:
        BadTable: It names no recording or group that is there.
    """
    there = (*trials, *left_out)
    of_group = any(trial.groups.get(row.key) == row.value for trial in there)
    if not of_group and row.key != "recording":
        group_values = sorted({trial.groups[row.key] for trial in there if row.key in trial.groups})
        mend = "correct it, or leave the row out"
        if not group_values and any(row.key in trial.labels for trial in there):
            mend = f"{row.key} is a label there: import again with it as group:{row.key}, too"
        elif row.key == "trial":
            mend = "write it so; for numbers of your own, import them as group:trial_number"
        raise BadTable(
            f"a value of the group {row.key!r} in the recordings "
            f"({_some(group_values) if group_values else 'which have no such group'})",
            f"{row.value!r} in {table.where(row)}", mend,
        )  # fmt: skip
    if not of_group and row.value not in recordings:
        raise BadTable("a recording of the folder", f"{row.value!r} in {table.where(row)}",
                       "correct its name, or leave the row out")  # fmt: skip
    return _moved(row, trials, left_out)


def rows_in_no_trial(table: FoldTable, dataset: Dataset) -> list[FoldRow]:
    """Return the rows that begin within a recording that is there, and in no trial of it.

    Raises:
        BadTable: One begins outside its recording.
    """
    there = (*dataset.trials, *dataset.unlabelled, *dataset.empty)
    found = [row for row in table.rows if row.start_s == row.start_s and row.value in dataset.spans
             and not _moved(row, there)]  # fmt: skip
    for row in found:
        first_s, last_s = dataset.spans[row.value]
        if not first_s - _SLACK_S <= row.start_s <= last_s + _SLACK_S:
            first, last, got = figures(first_s, last_s, row.start_s)
            raise BadTable(f"a moment within {first} and {last} s, as {row.value} lasts",
                           f"{got} s in {table.where(row)}",
                           "give start_s on the recording's own clock, see taxel info",
                           )  # fmt: skip
    return found if dataset.reference is None else []  # its reference touches are no trials here


def idle_note(table: FoldTable, rows: Sequence[FoldRow]) -> list[str]:
    """Return a note of rows that begin in no trial."""
    if not rows:
        return []
    begin = "begins" if len(rows) == 1 else "begin"
    return [f"{len(rows)} of {number_of(len(table.rows), 'row')} of {table.name} {begin} in no "
            f"trial, such as line {rows[0].line}: left out"]  # fmt: skip


def _some(values: Sequence[str]) -> str:
    more = f" and {len(values) - MOST_KNOWN} more" if len(values) > MOST_KNOWN else ""
    return ", ".join(values[:MOST_KNOWN]) + more


def _moved(row: FoldRow, trials: Sequence[Trial], left_out: Sequence[Trial] = ()) -> frozenset[int]:
    """Return the trials that a row moves; none where it names nothing that is there.

    A moment that lies in a trial that was left out moves no neighbour.
    """
    there = (*trials, *left_out)
    own = [i for i, trial in enumerate(there) if trial.groups.get(row.key) == row.value]
    if row.start_s == row.start_s:
        found = []
        for name in {there[i].recording for i in own}:
            here = [i for i in own if there[i].recording == name]
            spans = [(there[i].start_s, there[i].end_s) for i in here]
            place = span_at(row.start_s, spans, _SLACK_S)
            found += [] if place is None else [here[place]]
        own = found
    return frozenset(i for i in own if i < len(trials))


def _all(parts: Iterable[frozenset[int]]) -> frozenset[int]:
    return frozenset().union(*parts)


def _sides(
    table: FoldTable, fold: RowFold, owners: Mapping[int, frozenset[int]], trials: Sequence[Trial]
) -> list[frozenset[int]]:
    """Return the trials to train, to validate and to test on.

    The more exact row holds: a moment beside its whole recording. Unused rows leave out what no
    row as exact puts on a side.

    Args:
        table: It.
        fold: One of its folds.
        owners: Row's number → trials that it moves.
        trials: All that may be moved, for the message.

    Raises:
        BadSplit: A trial is unused by one row, and on a side by another that is as exact.
    """
    left = {exact: _all(owners[i] for i in fold.unused if _is_exact(table.rows[i]) is exact)
            for exact in (False, True)}  # fmt: skip
    sides = []
    for rows in (fold.train, fold.validation, fold.test):
        for i in rows:
            row = table.rows[i]
            if both := sorted(owners[i] & left[_is_exact(row)]):
                raise BadSplit(
                    "each trial on one side",
                    f"{trials[both[0]].groups['trial']} as {row.side} in {table.where(row)}, and "
                    "as unused in another", "leave one of these lines out",
                )  # fmt: skip
        exact = _all(owners[i] for i in rows if _is_exact(table.rows[i]))
        sides.append((_all(owners[i] for i in rows) - left[True]) | exact)
    return sides


def _is_exact(row: FoldRow) -> bool:
    """Return whether a row names a moment, and not the whole of a recording or group."""
    return row.start_s == row.start_s


def _all_unused(table: FoldTable, fold: RowFold) -> BadSplit:
    return BadSplit(
        f"trials on both sides of {fold.name}", f"a side whose trials {table.name} leaves out as "
        "unused", "mend the column side",
    )  # fmt: skip


def _refuse_both(
    table: FoldTable, trials: Sequence[Trial], name: str, sides: list[frozenset[int]]
) -> None:
    train, validation, test = sides
    both = sorted((train & test) | (validation & test) | (train & validation))
    if both:
        trial = trials[both[0]].groups["trial"]
        raise BadSplit(
            "each trial on one side", f"{trial} on two sides of {name} in {table.name}"
            f"{f', and {len(both) - 1} more' if len(both) > 1 else ''}",
            "put all rows of a trial on one side; taxel audit says what such a split leaks",
        )  # fmt: skip


def _refuse_empty(
    table: FoldTable, rows: RowFold, fold: TrialFold, lacking: Collection[int], target: str
) -> None:
    """Refuse a side without a trial; `lacking` are the rows whose trials lack the label."""
    for what, side, own in (("train on", fold.train, rows.train), ("test", fold.test, rows.test)):
        if side:
            continue
        without = [row in lacking for row in own]
        label = f"lack the label {target!r}"
        if all(without):
            why = label, f"{LABEL_THEM}; or choose other trials"
        elif any(without):
            why = f"{label} or gave no window", f"{LABEL_THEM}; or choose shorter windows"
        else:
            why = _NO_WINDOW
        raise _nothing_to(what, table, fold.name, why)


def _nothing_to(what: str, table: FoldTable, fold: str, why: tuple[str, str]) -> BadSplit:
    """Return the refusal of a side without a trial: what its trials are like, what helps."""
    like, mend = why
    return BadSplit(
        f"windows to {what} in {fold}", f"none: the rows of {table.name} name trials that {like}",
        mend,
    )  # fmt: skip


def _left_out(dataset: Dataset, split: Split) -> list[str]:
    """Return a note of trials that the table does not name."""
    named = _all(fold.train | fold.test | fold.validation for fold in split.trial_folds)
    if not (count := len(dataset.trials) - len(named)):
        return []
    every, stand = number_of(len(dataset.trials), "trial"), "stands" if count == 1 else "stand"
    return [f"{count} of {every} {stand} on no side of {split.name}: left out"]
