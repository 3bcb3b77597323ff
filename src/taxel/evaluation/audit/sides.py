"""Which piece stands on which side of which fold: from a split's name, or from a table.

The table is what another lab would hand over: a CSV with the columns

    recording   file name of the recording, with or without .mcap
    fold        the fold whose test part the row is in; it trains all the others
    side        instead of fold: train or test; other rows (such as "val") take no part
    start_s     where the row starts on the recording's clock, seconds; without it the row is
                the whole recording (all of its trials)
    end_s       where it ends; without it a row that starts where a trial starts is that trial,
                and any other lasts one window
    view        the one camera or finger that it shows; empty for all
    label_s     the moment whose label it carries; without it the check of the future is left out

Knows nothing about checks.
"""

from __future__ import annotations

import csv
import io
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from taxel.errors import BadFile, BadTable
from taxel.evaluation.audit.telling import Fold
from taxel.evaluation.audit.touch_set import Pieces, TouchSet, as_dataset, cut_pieces
from taxel.evaluation.splits import TrialFold, parse_split
from taxel.foreign.text_lines import lines_of
from taxel.recordings.table_columns import LARGEST_LIST

COLUMNS = ("recording", "fold", "side", "start_s", "end_s", "view", "label_s")
_SLACK_S = 1e-3


@dataclass(frozen=True, slots=True, kw_only=True)
class Sides:
    """Folds of pieces."""

    name: str
    folds: tuple[Fold, ...]
    """Indices of training and test pieces."""
    claimed: tuple[str, ...]
    """Groups that are said to be unseen in the test part."""

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
    if text.startswith("group:"):
        claimed = tuple(dict.fromkeys((*claimed, text.removeprefix("group:"))))
    return pieces, Sides(name=split.name, folds=found, claimed=claimed)


def table_sides(
    touch: TouchSet, table: Path, steps: int, claimed: tuple[str, ...] = ()
) -> tuple[Pieces, Sides]:
    """Return the pieces and folds that a table names.

    Raises:
        BadTable: It cannot be read, or a row fits no trial.
    """
    lines = _lines(table)
    parts: list[tuple[int, int, int, str, float]] = []
    names: list[str] = []
    for number, line in lines:
        for part in _pieces_of(touch, line, steps, f"{table.name}, line {number}"):
            parts.append(part)
            names.append((line.get("fold") or line.get("side") or "").strip())
    trial, first, stop, view, label = zip(*parts, strict=True)
    pieces = Pieces(
        trial=np.array(trial, np.intp), first=np.array(first, np.intp),
        stop=np.array(stop, np.intp), view=np.array(view, np.str_),
        label_s=np.array(label, np.float64),
    )  # fmt: skip
    return pieces, Sides(
        name=table.name, folds=_folds(table, np.array(names), "fold" in lines[0][1]),
        claimed=claimed,
    )  # fmt: skip


def _folds(table: Path, names: NDArray[np.str_], by_fold: bool) -> tuple[Fold, ...]:
    if not by_fold:
        train, test = np.flatnonzero(names == "train"), np.flatnonzero(names == "test")
        if not len(train) or not len(test):
            raise BadTable("rows with the sides train and test",
                           f"{', '.join(sorted(set(names)))} in {table}", "mend the column side",
                           )  # fmt: skip
        return ((train, test),)
    kinds = sorted(set(names))
    if len(kinds) < 2:
        raise BadTable("at least two folds", f"{', '.join(kinds)} in {table}",
                       "mend the column fold")  # fmt: skip
    return tuple((np.flatnonzero(names != k), np.flatnonzero(names == k)) for k in kinds)


def _lines(table: Path) -> list[tuple[int, dict[str, str]]]:
    try:
        text = "".join(lines_of(table, LARGEST_LIST))
        reader = csv.DictReader(io.StringIO(text, newline=""))
        lines = [(number, line) for number, line in enumerate(reader, 2) if any(line.values())]
        header = list(reader.fieldnames or [])
    except (OSError, BadFile, csv.Error) as error:
        raise BadTable("a table of folds (CSV) that can be read", f"{table}, which is none",
                       "check the path") from error  # fmt: skip
    unknown = [name for name in header if name not in COLUMNS]
    if unknown or "recording" not in header or ("fold" in header) == ("side" in header):
        raise BadTable(
            "the columns recording, fold or side, and if need be start_s, end_s, view, label_s",
            f"{', '.join(map(str, header)) or 'none'} in {table}", "mend line 1",
        )  # fmt: skip
    if not lines:
        raise BadTable("at least one row", f"none in {table}", "add one a recording or window")
    return lines


def _pieces_of(
    touch: TouchSet, line: dict[str, str], steps: int, where: str
) -> list[tuple[int, int, int, str, float]]:
    name = (line["recording"] or "").strip().removesuffix(".mcap")
    own = [i for i, trial in enumerate(touch.trials) if trial.groups["recording"] == name]
    if not own:
        raise BadTable("a recording of the folder", f"{name!r} in {where}",
                       "correct its name; trials without the label are left out")  # fmt: skip
    view = (line.get("view") or "").strip()
    if view and view not in touch.views:
        known = ", ".join(dict.fromkeys(touch.views))
        # An array's fingers have no names of their own: any word does.
        if touch.kind == "camera":
            raise BadTable(f"one of the cameras {known}", f"{view!r} in {where}", "correct it")
    start, end, label = (_number(line, key, where) for key in ("start_s", "end_s", "label_s"))
    if np.isnan(start):
        return [(i, 0, len(touch.rows[i]), view, label) for i in own]
    for i in own:
        time_s, trial = touch.time_s[i], touch.trials[i]
        if not min(trial.start_s, time_s[0]) - _SLACK_S <= start <= time_s[-1] + _SLACK_S:
            continue
        first = int(np.searchsorted(time_s, start - _SLACK_S))
        if not np.isnan(end):
            stop = int(np.searchsorted(time_s, end + _SLACK_S, side="right"))
        elif start <= max(trial.start_s, time_s[0]) + _SLACK_S:
            stop = len(time_s)
        else:
            stop = min(first + steps, len(time_s))
        if stop > first:
            return [(i, first, stop, view, label)]
    raise BadTable("a stretch within a labelled trial", f"{where}, which lies in none",
                   "give start_s on the recording's own clock, see taxel info")  # fmt: skip


def _number(line: dict[str, str], key: str, where: str) -> float:
    text = (line.get(key) or "").strip()
    try:
        return float(text) if text else float("nan")
    except ValueError as error:
        raise BadTable(f"seconds in {key}", f"{text!r} in {where}", "correct it") from error
