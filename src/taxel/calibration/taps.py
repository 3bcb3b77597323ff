"""Find taps in one channel while its scans come, and measure each: height, response, recovery.

Needs no marks: whoever or whatever taps, a tap is what stands clearly above rest and has gone
again. Memory stays constant over any number of taps. Knows nothing about forces or files.

Background of our choices: docs/decisions/0047.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from taxel.calibration.responses import recovery_s, rise_s

REST_S = 2.0
"""Untouched head in which rest and noise are measured, seconds. Our choice, 0047."""
_CLEAR = 20.0
"""A tap stands so many deviations above rest, as in `responses`. Our choice, 0022."""
_LEAST_V = 0.05
"""And so much at least, volts: rest at the converter's lower end has no noise. Our choice, 0047."""
_GONE = 0.1
"""A tap is over below this share of its height: the end of its recovery."""
_BEFORE_S = 0.05
"""A tap's rise is looked for from so long before it, seconds. Our choice, docs/decisions/0047."""
PAUSE_S = 1.5
"""After so long without a tap the baseline is measured anew, seconds: five time constants of 0.2 s
and half a second to measure. Our choice, docs/decisions/0047."""
_LOOK_S = 0.5
"""On the last so many seconds of the pause. Our choice, docs/decisions/0047."""
_LONGEST_S = 5.0
"""What has not gone after so long is no tap, seconds. Our choice, docs/decisions/0047."""

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Tap:
    """One tap."""

    at_s: float
    """When it rose above the threshold, fitted clock, seconds."""
    height: float
    """Peak above the baseline, in the channel's unit."""
    response_s: float
    """10 to 90 % of the height; NaN where it is not clear."""
    recovery_s: float
    """90 to 10 % of the height; NaN where it is not clear."""
    at_end: bool
    """The converter was at its end: the height says "at least"."""


class TapMeter:
    """Measures one channel's taps.

    Args:
        rate_hz: Scans a second.
    """

    def __init__(self, rate_hz: float) -> None:
        self._rate_hz = rate_hz
        self._values = np.zeros(0)
        self._time_s = np.zeros(0)
        self._ends = np.zeros(0, bool)
        self._base: float | None = None
        self._rise_v = 0.0
        self._gone_s = -math.inf
        self.taps: list[Tap] = []
        """So far, oldest first."""

    def push(self, values: Array, time_s: Array, at_end: NDArray[np.bool_]) -> None:
        """Take in scans.

        Args:
            values: One channel, shape (n,), NaN where not usable: held at the value before.
            time_s: Fitted clock, shape (n,), seconds.
            at_end: Where the converter was at its end, shape (n,).
        """
        self._values = _held(np.concatenate([self._values, values]))
        self._time_s = np.concatenate([self._time_s, time_s])
        self._ends = np.concatenate([self._ends, at_end])
        if self._base is None:
            self._learn_rest()
        while self._base is not None and self._take_one(self._base):
            pass

    def _learn_rest(self) -> None:
        head = round(REST_S * self._rate_hz)
        if len(self._values) < head:
            return
        rest = self._values[:head]
        self._base = float(np.median(rest))
        self._rise_v = max(_CLEAR * float(rest.std()), _LEAST_V)
        self._drop(head)

    def _take_one(self, base: float) -> bool:
        """Measure the next tap if it is over; return whether there may be another."""
        above = self._values - base
        risen = np.flatnonzero(above > self._rise_v)
        if not len(risen):
            self._drop(max(0, len(above) - round((_LOOK_S + _BEFORE_S) * self._rate_hz)))
            return False
        first = int(risen[0])
        base = self._rested(first, base)
        above = self._values - base
        longest = round(_LONGEST_S * self._rate_hz)
        inside = above[first : first + longest]
        # Gone as a tap, and low enough not to be taken for the next.
        level = np.minimum(_GONE * np.maximum.accumulate(inside), self._rise_v)
        low = np.flatnonzero(inside < level)
        if not len(low):
            if len(inside) < longest:
                return False
            self._base = float(np.median(self._values[first : first + longest]))
            self._drop(first + longest)  # it stays: that is the new rest
            return True
        gone = first + int(low[0])
        if gone + 2 >= len(above):  # the mean over neighbours wants the next two
            return False
        self._base = base
        start = max(0, first - round(_BEFORE_S * self._rate_hz))
        self._measure(
            above[start : gone + 2], self._time_s[first], bool(self._ends[first:gone].any())
        )
        self._gone_s = float(self._time_s[gone])
        self._drop(gone)
        return True

    def _rested(self, first: int, base: float) -> float:
        """Return the baseline of the tap that rises at `first`: anew after a pause."""
        look, margin = (round(part * self._rate_hz) for part in (_LOOK_S, _BEFORE_S / 2))
        quiet_s = float(self._time_s[first]) - self._gone_s
        if quiet_s < PAUSE_S or first < margin + look // 2:
            return base
        return float(np.median(self._values[max(0, first - margin - look) : first - margin]))

    def _measure(self, above: Array, at_s: float, at_end: bool) -> None:
        peak = int(np.argmax(above))
        height = float(above[max(0, peak - 1) : peak + 2].mean())
        self.taps.append(
            Tap(
                at_s=float(at_s),
                height=height,
                response_s=math.nan if at_end else rise_s(above, peak, height, self._rate_hz),
                recovery_s=math.nan if at_end else recovery_s(above, peak, height, self._rate_hz),
                at_end=bool(at_end),
            )
        )

    def _drop(self, scans: int) -> None:
        self._values, self._time_s = self._values[scans:], self._time_s[scans:]
        self._ends = self._ends[scans:]


def _held(values: Array) -> Array:
    """Return values with the last usable one in place of each NaN; 0 before the first."""
    good = np.isfinite(values)
    if good.all():
        return values
    last = np.maximum.accumulate(np.where(good, np.arange(len(values)), -1))
    return np.where(last >= 0, values[np.maximum(last, 0)], 0.0)
