"""Numbers that mark missing values, such as -32768 or 9999: by name they become missing.

Knows nothing about files.

Background of our choices: docs/decisions/0011.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from taxel.errors import BadTable
from taxel.recordings.imports.table_form import is_number
from taxel.recordings.imports.tables import LARGEST_VALUE

MOST_MARKS = 16
"""Of one line of a table. Source: our choice."""


def parse_marks(text: str, where: str) -> tuple[str, ...]:
    """Return the marks in a text such as "-32768 9999", as they stand there, each once.

    Raises:
        BadTable: One is no finite number that 32 bits hold, or there are too many.
    """
    marks = tuple(dict.fromkeys(text.split()))
    for mark in marks:
        if not (is_number(mark) and abs(float(mark)) <= LARGEST_VALUE):
            raise BadTable(
                "numbers that mark missing values, as in -32768 9999, in the column 'missing'",
                f"{mark[:80]!r} in {where}",
                "correct it; empty cells and NaN are no marks: --missing keep keeps them",
            )
    if len(marks) > MOST_MARKS:
        raise BadTable(f"at most {MOST_MARKS} marks in the column 'missing'",
                       f"{len(marks)} in {where}", "name fewer")  # fmt: skip
    return marks


def without_marked(
    values: NDArray[np.float64], marks: tuple[str, ...]
) -> tuple[NDArray[np.float64], dict[str, int]]:
    """Return values without those that are a mark, and how many were each.

    A mark is also found as its nearest number in 32 bits, as arrays of such numbers hold it.

    Args:
        values: Shape (n, channels), in each channel's unit; stays as it is.
        marks: Numbers, as `parse_marks` returns them.

    Returns:
        The values, NaN where they were marked; and mark → count, 0 where it does not occur.
    """
    counts, marked = dict[str, int](), np.zeros(values.shape, bool)
    for mark in marks:
        found = (values == float(mark)) | (values == float(np.float32(mark)))
        counts[mark] = int(np.count_nonzero(found))
        marked |= found
    return (np.where(marked, np.nan, values) if marked.any() else values), counts
