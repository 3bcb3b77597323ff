"""Which piece stands on which side of which fold: from a split's name, from a table of folds
(`evaluation/fold_table.py` says what stands in it), or because they lie in different folders.

What a table calls validation counts as training here: it is seen before the test. Knows nothing
about checks.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from taxel.errors import BadSplit, BadTable
from taxel.evaluation.audit.evidence import Fold
from taxel.evaluation.audit.touch_set import Pieces, TouchSet, as_dataset, cut_pieces
from taxel.evaluation.fold_table import FoldRow, FoldTable, RowFold, read_fold_table
from taxel.evaluation.shared_values import can_be_held_out
from taxel.evaluation.splits import Fold as SplitFold
from taxel.evaluation.splits import Split, TrialFold, by_group, parse_split
from taxel.labels.trials import OBJECTS, span_at
from taxel.recordings.imports.video_rows import SPLIT, TEST
from taxel.windows.dataset import Dataset

_SLACK_S = 1e-3
_MOST_TRIED = 16
"""Numbers of folds that are tried where folds test one class each. Source: our choice,
docs/decisions/0023."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Sides:
    """Folds of pieces."""

    name: str
    folds: tuple[Fold, ...]
    """Indices of training and test pieces."""
    claimed: tuple[str, ...]
    """Groups that are said to be unseen in the test part."""
    key: str | None = None
    """The group that one of taxel's own splits holds out; None for all others."""
    fold_count: int | None = None
    """Where folds of that split test one class each: the most folds found that all test several,
    0 if none were; None where nothing was searched."""

    def whole_trials(self, pieces: Pieces) -> bool:
        """Return whether no trial stands on both sides of a fold."""
        return all(
            not set(pieces.trial[train]) & set(pieces.trial[test]) for train, test in self.folds
        )

    def trial_folds(self, pieces: Pieces) -> list[Fold]:
        """Return the folds as folds of whole trials; only where `whole_trials`."""
        return [(np.unique(pieces.trial[train]), np.unique(pieces.trial[test]))
                for train, test in self.folds]  # fmt: skip


def named_sides(
    touch: TouchSet, text: str, steps: int, folds: int, seed: int, claimed: tuple[str, ...] = ()
) -> tuple[Pieces, Sides]:
    """Return the pieces and folds of one of taxel's own splits, such as "group:session".

    Raises:
        BadSplit: The text names none, or the trials cannot be split so.
    """
    pieces = cut_pieces(touch, steps, steps)
    dataset = as_dataset(touch, pieces, steps, steps)
    split = parse_split(text, dataset, touch.target, folds, seed)
    found = tuple(
        fold.windows(dataset) if isinstance(fold, TrialFold) else (fold.train, fold.test)
        for fold in split.folds
    )
    if not text.startswith("group:"):
        return pieces, Sides(name=split.name, folds=found, claimed=claimed)
    key = text.removeprefix("group:")
    claimed = tuple(dict.fromkeys((*claimed, key)))
    fewer = _of_several_classes(touch, dataset, key, split, seed)
    return pieces, Sides(name=split.name, folds=found, claimed=claimed, key=key, fold_count=fewer)


def _of_several_classes(
    touch: TouchSet, dataset: Dataset, key: str, split: Split, seed: int
) -> int | None:
    """Return the most folds of whole groups found that each test several classes.

    0 where none were found; None where nothing is to be searched, since the folds of the split do
    so already, or are two.
    """

    def several(folds: Sequence[SplitFold]) -> bool:
        return all(len(set(touch.y[sorted(fold.test)].tolist())) > 1 for fold in folds
                   if isinstance(fold, TrialFold))  # fmt: skip

    most = len(split.folds) - 1
    if several(split.folds) or most < 2:
        return None
    for count in _fold_counts(touch, dataset.group(key), most):
        with suppress(BadSplit):
            if several(by_group(dataset, touch.target, key, count, seed).folds):
                return count
    return 0


def _fold_counts(touch: TouchSet, groups: NDArray[np.str_], most: int) -> list[int]:
    """Return the numbers of folds to try, the largest first.

    A test part of several classes needs a group of several, or two groups of different classes.
    Of many numbers evenly spaced ones are tried, since each takes as long as a split.

    Args:
        touch: The trials.
        groups: Each one's group, shape (trials,).
        most: Folds that are wanted at most.
    """
    held = [set(touch.y[groups == name].tolist()) for name in np.unique(groups)]
    single = Counter(min(own) for own in held if len(own) == 1)
    alone = sum(single.values())
    pairs = min(alone // 2, alone - max(single.values(), default=0))
    first = min(most, len(held) - alone + pairs)
    if first < 2:
        return []
    spaced = np.linspace(first, 2, min(first - 1, _MOST_TRIED))
    return list(dict.fromkeys(spaced.round().astype(int).tolist()))


def given_sides(touch: TouchSet, steps: int, claimed: tuple[str, ...] = ()) -> tuple[Pieces, Sides]:
    """Return the windows as the trials' own column `split` parts them.

    It claims its objects too, where they can be held out: where each class has several.

    Raises:
        BadSplit: There is no such column, or it names no test trials, or nothing else.
    """
    tested = np.array([trial.groups.get(SPLIT) == TEST for trial in touch.trials])
    if not tested.any() or tested.all():
        raise BadSplit(f"trials with {TEST} and others with train in the column {SPLIT}",
                       f"{int(tested.sum())} of {len(tested)} with {TEST}",
                       "fill the column, or choose group:KEY")  # fmt: skip
    pieces = cut_pieces(touch, steps, steps)
    own = tested[pieces.trial]
    objects = [key for key in touch.keys(OBJECTS)
               if can_be_held_out([t.groups[key] for t in touch.trials], touch.y)]  # fmt: skip
    fold = (np.flatnonzero(~own), np.flatnonzero(own))
    return pieces, Sides(name="test trials given", folds=(fold,),
                         claimed=tuple(dict.fromkeys((*claimed, *objects))))  # fmt: skip


def are_given(touch: TouchSet) -> bool:
    """Return whether camera trials name their test trials, as `taxel evaluate-trials` takes them
    unless told otherwise.
    """
    return touch.kind == "camera" and any(t.groups.get(SPLIT) == TEST for t in touch.trials)


def table_sides(
    touch: TouchSet, path: Path, steps: int, claimed: tuple[str, ...] = ()
) -> tuple[Pieces, Sides]:
    """Return the pieces and folds that a table names.

    Rows of trials that are left out, as too short or without the label, are passed over.

    Raises:
        BadTable: It cannot be read, or a row fits no trial.
        BadSplit: All that a fold trains on or tests is left out.
    """
    table = read_fold_table(path)
    parts: list[_Piece] = []
    owner: list[int] = []
    for number, row in enumerate(table.rows):
        for part in _pieces_of(touch, row, steps, table):
            parts.append(part)
            owner.append(number)
    for fold in table.folds:
        _refuse_empty(table.name, fold, set(owner))
    trial, first, stop, view, label = zip(*parts, strict=True)
    pieces = Pieces(
        trial=np.array(trial, np.intp), first=np.array(first, np.intp),
        stop=np.array(stop, np.intp), view=np.array(view, np.str_),
        label_s=np.array(label, np.float64),
    )  # fmt: skip
    rows = np.array(owner, np.intp)
    folds = []
    for fold in table.folds:
        used = ~_left_out(table, fold, pieces, rows)
        sides = (fold.train + fold.validation, fold.test)
        train, test = (np.flatnonzero(used & np.isin(rows, side)) for side in sides)
        _refuse_empty(table.name, fold, set(rows[used].tolist()))
        folds.append((train, test))
    if (key := table.rows[0].key) != "recording":
        claimed = tuple(dict.fromkeys((*claimed, key)))
    return pieces, Sides(name=table.split, folds=tuple(folds), claimed=claimed)


def _left_out(
    table: FoldTable, fold: RowFold, pieces: Pieces, rows: NDArray[np.intp]
) -> NDArray[np.bool_]:
    """Return which pieces are trials of a whole recording that an unused row names by a moment."""
    whole = np.array([np.isnan(table.rows[row].start_s) for row in rows])
    left = np.zeros(len(rows), bool)
    for at in np.flatnonzero(~whole & np.isin(rows, fold.unused)):
        seen = (pieces.view == pieces.view[at]) | (pieces.view == "") | (pieces.view[at] == "")
        left |= whole & seen & (pieces.trial == pieces.trial[at])
    return left


def folder_sides(
    touch: TouchSet, first: int, name: str, steps: int, claimed: tuple[str, ...] = ()
) -> tuple[Pieces, Sides]:
    """Return the windows of all trials, the first so many to train on, the others tested."""
    pieces = cut_pieces(touch, steps, steps)
    own = pieces.trial < first
    fold = (np.flatnonzero(own), np.flatnonzero(~own))
    return pieces, Sides(name=name, folds=(fold,), claimed=claimed)


def _refuse_empty(table: str, fold: RowFold, found: set[int]) -> None:
    """Refuse a fold of which a side is left out whole; `found` are the rows that fit a trial."""
    for what, rows in (("train on", fold.train + fold.validation), ("test", fold.test)):
        if not found.intersection(rows):
            raise BadSplit(
                f"trials to {what} in {fold.name}",
                f"none: those that the rows of {table} name are left out, as too short or without "
                "the label", "choose other trials, or label them",
            )  # fmt: skip


_Piece = tuple[int, int, int, str, float]
"""Trial, first row, row behind the last, view, and label's moment."""


def _pieces_of(touch: TouchSet, row: FoldRow, steps: int, table: FoldTable) -> list[_Piece]:
    """Return what a row of the table names: whole trials, or a stretch of one.

    Empty where it lies in a trial that is left out.
    """
    trials = [i for i, trial in enumerate(touch.trials) if trial.groups.get(row.key) == row.value]
    left_out = [trial for trial in touch.left_out if trial.groups.get(row.key) == row.value]
    _refuse_unknown(touch, row, bool(trials or left_out), table.where(row))
    if np.isnan(row.start_s):
        return [(i, 0, len(touch.rows[i]), row.view, row.label_s) for i in trials]
    spans = [
        (min(touch.trials[i].start_s, touch.time_s[i][0]), touch.time_s[i][-1]) for i in trials
    ]
    spans += [(trial.start_s, trial.end_s) for trial in left_out]
    place = span_at(row.start_s, spans, _SLACK_S)
    if place is not None and place < len(trials):
        first, stop = _stretch(touch, trials[place], row, steps)
        if stop > first:
            return [(trials[place], first, stop, row.view, row.label_s)]
    if any(trial.start_s - _SLACK_S <= row.start_s <= trial.end_s + _SLACK_S for trial in left_out):
        return []
    raise BadTable(
        "a stretch within a labelled trial", f"{table.where(row)}, which lies in none",
        "give start_s on the recording's own clock, see taxel info",
    )  # fmt: skip


def _refuse_unknown(touch: TouchSet, row: FoldRow, named: bool, where: str) -> None:
    """Refuse a row that names no trial of the folder, or a camera that it does not have."""
    if not named:
        what = "a recording" if row.key == "recording" else f"a value of the group {row.key!r}"
        raise BadTable(f"{what} of the folder", f"{row.value!r} in {where}",
                       "correct its name, or leave the row out")  # fmt: skip
    # An array's fingers have no names of their own: any word does.
    if touch.kind == "camera" and row.view and row.view not in touch.views:
        known = ", ".join(dict.fromkeys(touch.views))
        raise BadTable(f"one of the cameras {known}", f"{row.view!r} in {where}", "correct it")


def _stretch(touch: TouchSet, index: int, row: FoldRow, steps: int) -> tuple[int, int]:
    """Return a trial's first row and the one behind the last from the row's moments on.

    Without an end: the whole trial where it begins with it, else one window.
    """
    time_s, trial = touch.time_s[index], touch.trials[index]
    slack_s = min(_SLACK_S, 0.5 * float(np.median(np.diff(time_s)))) if len(time_s) > 1 else 0.0
    first = int(np.searchsorted(time_s, row.start_s - slack_s))
    if not np.isnan(row.end_s):
        return first, int(np.searchsorted(time_s, row.end_s + slack_s, side="right"))
    if row.start_s <= max(trial.start_s, time_s[0]) + slack_s:
        return first, len(time_s)
    return first, min(first + steps, len(time_s))
