"""Clocks, and the fit of a device's clock to the host's.

Every stage takes a `Clock`, so that tests run on a `ManualClock` without
sleeping. Knows nothing about samples, files or devices.
"""

from __future__ import annotations

import time
from collections import deque
from typing import Protocol

import numpy as np


class Clock(Protocol):
    """Monotonic seconds, and a way to wait."""

    def now_s(self) -> float:
        """Return monotonic time, seconds."""
        ...

    def sleep(self, duration_s: float) -> None:
        """Wait for a duration, seconds; nothing happens for zero or less."""
        ...


class SystemClock:
    """The host's monotonic clock."""

    def now_s(self) -> float:
        return time.monotonic()

    def sleep(self, duration_s: float) -> None:
        if duration_s > 0:
            time.sleep(duration_s)


def asleep_s() -> float:
    """Return how long this machine has slept (suspended) since its start, seconds.

    Its monotonic clock stands still meanwhile: no time seems to be missing. 0 where the system does
    not say. Never more than is true, whatever runs between the looks at two clocks.
    """
    if not hasattr(time, "CLOCK_BOOTTIME"):
        return 0.0
    since_start_s = time.clock_gettime(time.CLOCK_BOOTTIME)
    return max(0.0, since_start_s - time.clock_gettime(time.CLOCK_MONOTONIC))


class ManualClock:
    """A clock that moves only when told to; `sleep` moves it."""

    def __init__(self, start_s: float = 0.0) -> None:
        self._now_s = start_s

    def now_s(self) -> float:
        return self._now_s

    def sleep(self, duration_s: float) -> None:
        self.advance(max(0.0, duration_s))

    def advance(self, duration_s: float) -> None:
        """Move the clock forward, seconds.

        Raises:
            ValueError: The duration is negative.
        """
        if duration_s < 0:
            raise ValueError(f"needed a duration of at least 0 s; got {duration_s} s")
        self._now_s += duration_s


class ClockFit:
    """Estimate host time from device time, causally, from arrivals that can only be late.

    An arrival is the true moment plus a delay that is never negative, so the
    earliest arrival in each second of device time lies nearest the truth (the
    lower envelope). A Theil–Sen line through the envelope of the last
    `span_s` seconds gives rate and offset, unmoved by a second in which all
    was late.

    Source: docs/decisions/0003; measured bias 0.3 ms where least squares gives 2.0 ms.
    """

    def __init__(self, bin_s: float = 1.0, span_s: float = 30.0) -> None:
        self._bin_s = bin_s
        self._points: deque[tuple[float, float]] = deque(maxlen=max(2, round(span_s / bin_s)))
        self._bin: int | None = None
        self._best: tuple[float, float] | None = None
        self._rate = 1.0
        self._offset_s: float | None = None

    @property
    def rate(self) -> float:
        """Host seconds a device second; 1.00004 is a device 40 ppm slow."""
        return self._rate

    def add(self, device_s: float, arrival_s: float) -> None:
        """Take in one arrival; both clocks in seconds, device time not decreasing."""
        index = int(device_s // self._bin_s)
        delay = arrival_s - device_s
        if self._bin is None or index != self._bin:
            if self._best is not None:
                self._points.append(self._best)
                self._fit()
            self._bin, self._best = index, (device_s, delay)
        elif self._best is None or delay < self._best[1]:
            self._best = (device_s, delay)
        if self._offset_s is None or len(self._points) < 2:
            known = [delay for _, delay in self._points]
            best = [self._best[1]] if self._best is not None else []
            self._offset_s = min(known + best)

    def host_s(self, device_s: float) -> float:
        """Return the host time at which the device's clock showed `device_s`.

        Raises:
            ValueError: No arrival was added yet.
        """
        if self._offset_s is None:
            raise ValueError("needed at least one arrival before the fit can be read; got none")
        return device_s + self._offset_s + (self._rate - 1.0) * device_s

    def _fit(self) -> None:
        if len(self._points) < 2:
            return
        points = np.array(self._points)
        device, delay = points[:, 0], points[:, 1]
        i, j = np.triu_indices(len(points), 1)
        slope = float(np.median((delay[j] - delay[i]) / (device[j] - device[i])))
        self._rate = 1.0 + slope
        self._offset_s = float(np.median(delay - slope * device))
