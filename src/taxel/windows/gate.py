"""The contact gate: which rows hold contact, and a threshold from measured noise.

Knows nothing about windows, files or models.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

NOISE_SIGMAS = 6.0
"""Standard deviations above rest that count as contact. Source: our choice, docs/decisions/0003."""
_SIGMA_PER_MAD = 1.4826
"""Standard deviation over median absolute deviation, for a normal distribution."""


def above_gate(
    values: NDArray[np.float32],
    usable: NDArray[np.bool_] | None,
    gate: float | NDArray[np.float32],
) -> NDArray[np.bool_]:
    """Return which values lie above the gate, shape (n, channels).

    In layout B a row counts as a whole: it is kept with all its channels when any
    usable channel lies above the gate, so that columns stay sensors and rows stay time.

    Args:
        values: Shape (n, channels), in the channels' unit.
        usable: Shape (n, channels); None where all are.
        gate: Threshold in the same unit, for all channels or one a channel, shape (channels,).
    """
    above: NDArray[np.bool_] = values > np.asarray(gate, np.float32)
    return above if usable is None else above & usable


def noise_gate(
    values: NDArray[np.float32], usable: NDArray[np.bool_], sigmas: float = NOISE_SIGMAS
) -> float:
    """Return a threshold measured from the signal's own noise, in the channels' unit.

    Each channel's rest level and noise are its median and its median absolute
    deviation, which stay at rest as long as contact takes less than half of the
    time. The threshold is the highest of the channels'.

    Args:
        values: Shape (n, channels), at least 10 rows.
        usable: Shape (n, channels).
        sigmas: How many standard deviations above rest count as contact.

    Raises:
        ValueError: Fewer than 10 usable values in every channel.
    """
    thresholds = []
    for channel in range(values.shape[1]):
        good = values[usable[:, channel], channel].astype(np.float64)
        if len(good) < 10:
            continue
        rest = np.median(good)
        noise = _SIGMA_PER_MAD * np.median(np.abs(good - rest))
        thresholds.append(float(rest + sigmas * noise))
    if not thresholds:
        raise ValueError(f"needed 10 usable values in a channel; got {len(values)} rows")
    return max(thresholds)
