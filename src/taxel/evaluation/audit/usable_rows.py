"""Rows of an array whose missing values stand as the channel's last one: a 0 would be touch.

Knows nothing about recordings, trials or checks.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray


def held_rows(values: NDArray[np.float32], usable: NDArray[np.bool_]) -> NDArray[np.float32]:
    """Return values, each unusable one replaced by its channel's last usable one.

    Before the first usable one stands that one; a channel that has none is 0 throughout.

    Args:
        values: Shape (rows, channels).
        usable: Likewise: missing, stale and NaN values are not.
    """
    if usable.all():
        return values
    held = np.zeros(values.shape, np.float32)
    row = np.arange(len(values))
    for channel in np.flatnonzero(usable.any(axis=0)):  # one after another: recordings may be long
        own = usable[:, channel]
        last = np.maximum.accumulate(np.where(own, row, own.argmax()))
        held[:, channel] = values[last, channel]
    return held


def sums_of(values: NDArray[np.float32], usable: NDArray[np.bool_]) -> NDArray[np.float64]:
    """Return each channel's count, sum and sum of squares of usable values, shape (3, channels).

    Args:
        values: Shape (rows, channels).
        usable: Likewise.
    """
    known = np.where(usable, values, np.float32(0.0))
    squares = np.square(known, dtype=np.float64).sum(axis=0)
    sums = [usable.sum(axis=0), known.sum(axis=0, dtype=np.float64), squares]
    return np.asarray(np.stack(sums), np.float64)
