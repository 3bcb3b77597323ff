"""Whether a trial is another scaled and offset, with nothing left but rounding.

Asked where trials are too short to distinguish their noise from touch. Knows nothing about labels.

Background of our choices: docs/decisions/0023.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

LEAST = 6
"""Values that scale and offset leave free, at least: fewer are met by chance. Source: our choice,
docs/decisions/0023."""
CLEAR = 10.0
"""How often a course must leave the straight line by more than rounding does, to say something.
Source: our choice, docs/decisions/0023."""
SMALL = 10.0
"""Percentile of the steps between a channel's values that is its resolution. Source: our choice,
docs/decisions/0023."""
_HALF = 0.6
"""Steps that rounding moves a value by, at most: half a one, and what the fit of scale and offset
adds. Source: our choice, docs/decisions/0023."""
_FLOAT = 8.0
"""Rounding of 32-bit values, in units of their last place."""


def small_steps(trials: Sequence[NDArray[np.float32]]) -> NDArray[np.float64]:
    """Return the resolution of each channel, shape (channels,): a small step between its values.

    Nine of ten steps are at least as large: copies that were not rounded have a few smaller ones.
    Steps as small as the rounding of 32-bit values are none.

    Args:
        trials: Each shape (rows, channels).
    """
    every = np.sort(np.concatenate(trials).astype(np.float64), axis=0)
    least = _float_error(every)
    found = np.zeros(every.shape[1])
    for channel, steps in enumerate(np.diff(every, axis=0).T):
        some = steps[steps > least[channel]]
        found[channel] = np.percentile(some, SMALL) if len(some) else 0.0
    return found


def up_to_rounding(
    first: NDArray[np.float32], other: NDArray[np.float32], steps: NDArray[np.float64]
) -> bool:
    """Return whether one trial is the other, each channel scaled and offset, up to rounding.

    Each channel has a scale and an offset of its own. A channel that stands still, or runs along
    a straight line, fits any other such channel: it must fit, but proves nothing.

    Args:
        first: Shape (rows, channels).
        other: Shape (rows, channels), as many rows.
        steps: The resolution of each channel, shape (channels,).
    """
    own, copy = first.astype(np.float64), other.astype(np.float64)
    a, b = own - own.mean(axis=0), copy - copy.mean(axis=0)
    size = (a * a).sum(axis=0)
    scale = (a * b).sum(axis=0) / np.where(size > 0, size, 1.0)
    exact = _float_error(own) * np.abs(scale) + _float_error(copy)
    rounding = _HALF * steps * (1.0 + np.abs(scale)) + exact
    if (np.abs(b - scale * a) > rounding).any():
        return False
    bent = np.abs(np.diff(copy, n=2, axis=0)).max(axis=0, initial=0.0) > CLEAR * rounding
    return int(np.count_nonzero(bent)) * (len(own) - 2) >= LEAST


def scaled_over_channels(
    first: NDArray[np.float32], other: NDArray[np.float32], steps: NDArray[np.float64]
) -> bool:
    """Return whether one reading is the other, all channels scaled and offset alike.

    Up to rounding; where few channels differ from each other, scale and offset fit any reading.

    Args:
        first: Shape (channels,).
        other: Shape (channels,).
        steps: The resolution of each channel, shape (channels,).
    """
    own, copy = first.astype(np.float64), other.astype(np.float64)
    a, b = own - own.mean(), copy - copy.mean()
    scale = (a @ b) / max(float(a @ a), np.finfo(float).tiny)
    exact = _FLOAT * np.finfo(np.float32).eps * (np.abs(own).max() * abs(scale)
                                                 + np.abs(copy).max())  # fmt: skip
    rounding = _HALF * steps * (1.0 + abs(scale)) + exact
    if (np.abs(b - scale * a) > rounding).any():
        return False
    levels = np.unique(np.round(copy / max(CLEAR * float(rounding.max()), np.finfo(float).tiny)))
    return len(levels) >= LEAST + 2


def _float_error(values: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return what 32-bit rounding may change in each channel, shape (channels,)."""
    largest = np.abs(values).max(axis=0, initial=0.0)
    return np.asarray(_FLOAT * np.finfo(np.float32).eps * largest, np.float64)
