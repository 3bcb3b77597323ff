"""The common time grid: at each tick, the latest scan if it is fresh enough.

Carries its state from call to call, so that any way of cutting a stream into
calls gives the same rows. Knows nothing about gates, windows or models.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from taxel.signals import Samples, Validity

_SAME_RATE = 0.005
"""Nominal rates closer than this fraction count as one rate: scans are rows."""
_TICK_SLACK_S = 1e-6
"""A scan this close after a tick counts for the tick, seconds: hides float rounding."""


@dataclass(frozen=True, slots=True)
class Rows:
    """Scans on the grid, oldest first."""

    time_s: NDArray[np.float64]
    """Shape (n,), fitted clock, seconds."""
    values: NDArray[np.float32]
    """Shape (n, channels); 0 where not usable."""
    usable: NDArray[np.bool_]
    """Shape (n, channels)."""
    saturated: NDArray[np.bool_]
    """Shape (n, channels)."""

    def __len__(self) -> int:
        return len(self.time_s)


class Grid:
    """Put scans of one sensor array on a common grid, call by call.

    Args:
        grid_hz: Ticks a second; None passes each scan through as a row.
        sensor_hz: The array's nominal rate, hertz.
        max_age_s: Values older than this at a tick are not usable, seconds.
    """

    def __init__(self, grid_hz: float | None, sensor_hz: float, max_age_s: float) -> None:
        same = grid_hz is not None and abs(sensor_hz / grid_hz - 1.0) < _SAME_RATE
        self._period_s = None if grid_hz is None or same else 1.0 / grid_hz
        self._max_age_s = max_age_s
        self._start_s: float | None = None
        self._tick = 0
        self._last: Samples | None = None

    def push(self, samples: Samples) -> Rows:
        """Return the rows that these scans complete; none where they reach no tick."""
        if self._period_s is None:
            return _rows_of(samples, samples.fitted_s)
        if not len(samples):
            return _rows_of(samples, samples.fitted_s)
        if self._start_s is None:
            self._start_s = float(samples.fitted_s[0])
        known = samples if self._last is None else Samples.join([self._last, samples])
        self._last = samples[-1:]
        # A tick is complete once a scan at or after it is known.
        last_tick = int(
            np.floor((known.fitted_s[-1] - self._start_s + _TICK_SLACK_S) / self._period_s)
        )
        ticks_s = self._start_s + self._period_s * np.arange(
            self._tick, last_tick + 1, dtype=np.float64
        )
        self._tick = max(self._tick, last_tick + 1)
        latest = np.searchsorted(known.fitted_s, ticks_s + _TICK_SLACK_S, side="right") - 1
        rows = _rows_of(known[np.maximum(latest, 0)], ticks_s)
        stale = ticks_s - known.fitted_s[np.maximum(latest, 0)] > self._max_age_s
        rows.usable[stale] = False
        rows.values[stale] = 0.0
        return rows


def _rows_of(samples: Samples, time_s: NDArray[np.float64]) -> Rows:
    usable = samples.usable
    return Rows(
        time_s=time_s,
        values=np.where(usable, samples.values, np.float32(0.0)),
        usable=usable,
        saturated=(samples.validity & np.uint8(Validity.SATURATED)) != 0,
    )
