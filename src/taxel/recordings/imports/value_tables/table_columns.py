"""The columns of text and .npy files, read piece by piece: memory is that of the values.

A cell that is not a number is an error, never a zero; each error names the file, the line and
the column. Knows nothing about times, units or recordings.

Background of our choices: docs/decisions/0011.
"""

from __future__ import annotations

import csv
import io
from collections.abc import Collection, Iterable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from itertools import islice
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from taxel.errors import BadFile, BadTable
from taxel.foreign.archives import LONGEST_START, read_head
from taxel.foreign.files import MIB, open_file, refuse_larger, size_of
from taxel.foreign.sheets import is_sheet
from taxel.foreign.text_lines import lines_of
from taxel.plain_text import number_of
from taxel.recordings.imports.value_tables.places import place_by_number, places_of, some_names
from taxel.recordings.imports.value_tables.table_form import (
    DecimalSign,
    TableForm,
    find_form,
    is_missing,
    is_number,
)
from taxel.recordings.imports.value_tables.table_rows import rows_of
from taxel.recordings.imports.value_tables.time_stamps import is_stamp, seconds_of

LARGEST_TABLE = 1024 * MIB
"""Bytes of a table of values, unpacked: three hours of twelve channels at 1 kHz as text. Our
choice."""
MOST_VALUES = 128 * MIB
"""Numbers that are taken from one table; 1 GiB of them. Source: our choice."""
LARGEST_LIST = 8 * MIB
"""Bytes of a table that lists files or intervals, some 100,000 of them. Source: our choice."""
_MOST_CELLS = 1_000_000
"""Of such a list, and its rows count as cells too."""
_NO_TIME = "00:00"
"""A time stamp in the place of none."""
_BLOCK_CELLS = 65_536
"""Cells of a text that become numbers at a time."""
_BLOCK_BYTES = 8 * MIB
"""Bytes of a .npy file that are read at a time."""


@dataclass(frozen=True, slots=True, kw_only=True)
class TextColumns:
    """The columns of numbers read from a text, and how the text was read."""

    values: NDArray[np.float64]
    """Shape (rows, wanted), in the file's own units."""
    first_line: int
    """Number of the line that holds the first row."""
    number_header: str = ""
    """The names in line 1 where all of them are numbers, which values could be, too; or empty."""
    decimal_comma: bool = False
    """Whether commas were taken for decimal signs."""
    one_more: bool = False
    """Whether each row ends in a separator, with an empty cell behind it that was left out."""
    passed_over: str = ""
    """Which lines around the names are no rows, and why, for a note; or empty."""
    stated: tuple[tuple[str, str], ...] = ()
    """Name and unit of each wanted column as the text states them; nothing for a .npy file."""
    dtype: np.dtype[Any] = field(default_factory=lambda: np.dtype(np.float64))
    """Of the numbers in the file; of a text those that its cells became."""


def text_columns(
    path: Path,
    wanted: Sequence[str],
    stamps: str = "",
    beside: Collection[str] = (),
    *,
    parted: bool = False,
) -> TextColumns:
    """Return the wanted columns of a text; `table_form.find_form` says how it may be written.

    Args:
        path: The file; one that ends in .gz is unpacked. Commas, semicolons, tabs or blanks
            separate.
        wanted: Names as in the header, or numbers from 1. Where the header itself holds whole
            numbers, these are names, and nothing is counted.
        stamps: The wanted column that holds dates or times of day, which become seconds
            (time_stamps.py); none by default.
        beside: Columns that are taken of the file by other calls, as in `find_form`.
        parted: Whether empty rows part trials; they are rows of NaN then.

    Raises:
        BadTable: Anything in the file is not as it should be; says where.
    """
    form, where, rows = _opened(path, wanted, beside, parted=parted)
    sign = DecimalSign(path, form.separator)
    stamped = where[wanted.index(stamps)] if stamps else -1
    values = _values(path, rows, form, where, sign, stamped)
    return TextColumns(
        values=values, first_line=form.first_line, decimal_comma=sign.comma,
        number_header=some_names(form.names) if form.counting else "", one_more=form.one_more,
        passed_over=form.passed_over, stated=tuple(map(form.stated, where)),
    )  # fmt: skip


def text_names(
    path: Path, wanted: Sequence[str] = (), beside: Collection[str] = ()
) -> tuple[str, ...]:
    """Return the names of a text's columns; their numbers from 1 where no line holds names.

    Args:
        path: The file.
        wanted: Names by which their line is known, such as that of the column of time.
        beside: As in `find_form`.

    Raises:
        BadTable: As `text_columns`.
    """
    return find_form(path, table_lines(path, LARGEST_TABLE), wanted, beside)[0].names


def text_cells(
    path: Path, wanted: Sequence[str], beside: Collection[str] = ()
) -> tuple[int, Iterator[list[str]]]:
    """Return the number of a text's first row's line, and the wanted cells of each row, as text.

    Raises:
        BadTable: As `text_columns`, some of it only when the rows are taken.
    """
    form, where, rows = _opened(path, wanted, beside)
    return form.first_line, ([row[place].strip() for place in where] for row in rows)


def parted_cells(
    path: Path, wanted: Sequence[str], beside: Collection[str] = ()
) -> tuple[int, Iterator[list[str]]]:
    """Return what `text_cells` does of a text whose empty rows part trials.

    Before the cells of each row stands the number of its part, from 1; an empty row has no cells.
    """
    form, where, rows = _opened(path, wanted, beside, parted=True)
    return form.first_line, _in_parts(rows, where)


def _opened(
    path: Path, wanted: Sequence[str], beside: Collection[str], *, parted: bool = False
) -> tuple[TableForm, list[int], Iterator[list[str]]]:
    """Return how a text is written, where its wanted columns stand, and its rows."""
    form, below = find_form(path, table_lines(path, LARGEST_TABLE), wanted, beside)
    form = replace(form, parted=parted)
    names = form.names
    what = (
        f"a header with {some_names(names)}"
        if form.named
        else f"{number_of(len(names), 'column')}, no header"
    )
    return form, places_of(path, names, wanted, what), rows_of(path, below, form)


def _in_parts(rows: Iterator[list[str]], where: Sequence[int]) -> Iterator[list[str]]:
    part, within = 0, False
    for row in rows:
        if not (filled := _is_filled(row)):
            yield []
        else:
            part += not within
            yield [str(part), *(row[place].strip() for place in where)]
        within = filled


def _is_filled(row: Sequence[str]) -> bool:
    return any(cell.strip() for cell in row)


def _values(
    path: Path,
    rows: Iterator[list[str]],
    form: TableForm,
    where: Sequence[int],
    sign: DecimalSign,
    stamped: int,
) -> NDArray[np.float64]:
    """Return the columns at the places `where` as numbers, shape (rows, places).

    Time stamps at the place `stamped` become seconds.
    """
    blocks, count = [np.empty((0, len(where)))], 0
    while block := list(islice(rows, max(1, _BLOCK_CELLS // len(form.names)))):
        block_values = np.empty((len(block), len(where)))
        for place, index in enumerate(where):
            line = form.first_line + count
            cells = [row[index] for row in block]
            if index == stamped:
                if form.parted:  # the time of a row between trials is not looked at
                    cells = [cell if _is_filled(row) else _NO_TIME
                             for cell, row in zip(cells, block, strict=True)]  # fmt: skip
                block_values[:, place] = seconds_of(path, cells, form.names[index], line)
                continue
            cells = sign.with_points(cells, line)
            block_values[:, place] = _numbers(path, cells, form.names[index], line)
        blocks.append(block_values)
        count += len(block)
        _refuse_many(path, count * len(where))
    return np.concatenate(blocks)


def npy_columns(path: Path, wanted: Sequence[str]) -> TextColumns:
    """Return the wanted columns of a .npy file of shape (rows, columns), numbered from 1.

    One of shape (rows,) has one column.

    Raises:
        BadTable: It holds no such array, or its size is not what it says.
    """
    try:
        with open_file(path) as file:
            size = size_of(file)
            refuse_larger(path, size, LARGEST_TABLE)
            start, dtype, shape, by_columns = read_head(file.read(LONGEST_START))
            if len(shape) not in (1, 2) or dtype.kind not in "iufb":
                raise BadTable(
                    "an array of shape (rows, columns) of real numbers",
                    f"{path} of shape {shape}, {dtype}", "write it so",
                )  # fmt: skip
            rows, columns = (*shape, 1)[:2]
            if rows * columns * dtype.itemsize != size - start:
                raise BadFile(
                    "as many bytes as its shape says", f"{size - start:,} for {shape}", "write it"
                )
            # Names are numbers here: nothing is listed, however many columns a head speaks of.
            where = [place_by_number(path, name, columns) for name in wanted]
            _refuse_many(path, rows * len(where))
            values = np.empty((rows, len(where)))
            if by_columns:
                for place, index in enumerate(where):
                    file.seek(start + index * rows * dtype.itemsize)
                    values[:, place] = np.frombuffer(file.read(rows * dtype.itemsize), dtype)
                return TextColumns(values=values, first_line=1, dtype=dtype)
            file.seek(start)
            step = max(1, _BLOCK_BYTES // max(1, columns * dtype.itemsize))
            for row in range(0, rows, step):
                count = min(step, rows - row)
                block = np.frombuffer(file.read(count * columns * dtype.itemsize), dtype)
                values[row : row + count] = block.reshape(count, columns)[:, where]
            return TextColumns(values=values, first_line=1, dtype=dtype)
    except BadFile as error:
        raise BadTable(
            "a .npy file of numbers", f"{path}: {error.got}", "write it again"
        ) from error
    except (OSError, ValueError) as error:
        if isinstance(error, BadTable):
            raise
        raise BadTable("a .npy file of numbers", f"{path}: {error}", "write it again") from error


def npy_shape(path: Path) -> tuple[int, ...]:
    """Return the shape of a .npy file, by its head.

    Raises:
        BadTable: It has none.
    """
    try:
        with open_file(path) as file:
            return read_head(file.read(LONGEST_START))[2]
    except BadFile as error:
        raise BadTable(error.needed, f"{path}: {error.got}", error.mend) from error
    except OSError as error:
        raise BadTable("a .npy file of numbers", f"{path}: {error}", "check the path") from error


def read_cells(path: Path) -> list[list[str]]:
    """Return the cells of a small table, line by line, whatever separates them.

    Columns and lines at its end that are empty throughout, as spreadsheets write them where a cell
    was only formatted, are left out.
    The separator is the one of comma, semicolon and tab that stands most often in the first
    line that is no "#" remark; where a comma ties, it is taken for a decimal comma.

    Raises:
        BadTable: It cannot be read, is too long, not text in a certain encoding, or no CSV.
    """
    text = "".join(_raw_lines(path, LARGEST_LIST))
    separator = list_separator(path, io.StringIO(text))
    rows, cells = [], 0
    try:
        for row in csv.reader(io.StringIO(text, newline=""), delimiter=separator):
            cells += 1 + len(row)
            if cells > _MOST_CELLS:
                raise BadTable(
                    f"a table of at most {_MOST_CELLS:,} cells", f"more in {path}", "split it"
                )
            rows.append(row)
    except csv.Error as error:
        raise BadTable("a table (CSV)", f"{path}: {error}", "save it again as CSV") from error
    return _trimmed(rows)


def list_separator(path: Path, lines: Iterable[str]) -> str:
    """Return what separates the cells of a small table, by its first line that is no remark."""
    with_text = (line for line in lines if line.strip() and line[0] != "#")
    return "\t" if is_sheet(path) else max("\t;,", key=next(with_text, "").count)


def by_column(columns: Sequence[str], cells: Sequence[str], where: str) -> dict[str, str]:
    """Return a row's cells, without blanks around them, by their columns.

    Raises:
        BadTable: There are more or fewer than columns.
    """
    if len(cells) != len(columns):
        raise BadTable(f"{len(columns)} cells", f"{len(cells)} in {where}", "mend the line")
    return {name: cell.strip() for name, cell in zip(columns, cells, strict=True)}


def _trimmed(rows: list[list[str]]) -> list[list[str]]:
    """Return rows without empty ones at the end, and without empty columns behind the last name."""
    while rows and not any(cell.strip() for cell in rows[-1]):
        rows.pop()
    width = max((at for row in rows for at, cell in enumerate(row, start=1) if cell.strip()),
                default=0)  # fmt: skip
    spare = max(len(rows[0]) - width, 0) if rows else 0
    return [row[:width] if len(row) == width + spare else row for row in rows]


def mend_number(cell: str) -> str:
    """Return how to mend a cell that is not a number: by its decimal comma, if it has one."""
    if "," in cell and is_number(cell.replace(",", ".")):
        return "write decimal points, not commas"
    return "mend the file, or choose other columns"


def _raw_lines(path: Path, most: int) -> Iterator[str]:
    try:
        yield from lines_of(path, most)
    except BadFile as error:
        raise BadTable(error.needed, error.got, error.mend) from error
    except OSError as error:
        raise BadTable(
            "a file that can be read", f"{path}: {error.strerror or error}", "check the path"
        ) from error


def table_lines(path: Path, most: int) -> Iterator[str]:
    """Return a text's lines without their ends; a BadTable says what cannot be read."""
    return (line.rstrip("\r\n") for line in _raw_lines(path, most))


def _numbers(path: Path, cells: list[str], name: str, first_line: int) -> NDArray[np.float64]:
    """Return a column's numbers; a cell without a value is NaN, any other must be a number."""
    try:
        if not any("_" in cell for cell in cells):
            return np.array(cells, dtype=np.float64)
    except ValueError:
        pass
    numbers = np.empty(len(cells))
    for row, cell in enumerate(cells):
        if is_missing(cell):
            numbers[row] = np.nan
            continue
        if not is_number(cell):
            where = f"in {path}, line {row + first_line}, column {name[:80]!r}"
            if _holds_several(cell):
                raise BadTable(
                    "a number", f"{cell[:80]!r} {where}, where blanks separate no cells",
                    "write as many numbers in each line, or separate them by commas, semicolons or "
                    "tabs; for other texts, name a function that reads them in the column 'layout'",
                )  # fmt: skip
            raise BadTable(
                "a number",
                f"{cell[:80]!r} {where}",
                "if it is the time, write NAME[iso] in the column 'time'; else choose other columns"
                if is_stamp(cell) else mend_number(cell),
            )  # fmt: skip
        numbers[row] = float(cell)
    return numbers


def _holds_several(cell: str) -> bool:
    """Return whether a cell holds several numbers with blanks between them."""
    words = cell.split()
    return len(words) > 1 and all(map(is_number, words))


def _refuse_many(path: Path, count: int) -> None:
    if count > MOST_VALUES:
        raise BadTable(
            f"at most {MOST_VALUES:,} values in a table", f"more in {path}",
            "cut it into several, or take fewer columns",
        )  # fmt: skip
