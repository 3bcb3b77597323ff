"""Texts that lie on their side: each line is a channel, and its cells are scans, oldest first.

Read only where the import table says so (`channels rows` in the column `axes`), for large skins
that were touched for a moment look the same. Knows nothing about recordings.

Background of our choices: docs/decisions/0011.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from taxel.errors import BadTable
from taxel.plain_text import number_of
from taxel.recordings.imports.notes import LYING
from taxel.recordings.imports.value_tables.places import as_number
from taxel.recordings.imports.value_tables.row_times import BadTimes, check_time
from taxel.recordings.imports.value_tables.table_columns import (
    LARGEST_TABLE,
    MOST_VALUES,
    mend_number,
    table_lines,
)
from taxel.recordings.imports.value_tables.table_form import (
    REMARK,
    DecimalSign,
    cells_of,
    find_form,
    is_missing,
    is_number,
    is_text,
    is_whole,
)
from taxel.recordings.imports.value_tables.tables import (
    ALL,
    LARGEST_VALUE,
    MOST_CHANNELS,
    TIME_UNITS_S,
    Column,
    Missing,
    Table,
    TimeColumn,
    refuse_stamps,
)

AXES = ("channels", "rows")
"""What the column `axes` says of such a text."""
HINT = f"if each line is a channel, write {' '.join(AXES)} in the column 'axes'"
"""How to mend what is refused in a text that may lie on its side."""


@dataclass(frozen=True, slots=True, kw_only=True)
class _Lines:
    """The lines of a text, as channels."""

    names: tuple[str, ...]
    """What stands first in each line; their numbers from 1 where that is a value."""
    values: list[NDArray[np.float64]]
    """Of each line, each of shape (scans,)."""
    first_line: int
    """Number of the first one."""
    first_cell: int
    """Number of the cell that holds its first value."""
    decimal_comma: bool
    """Whether commas were taken for decimal signs."""
    dropped: str
    """Which line is no channel, and why; or empty."""
    counting: str
    """Which line is a channel though its values count; or empty."""
    ids: str
    """What the first values of all lines are where they count the lines; or empty."""


def lies(file: Path, axes: str) -> bool:
    """Return whether a row of the import table says that a text lies on its side."""
    words = tuple(axes.replace(",", " ").lower().split())
    return words == AXES and is_text(file.name)


def may_lie(path: Path) -> bool:
    """Return whether a text's first line has far more cells than the text has lines."""
    try:
        separator = find_form(path, table_lines(path, LARGEST_TABLE))[0].separator
        lines = (line for line in table_lines(path, LARGEST_TABLE)
                 if line.strip() and not line.lstrip().startswith(REMARK))  # fmt: skip
        most = len(cells_of(path, 1, next(lines, ""), separator)) / LYING
        return all(number < most for number, _ in enumerate(lines, start=2))
    except BadTable:
        return False


def read_lying(
    path: Path, columns: Sequence[Column], time: TimeColumn, missing: Missing, bad_times: BadTimes
) -> Table:
    """Return the wanted lines of a text as channels.

    Args:
        path: The file.
        columns: Wanted channels: the word or number in front of a line, or the line's number from
            1 where there is none.
        time: A rate, or the line that holds times.
        missing: What happens to values that are not finite.
        bad_times: What happens to scans whose times are garbled or repeat.

    Raises:
        BadTable: Anything in the file is not as it should be; says where.
    """
    if time.column is not None:
        refuse_stamps(time.column, str(path))
    lines = _read(path)
    stated = None if time.column is None else _place(path, time.column.name, lines.names)
    if [column.name for column in columns] == [ALL]:
        columns = [Column(name=name, unit=columns[0].unit)
                   for place, name in enumerate(lines.names) if place != stated]  # fmt: skip
    places = [_place(path, column.name, lines.names) for column in columns]
    if not places:
        raise BadTable(f"a channel beside the times in {path}", "none", "correct the table")
    if missing == "refuse":
        _check_finite(path, lines, places)
    scans = len(lines.values[0])
    if time.column is None or stated is None:
        time_s = np.arange(scans) / (time.rate_hz or 1.0)
    else:
        time_s = lines.values[stated] * TIME_UNITS_S[time.column.unit]
    values = np.empty((scans, len(places)))
    for channel, place in enumerate(places):
        values[:, channel] = lines.values[place]
    table = Table(values=values, time_s=time_s,
                  names=tuple(column.name for column in columns),
                  units=tuple(column.unit for column in columns),
                  decimal_comma=lines.decimal_comma, passed_over=lines.dropped,
                  doubts=tuple(_doubts(lines, counted=0 in places)))  # fmt: skip
    if stated is None:
        return table
    line = f"line {lines.first_line + stated}, cell"
    return table.without(check_time(path, time_s, bad_times, lines.first_cell, line=line))


def _doubts(lines: _Lines, *, counted: bool) -> list[str]:
    """Return what may have been meant in another way.

    Args:
        lines: Of the text.
        counted: Whether the first of them is a channel.
    """
    doubts = []
    if counted and lines.counting:
        doubts.append(f"{lines.counting} was taken as a channel; if it only numbers the scans, "
                      "remove it, or name the others in the column 'channels'")  # fmt: skip
    if lines.ids:
        doubts.append(f"the first values of its lines are {lines.ids}; if these are the channels' "
                      "numbers and no scan, write words in their place, as in c1")  # fmt: skip
    return doubts


def _read(path: Path) -> _Lines:
    """Read a text line by line; of each only its first cell stays text."""
    separator = find_form(path, table_lines(path, LARGEST_TABLE))[0].separator
    sign = DecimalSign(path, separator)
    firsts: list[str] = []
    rows: list[NDArray[np.float64]] = []
    first_line = ended = count = 0
    for number, line in enumerate(table_lines(path, LARGEST_TABLE), start=1):
        if not rows and line.lstrip().startswith(REMARK):
            continue
        if not line.strip():
            ended = ended or number
            continue
        if ended:
            raise BadTable("a channel in each line", f"an empty line {ended} in {path}",
                           "remove it")  # fmt: skip
        first_line = first_line or number
        cells = cells_of(path, number, line, separator)
        count += len(cells)
        if count > MOST_VALUES or len(rows) > MOST_CHANNELS + 1:
            raise BadTable(
                f"at most {MOST_CHANNELS:,} lines as channels, and {MOST_VALUES:,} values",
                f"more in {path}", "leave 'axes' empty if each line is a scan; else cut the file",
            )  # fmt: skip
        if rows and len(cells) != len(rows[0]):
            raise BadTable(
                f"{number_of(len(rows[0]), 'cell')} in each line, as in line {first_line}",
                f"{len(cells)} in {path}, line {number}", "mend the file",
            )  # fmt: skip
        firsts.append(cells[0].strip())
        rows.append(np.empty(len(cells)))
        rows[-1][1:] = numbers_in_line(path, sign.with_points(cells[1:], number), number, 2)
    return _as_channels(path, firsts, rows, first_line, sign)


def _as_channels(
    path: Path,
    firsts: list[str],
    rows: list[NDArray[np.float64]],
    first_line: int,
    sign: DecimalSign,
) -> _Lines:
    """Return lines as channels, by what stands first in each of them.

    Args:
        path: For messages.
        firsts: The first cell of each line.
        rows: Numbers of each line's cells, each of shape (cells,); the first one is written here.
        first_line: Number of the first one.
        sign: Of the file.
    """
    counting, dropped = _counting(rows[0]), ""
    if counting and not firsts[0] and _is_index(firsts[1:]):  # as pandas writes it
        dropped = f"line {first_line}, which counts the scans ({counting})"
        firsts, rows, first_line, counting = firsts[1:], rows[1:], first_line + 1, ""
    is_value = [is_missing(first) or is_number(first.replace(",", ".")) for first in firsts]
    named = bool(dropped) or not any(is_value)
    if not named and not all(is_value):
        word, value = is_value.index(False), is_value.index(True)
        raise BadTable(
            "a word in front of each line, which names its channel, or a number in each",
            f"{firsts[word][:80]!r} in front of line {first_line + word} and "
            f"{firsts[value][:80]!r} in front of line {first_line + value} in {path}",
            "name all lines, as with c1 for 1, or mend the one that is wrong",
        )  # fmt: skip
    if len(rows[0]) - named < 1:
        raise BadTable("scans in each line", f"none in {path}, line {first_line}", "mend the file")
    if not named:
        for number, (first, row) in enumerate(zip(firsts, rows, strict=True), start=first_line):
            row[:1] = numbers_in_line(path, sign.with_points([first], number), number, 1)
        counting = _counting(rows[0], start=0) or ("" if firsts[0] else counting)
    names = firsts if named else [str(number) for number in range(1, len(rows) + 1)]
    ids = "" if named or len(rows) < 2 else _counting(np.array([row[0] for row in rows]), start=0)
    return _Lines(
        names=tuple(names), values=[row[int(named) :] for row in rows], first_line=first_line,
        first_cell=1 + named, decimal_comma=sign.comma, dropped=dropped,
        counting=f"line {first_line} ({counting})" if counting else "", ids=ids,
    )  # fmt: skip


def _counting(numbers: NDArray[np.float64], start: int = 1) -> str:
    """Return the first of some numbers where they count from 0 or 1; else nothing.

    Args:
        numbers: Shape (n,).
        start: How many of them do not matter.
    """
    own = numbers[start:]
    if len(own) < 2 or own[0] not in (0, 1):
        return ""
    if not np.array_equal(own, own[0] + np.arange(len(own))):
        return ""
    return ", ".join(f"{number:.0f}" for number in own[:3]) + " …" * (len(own) > 3)


def _is_index(firsts: Sequence[str]) -> bool:
    """Return whether the first cells of lines are what tells these apart: words, or whole numbers
    that increase.
    """
    if all(map(is_whole, firsts)):
        numbers = [int(first) if len(first) < 10 else -1 for first in firsts]
        return bool(numbers) and numbers == sorted(set(numbers))
    return not any(is_missing(first) or is_number(first.replace(",", ".")) for first in firsts)


def numbers_in_line(
    path: Path, cells: list[str], line: int, first_cell: int
) -> NDArray[np.float64]:
    """Return a line's numbers, shape (cells,); a cell without a value is NaN.

    Args:
        path: For messages.
        cells: Some of the line's, with decimal points.
        line: The line's number.
        first_cell: Number of the first of them.

    Raises:
        BadTable: A cell is something else.
    """
    numbers = np.empty(len(cells))
    for place, cell in enumerate(cells):
        if is_missing(cell):
            numbers[place] = np.nan
        elif is_number(cell):
            numbers[place] = float(cell)
        else:
            raise BadTable("a number", f"{cell[:80]!r} in {path}, line {line}, "
                           f"cell {place + first_cell}", mend_number(cell))  # fmt: skip
    return numbers


def _check_finite(path: Path, lines: _Lines, places: Sequence[int]) -> None:
    for place in places:
        if (odd := np.flatnonzero(~(np.abs(lines.values[place]) <= LARGEST_VALUE))).size:
            raise BadTable(
                "a finite number that 32 bits hold",
                f"{lines.values[place][odd[0]]} in {path}, line {lines.first_line + place}, cell "
                f"{lines.first_cell + odd[0]}",
                "mend the file, or keep such cells as invalid with --missing keep",
            )  # fmt: skip


def _place(path: Path, name: str, names: Sequence[str]) -> int:
    """Return the place of a line, from 0, by its name, or its number where no name is one."""
    found = [place for place, own in enumerate(names) if own == name]
    number = 0 if any(map(is_whole, names)) else as_number(name)
    if not found and 1 <= number <= len(names):
        return number - 1
    if len(found) != 1:
        raise BadTable(
            f"one line that begins with {name[:80]!r} in {path}",
            f"{len(found)} of {number_of(len(names), 'line')}, the first is {names[0][:40]!r}",
            "correct it",
        )  # fmt: skip
    return found[0]
