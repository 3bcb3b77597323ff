"""Where a column of times begins anew: most often, a new trial begins there.

Knows nothing about files, units or recordings.

Background of our choices: docs/decisions/0011.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

RESTARTS = "restarts"
"""In the column `trials`: the rows from one restart of time to the next are a trial."""
NEAR_START = 0.1
"""Share of the time since the last restart within which time must go back to where it began:
rows in a wrong order go back by less. Source: our choice, docs/decisions/0011."""


def begins_anew(now: float, before: float, start: float) -> bool:
    """Return whether time begins anew in a row: it goes back to about where it began, or further.

    Args:
        now: The row's time.
        before: That of the row above it.
        start: That of the first row since time began.
    """
    return start < before and now < before and now - start <= NEAR_START * (before - start)


def restarts_of(time_s: NDArray[np.float64]) -> list[int]:
    """Return the rows, from 0, in which times begin anew.

    Args:
        time_s: Shape (n,), seconds.
    """
    found: list[int] = []
    start = 0
    for row in (np.flatnonzero(np.diff(time_s) < 0) + 1).tolist():
        if begins_anew(time_s[row], time_s[row - 1], time_s[start]):
            found.append(row)
            start = row
    return found
