"""Where the signal rests: smoothing, baselines with their drift, noise and hum.

Knows nothing about forces, curves or files.

Background of our choices: docs/decisions/0022.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

SMOOTH_S = 0.02
"""Length of the moving mean before anything is read off, seconds: one period of 50 Hz, which
it removes with all its harmonics; 60 Hz is left at a sixth. Our choice, docs/decisions/0022."""
BLOCK_S = 0.25
"""Rest is averaged in blocks of this length, seconds. Our choice."""
_MOST_BLOCKS = 300
"""Blocks that a line is laid through at most: all pairs of them are looked at. Our choice."""
_HUMS_HZ = (50.0, 60.0)
"""Mains hum that is measured at rest, hertz."""


@dataclass(frozen=True, slots=True, kw_only=True)
class RestLine:
    """A channel's baseline as a straight line over time."""

    at_s: float
    """The moment that `level` belongs to, on the scans' fitted clock, seconds."""
    level: float
    """In the channel's unit."""
    per_hour: float
    """Drift, in the channel's unit an hour."""
    per_hour_95: tuple[float, float]
    """Its 95 % interval; NaN where it is not known."""

    def at(self, time_s: NDArray[np.float64] | float) -> NDArray[np.float64]:
        """Return the baseline at moments in seconds, in the channel's unit; shape as `time_s`."""
        return np.asarray(self.level + self.per_hour * (np.asarray(time_s) - self.at_s) / 3600.0)


@dataclass(frozen=True, slots=True, kw_only=True)
class Noise:
    """What a channel does at rest."""

    rms_v: float
    """About the mean of each block, at the full rate, in the channel's unit."""
    told_rms_v: float
    """The same after smoothing: what a measured press is blurred by."""
    hum_50_v: float
    """Amplitude at 50 Hz."""
    hum_60_v: float
    """Amplitude at 60 Hz."""
    at_floor: float
    """Share of scans that read 0: the converter hides what lies below, and noise with it."""


def smoothed(values: NDArray[np.floating], rate_hz: float) -> NDArray[np.float64]:
    """Return the centred moving mean over `SMOOTH_S`, same shape (n, channels); the ends have
    fewer values in it. Values that are not finite have no part in it; 0 where no value has.
    """
    n = len(values)
    if n == 0:
        return np.zeros(values.shape)
    width = min(max(1, round(SMOOTH_S * rate_hz)), n)
    means = np.empty(values.shape, np.float64)
    for channel in range(values.shape[1]):  # one after another: a long recording is large
        column = values[:, channel].astype(np.float64)
        known = np.isfinite(column)
        total = _moving_sum(np.where(known, column, 0.0), width)
        count = _moving_sum(known.astype(np.float64), width)
        means[:, channel] = np.where(count > 0, total / np.maximum(count, 1.0), 0.0)
    return means


def _moving_sum(values: NDArray[np.float64], width: int) -> NDArray[np.float64]:
    """Return the sum of the `width` values around each, shape (n,); beyond the ends there is 0."""
    n, before = len(values), width // 2
    total = np.zeros(n + width)
    total[before + 1 : before + 1 + n] = values
    np.cumsum(total, out=total)
    return np.asarray(total[width:] - total[:n])


def rest_blocks(resting: NDArray[np.bool_], rate_hz: float) -> list[slice]:
    """Return runs of rest cut into blocks of about `BLOCK_S`; shorter runs are left out.

    Args:
        resting: Shape (n,).
        rate_hz: Scans a second.
    """
    edges = np.flatnonzero(np.diff(np.concatenate([[False], resting, [False]]).astype(np.int8)))
    length = max(2, round(BLOCK_S * rate_hz))
    blocks = []
    for start, end in zip(edges[::2].tolist(), edges[1::2].tolist(), strict=True):
        count = (end - start) // length
        blocks += [slice(start + i * length, start + (i + 1) * length) for i in range(count)]
    return blocks


def rest_line(time_s: NDArray[np.float64], level: NDArray[np.float64]) -> RestLine:
    """Return the Theil–Sen line through block means, with Sen's 95 % interval of its slope.

    Args:
        time_s: Shape (blocks,), the middles of the blocks, seconds, increasing.
        level: Shape (blocks,), their means.

    Raises:
        ValueError: There is no block.
    """
    if len(time_s) == 0:
        raise ValueError("needed a stretch of rest; got none")
    step = max(1, math.ceil(len(time_s) / _MOST_BLOCKS))
    t, v = time_s[::step], level[::step]
    middle = float(np.median(t))
    if len(t) < 3 or t[-1] - t[0] <= 0:
        nothing = (math.nan, math.nan)
        return RestLine(at_s=middle, level=float(np.median(v)), per_hour=0.0, per_hour_95=nothing)
    i, j = np.triu_indices(len(t), 1)
    slopes = np.sort((v[j] - v[i]) / (t[j] - t[i]) * 3600.0)
    slope = float(np.median(slopes))
    # Sen 1968: the slopes' ranks at which Kendall's statistic stays inside its 95 %.
    n = len(t)
    reach = 1.96 * math.sqrt(n * (n - 1) * (2 * n + 5) / 18.0)
    low = max(0, int((len(slopes) - reach) / 2))
    high = min(len(slopes) - 1, math.ceil((len(slopes) + reach) / 2))
    return RestLine(
        at_s=middle,
        level=float(np.median(v - slope * (t - middle) / 3600.0)),
        per_hour=slope,
        per_hour_95=(float(slopes[low]), float(slopes[high])),
    )


def measure_noise(
    values: NDArray[np.floating],
    smooth: NDArray[np.float64],
    blocks: Sequence[slice],
    rate_hz: float,
) -> Noise:
    """Return the noise of one channel over its blocks of rest; NaN where there are none.

    Args:
        values: Shape (n,), as recorded.
        smooth: Shape (n,), smoothed.
        blocks: Of rest.
        rate_hz: Scans a second.
    """
    if not blocks:
        return Noise(rms_v=math.nan, told_rms_v=math.nan, hum_50_v=math.nan,
                     hum_60_v=math.nan, at_floor=math.nan)  # fmt: skip
    chosen = blocks[:: max(1, len(blocks) // _MOST_BLOCKS)]
    length = chosen[0].stop - chosen[0].start
    raw = np.stack([values[block] for block in chosen]).astype(np.float64)
    calm = np.stack([smooth[block] for block in chosen])
    hums = [_hum(raw, hum_hz, rate_hz) for hum_hz in _HUMS_HZ]
    return Noise(
        rms_v=float(np.sqrt(np.mean(raw.var(axis=1)) * length / (length - 1))),
        # About the channel's own line a block's mean may wander: that blurs a press as well.
        told_rms_v=float(np.sqrt(np.mean(calm.var(axis=1)))),
        hum_50_v=hums[0],
        hum_60_v=hums[1],
        at_floor=float(np.mean(raw <= 0.0)),
    )


def _hum(blocks: NDArray[np.float64], hum_hz: float, rate_hz: float) -> float:
    """Return the amplitude of one frequency, its share of white noise taken away.

    Args:
        blocks: Shape (blocks, n).
        hum_hz: Which frequency.
        rate_hz: Scans a second; below twice `hum_hz` the answer is NaN.
    """
    n = blocks.shape[1]
    turns = hum_hz / rate_hz * np.arange(n)
    if 2 * hum_hz >= rate_hz or turns[-1] < 3:
        return math.nan
    others = [other for other in _HUMS_HZ if 2 * other < rate_hz]
    waves = [np.ones(n)]
    for other in [hum_hz, *(other for other in others if other != hum_hz)]:
        phase = 2 * np.pi * other / rate_hz * np.arange(n)
        waves += [np.sin(phase), np.cos(phase)]
    design = np.stack(waves, axis=1)
    found, *_ = np.linalg.lstsq(design, blocks.T, rcond=None)
    left = blocks.T - design @ found
    variance = float(np.mean(left**2)) * n / (n - len(waves))
    power = float(np.mean(found[1] ** 2 + found[2] ** 2)) - 4.0 * variance / n
    return math.sqrt(max(power, 0.0))
