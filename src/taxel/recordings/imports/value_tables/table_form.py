"""How a text of numbers is written: what separates, which line names the columns, which sign is
decimal.

Nothing is guessed where two readings are possible: a comma is a decimal sign only where something
else separates, and points and commas are never taken for it in one file. Knows nothing about units
or recordings.

Background of our choices: docs/decisions/0011.
"""

from __future__ import annotations

import csv
import re
from collections.abc import Collection, Iterator, Sequence, Set
from dataclasses import dataclass
from itertools import chain
from pathlib import Path

from taxel.errors import BadTable
from taxel.foreign.sheets import ENDING as SHEETS_ENDING
from taxel.foreign.sheets import is_sheet, without_sheet
from taxel.plain_text import visible
from taxel.recordings.imports.value_tables.stated_units import stated_in
from taxel.recordings.imports.value_tables.table_head import NO_VALUE, below_head, holds_units
from taxel.recordings.imports.value_tables.time_stamps import is_stamp

_ENDINGS = (".csv", ".tsv", ".txt", ".dat")
TEXT_ENDINGS = (*(f"{ending}.gz" for ending in _ENDINGS), *_ENDINGS, SHEETS_ENDING)
"""Of the names of texts that hold tables of values; sheets of workbooks are read as such."""
BLANKS = " "
"""A separator: any number of blanks, also before the first cell and behind the last."""
REMARK = "#"
_SEPARATORS = ",;\t"
_DECIMAL_COMMA = re.compile(r"\s*[+-]?\d*,\d+([eE][+-]?\d+)?\s*")


@dataclass(frozen=True, slots=True, kw_only=True)
class TableForm:
    """How one file is written."""

    separator: str
    names: tuple[str, ...]
    """The columns' names; their numbers from 1 where no line holds names."""
    named: bool
    """Whether a line holds names."""
    counting: bool
    """Whether they are in a line that holds only numbers, which values could be, too."""
    first_line: int
    """Number of the line that holds the first row."""
    spare: int = 0
    """Empty cells behind the last name, in each row."""
    one_more: bool = False
    """Whether each row ends in a separator that the line of names does not end in."""
    passed_over: str = ""
    """Which lines around the names are no rows, and why, for a note; or empty."""
    units: tuple[str, ...] = ()
    """What stands below the names where that line holds units; or nothing."""
    parted: bool = False
    """Whether empty rows, and blank lines, part trials, so that they may stand anywhere."""

    def stated(self, place: int) -> tuple[str, str]:
        """Return the name of the column at a place, and the unit that the text states for it."""
        name, below = self.names[place], "".join(self.units[place : place + 1])
        return name, stated_in(name, below) if self.named else ""


def find_form(
    path: Path,
    lines: Iterator[str],
    wanted: Collection[str] = (),
    beside: Collection[str] = (),
) -> tuple[TableForm, Iterator[str]]:
    """Return how a text is written, and the lines that hold its rows.

    A first line of nothing but numbers is a row of values, unless they count the columns, from 0
    (as pandas does) or 1, and the line below does not. So is one with words, where it holds a time
    stamp, or numbers in columns that are asked for by their numbers (`_is_row`). Lines above it
    that begin with # are remarks; the last of them names the columns where it has as many words (as
    NumPy writes it). Rows may end in a separator (as dumps of ROS do) where the names do not, or
    in empty cells without a name, as of spreadsheets: nothing stands in them, in any row, so that
    no cell can belong to another name. Lines above
    that of the wanted names, and a line of units below it, are passed over (table_head.py).

    Args:
        path: For messages.
        lines: Without their ends.
        wanted: Names of columns by which the line of names is known.
        beside: Names or numbers of other columns that are taken of the same file.

    Raises:
        BadTable: The first line is empty, or there is none.
    """
    above_names, lines = below_head(lines, wanted)
    first, number, remark = _below_remarks(path, lines)
    number += above_names
    second = next(lines, None)
    separator = _separator(path, first, second)
    top = [name.strip() for name in cells_of(path, number, first, separator)]
    above = _names_in(remark, separator, len(top))
    counting = (
        count_columns(top)
        and not above
        and not (second and count_columns([cell.strip() for cell in _split(second, separator)]))
    )
    below = lines if second is None else chain([second], lines)
    cells = [] if second is None else cells_of(path, number + 1, second, separator)
    words = any(name and not _is_value(name) for name in top)
    if counting or (words and not _is_row(top, cells, {*wanted, *beside})):
        count, spare = _named_columns(top, cells)
        units, below = _below_units(path, number + 1, cells, below, separator)
        form = TableForm(separator=separator, names=tuple(top[:count]), named=True,
                         counting=counting, first_line=number + 1 + bool(units), spare=spare,
                         one_more=len(cells) == len(top) + 1 and spare > 0,
                         passed_over=_passed_over(above_names, number + 1, units),
                         units=tuple(units))  # fmt: skip
        return form, below
    names = above or [str(number) for number in range(1, len(top) + 1)]
    form = TableForm(separator=separator, names=tuple(names), named=bool(above), counting=False,
                     first_line=number, passed_over=_passed_over(above_names, 0, []))  # fmt: skip
    return form, chain([first], below)


def _is_row(top: Sequence[str], second: Sequence[str], asked: Set[str]) -> bool:
    """Return whether a first line that holds words is a row all the same, and names nothing.

    It is one where a cell is a time stamp, as the one below it is. And it is one where columns are
    asked for by numbers alone, a column holds a number in both lines, and words stand above words
    only; unless all that is asked for stands in it, or its numbers count columns.

    Args:
        top: Its cells.
        second: Those of the line below it; none where there is no such line.
        asked: Names and numbers of all columns that are taken.
    """
    pairs = list(zip(top, second or top, strict=False))
    if any(is_stamp(cell) and is_stamp(below) for cell, below in pairs):
        return True
    if not all(map(is_whole, asked)) or asked <= set(top):
        return False
    numbers = [cell for cell in top if _is_value(cell)]
    return (
        any(all(map(_is_value, pair)) for pair in pairs)
        and not any(_is_value(below) for cell, below in pairs if cell and not _is_value(cell))
        and not (numbers and count_columns(numbers))
    )


def _named_columns(top: Sequence[str], second: Sequence[str]) -> tuple[int, int]:
    """Return how many columns the names are of, and how many empty cells each row has behind them.

    Args:
        top: The names; those at the end may be empty.
        second: Cells of the line below; none where there is no such line.
    """
    count = max((place for place, name in enumerate(top, start=1) if name), default=len(top))
    spare = len(second) - count
    if 0 <= spare <= len(top) - count + 1 and not any(cell.strip() for cell in second[count:]):
        return count, spare
    return len(top), 0


def _below_units(
    path: Path, number: int, second: list[str], below: Iterator[str], separator: str
) -> tuple[list[str], Iterator[str]]:
    """Return the units in the line below the names, if it holds units, and the lines of rows.

    Args:
        path: For messages.
        number: Of the line below the names.
        second: Its cells.
        below: That line and those below it.
        separator: Of the cells.
    """
    line, after = next(below, None), next(below, None)
    if line is None or after is None:
        return [], chain([] if line is None else [line], below)
    third = cells_of(path, number + 1, after, separator)
    if holds_units(second, third, _is_value):
        return second, chain([after], below)
    return [], chain([line, after], below)


def _passed_over(above: int, number: int, units: Sequence[str]) -> str:
    """Return which lines are no rows: those above the names, and the one of units."""
    found = []
    if above:
        lines = "line 1" if above == 1 else f"lines 1 to {above}"
        found.append(f"{lines} above the names")
    if units:
        shown = ", ".join(visible(cell.strip()) for cell in units[:6]) + (" …" * bool(units[6:]))
        found.append(f"line {number}, which holds units ({shown})")
    return " and ".join(found)


def _names_in(remark: str, separator: str, columns: int) -> list[str]:
    """Return the names in a remark, which other characters may separate than values; or none."""
    for own in (separator, *_SEPARATORS, BLANKS):
        names = [name.strip() for name in _split(remark, own)]
        if len(names) == columns and not any(map(_is_value, names)) and all(names):
            return names
    return []


def cells_of(path: Path, number: int, line: str, separator: str) -> list[str]:
    """Return a line's cells.

    Raises:
        BadTable: Its quotes do not end.
    """
    if '"' not in line:
        return _split(line, separator)
    text = line.strip() if separator == BLANKS else line
    try:
        return next(csv.reader((text,), delimiter=separator, skipinitialspace=separator == BLANKS))
    except csv.Error as error:
        raise BadTable(
            "a table (CSV)", f"{path}, line {number}: {error}", "save it again as CSV"
        ) from error


def is_number(cell: str) -> bool:
    """Return whether a cell is a number as a table may hold it: Python would also take 1_000."""
    try:
        float(cell)
    except ValueError:
        return False
    return "_" not in cell


def is_missing(cell: str) -> bool:
    """Return whether a cell says that there is no value: it is empty, or one of `NO_VALUE`."""
    word = cell.strip().lower()
    return not word or word in NO_VALUE


def _is_value(cell: str) -> bool:
    return is_number(cell) or bool(_DECIMAL_COMMA.fullmatch(cell))


def is_text(name: str) -> bool:
    """Return whether a file's name is that of a text that holds a table, or of a sheet."""
    return without_sheet(name).lower().endswith(TEXT_ENDINGS)


def is_whole(name: str) -> bool:
    """Return whether a column's name can be its number."""
    return name.isascii() and name.isdecimal()


def header_names(names: Collection[str], header: Sequence[str]) -> set[str]:
    """Return columns of a text as its header calls them, also those that are named by numbers.

    Args:
        names: As the import table names them.
        header: The text's own names, in order; empty where it has none.
    """
    return set(names) | {header[place] for place in column_places(names, header)}


def column_places(names: Collection[str], header: Sequence[str]) -> set[int]:
    """Return the places of columns, from 0: by name, all that share it, else by number from 1.

    Args:
        names: As the import table names them.
        header: The text's own names, in order.
    """
    found = {place for place, name in enumerate(header) if name in names}
    for name in set(names) - set(header):
        if is_whole(name) and len(name) < 7 and 1 <= int(name) <= len(header):
            found.add(int(name) - 1)
    return found


def count_columns(cells: Sequence[str]) -> bool:
    """Return whether cells count two columns or more, from 0 or 1; an index has no name."""
    numbers = list(cells[1:] if cells[0] == "" else cells)
    starts = (0, 1) if len(numbers) > 1 else ()
    return any(numbers == [str(start + n) for n in range(len(numbers))] for start in starts)


class DecimalSign:
    """The decimal sign of one file: a point, or a comma where something else separates.

    Args:
        path: For messages.
        separator: Of the file's cells.
    """

    def __init__(self, path: Path, separator: str) -> None:
        self._path, self._may_be_comma = path, separator != ","
        self.comma = self._point = False

    def with_points(self, cells: list[str], first_line: int) -> list[str]:
        """Return a column's cells with decimal points.

        Args:
            cells: As they stand in the file.
            first_line: Number of the first one's line, for messages.

        Raises:
            BadTable: The file has both signs.
        """
        if not self._may_be_comma:
            return cells
        text = "".join(cells)
        self._point = self._point or "." in text
        if "," in text:
            found = [_with_point(cell) for cell in cells]
            self.comma = self.comma or found != cells
            cells = found
        if self.comma and self._point:
            raise BadTable(
                "one decimal sign in a file", f"points and commas in {self._path}, from about line "
                f"{first_line} on", "write decimal points, and no thousands separators",
            )  # fmt: skip
        return cells


def _with_point(cell: str) -> str:
    return cell.replace(",", ".") if _DECIMAL_COMMA.fullmatch(cell) else cell


def _below_remarks(path: Path, lines: Iterator[str]) -> tuple[str, int, str]:
    """Return the first line that is no remark, its number, and the last remark's words."""
    remark, seen = "", False
    for number, line in enumerate(lines, start=1):
        if line.lstrip().startswith(REMARK):
            remark, seen = line.strip().lstrip(REMARK).strip(), True
        elif line or not seen:
            if line:
                return line, number, remark
            empty = not any(lines)
            raise BadTable(
                "rows of numbers",
                f"the empty file {path}" if empty else f"an empty line 1 in {path}",
                "leave the file out" if empty else "remove the line",
            )
    got = f"none below the remarks in {path}" if seen else f"the empty file {path}"
    raise BadTable("rows of numbers", got, "leave the file out")


def _separator(path: Path, first: str, second: str | None) -> str:
    """Return what separates: by the line below too, where decimal commas or blanks may be."""
    if is_sheet(path):
        return "\t"
    sample = first if second is None else second
    for separator in (";", "\t", BLANKS):
        cells = _split(sample, separator)
        if len(cells) > 1 and len(cells) == len(_split(first, separator)):
            with_comma = [cell for cell in cells if "," in cell]
            if with_comma and all(map(_DECIMAL_COMMA.fullmatch, with_comma)):
                return separator
    most = max(_SEPARATORS, key=first.count)
    if most in first:
        return most
    above, below = (len(cells_of(path, 1, line, BLANKS)) for line in (first, sample))
    return BLANKS if above == below > 1 else most


def _split(line: str, separator: str) -> list[str]:
    return line.split() if separator == BLANKS else line.split(separator)
