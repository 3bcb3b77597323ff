"""Labels that change within a recording: a text's column with a label in each row, as marks.

Rows that follow one another with the same labels become a marked stretch, and so a trial. Knows
nothing about how texts are read or recordings are written.

Background of our choices: docs/decisions/0011.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import groupby

import numpy as np
from numpy.typing import NDArray

from taxel.errors import BadTable
from taxel.plain_text import visible
from taxel.recordings.imports.spelling import composed
from taxel.signals import Mark

ROWS = "rows:"
"""Begins a cell that names the column with a label in each row."""


def columns_by_row(named: Mapping[str, str], where: str) -> dict[str, str]:
    """Return label → column of the cells that begin with `rows:`.

    Args:
        named: Column of the import table → the row's cell.
        where: Table and line, for messages.

    Raises:
        BadTable: Such a cell is no label's, or names no column.
    """
    found = {}
    for name, cell in named.items():
        if not cell.lower().startswith(ROWS):
            continue
        column = cell[len(ROWS) :].strip()
        if not name.startswith("label:") or not column:
            raise BadTable(
                f"{ROWS}COLUMN in a column label:NAME",
                f"{cell[:80]!r} in the column {name!r} in {where}",
                "write it there, or a value that holds for the whole file",
            )
        found[name.removeprefix("label:")] = column
    return found


def marks_by_row(labels: Mapping[str, Sequence[str]], time_s: NDArray[np.float64]) -> list[Mark]:
    """Return a mark for each stretch of rows that have the same labels, in the order of time.

    Args:
        labels: Label → its value in each row; an empty one is none. A stretch without any label
            is not marked.
        time_s: Fitted time of the rows, shape (n,), seconds, increasing.
    """
    each = list(zip(*labels.values(), strict=True))
    marks = []
    for values, rows in groupby(range(len(each)), key=each.__getitem__):
        own = {
            composed(name): composed(value)
            for name, value in zip(labels, values, strict=True)
            if value
        }
        stretch = list(rows)
        if own:
            marks.append(Mark(start_s=float(time_s[stretch[0]]), end_s=float(time_s[stretch[-1]]),
                              labels=own))  # fmt: skip
    return marks


def remarks_on_rows(columns: Mapping[str, str]) -> list[str]:
    """Return how labels that stand in rows were read: a line, none where there are none."""
    names = ", ".join(visible(column) for column in dict.fromkeys(columns.values()))
    rule = "rows that follow one another with the same value are one trial"
    return [f"labels were taken from the column {names}: {rule}"] if columns else []
