"""Texts in which a scan is several lines: a line for each row of a grid of taxels.

A text is read so where the import table names nothing but grids, its lines have as many numbers as
these have columns, and no line names them. Blank lines may part scans. Knows nothing about
recordings.

Background of our choices: docs/decisions/0011.
"""

from __future__ import annotations

from array import array
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from taxel.errors import BadTable
from taxel.grid_names import grid_place
from taxel.plain_text import number_of
from taxel.recordings.imports.lying_texts import numbers_in_line
from taxel.recordings.imports.value_tables.table_columns import (
    LARGEST_TABLE,
    MOST_VALUES,
    table_lines,
)
from taxel.recordings.imports.value_tables.table_form import (
    DecimalSign,
    cells_of,
    find_form,
    is_text,
)
from taxel.recordings.imports.value_tables.tables import (
    LARGEST_VALUE,
    Column,
    Missing,
    Table,
    TimeColumn,
)


def lines_in_scan(path: Path, columns: Sequence[Column], time: TimeColumn) -> int:
    """Return how many lines of a text are one scan; 0 where each line is one.

    Args:
        path: The file.
        columns: Wanted channels.
        time: Where time comes from; a scan of several lines has a rate only.

    Raises:
        BadTable: The text is empty, or its first lines cannot be read.
    """
    if time.column is not None or not is_text(path.name):
        return 0
    places = [grid_place(column.name) if column.grid else None for column in columns]
    if None in places:
        return 0
    wide: dict[str, int] = {}
    for column, place in zip(columns, places, strict=True):
        assert place is not None
        wide[column.grid] = max(wide.get(column.grid, 0), place.column)
    width = max(wide.values())
    if len(set(wide.values())) > 1 or len(columns) == width:
        return 0
    form = find_form(path, table_lines(path, LARGEST_TABLE))[0]
    fits = len(form.names) == width and not form.spare
    return len(columns) // width if fits and (form.counting or not form.named) else 0


def read_blocks(
    path: Path, columns: Sequence[Column], time: TimeColumn, missing: Missing, lines: int
) -> Table:
    """Return the scans of a text in which each of them is several lines.

    Args:
        path: The file.
        columns: Its channels: grids, one below the other, row by row.
        time: A rate.
        missing: What happens to values that are not finite.
        lines: How many are one scan.

    Raises:
        BadTable: A line has another number of cells, a cell is no number, or a scan another number
            of lines.
    """
    grids = " and ".join(dict.fromkeys(column.grid for column in columns))
    form, below = find_form(path, table_lines(path, LARGEST_TABLE))
    sign, width = DecimalSign(path, form.separator), len(form.names)
    values, numbers, blank = array("d"), array("q"), 0
    for number, line in enumerate(below, start=form.first_line):
        if not line.strip(f"{form.separator} "):
            blank = blank or number
            continue
        if blank and len(numbers) % lines:
            raise _cut(path, grids, lines, f"a blank line {blank} within", len(numbers) % lines)
        blank = 0
        cells = cells_of(path, number, line, form.separator)
        if len(cells) != width:
            raise BadTable(f"{number_of(width, 'cell')} in every line, as in line "
                           f"{form.first_line}", f"{len(cells)} in {path}, line {number}",
                           "mend the file")  # fmt: skip
        values.extend(numbers_in_line(path, sign.with_points(cells, number), number, 1))
        numbers.append(number)
        if len(values) > MOST_VALUES:
            raise BadTable(f"at most {MOST_VALUES:,} values in a table", f"more in {path}",
                           "cut it into several")  # fmt: skip
    if not numbers:
        raise BadTable("rows of numbers", f"none in {path}", "leave the file out")
    if left := len(numbers) % lines:
        raise _cut(path, grids, lines, "the end of", left)
    cells_read = np.frombuffer(values)
    if missing == "refuse" and (odd := np.flatnonzero(~(np.abs(cells_read) <= LARGEST_VALUE))).size:
        place, cell = divmod(int(odd[0]), width)
        raise BadTable("a finite number that 32 bits hold",
                       f"{cells_read[odd[0]]} in {path}, line {numbers[place]}, cell {cell + 1}",
                       "mend the file, or keep such cells as invalid with --missing keep",
                       )  # fmt: skip
    scans = cells_read.reshape(-1, len(columns)).copy()
    return Table(
        values=scans, time_s=np.arange(len(scans)) / (time.rate_hz or 1.0),
        names=tuple(column.name for column in columns),
        units=tuple(column.unit for column in columns), decimal_comma=sign.comma,
        passed_over=form.passed_over,
        remarks=(f"each {lines} lines of {number_of(width, 'number')} were read as one scan of "
                 f"{grids}",),
    )  # fmt: skip


def _cut(path: Path, grids: str, lines: int, where: str, begun: int) -> BadTable:
    """Return the error of a scan that has too few lines.

    Args:
        path: The file.
        grids: As the import table calls them.
        lines: How many a scan has.
        where: What came instead of the next line.
        begun: Lines of the scan above it.
    """
    return BadTable(
        f"{lines} lines for each scan of {grids}",
        f"{where} {path} after {begun} of them",
        "mend the file, or correct rows and columns in 'channels'",
    )
