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
from taxel.recordings.imports.row_times import BadTimes, check_time
from taxel.recordings.imports.table_columns import (
    LARGEST_TABLE,
    MOST_VALUES,
    as_number,
    mend_number,
    table_lines,
)
from taxel.recordings.imports.table_form import (
    REMARK,
    DecimalSign,
    cells_of,
    count_columns,
    find_form,
    is_missing,
    is_number,
    is_text,
    is_whole,
)
from taxel.recordings.imports.tables import (
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


@dataclass(frozen=True, slots=True)
class _Lines:
    """The lines of a text, as channels."""

    names: tuple[str, ...]
    """What stands first in each line; their numbers from 1 where that is a value."""
    values: NDArray[np.float64]
    """Shape (lines, scans)."""
    first_line: int
    """Number of the first one."""
    first_cell: int
    """Number of the cell that holds its first value."""


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
    scans = lines.values.shape[1]
    if time.column is None or stated is None:
        time_s = np.arange(scans) / (time.rate_hz or 1.0)
    else:
        time_s = lines.values[stated] * TIME_UNITS_S[time.column.unit]
    table = Table(values=np.ascontiguousarray(lines.values[places].T), time_s=time_s,
                  names=tuple(column.name for column in columns),
                  units=tuple(column.unit for column in columns))  # fmt: skip
    return table if stated is None else table.without(check_time(path, time_s, bad_times))


def _read(path: Path) -> _Lines:
    separator = find_form(path, table_lines(path, LARGEST_TABLE))[0].separator
    rows: list[list[str]] = []
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
        rows.append(cells_of(path, number, line, separator))
        count += len(rows[-1])
        if count > MOST_VALUES or len(rows) > MOST_CHANNELS + 2:
            raise BadTable(
                f"at most {MOST_CHANNELS:,} lines as channels, and {MOST_VALUES:,} values",
                f"more in {path}", "leave 'axes' empty if each line is a scan; else cut the file",
            )  # fmt: skip
    index = False
    if (
        len(rows) > 1
        and count_columns(_stripped(rows[0]))
        and not count_columns(_stripped(rows[1]))
    ):  # as pandas writes it
        index, rows, first_line = not rows[0][0].strip(), rows[1:], first_line + 1
    return _as_numbers(path, rows, first_line, separator, index=index)


def _as_numbers(
    path: Path, rows: list[list[str]], first_line: int, separator: str, *, index: bool
) -> _Lines:
    """Return lines of cells as numbers.

    Args:
        path: For messages.
        rows: Each line's cells.
        first_line: Number of the first one.
        separator: Of the cells.
        index: Whether what stands first in each line is a name, also if it is a number.
    """
    named = index or not any(is_number(row[0].replace(",", ".")) or is_missing(row[0])
                             for row in rows)  # fmt: skip
    width = len(rows[0])
    if width - named < 1:
        raise BadTable("scans in each line", f"none in {path}, line {first_line}", "mend the file")
    sign = DecimalSign(path, separator)
    values = np.empty((len(rows), width - named))
    for place, row in enumerate(rows):
        number = first_line + place
        if len(row) != width:
            raise BadTable(f"{number_of(width, 'cell')} in each line, as in line {first_line}",
                           f"{len(row)} in {path}, line {number}", "mend the file")  # fmt: skip
        values[place] = _numbers(path, sign.with_points(row[named:], number), number, 1 + named)
    names = [row[0].strip() if named else str(place) for place, row in enumerate(rows, start=1)]
    return _Lines(tuple(names), values, first_line, 1 + named)


def _numbers(path: Path, cells: list[str], line: int, first_cell: int) -> NDArray[np.float64]:
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
                f"{lines.values[place, odd[0]]} in {path}, line {lines.first_line + place}, cell "
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


def _stripped(cells: Sequence[str]) -> list[str]:
    return [cell.strip() for cell in cells]
