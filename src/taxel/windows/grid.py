"""The common time grid: at each tick, the latest scan if it is fresh enough.

Carries its state from call to call, so that any way of cutting a stream into
calls gives the same rows. Knows nothing about gates, windows or models.

Background of our choices: docs/decisions/0003.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import floor

import numpy as np
from numpy.typing import NDArray

from taxel.errors import BadInput
from taxel.signals import UNUSABLE, Samples, Validity

_SAME_RATE = 0.005
"""Nominal rates closer than this fraction count as one rate: scans are rows."""
_TICK_SLACK_S = 1e-6
"""A scan this close after a tick counts for the tick, seconds: hides float rounding."""
_MOST_EMPTY_TICKS, _MOST_TICKS_A_SCAN = 2_000_000, 100
"""What is put on the grid at once: five hours without a scan at 100 Hz. Source: our choice."""
_UNUSABLE, _SATURATED, _STALE = (
    np.uint8(flag) for flag in (UNUSABLE, Validity.SATURATED, Validity.STALE)
)


@dataclass(slots=True)  # not frozen: made several times a scan, and freezing doubles the cost
class Rows:
    """Scans on the grid, oldest first. Arrays may be views of the samples: not to be written."""

    time_s: NDArray[np.float64]
    """Shape (n,), fitted clock, seconds."""
    values: NDArray[np.float32]
    """Shape (n, channels); 0 where not usable."""
    flags: NDArray[np.uint8]
    """Shape (n, channels): `Validity` flags, those of the scan and STALE."""

    @property
    def usable(self) -> NDArray[np.bool_]:
        """Shape (n, channels): True where the value may be used."""
        found: NDArray[np.bool_] = (self.flags & _UNUSABLE) == 0
        return found

    @property
    def saturated(self) -> NDArray[np.bool_]:
        """Shape (n, channels): True where the value stands at the converter's limit."""
        found: NDArray[np.bool_] = (self.flags & _SATURATED) != 0
        return found

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
        self._last: _Scans | None = None
        self._none: Rows | None = None

    def push(self, samples: Samples) -> Rows:
        """Return the rows that these scans complete; none where they reach no tick."""
        if self._period_s is None or not len(samples):
            return _rows_of(samples.values, samples.validity, samples.fitted_s)
        if self._start_s is None:
            self._start_s = float(samples.fitted_s[0])
            self._none = _rows_of(samples.values[:0], samples.validity[:0], samples.fitted_s[:0])
        # A tick is complete once a scan at or after it is known.
        reached_s = float(samples.fitted_s[-1]) - self._start_s + _TICK_SLACK_S
        last_tick = floor(reached_s / self._period_s)
        before = self._last
        self._last = (samples.fitted_s[-1:], samples.values[-1:], samples.validity[-1:])
        if last_tick < self._tick and self._none is not None:
            return self._none  # the usual case live: most scans complete no tick
        scans = (samples.fitted_s, samples.values, samples.validity)
        if last_tick == self._tick:
            self._tick = last_tick + 1
            tick_s = self._start_s + self._period_s * last_tick
            return self._at_tick(scans if before is None else before, scans, tick_s)
        known = scans if before is None else _joined(before, scans)
        _refuse_jump(last_tick - self._tick, len(samples), self._period_s)
        ticks_s = self._start_s + self._period_s * np.arange(
            self._tick, last_tick + 1, dtype=np.float64
        )
        self._tick = last_tick + 1
        return self._latest(known, ticks_s)

    def _at_tick(self, before: _Scans, scans: _Scans, tick_s: float) -> Rows:
        """Return the row at one tick: `_latest` for the live path's usual case."""
        found = int(scans[0].searchsorted(tick_s + _TICK_SLACK_S, side="right")) - 1
        fitted_s, values, validity = scans if found >= 0 else before
        part = slice(found, found + 1) if found >= 0 else slice(0, 1)
        flags = validity[part]
        if tick_s - float(fitted_s[part][0]) > self._max_age_s:
            flags = flags | _STALE
        return _rows_of(values[part], flags, np.array([tick_s]))

    def _latest(self, known: _Scans, ticks_s: NDArray[np.float64]) -> Rows:
        """Return at each tick the latest scan; not usable where it is too old."""
        fitted_s, values, validity = known
        latest = np.maximum(fitted_s.searchsorted(ticks_s + _TICK_SLACK_S, side="right") - 1, 0)
        flags = validity[latest]
        flags[ticks_s - fitted_s[latest] > self._max_age_s] |= _STALE
        return _rows_of(values[latest], flags, ticks_s)


_Scans = tuple[NDArray[np.float64], NDArray[np.float32], NDArray[np.uint8]]
"""Fitted times (n,), values (n, channels) and validity (n, channels)."""


def _refuse_jump(ticks: int, scans: int, period_s: float) -> None:
    """Refuse scans whose times lie so far apart that the ticks between would fill the memory."""
    if ticks > _MOST_EMPTY_TICKS + _MOST_TICKS_A_SCAN * scans:
        raise BadInput(
            "scans that follow one another", f"{scans} of them over {ticks * period_s:,.0f} s",
            "look at the clock that they were recorded by, or use --window grid=own",
        )  # fmt: skip


def _joined(first: _Scans, second: _Scans) -> _Scans:
    return (
        np.concatenate([first[0], second[0]]),
        np.concatenate([first[1], second[1]]),
        np.concatenate([first[2], second[2]]),
    )


def _rows_of(
    values: NDArray[np.float32], flags: NDArray[np.uint8], time_s: NDArray[np.float64]
) -> Rows:
    unusable = flags & _UNUSABLE
    if unusable.any():
        values = np.where(unusable, np.float32(0.0), values)
    return Rows(time_s, values, flags)
