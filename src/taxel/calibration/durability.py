"""What many taps say of a pad: wear, output against tapping rate, response and recovery time.

Knows nothing about how taps were found, files or screens.

Background of our choices: docs/decisions/0047.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from taxel.calibration.figures_of_merit import Interval, quartiles
from taxel.calibration.taps import Tap

STATED_FOR = 10_000
"""Taps that a loss of output is stated for. Source: the order of durability tests of such pads;
our choice, docs/decisions/0047."""
FEWEST = 20
"""Taps from which a channel is reported, and from which a trend is. Our choice, 0047."""
WIDEST = 2.0
"""Widest 95 % interval with which a loss is stated, as wide as it would be without wear: from few
taps a trend says nothing about so many. Our choice, docs/decisions/0047."""
_LARGEST = 100.0
"""Exponent beyond which a gain is no pad's, and too wide whatever follows. Our choice, 0047."""
_FEWEST_AT_RATE = 5
"""Taps from which a rate has a row. Our choice, docs/decisions/0047."""
_STEADY = 1.5
"""A tap that waited this many times longer than the next one did is left out. Our choice, 0047."""
_OCTAVE_PARTS = 2
"""Rates are put together by half octaves. Our choice, docs/decisions/0047."""

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True, kw_only=True)
class AtRate:
    """Taps of one rate."""

    tap_hz: float
    """Their mean rate, taps a second."""
    taps: int
    height: Interval
    """Mean, in the channel's unit, and its 95 % interval."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Durability:
    """One channel after many taps."""

    channel: str
    taps: int
    at_end: int
    """Taps at the converter's end: they count, and are left out of what follows."""
    tap_hz: float
    """The commonest rate: wear is measured on its taps, so that the rate changes nothing."""
    first: float
    """Height when tapping began, by the trend, in the channel's unit; NaN without one."""
    last: float
    """Height when it ended, by the trend."""
    lost: Interval
    """Share of the height lost in `STATED_FOR` taps, by the trend, 0…1; below 0 is a gain. NaN
    where its interval would be wider than `WIDEST`."""
    response_s: Interval
    """10 to 90 %: median and quartiles, seconds. Whatever taps has its own speed in it."""
    recovery_s: Interval
    """90 to 10 %: median and quartiles, seconds."""
    by_rate: tuple[AtRate, ...]
    """Slowest first."""


def durability_of(channel: str, taps: Sequence[Tap]) -> Durability:
    """Return what one channel's taps say.

    Args:
        channel: Its name.
        taps: Oldest first, at least `FEWEST`.
    """
    good = np.array([not tap.at_end for tap in taps])
    height = np.array([tap.height for tap in taps])
    rate_hz, steady = _rates(np.array([tap.at_s for tap in taps]))
    good &= steady
    bins = np.round(_OCTAVE_PARTS * np.log2(rate_hz))  # half an octave each
    commonest = _commonest(bins[good])
    chosen = np.flatnonzero(good & (bins == commonest))
    first, last, lost = _trend(chosen.astype(np.float64), height[chosen])
    rows = [(each, np.flatnonzero(good & (bins == each))) for each in np.unique(bins[good])]
    return Durability(
        channel=channel,
        taps=len(taps),
        at_end=sum(tap.at_end for tap in taps),
        tap_hz=float(rate_hz[chosen].mean()) if len(chosen) else math.nan,
        first=first,
        last=last,
        lost=lost,
        response_s=quartiles(np.array([taps[i].response_s for i in chosen])),
        recovery_s=quartiles(np.array([taps[i].recovery_s for i in chosen])),
        by_rate=tuple(
            AtRate(tap_hz=float(rate_hz[at].mean()), taps=len(at), height=_mean(height[at]))
            for _, at in rows
            if len(at) >= _FEWEST_AT_RATE
        ),
    )


def _rates(at_s: Array) -> tuple[Array, NDArray[np.bool_]]:
    """Return each tap's rate by the interval to the tap before it, and which rates are steady.

    The first tap after a pause, or at another rate, is not: the pad has rested otherwise. Shapes
    (taps,).
    """
    steps = np.maximum(np.diff(at_s), 1e-6)
    before, after = np.concatenate([steps[:1], steps]), np.concatenate([steps, steps[-1:]])
    return 1.0 / before, before < _STEADY * after


def _commonest(bins: Array) -> float:
    if not len(bins):
        return math.nan
    names, counts = np.unique(bins, return_counts=True)
    return float(names[np.argmax(counts)])


def _trend(number: Array, height: Array) -> tuple[float, float, Interval]:
    """Return height at the first and last tap, and the share lost in `STATED_FOR` taps.

    A straight line through the heights' logarithms, by least squares; 1.96 standard errors.
    """
    nan = math.nan
    if len(number) < FEWEST or height.min() <= 0:
        return nan, nan, (nan, nan, nan)
    middle = number - number.mean()
    logs = np.log(height)
    slope = float(middle @ logs / (middle @ middle))
    off = logs - logs.mean() - slope * middle
    error = math.sqrt(float(off @ off) / (len(number) - 2) / float(middle @ middle))
    ends = np.exp(logs.mean() + slope * middle[[0, -1]])
    up, between, down = (STATED_FOR * (slope + sign * 1.96 * error) for sign in (1, 0, -1))
    # Judged without the trend itself: near a loss of all, even the widest interval looks narrow,
    # so that few taps would state only the losses that chance made too large.
    if up > _LARGEST or up - between > math.asinh(WIDEST / 2.0):
        return float(ends[0]), float(ends[1]), (nan, nan, nan)
    lost = (1.0 - math.exp(between), 1.0 - math.exp(up), 1.0 - math.exp(down))
    return float(ends[0]), float(ends[1]), lost


def _mean(values: Array) -> Interval:
    middle, error = float(values.mean()), float(values.std(ddof=1)) / math.sqrt(len(values))
    return middle, middle - 1.96 * error, middle + 1.96 * error
