"""Which lines of a text of numbers are rows, and whether each has a cell for each column.

Knows nothing about what the cells hold.

Background of our choices: docs/decisions/0011.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

from taxel.errors import BadTable
from taxel.plain_text import number_of
from taxel.recordings.imports.value_tables.table_form import TableForm, cells_of

_GRIDS = "if they part scans of several lines, write the grid in 'channels', as pad:4x4[N]; "


def rows_of(path: Path, lines: Iterator[str], form: TableForm) -> Iterator[list[str]]:
    """Yield the cells of each line, which must be as many as there are columns.

    Blank lines, and rows without anything in their cells, may end a text, as spreadsheets write
    them: they are left out there. Where they part trials, each of them is a row of empty cells.

    Args:
        path: For messages.
        lines: From the first row on, without their ends.
        form: How the text is written.

    Raises:
        BadTable: A line has another number of cells, or something behind the last name's column.
    """
    width, blank, empty = len(form.names) + form.spare, 0, 0
    nothing = f"{form.separator} "
    for number, line in enumerate(lines, start=form.first_line):
        if not line.strip(nothing):
            cells = cells_of(path, number, line, form.separator)
            if len(cells) == width > 1 or form.parted:
                empty += 1
            else:
                blank = blank or number
            continue
        if blank:  # it was not the end
            raise _ragged(path, form, 0, blank)
        yield from ([""] * len(form.names) for _ in range(empty))
        empty = 0
        cells = cells_of(path, number, line, form.separator)
        if len(cells) != width:
            raise _ragged(path, form, len(cells), number)
        if form.spare and (odd := "".join(cells[len(form.names) :]).strip()):
            raise BadTable(
                "nothing behind the last name's column in every line, as in line "
                f"{form.first_line}", f"{odd[:80]!r} in {path}, line {number}",
                "name that column too, in the line of names",
            )  # fmt: skip
        yield cells[: len(form.names)]


def _ragged(path: Path, form: TableForm, count: int, number: int) -> BadTable:
    """Return the error of a line that has another number of cells than there are columns."""
    names, got = len(form.names), f"{count} in {path}, line {number}"
    if form.spare:
        behind = "a separator" if form.spare == 1 else f"{form.spare} separators"
        return BadTable(
            f"{number_of(names, 'cell')} and {behind} behind them in every line, as in line "
            f"{form.first_line}", got, "write all lines alike",
        )  # fmt: skip
    if not count:
        mend = (
            "remove the blank line; if blank lines part trials, write 'empty rows' in the column "
            "'trials'; "
            + _GRIDS * (not form.named)
            + "if another table begins below it, save that by itself"
        )
    elif count < names:
        mend = "mend the file, which may have been cut short"
    elif form.named:
        got += f", where {names} are named"
        mend = "name every column in the line of names, or remove what stands in none"
    else:
        got += f", where line {form.first_line} has {names}"
        mend = "put a line of names above, one for each column, or write all lines alike"
    return BadTable(f"{number_of(names, 'cell')} in every line", got, mend)
