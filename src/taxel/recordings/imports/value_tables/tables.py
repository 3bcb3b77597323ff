"""Read a table of values strictly: a cell that is not a number is an error, never a zero.

Knows texts (.csv, .tsv, .txt, .dat, packed or not) and .npy (table_columns.py reads them); other
layouts are in layouts.py.
Each error names the file, the line and the column. Knows nothing about recordings.

Background of our choices: docs/decisions/0011.
"""

from __future__ import annotations

import math
import re
from collections.abc import Collection, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from taxel.errors import BadTable
from taxel.grid_names import by_rows
from taxel.recordings.imports.value_tables.places import some_names
from taxel.recordings.imports.value_tables.row_times import (
    LARGEST_RATE_HZ,
    REFUSED,
    BadTimes,
    DroppedRows,
    check_time,
)
from taxel.recordings.imports.value_tables.stated_units import other_units
from taxel.recordings.imports.value_tables.table_columns import (
    npy_columns,
    npy_shape,
    text_columns,
    text_names,
)
from taxel.recordings.imports.value_tables.table_form import column_places, is_text

Missing = Literal["refuse", "keep"]
"""What happens to empty cells, NaN and infinity: an error, or kept and flagged NOT_FINITE."""

Trials = Literal["one", "many", "parted"]
"""Trials in a file: one, many, or many that empty rows part."""
LARGEST_VALUE = float(np.finfo(np.float32).max)
"""Recordings hold values in 32 bits."""
MOST_CHANNELS = 16_384
"""Of a table; the largest skins have some 5,000. Source: our choice."""
BY_NUMBER = "for a column whose own name holds brackets write its number from 1, as in 2[N]"
ALL = "*"
"""In the place of a channel's name: all columns but that of time."""
_GRID = re.compile(r"(.{1,40}):([0-9]{1,4})x([0-9]{1,4})")
"""A grid of channels: its name, rows and columns."""
_IN_LINES = (
    "; lines are joined to a scan where each has as many numbers as a row of the grid, no line "
    "names them and 'time' is a rate"
)
"""When scan_blocks.py reads a text."""
TIME_UNITS_S = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9}
"""Unit of a time column → seconds."""
STAMPS = "iso"
"""In the place of its unit: dates with times, or times of day (time_stamps.py)."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Column:
    """A column of values, and its unit."""

    name: str
    """The header's name, or the column's number from 1 where there is no header."""
    unit: str
    grid: str = ""
    """What the import table calls the grid in which it lies, such as pad:3x4; where that names
    nothing but grids, a file's columns are called so from then on, in order."""


@dataclass(frozen=True, slots=True, kw_only=True)
class TimeColumn:
    """Where time comes from: a column, or a known rate."""

    column: Column | None = None
    rate_hz: float | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class Table:
    """Values that were measured at known times."""

    values: NDArray[np.float64]
    """Shape (n, channels), in each channel's unit, oldest first."""
    time_s: NDArray[np.float64]
    """Shape (n,), seconds, increasing."""
    names: tuple[str, ...]
    units: tuple[str, ...]
    number_header: str = ""
    """The file's first line where it was taken as names though it holds only numbers; or empty."""
    decimal_comma: bool = False
    """Whether commas were taken for decimal signs."""
    one_more: bool = False
    """Whether each row ends in a separator, with an empty cell behind it that was left out."""
    passed_over: str = ""
    """Which lines around the names are no rows, and why, for a note; or empty."""
    other_units: str = ""
    """Which columns have another unit in the file than asked for, for a note; or empty."""
    remarks: tuple[str, ...] = ()
    """How the file was read, for notes."""
    doubts: tuple[str, ...] = ()
    """What may have been meant in another way, for notes."""
    dtype: np.dtype[Any] = field(default_factory=lambda: np.dtype(np.float64))
    """Of the numbers that the file holds; those of texts are of 64 bits."""
    rails: tuple[float, float] | None = None
    """Lowest and highest value that the file's numbers can hold, where a converter clips; None
    where that is not known."""
    dropped: DroppedRows = field(default_factory=DroppedRows)
    """Rows of the file, or of the trial, that were left out because of their times."""

    def without(self, dropped: DroppedRows) -> Table:
        """Return the table without some of its rows."""
        if not (rows := dropped.rows):
            return self
        return replace(
            self, values=np.delete(self.values, rows, axis=0),
            time_s=np.delete(self.time_s, rows), dropped=dropped,
        )  # fmt: skip


def parse_columns(text: str, where: str) -> tuple[Column, ...]:
    """Return the columns of a text such as "Data0[count] Data1[count] 7[deg]".

    NAME:ROWSxCOLUMNS[UNIT] stands for a grid, row by row: "thumb:14x6[count]" for thumb_r1c1 to
    thumb_r14c6.

    Raises:
        BadTable: A word is not NAME[UNIT], or a name comes twice.
    """
    found: list[Column] = []
    more = text
    while "]" in more:
        word, _, more = more.partition("]")
        name, bracket, unit = (part.strip() for part in word.partition("["))
        if not (name and bracket and unit) or "[" in unit:
            raise _no_unit(f"{word.strip()}]", where)
        grid = _GRID.fullmatch(name)
        sides = (int(grid[2]), int(grid[3])) if grid else (1, 1)
        if 0 in sides:
            raise BadTable(
                f"a grid of at least one row and column in {where}", repr(name), "correct it"
            )
        if len(found) + math.prod(sides) <= MOST_CHANNELS:
            names = [name] if grid is None else grid_names(f"{grid[1]}_", *sides)
            of_grid = "" if grid is None else name
            found += [Column(name=own, unit=unit, grid=of_grid) for own in names]
        else:
            raise BadTable(f"at most {MOST_CHANNELS:,} channels in {where}", "more", "split them")
    if more.strip():
        raise _no_unit(more.split()[0], where)
    names = [column.name for column in found]
    if not found or len(set(names)) < len(names):
        raise BadTable(
            f"at least one channel, each once, in {where}",
            repr(text[:80]),
            "correct it" if found else f"write a column channels, as a[N] b[N] or {ALL}[N]",
        )
    return tuple(found)


def grid_names(prefix: str, rows: int, columns: int) -> list[str]:
    """Return what the channels of a grid are called, row by row: prefix, r1c1, …"""
    return [f"{prefix}r{r}c{c}" for r in range(1, rows + 1) for c in range(1, columns + 1)]


def _no_unit(word: str, where: str) -> BadTable:
    return BadTable(
        f"channels as NAME[UNIT] NAME[UNIT] … in {where}", repr(word[:80]),
        BY_NUMBER if word.startswith("[") or word.count("[") > 1 else "name each unit",
    )  # fmt: skip


def parse_time(text: str, where: str) -> TimeColumn:
    """Return where time comes from: "Timestamp[ms]", "1[s]", "stamp[iso]" or "rate:100Hz".

    Raises:
        BadTable: It is neither, or the unit is not s, ms, us, ns or iso.
    """
    rate = re.fullmatch(r"rate:\s*([0-9.]{1,40})\s*Hz", text.strip())
    if rate is not None:
        try:
            rate_hz = float(rate[1])
        except ValueError:
            rate_hz = 0.0
        if 0 < rate_hz <= LARGEST_RATE_HZ:
            return TimeColumn(rate_hz=rate_hz)
    match = re.fullmatch(r"\s*([^\[\]]+)\[([^\[\]]+)\]\s*", text)
    if match is None or match[2].strip() not in (*TIME_UNITS_S, STAMPS):
        raise BadTable(
            f"time as NAME[s], NAME[ms], NAME[us], NAME[ns], NAME[iso] or rate:100Hz in {where}",
            repr(text[:80]),
            BY_NUMBER.replace("[N]", "[ms]") if text.count("[") > 1 else "correct it",
        )
    return TimeColumn(column=Column(name=match[1].strip(), unit=match[2].strip()))


def names_of(columns: Sequence[Column], time: TimeColumn) -> list[str]:
    """Return the names of columns, and that of time where it has a column; none for `*`."""
    timed = [] if time.column is None else [time.column]
    return [column.name for column in (*columns, *timed) if column.name != ALL]


def refuse_stamps(column: Column, where: str) -> None:
    """Refuse time stamps as texts, for arrays hold numbers.

    Raises:
        BadTable: The column's unit says that it holds stamps.
    """
    if column.unit == STAMPS:
        raise BadTable(
            "times as numbers in an array", f"{column.name}[{STAMPS}] in {where}",
            "save seconds in it and write s, or give a rate, as in rate:100Hz",
        )  # fmt: skip


def read_table(
    path: Path,
    columns: Sequence[Column],
    time: TimeColumn,
    missing: Missing = "refuse",
    *,
    bad_times: BadTimes = REFUSED,
    trials: Trials = "one",
    but: Collection[str] = (),
) -> Table:
    """Return the wanted columns of a text or a .npy file.

    Args:
        path: The file. Commas, semicolons, tabs or blanks separate a text's cells.
        columns: Wanted channels, in the order of the result.
        time: Where time comes from.
        missing: What happens to values that are not finite. Time must always be.
        bad_times: What happens to rows whose times are garbled or repeat.
        trials: How many it holds. Where times may begin anew, they are not looked at; where empty
            rows part trials, values are not, either.
        but: Columns that `*` leaves out, beside that of time: other calls take them.

    Raises:
        BadTable: Anything in the file is not as it should be; says where.
    """
    called, columns = columns, _all_columns(path, columns, time, but)
    called = called if _is_grid(called) else columns
    asked = [*columns, *([] if time.column is None else [time.column])]
    wanted = [column.name for column in asked]
    stamps = time.column.name if time.column and time.column.unit == STAMPS else ""
    ending = path.name.lower()
    if ending.endswith(".npy"):
        if time.column is not None:
            refuse_stamps(time.column, str(path))
        text = npy_columns(path, wanted)
    elif is_text(path.name):
        text = text_columns(path, wanted, stamps, but, parted=trials == "parted")
    else:
        raise BadTable(
            "a .csv, .tsv, .txt or .dat file, packed as .gz or not, .xlsx, .wav, .npy, .npz, .mat, "
            ".h5 or .hdf5",
            str(path),
            "save it as one of them, or name a function of yours that reads it, as "
            "module.py:function, in the column 'layout'",
        )  # fmt: skip
    cells, first_line = text.values, text.first_line
    values = cells[:, : len(columns)]
    if trials != "parted":
        if missing == "refuse" and is_text(path.name) and len(wanted) > 1:
            _refuse_empty(path, cells, first_line, timed=time.column is not None)
        check_values(path, values, [column.name for column in columns], missing, first_line)
    table = Table(
        values=values,
        time_s=_time_s(cells, time),
        names=tuple(column.name for column in called),
        units=tuple(column.unit for column in columns),
        number_header=text.number_header,
        decimal_comma=text.decimal_comma,
        one_more=text.one_more,
        passed_over=text.passed_over,
        other_units=other_units(text.stated, [column.unit for column in asked][: len(text.stated)]),
        dtype=text.dtype,
    )
    if trials != "one" or time.column is None:
        return table
    text_lines = is_text(path.name)
    return table.without(check_time(path, table.time_s, bad_times, first_line, text=text_lines))


def _refuse_empty(path: Path, cells: NDArray[np.float64], first_line: int, *, timed: bool) -> None:
    """Refuse rows of a text without any value, shape (n, columns): they may part trials."""
    empty = np.flatnonzero(np.isnan(cells).all(axis=1))
    if not empty.size:
        return
    keep = "" if timed else ", or keep it as invalid with --missing keep"
    raise BadTable(
        "a finite number that 32 bits hold",
        f"nan in {path}, line {empty[0] + first_line}, where no channel has a value",
        f"if such rows part trials, write 'empty rows' in the column 'trials'; or remove it{keep}",
    )


def check_values(
    path: Path | str,
    values: NDArray[np.float64],
    names: Sequence[str],
    missing: Missing,
    first_line: int = 1,
    place: str = "line {row}, column {name!r}",
) -> None:
    """Refuse a table without rows, and values that are not finite unless they are to be kept.

    Args:
        path: The file, for messages.
        values: Shape (n, channels).
        names: Of the channels.
        missing: What happens to values that are not finite.
        first_line: Number of the first row.
        place: Where a value stands, by its row's number and its channel's name.

    Raises:
        BadTable: Says file and place.
    """
    if len(values) == 0:
        raise BadTable("rows of numbers", f"none in {path}", "leave the file out")
    fits = np.abs(values) <= LARGEST_VALUE  # NaN does not, either
    if missing == "keep" or fits.all():
        return
    row, column = np.argwhere(~fits)[0]
    raise BadTable(
        "a finite number that 32 bits hold",
        f"{values[row, column]} in {path}, "
        + place.format(row=row + first_line, name=names[column]),
        "mend the file, or keep such cells as invalid with --missing keep",
    )


def _time_s(cells: NDArray[np.float64], time: TimeColumn) -> NDArray[np.float64]:
    """Return the times of rows, seconds."""
    if time.column is None:
        return np.arange(len(cells)) / (time.rate_hz or 1.0)
    return cells[:, -1] * TIME_UNITS_S.get(time.column.unit, 1.0)


def _all_columns(
    path: Path, columns: Sequence[Column], time: TimeColumn, but: Collection[str]
) -> Sequence[Column]:
    """Return the wanted columns by the file's own names, where * and a grid mean all but that of
    time and those in `but`.
    """
    if not _is_grid(columns) and [column.name for column in columns] != [ALL]:
        return columns
    ending = path.name.lower()
    if ending.endswith(".npy"):
        sides = npy_shape(path)
        count = (*sides, 1)[1] if len(sides) in (1, 2) else 0  # one axis is one channel
        names: Sequence[str] = (
            [str(number) for number in range(1, count + 1)] if count <= MOST_CHANNELS + 1 else ()
        )
    elif is_text(path.name):
        names = text_names(path, names_of([], time), but)
    else:
        return columns
    taken = {*but, time.column.name if time.column is not None else ""} - {""}
    places = column_places(taken, names)
    channels = [name for place, name in enumerate(names) if place not in places]
    if len(channels) > MOST_CHANNELS or not channels:
        raise BadTable(
            f"between 1 and {MOST_CHANNELS:,} channels in {path}", f"{len(channels):,}",
            "name the channels",
        )  # fmt: skip
    if not _is_grid(columns):
        return [Column(name=name, unit=columns[0].unit) for name in channels]
    known = {column.name for column in columns} & set(channels)
    if len(known) == len(columns):
        return columns
    words = list(dict.fromkeys(column.grid for column in columns))
    if len(channels) != len(columns) or set(words) & set(channels):
        raise BadTable(
            f"as many columns in {path} as {', '.join(words)} have places, {len(columns):,}, for a "
            "grid takes all of them in order",
            f"{len(channels):,}, {some_names(channels)}"
            + (f", beside {some_names([names[place] for place in sorted(places)])}" * bool(places)),
            "correct its rows and columns, or remove columns that are no taxels from the file"
            + (_IN_LINES if is_text(path.name) else ""),
        )  # fmt: skip
    if known or not by_rows(channels):
        raise BadTable(
            f"columns in {path} row by row",
            ", ".join([*channels[:3], "…"]),
            "name each column as the file does, in the order that you want",
        )
    return [Column(name=name, unit=own.unit) for name, own in zip(channels, columns, strict=True)]


def _is_grid(columns: Sequence[Column]) -> bool:
    return all(column.grid for column in columns)
