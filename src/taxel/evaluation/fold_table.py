"""Somebody else's split as a table: which recordings, trials or groups stand on which side.

A CSV (comma, semicolon or tab; UTF-8, or UTF-16 with its mark) with a line of names and a line
for each recording, trial, group or window:

    recording   file name of the recording, with or without .mcap; or, instead of it,
    group:KEY   a value of the group KEY, such as an object: all of its trials
    side        train, validation (or val) or test; unused takes no part: beside a line for the
                whole recording, an unused line with start_s leaves out one trial of it
    fold        a fold's name. Without side: the row is tested in this fold and trains all
                others. With side: on which side it stands in this fold
    start_s     where the row starts on the recording's clock, seconds; without it the row is the
                whole recording (all of its trials)
    end_s       where it ends; without it a row that starts where a trial starts is that trial, and
                for taxel audit any other lasts one window
    view        taxel audit: the one camera or finger that it shows; empty for all
    label_s     taxel audit: the moment whose label it carries

Knows nothing about trials, windows or checks.
"""

from __future__ import annotations

import csv
import io
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import zip_longest
from math import nan
from pathlib import Path
from typing import Literal

from taxel.errors import BadFile, BadSplit, BadTable
from taxel.evaluation.splits import TrialFold
from taxel.foreign.text_lines import lines_of
from taxel.recordings.imports.value_tables.table_columns import LARGEST_LIST
from taxel.recordings.whole import write_whole

Side = Literal["train", "validation", "test", "unused"]
SIDES: dict[str, Side] = {
    "train": "train", "training": "train", "validation": "validation", "val": "validation",
    "valid": "validation", "test": "test", "unused": "unused", "": "unused",
}  # fmt: skip
"""What a table may say → the side."""
COLUMNS = ("recording", "fold", "side", "start_s", "end_s", "view", "label_s")
"""Beside group:KEY, which takes the place of recording."""
GROUP = "group:"
_TO_SCORE = "give the column side, with test in each row to score, and one fold at most"


@dataclass(frozen=True, slots=True, kw_only=True)
class FoldRow:
    """One line of the table."""

    line: int
    """Its number in the file, the line of names being 1."""
    key: str
    """The group that `value` belongs to: "recording", or the KEY of group:KEY."""
    value: str
    """A recording's name without its ending, or the group's value."""
    fold: str
    """Empty where the table has no such column."""
    side: Side | None
    """None where the table has no such column."""
    start_s: float
    """On the recording's clock, seconds; NaN for the whole recording."""
    end_s: float
    """Same clock, seconds; NaN where it is not given."""
    view: str
    label_s: float
    """Same clock, seconds; NaN where it is not given."""


@dataclass(frozen=True, slots=True, kw_only=True)
class RowFold:
    """One fold, as indices into the table's rows."""

    name: str
    train: tuple[int, ...]
    validation: tuple[int, ...]
    test: tuple[int, ...]
    unused: tuple[int, ...] = ()
    """Rows that take no part, though another row may name the whole recording."""


@dataclass(frozen=True, slots=True, kw_only=True)
class FoldTable:
    """A split that was written down."""

    name: str
    """The file's name, printed beside every accuracy."""
    rows: tuple[FoldRow, ...]
    folds: tuple[RowFold, ...]
    """At least one; each with something to test and, unless it was read to score a bundle, to
    train on."""

    @property
    def split(self) -> str:
        """Its name as a split's, which names the group that it holds out where it lists groups."""
        key = self.rows[0].key
        return self.name if key == "recording" else f"{self.name}, {key} held out"

    def where(self, row: FoldRow) -> str:
        """Return a row's place, for messages."""
        return f"{self.name}, line {row.line}"


def read_fold_table(path: Path, *, to_score: bool = False) -> FoldTable:
    """Read a table of folds.

    Args:
        path: The table.
        to_score: For a bundle, which is trained already: rows to train on need not be there, and
            there is one fold, for a bundle that fits one was trained on what others test.

    Raises:
        BadTable: It cannot be read, a column or value is none that it may hold, a fold has nothing
            to test or, unless it is read to score, to train on, or there are several folds to
            score; says where.
    """
    header, lines = _lines(path)
    key = _key(path, header)
    rows = tuple(_row(path.name, number, line, key) for number, line in lines)
    if not rows:
        raise BadTable("at least one row", f"none in {path}", "add one for each recording")
    folds = _folds(path, rows, to_score)
    if to_score and len(folds) > 1:
        raise BadTable(
            "a table with one test part for a bundle",
            f"{len(folds)} folds in {path.name}, each of which needs a model of its own",
            f"{_TO_SCORE}; or leave the bundle out: each fold then trains its own model",
        )
    return FoldTable(name=path.name, rows=rows, folds=folds)


def write_fold_table(
    path: Path, folds: Sequence[TrialFold], column: str, rows: Sequence[tuple[str, float | None]]
) -> int:
    """Write folds that test each trial once, or a single fold, as such a table.

    Args:
        path: The table.
        folds: Of whole trials; of several, each trains on all that the others test.
        column: "recording", or group:KEY where the folds keep its values whole.
        rows: Each trial's value of that column, and where the trial starts on the recording's
            clock, seconds; None where the value says enough.

    Returns:
        How many rows it has.

    Raises:
        RecordingFailed: The disk refused.
    """
    sides = [(_short(fold.name), fold.test) for fold in folds]
    if len(folds) == 1:
        sides = [("train", folds[0].train), ("test", folds[0].test)]
    lines = {(*rows[at], side): None for side, own in sides for at in sorted(own)}
    timed = any(start_s is not None for _, start_s, _ in lines)
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow([column, *(["start_s"] if timed else []), "fold" if len(folds) > 1 else "side"])
    for value, start_s, side in lines:
        start = "" if start_s is None else repr(float(start_s))
        writer.writerow([value, *([start] if timed else []), side])
    write_whole(path, text.getvalue())
    return len(lines)


def _short(fold: str) -> str:
    """Return a fold's name without the word that reading the table puts before it."""
    return fold.removeprefix("fold ").removeprefix("without ")


def refuse_twice(table: str, names: Sequence[str], tested: Sequence[int]) -> None:
    """Refuse a table that tests a trial in several folds: one of its answers would be lost.

    Args:
        table: Its name.
        names: Of the trials.
        tested: In how many folds each is tested.

    Raises:
        BadSplit: So it is.
    """
    most = max(tested, default=0)
    if most > 1:
        raise BadSplit(
            "each trial tested in one fold", f"{names[tested.index(most)]} in {most} of {table}",
            "give each repetition a table of its own",
        )  # fmt: skip


def _lines(path: Path) -> tuple[list[str], list[tuple[int, dict[str, str]]]]:
    try:
        text = "".join(lines_of(path, LARGEST_LIST)).removeprefix("\ufeff")
        top = text.lstrip("\r\n").partition("\n")[0]
        separator = max(",;\t", key=top.count)
        lines: list[tuple[int, list[str]]] = []
        reader, number = csv.reader(io.StringIO(text, newline=""), delimiter=separator), 1
        for cells in reader:
            if any(cell.strip() for cell in cells):
                lines.append((number, [cell.strip() for cell in cells]))
            number = reader.line_num + 1  # a cell between quotes may hold several lines
    except (OSError, BadFile, csv.Error) as error:
        raise BadTable("a table of folds (CSV) that can be read", f"{path}, which is not one",
                       "check the path") from error  # fmt: skip
    header = lines[0][1] if lines else []
    while header and not header[-1]:  # as spreadsheets fill up lines
        header.pop()
    for number, cells in lines[1:]:
        if surplus := [at for at, cell in enumerate(cells, 1) if at > len(header) and cell]:
            raise BadTable(
                f"at most {len(header)} cells, as line {lines[0][0]} has names",
                f"{cells[surplus[0] - 1]!r} in column {surplus[0]} of {path.name}, line {number}",
                "mend the line; a value that holds a comma stands between quotes",
            )  # fmt: skip
    return header, [(number, dict(zip_longest(header, cells[: len(header)], fillvalue="")))
                    for number, cells in lines[1:]]  # fmt: skip


def _key(path: Path, header: list[str]) -> str:
    """Return the column that says what a row is."""
    for again in (name for at, name in enumerate(header) if name in header[:at]):
        columns = [str(at) for at, name in enumerate(header, 1) if name == again]
        raise BadTable("each column once", f"{again!r} in the columns {' and '.join(columns)} of "
                       f"{path}, line 1", "remove all but one of them")  # fmt: skip
    names = [name for name in header if name == "recording" or name.startswith(GROUP)]
    others = [name for name in header if name not in COLUMNS and name not in names]
    sided = "fold" in header or "side" in header
    if len(names) != 1 or others or not sided or names == [GROUP]:
        raise BadTable(
            "the columns recording (or group:KEY), fold or side or both, and if need be start_s, "
            "end_s, view, label_s",
            f"{', '.join(header) or 'none'} in {path}",
            "mend line 1, whose names stand between commas, semicolons or tabs"
            + (f": {GROUP}{others[0]} if {others[0]} is a group" if others and not names else ""),
        )  # fmt: skip
    return names[0]


def _row(name: str, number: int, line: dict[str, str], key: str) -> FoldRow:
    where = f"{name}, line {number}"
    if not line[key]:
        raise BadTable(f"a value of {key} in every row", f"none in {where}", "fill it in")
    side = None
    if "side" in line:
        side = SIDES.get(line["side"].casefold())
        if side is None:
            raise BadTable("a side: train, validation, test or unused",
                           f"{line['side']!r} in {where}", "correct it")  # fmt: skip
    elif not line["fold"]:
        raise BadTable("a fold in every row", f"none in {where}",
                       "fill it in, or leave the row out")  # fmt: skip
    whole = key == "recording"
    start, end, label = (_seconds(line, column, where) for column in ("start_s", "end_s",
                                                                      "label_s"))  # fmt: skip
    if start == start and not whole:
        raise BadTable("start_s beside recordings", f"it beside {key} in {where}",
                       "name the recording, or leave start_s out")  # fmt: skip
    return FoldRow(
        line=number, key="recording" if whole else key.removeprefix(GROUP),
        value=line[key].removesuffix(".mcap") if whole else line[key],
        fold=line.get("fold", ""), side=side, start_s=start, end_s=end,
        view=line.get("view", ""), label_s=label,
    )  # fmt: skip


def _seconds(line: dict[str, str], key: str, where: str) -> float:
    text = line.get(key, "")
    try:
        return float(text) if text else nan
    except ValueError as error:
        raise BadTable(f"seconds in {key}, such as 12.5", f"{text!r} in {where}",
                       "correct it") from error  # fmt: skip


def _folds(path: Path, rows: tuple[FoldRow, ...], to_score: bool) -> tuple[RowFold, ...]:
    names = list(dict.fromkeys(row.fold for row in rows))
    if rows[0].side is not None:
        return tuple(_sided(path, rows, name, to_score) for name in names)
    if len(names) < 2 and to_score:
        raise BadTable("a column side in a table for a bundle", f"the fold {names[0]} only in "
                       f"{path}", _TO_SCORE)  # fmt: skip
    if len(names) < 2:
        raise BadTable("at least two folds, or a column side", f"{', '.join(names)} in {path}",
                       "mend the column fold")  # fmt: skip
    return tuple(
        RowFold(
            name=f"fold {name}", validation=(),
            train=tuple(i for i, row in enumerate(rows) if row.fold != name),
            test=tuple(i for i, row in enumerate(rows) if row.fold == name),
        )
        for name in names
    )  # fmt: skip


def _sided(path: Path, rows: tuple[FoldRow, ...], name: str, to_score: bool) -> RowFold:
    own: dict[str, list[int]] = {side: [] for side in SIDES.values()}
    for index, row in enumerate(rows):
        if row.fold == name and row.side is not None:
            own[row.side].append(index)
    _refuse_contradiction(path, [row for row in rows if row.fold == name])
    of = f" of fold {name!r}" if name else ""
    needed = ("test",) if to_score else ("train", "test")
    for side in needed:
        if not own[side]:
            kinds = ", ".join(kind for kind, found in own.items() if found) or "none"
            raise BadTable(
                f"rows with the side{'s' * (len(needed) - 1)} {' and '.join(needed)}{of}",
                f"{kinds} in {path}: nothing to {side}{' on' if side == 'train' else ''}",
                "mend the column side",
            )  # fmt: skip
    return RowFold(
        name=f"fold {name}" if name else "test", train=tuple(own["train"]),
        validation=tuple(own["validation"]), test=tuple(own["test"]), unused=tuple(own["unused"]),
    )  # fmt: skip


def _refuse_contradiction(path: Path, rows: Sequence[FoldRow]) -> None:
    """Refuse a fold's rows that name the very same as unused and on a side."""
    first: dict[tuple[object, ...], FoldRow] = {}
    for row in rows:
        times = (None if value != value else value for value in (row.start_s, row.end_s))
        before = first.setdefault((row.value, row.view, *times), row)
        if before.side != row.side and "unused" in (before.side, row.side):
            raise BadTable(
                "each line to name what no other line names", f"{row.value!r} as {row.side} in "
                f"{path.name}, line {row.line}, and as {before.side} in line {before.line}",
                "leave one of them out",
            )  # fmt: skip
