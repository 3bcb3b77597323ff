"""Counters of 32 bits that wrap, as numbers that only rise; and data frames as arrays.

Knows nothing about ports or time; the caller says where a counter should stand.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache

import numpy as np
from numpy.typing import NDArray

_WRAP = 1 << 32
_HALF = 1 << 31


def unwrap(raw: NDArray[np.uint32], near: int) -> NDArray[np.int64]:
    """Return wrapped counts as whole ones, each the nearest to the one before.

    Args:
        raw: Shape (n,): counters as they came, u32.
        near: About where the first should stand: the last known count, plus what a clock
            says has passed since. Within 2³¹ of the truth the result is right.

    Returns:
        Shape (n,). Steps backwards stay what they are, so that a restart can be seen.
    """
    if not len(raw):
        return np.zeros(0, np.int64)
    steps = np.empty(len(raw), np.int64)
    steps[0] = _nearest(int(raw[0]), near)
    if len(raw) > 1:
        steps[1:] = (raw[1:] - raw[:-1]).view(np.int32)
    return np.cumsum(steps)


def _nearest(raw: int, near: int) -> int:
    return near + (raw - near + _HALF) % _WRAP - _HALF


@cache
def _data_layout(channels: int) -> np.dtype[np.void]:
    return np.dtype(
        [
            ("kind", "u1"),
            ("board", "u1"),
            ("seq", "<u4"),
            ("t_us", "<u4"),
            ("values", "<u2", (channels,)),
        ]
    )


def data_size(channels: int) -> int:
    """Return the bytes of a data message's payload with this many values."""
    return 10 + 2 * channels


def data_arrays(
    payloads: Sequence[bytes], channels: int
) -> tuple[NDArray[np.uint32], NDArray[np.uint32], NDArray[np.uint16]]:
    """Unpack many data messages of one board at once: the hot path.

    Args:
        payloads: Each of `data_size(channels)` bytes, of kind DATA; the caller has looked.
        channels: Values in each.

    Returns:
        seq, shape (n,); t_us, shape (n,); values, shape (n, channels), converter counts.
    """
    rows = np.frombuffer(b"".join(payloads), _data_layout(channels))
    return rows["seq"], rows["t_us"], rows["values"]
