"""Read a table of values strictly: a cell that is not a number is an error, never a zero.

Knows .csv, .csv.gz and .npy; other layouts are in layouts.py. Text is UTF-8,
or UTF-16 that says so; no other encoding is certain, so none is guessed. Each
error names the file, the line and the column. Knows nothing about recordings.
"""

from __future__ import annotations

import codecs
import csv
import gzip
import io
import re
import zlib
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from taxel.errors import BadTable

Missing = Literal["refuse", "keep"]
"""What happens to empty cells, NaN and infinity: an error, or kept and flagged NOT_FINITE."""

TIME_UNITS_S = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9}
"""Unit of a time column → seconds."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Column:
    """A column of values, and its unit."""

    name: str
    """The header's name, or the column's number from 1 where there is no header."""
    unit: str


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


def parse_columns(text: str, where: str) -> tuple[Column, ...]:
    """Return the columns of a text such as "Data0[count] Data1[count] 7[deg]".

    Raises:
        BadTable: A word is not NAME[UNIT], or a name comes twice.
    """
    words = re.findall(r"\S[^\[\]]*\[[^\[\]]*\]|\S+", text)
    found = []
    for word in words:
        match = re.fullmatch(r"([^\[\]]+)\[([^\[\]]+)\]", word)
        if match is None:
            raise BadTable(
                f"channels as NAME[UNIT] NAME[UNIT] … in {where}", repr(word), "name each unit"
            )
        found.append(Column(name=match[1].strip(), unit=match[2].strip()))
    names = [column.name for column in found]
    if not found or len(set(names)) < len(names):
        raise BadTable(f"at least one channel, each once, in {where}", repr(text), "correct it")
    return tuple(found)


def parse_time(text: str, where: str) -> TimeColumn:
    """Return where time comes from: "Timestamp[ms]", "1[s]" or "rate:100Hz".

    Raises:
        BadTable: It is neither, or the unit is not s, ms, us or ns.
    """
    rate = re.fullmatch(r"rate:\s*([0-9.]+)\s*Hz", text.strip())
    if rate is not None:
        try:
            rate_hz = float(rate[1])
        except ValueError:
            rate_hz = 0.0
        if rate_hz > 0:
            return TimeColumn(rate_hz=rate_hz)
    match = re.fullmatch(r"\s*([^\[\]]+)\[([^\[\]]+)\]\s*", text)
    if match is None or match[2].strip() not in TIME_UNITS_S:
        raise BadTable(
            f"time as NAME[s], NAME[ms], NAME[us], NAME[ns] or rate:100Hz in {where}",
            repr(text),
            "correct it",
        )
    return TimeColumn(column=Column(name=match[1].strip(), unit=match[2].strip()))


def read_table(
    path: Path, columns: Sequence[Column], time: TimeColumn, missing: Missing = "refuse"
) -> Table:
    """Return the wanted columns of a .csv, .csv.gz or .npy file.

    Args:
        path: The file. A CSV may be separated by comma, semicolon or tab.
        columns: Wanted channels, in the order of the result.
        time: Where time comes from.
        missing: What happens to values that are not finite. Time must always be.

    Raises:
        BadTable: Anything in the file is not as it should be; says where.
    """
    wanted = [*columns] + ([time.column] if time.column is not None else [])
    if path.name.endswith(".npy"):
        cells = _npy_columns(path, wanted)
        first_line = 1
    elif path.name.endswith((".csv", ".csv.gz")):
        cells, first_line = _csv_columns(path, wanted)
    else:
        raise BadTable(
            "a .csv, .csv.gz or .npy file", str(path), "name a layout for it in the column 'layout'"
        )
    values = cells[:, : len(columns)]
    check_values(path, values, [column.name for column in columns], missing, first_line)
    return Table(
        values=values,
        time_s=_time_s(path, cells, time, first_line),
        names=tuple(column.name for column in columns),
        units=tuple(column.unit for column in columns),
    )


def read_cells(path: Path) -> list[list[str]]:
    """Return the cells of a small table, line by line, whatever separates them.

    The separator is the one of comma, semicolon and tab that stands most often in the first
    line that is no "#" remark; where a comma ties, it is taken for a decimal comma.

    Raises:
        BadTable: It cannot be read, is not text in a certain encoding, or no CSV.
    """
    text = _text(path)
    first = next((line for line in text.splitlines() if line.strip() and line[0] != "#"), "")
    separator = max("\t;,", key=first.count)
    try:
        return list(csv.reader(io.StringIO(text, newline=""), delimiter=separator))
    except csv.Error as error:
        raise BadTable("a table (CSV)", f"{path}: {error}", "save it again as CSV") from error


def is_number(cell: str) -> bool:
    """Return whether a cell is a number as a table may hold it: Python would also take 1_000."""
    try:
        float(cell)
    except ValueError:
        return False
    return "_" not in cell


def mend_number(cell: str) -> str:
    """Return how to mend a cell that is not a number: by its decimal comma, if it has one."""
    if is_number(cell.replace(",", ".")):
        return "write decimal points, not commas"
    return "mend the file, or choose other columns"


def check_values(
    path: Path,
    values: NDArray[np.float64],
    names: Sequence[str],
    missing: Missing,
    first_line: int = 1,
) -> None:
    """Refuse a table without rows, and values that are not finite unless they are to be kept.

    Raises:
        BadTable: Says file, line and column.
    """
    if len(values) == 0:
        raise BadTable("rows of numbers", f"none in {path}", "leave the file out")
    if missing == "keep" or np.isfinite(values).all():
        return
    row, column = np.argwhere(~np.isfinite(values))[0]
    raise BadTable(
        "a finite number",
        f"{values[row, column]} in {path}, line {row + first_line}, column {names[column]!r}",
        "mend the file, or keep such cells as invalid with --missing keep",
    )


def check_time(path: Path, time_s: NDArray[np.float64], first_line: int = 1) -> None:
    """Refuse times that are not finite or do not increase.

    Raises:
        BadTable: Says file and line.
    """
    if not np.isfinite(time_s).all():
        line = int(np.argmin(np.isfinite(time_s))) + first_line
        raise BadTable("a time in every row", f"none in {path}, line {line}", "mend the file")
    steps = np.diff(time_s)
    if (steps <= 0).any():
        row = int(np.argmax(steps <= 0)) + 1
        raise BadTable(
            "times that increase from row to row",
            f"{time_s[row]:.6g} s after {time_s[row - 1]:.6g} s in {path}, line {row + first_line}",
            "sort the rows, or give a rate instead of a time column",
        )


def _time_s(
    path: Path, cells: NDArray[np.float64], time: TimeColumn, first_line: int
) -> NDArray[np.float64]:
    if time.column is None:
        return np.arange(len(cells)) / (time.rate_hz or 1.0)
    time_s = cells[:, -1] * TIME_UNITS_S[time.column.unit]
    check_time(path, time_s, first_line)
    return time_s


def _npy_columns(path: Path, wanted: Sequence[Column]) -> NDArray[np.float64]:
    try:
        array = np.load(path, allow_pickle=False)
    except (OSError, ValueError, EOFError) as error:
        raise BadTable("a .npy file of numbers", f"{path}: {error}", "write it again") from error
    if not isinstance(array, np.ndarray) or array.ndim != 2 or array.dtype.kind not in "iufb":
        got = f"{path} of shape {getattr(array, 'shape', '?')}, {getattr(array, 'dtype', '?')}"
        raise BadTable("an array of shape (rows, columns) of real numbers", got, "write it so")
    numbers = [str(number) for number in range(1, array.shape[1] + 1)]
    where = [_index(path, numbers, column, "numbered from 1") for column in wanted]
    return np.asarray(array[:, where], np.float64)


def _csv_columns(path: Path, wanted: Sequence[Column]) -> tuple[NDArray[np.float64], int]:
    """Return the wanted columns, shape (rows, len(wanted)), and the line of the first row."""
    text = _text(path)
    lines = text.splitlines()
    if not any(lines):
        raise BadTable("rows of numbers", f"the empty file {path}", "leave the file out")
    separator = max(",;\t", key=lines[0].count)
    rows = list(csv.reader(lines, delimiter=separator))
    while rows and not rows[-1]:
        rows.pop()
    width = len(rows[0])
    if set(map(len, rows)) != {width}:
        line = next(i for i, row in enumerate(rows, start=1) if len(row) != width)
        raise BadTable(
            f"{width} cells in every line",
            f"{len(rows[line - 1])} in {path}, line {line}",
            "mend the file, which may have been cut short",
        )
    header = [name.strip() for name in rows[0]]
    has_header = any(name and not is_number(name) for name in header)
    names = header if has_header else [str(number) for number in range(1, width + 1)]
    what = f"a header with {', '.join(header)}" if has_header else f"{width} columns, no header"
    where = [_index(path, names, column, what) for column in wanted]
    body = rows[1:] if has_header else rows
    first_line = 2 if has_header else 1
    cells = np.empty((len(body), len(wanted)))
    for place, index in enumerate(where):
        cells[:, place] = _numbers(path, [row[index] for row in body], names[index], first_line)
    return cells, first_line


def _text(path: Path) -> str:
    try:
        content = path.read_bytes()
        if path.name.endswith(".gz"):
            content = gzip.decompress(content)
    except (EOFError, zlib.error, gzip.BadGzipFile) as error:
        raise BadTable("a whole gzip file", f"{path}: {error}", "copy it again") from error
    except OSError as error:
        raise BadTable(
            "a file that can be read", f"{path}: {error.strerror or error}", "check the path"
        ) from error
    return _decoded(path, content)


def _decoded(path: Path, content: bytes) -> str:
    marked = content.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE))
    try:
        text = content.decode("utf-16" if marked else "utf-8-sig")
    except UnicodeDecodeError as error:
        line = content[: error.start].count(b"\n") + 1
        what = "broken UTF-16" if marked else "another encoding, such as Latin-1 or Windows-1252"
        raise BadTable(
            "text in UTF-8", f"{what} in {path}, line {line} (byte 0x{content[error.start]:02x})",
            "save it as UTF-8 (in Excel: CSV UTF-8)",
        ) from error  # fmt: skip
    if "\0" in text:
        raise BadTable("text in UTF-8", f"zero bytes in {path}, as of UTF-16 without its mark",
                       "save it as UTF-8 (in Excel: CSV UTF-8)")  # fmt: skip
    return text


def _index(path: Path, names: Sequence[str], column: Column, what: str) -> int:
    found = [index for index, name in enumerate(names) if name == column.name]
    if not found and column.name.isdecimal() and 1 <= int(column.name) <= len(names):
        found = [int(column.name) - 1]
    if len(found) == 1:
        return found[0]
    problem = "no such column" if not found else f"{len(found)} columns of that name"
    raise BadTable(f"the column {column.name!r}", f"{problem} in {path} ({what})", "correct it")


def _numbers(path: Path, cells: list[str], name: str, first_line: int) -> NDArray[np.float64]:
    """Return a column's numbers; an empty cell is NaN, anything else must be a number."""
    try:
        if not any("_" in cell for cell in cells):
            return np.array(cells, dtype=np.float64)
    except ValueError:
        pass
    numbers = np.empty(len(cells))
    for row, cell in enumerate(cells):
        if cell.strip() and not is_number(cell):
            raise BadTable(
                "a number",
                f"{cell!r} in {path}, line {row + first_line}, column {name!r}",
                mend_number(cell),
            )
        numbers[row] = float(cell) if cell.strip() else np.nan
    return numbers
