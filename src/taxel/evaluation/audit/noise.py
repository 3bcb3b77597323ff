"""Trials that share their noise from row to row, wherever they start: copies, shifted or cut.

Touch may repeat, noise never does. Second differences are mostly noise; limited, so that no edge of
touch outweighs it, they are compared at every lag. A copy stands out at one lag, from all other
lags (hum and tones repeat) and from all other trials (edges meet). Knows nothing about
labels.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy import fft

SAME, BY_CHANCE = 0.5, 10.0
"""Least correlation of copies at their lag; where few differences say something, so much over the
root of their number. Our choice, docs/decisions/0023."""
ALONE = 2.2
"""A copy's correlation over that with the tenth nearest trial, and over that at other lags, at
least. Our choice, decision 23."""
_LIMIT = 3.0
"""Medians to which a difference is limited."""
_MIXED = 4
"""Channels, or sums of channels with random signs, that are compared."""
_TENTH = 10
_NEAR = 4
"""Lags beside the best one that belong to it."""
MANY = 2000
"""Trials that are compared; beyond, an even choice of them."""
_WORK, _HELD, _STRETCH = 1_500_000_000, 6_250_000, 256
"""Trials² × rows that are compared, about 20 s, and trials × rows that are held, 0.5 GB; beyond,
the middle rows of each, 256 at least."""

Table = NDArray[np.float32]


def shared_noise(rows: tuple[Table, ...]) -> tuple[dict[tuple[int, int], float], ...]:
    """Return pairs of trials that share their noise, as they are and with one run backwards.

    Args:
        rows: The trials, each shape (rows, channels).

    Returns:
        Pairs (lower number first) → correlation, for either way.
    """
    index, longest = _compared(rows)
    fine = [_fine(rows[i], longest) for i in index]
    size = fft.next_fast_len(2 * longest, real=True)
    spectra = np.stack([fft.rfft(trace, size, axis=0) for trace in fine], axis=2)
    count = np.array([np.count_nonzero(trace) for trace in fine])
    least = np.maximum(SAME, BY_CHANCE / np.sqrt(np.maximum(count, 1)))
    return tuple(_pairs(spectra, other, size, least, index)
                 for other in (spectra.conj(), spectra))  # fmt: skip


def left_out(rows: tuple[Table, ...]) -> str:
    """Return a sentence on what of some trials is not compared; empty where all is."""
    index, longest = _compared(rows)
    if len(index) == len(rows) and longest >= max(map(len, rows)):
        return ""
    return f"Of {len(rows)} trials {len(index)} are compared, of each {longest} rows at most."


def _compared(rows: tuple[Table, ...]) -> tuple[NDArray[np.intp], int]:
    """Return which trials are compared, and how many rows of each at most."""
    n = min(len(rows), MANY)
    index = np.unique(np.linspace(0, len(rows) - 1, n).round().astype(np.intp))
    most = max(_STRETCH, min(_WORK // n**2, _HELD // n))
    return index, min(max(map(len, rows)), most)


def _fine(rows: Table, longest: int) -> Table:
    """Return what changes from row to row in the middle rows, shape (rows − 2, mixed), norm 1."""
    first = (len(rows) - min(len(rows), longest)) // 2
    change = np.diff(rows[first : first + longest].astype(np.float64), n=2, axis=0)
    usual = np.median(np.abs(change), axis=0) if len(change) else np.zeros(rows.shape[1])
    change = np.clip(change / np.where(usual > 0, usual, 1e-12), -_LIMIT, _LIMIT)
    size = np.linalg.norm(change, axis=0)
    change /= np.where(size > 0, size, 1.0)
    if change.shape[1] > _MIXED:
        change = change @ np.random.default_rng(0).choice((-1.0, 1.0), (change.shape[1], _MIXED))
    return np.asarray(change / max(float(np.linalg.norm(change)), 1e-12), np.float32)


def _pairs(
    own: NDArray[np.complex64],
    other: NDArray[np.complex64],
    size: int,
    least: NDArray[np.float64],
    index: NDArray[np.intp],
) -> dict[tuple[int, int], float]:
    """Return pairs that stand out at one lag, from other lags and other trials."""
    n = own.shape[2]
    best = np.zeros((n, n), np.float32)
    for place in range(n - 1):
        lags = _lags(own, other, place, slice(place + 1, n), size)
        best[place, place + 1 :] = best[place + 1 :, place] = lags.max(axis=0)
    tenth = min(_TENTH, max(1, n // 3))
    usual = np.partition(best, -tenth, axis=1)[:, -tenth]
    alone = best >= np.maximum(ALONE * np.maximum(usual[:, None], usual),
                               np.maximum(least[:, None], least))  # fmt: skip
    found = {}
    for a, b in np.argwhere(np.triu(alone, 1)):
        lags = _lags(own, other, a, slice(b, b + 1), size)[:, 0]
        lags[(lags.argmax() + np.arange(-_NEAR, _NEAR + 1)) % size] = 0.0
        if best[a, b] >= ALONE * np.abs(lags).max():
            found[int(index[a]), int(index[b])] = float(best[a, b])
    return found


def _lags(
    own: NDArray[np.complex64],
    other: NDArray[np.complex64],
    trace: int,
    others: slice,
    size: int,
) -> Table:
    """Return a trial's correlation with others at every lag, shape (size, others)."""
    product = (own[:, None, :, trace] @ other[:, :, others])[:, 0]
    return np.asarray(fft.irfft(product, size, axis=0, overwrite_x=True), np.float32)
