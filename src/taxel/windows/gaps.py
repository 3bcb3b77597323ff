"""Short gaps of a finished window: filled in between their neighbours, or not at all.

A window is filled as a whole or stays as it is, so that no value of 0 for "missing" is ever read as
touch. Works on one window's own rows, hence the same offline and live. Knows nothing about streams.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

SHORT = 1 / 15
"""Rows of a gap that is short, as a share of the window: 5 of 75, none of 12. Source: our choice,
docs/decisions/0040."""


def fill_gaps(
    values: NDArray[np.float32], usable: NDArray[np.bool_], length: int, most: float
) -> NDArray[np.float32] | None:
    """Return a window's values with all gaps filled in; None where they are too long or too many.

    Between two usable values of a channel a straight line is taken, at the window's ends the
    nearest value is held.

    Args:
        values: The measured rows, shape (rows, channels), oldest first.
        usable: Shape (rows, channels).
        length: Rows of a full window.
        most: Largest share of values that may be filled in, 0…1.
    """
    bad = ~usable
    if np.count_nonzero(bad) > most * bad.size:
        return None
    most_rows = int(length * SHORT)
    rows = np.arange(len(values))
    found = values.copy()
    for channel in np.flatnonzero(bad.any(axis=0)):
        gap, good = bad[:, channel], usable[:, channel]
        if _longest(gap) > most_rows or not good.any():
            return None
        found[gap, channel] = np.interp(rows[gap], rows[good], values[good, channel])
    return found


def _longest(gap: NDArray[np.bool_]) -> int:
    """Return the length of the longest run of True."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], gap, [False]]).astype(np.int8)))
    return int((edges[1::2] - edges[::2]).max(initial=0))
