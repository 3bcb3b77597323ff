"""Single numbers about a sensor or an array: hysteresis, range, uniformity, ghosts.

Pure functions of numbers. Knows nothing about recordings, files or fits.

Background of our choices: docs/decisions/0022.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from taxel.calibration.curves import Curve
from taxel.calibration.fitting import DRAWS, bands_of

ABOVE_NOISE = 3.0
"""Standard deviations above rest from which a force is usable. Our choice."""
WORST_SHARE = 0.5
"""A force is usable where its 95 % interval is at most this share of it, either way. Our choice."""
OUTLIER_SIGMAS = 3.5
"""Robust standard deviations from the median beyond which a sensor is named. Source: Iglewicz
and Hoaglin's rule for the modified z-score."""
OUTLIER_SHARE = 0.25
"""And at least this share off the median: among alike sensors small differences are
no fault. Our choice."""
REFERENCE_SHARE = 0.01
"""As above, for pins at one known voltage. Our choice: about twice the ±0.4 % of a board."""
GHOST_SHARE = 0.005
"""Ghosts surely above this share of the pressed sensor are named. Our choice."""

Interval = tuple[float, float, float]
"""Value, lower and upper end of its 95 % interval, or median and quartiles."""
Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True, kw_only=True)
class Hysteresis:
    """How much higher equal forces read in falling than in rising series."""

    mean_pct: float
    """Mean over the forces, % of the curve's span; NaN where both directions are not known."""
    low_pct: float
    """Lower end of its 95 % interval: presses drawn anew."""
    high_pct: float
    largest_pct: float
    """The force at which it is largest, sign dropped."""


def hysteresis(
    curve: Curve, force_n: Array, volts: Array, rising: NDArray[np.bool_], rng: np.random.Generator
) -> Hysteresis:
    """Return the hysteresis of one sensor; each press is judged against the curve, so that
    forces need not be equal.

    Args:
        curve: The sensor's.
        force_n: Shape (presses,).
        volts: Shape (presses,).
        rising: Shape (presses,).
        rng: For the interval.
    """
    off = 100.0 * (volts - curve.volts(force_n)) / float(curve.volts(force_n.max()))
    bands = bands_of(force_n)
    pairs = [
        (off[(bands == b) & ~rising], off[(bands == b) & rising])
        for b in np.unique(bands)
        if (~rising[bands == b]).any() and rising[bands == b].any()
    ]
    if not pairs:
        return Hysteresis(mean_pct=math.nan, low_pct=math.nan, high_pct=math.nan,
                          largest_pct=math.nan)  # fmt: skip
    gaps = [float(down.mean() - up.mean()) for down, up in pairs]
    drawn = sum(_means(down, rng) - _means(up, rng) for down, up in pairs) / len(pairs)
    low, high = np.percentile(drawn, [2.5, 97.5])
    return Hysteresis(
        mean_pct=float(np.mean(gaps)),
        low_pct=float(low),
        high_pct=float(high),
        largest_pct=float(np.max(np.abs(gaps))),
    )


def _means(values: Array, rng: np.random.Generator) -> Array:
    """Return the means of values drawn anew, shape (DRAWS,)."""
    return np.asarray(values[rng.integers(0, len(values), (DRAWS, len(values)))].mean(axis=1))


def quartiles(values: Array) -> Interval:
    """Return median, lower and upper quartile; NaN where no value is finite.

    Args:
        values: Shape (n,); those that are not finite are left out.
    """
    known = values[np.isfinite(values)]
    if len(known) == 0:
        return math.nan, math.nan, math.nan
    low, middle, high = np.percentile(known, [25, 50, 75])
    return float(middle), float(low), float(high)


def repeatability_v(curve: Curve, force_n: Array, volts: Array, rising: NDArray[np.bool_]) -> float:
    """Return the standard deviation of equal presses, volts: about the mean of their force
    and direction; NaN where no press was repeated.

    Args:
        curve: What the presses should give.
        force_n: Shape (presses,).
        volts: Shape (presses,).
        rising: Shape (presses,): in a rising series or a falling one.
    """
    off = volts - curve.volts(force_n)
    cells = bands_of(force_n) * 2 + rising
    squares, freedom = 0.0, 0
    for cell in np.unique(cells):
        own = off[cells == cell]
        squares += float(np.sum((own - own.mean()) ** 2))
        freedom += len(own) - 1
    return math.sqrt(squares / freedom) if freedom else math.nan


def usable_range(
    curve: Curve, noise_v: float, spread_v: float, from_n: float, up_to_n: float
) -> tuple[float, float]:
    """Return the smallest and the largest force in this sensor's range, newtons.

    Smallest: where the curve stands `ABOVE_NOISE` times above the noise (below `from_n` that
    is the curve's word alone, no press was made there). Largest: up to where 1.96 spreads
    are at most `WORST_SHARE` of the force on the way from there; NaN both where none is.

    Args:
        curve: The sensor's.
        noise_v: Of the smoothed signal at rest, volts.
        spread_v: Standard deviation of presses about the curve, volts.
        from_n: Smallest force that was pressed.
        up_to_n: Largest.
    """
    grid = np.geomspace(min(from_n, 0.1) / 10, up_to_n, 2000)
    volts = curve.volts(grid)
    clear = np.flatnonzero(volts - (curve.volts(0.0) if curve.form == "line" else 0.0)
                           >= ABOVE_NOISE * noise_v)  # fmt: skip
    if len(clear) == 0:
        return math.nan, math.nan
    sure = 1.96 * spread_v / curve.slope_v_per_n(grid) <= WORST_SHARE * grid
    both = np.flatnonzero(sure & (np.arange(len(grid)) >= clear[0]))
    if len(both) == 0:
        return math.nan, math.nan
    first = int(both[0])
    breaks = np.flatnonzero(~sure[first:])
    last = first + int(breaks[0]) - 1 if len(breaks) else len(grid) - 1
    return float(grid[first]), float(grid[last])


@dataclass(frozen=True, slots=True, kw_only=True)
class Uniformity:
    """How alike channels are at one and the same input."""

    at: str
    """Which input, such as "1.58 N" or "3.3 V"."""
    volts: tuple[float, ...]
    """One a channel; NaN where it is not known."""
    at_least: tuple[bool, ...]
    """One a channel: the converter was at its end, so the value says "at least"."""
    spread_pct: float
    """Standard deviation over the channels that are neither named nor at an end, % of the
    median."""
    range_pct: float
    """Largest less smallest of the same, % of the median."""
    outliers: tuple[str, ...]
    """Channels far from the median, by name."""


def uniformity(
    at: str, volts: Array, at_least: NDArray[np.bool_], names: Sequence[str], least_share: float
) -> Uniformity:
    """Return how alike channels are.

    Args:
        at: Which input.
        volts: Shape (channels,).
        at_least: Shape (channels,).
        names: One a channel.
        least_share: How far off the median a channel must be to be named, relative.
    """
    measured = np.isfinite(volts) & ~at_least
    median = float(np.median(volts[measured])) if measured.any() else math.nan
    far = np.zeros(len(volts), bool)
    if measured.sum() >= 3 and median > 0:
        off = np.abs(volts / median - 1.0)
        sigma = 1.4826 * float(np.median(off[measured]))
        far = measured & (off > max(OUTLIER_SIGMAS * sigma, least_share))
    like = volts[measured & ~far] / median
    return Uniformity(
        at=at,
        volts=tuple(map(float, volts)),
        at_least=tuple(map(bool, at_least)),
        spread_pct=100.0 * float(like.std(ddof=1)) if len(like) > 1 else math.nan,
        range_pct=100.0 * float(np.ptp(like)) if len(like) > 1 else math.nan,
        outliers=tuple(name for name, outlying in zip(names, far, strict=True) if outlying),
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class Ghosts:
    """What channels show while another one is pressed."""

    share: tuple[tuple[float, ...], ...]
    """Row: the pressed sensor; column: who shows it; 1 on the diagonal, NaN where no press."""
    error: tuple[tuple[float, ...], ...]
    """Standard error of each."""
    named: tuple[str, ...]
    """Those surely above `GHOST_SHARE`, largest first, as "pressed → shows: share"."""


def ghosts(shares: Array, pressed: NDArray[np.int64], names: Sequence[str]) -> Ghosts:
    """Return the cross-talk matrix.

    Args:
        shares: Shape (presses, channels): area of each channel over the pressed one's.
        pressed: Shape (presses,): which channel was.
        names: One a channel.
    """
    c = len(names)
    mean, error = np.full((c, c), np.nan), np.full((c, c), np.nan)
    for row in range(c):
        on_row = shares[pressed == row]
        on_row = on_row[np.isfinite(on_row).all(axis=1)]
        if len(on_row) > 1:
            mean[row] = on_row.mean(axis=0)
            error[row] = on_row.std(axis=0, ddof=1) / math.sqrt(len(on_row))
    outliers = []
    for row, column in np.argwhere(np.abs(mean) - 2.0 * error > GHOST_SHARE):
        if row != column:
            share = float(mean[row, column])
            outliers.append((abs(share), f"{names[row]} → {names[column]}: {share:.1%}"))
    return Ghosts(
        share=tuple(tuple(map(float, row)) for row in mean),
        error=tuple(tuple(map(float, row)) for row in error),
        named=tuple(text for _, text in sorted(outliers, reverse=True)),
    )
