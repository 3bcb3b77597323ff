"""Numbers that mark missing values, such as -32768 or 9999: by name they become missing.

Knows nothing about files.

Background of our choices: docs/decisions/0011.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from taxel.errors import BadTable
from taxel.recordings.imports.value_tables.table_form import is_number
from taxel.recordings.imports.value_tables.tables import LARGEST_VALUE

MOST_MARKS = 16
"""Of one line of a table. Source: our choice."""


def parse_marks(text: str, where: str) -> tuple[str, ...]:
    """Return the marks in a text such as "-32768 9999", as they stand there, each number once.

    Raises:
        BadTable: One is no finite number that 32 bits hold, or there are too many.
    """
    by_value = dict[float, str]()
    for mark in text.split():
        if not (is_number(mark) and abs(float(mark)) <= LARGEST_VALUE):
            raise BadTable(
                "numbers that mark missing values, with blanks between them, as in -32768 9999, in "
                "the column 'missing'", f"{mark[:80]!r} in {where}", _mend(mark),
            )  # fmt: skip
        by_value.setdefault(float(mark), mark)
    marks = tuple(by_value.values())
    if len(marks) > MOST_MARKS:
        raise BadTable(f"at most {MOST_MARKS} marks in the column 'missing'",
                       f"{len(marks)} in {where}", "name fewer")  # fmt: skip
    return marks


def _mend(mark: str) -> str:
    if any(sign in mark for sign in ",;"):
        return "write blanks between marks, and decimal points"
    if is_number(mark) and math.isfinite(float(mark)):
        return f"correct it: recordings hold no value beyond {LARGEST_VALUE:.2g}"
    return "correct it; empty cells and NaN are no marks: --missing keep keeps them"


def without_marked(
    values: NDArray[np.float64], marks: tuple[str, ...], dtype: np.dtype[Any]
) -> tuple[NDArray[np.float64], dict[str, int]]:
    """Return values without those that are a mark, and how many were each.

    In a file of shorter floats a mark is its nearest number among these; in any other it is itself.

    Args:
        values: Shape (n, channels), in each channel's unit; stays as it is.
        marks: Numbers, as `parse_marks` returns them.
        dtype: Of the numbers that the file holds.

    Returns:
        The values, NaN where they were marked; and mark → count, 0 where it does not occur.
    """
    counts, marked = dict[str, int](), np.zeros(values.shape, bool)
    for mark in marks:
        number = float(mark)
        if dtype.kind == "f" and dtype.itemsize < values.itemsize:
            with np.errstate(over="ignore"):
                number = float(np.float64(mark).astype(dtype))
        found = (values == number) & math.isfinite(number)  # beyond what the file can hold
        counts[mark] = int(np.count_nonzero(found))
        marked |= found
    return (np.where(marked, np.nan, values) if marked.any() else values), counts
