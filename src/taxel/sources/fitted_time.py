"""Turn a device's clock and late arrivals into the fitted time of each scan, as they come.

Knows nothing about any one sensor.

Background of our choices: docs/decisions/0014.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from taxel.clock import ClockFit

_STEP_S = 0.1
"""The fit learns at most once in this time, seconds: its envelope keeps only the earliest
arrival of a second, so that ten a second lose nothing and cost nothing. Our choice."""


class FittedTime:
    """The fitted time of each scan, from nothing but what had arrived before it.

    A device that was restarted needs a new one, as its clock begins anew.
    """

    def __init__(self) -> None:
        self._fit = ClockFit()
        self._last_s = -np.inf

    def of(
        self, device_s: NDArray[np.float64], arrival_s: NDArray[np.float64]
    ) -> NDArray[np.float64]:
        """Return the times at which scans were taken, on the arrivals' clock, never decreasing.

        Args:
            device_s: Shape (n,): the device's clock, seconds, not decreasing.
            arrival_s: Shape (n,): when each scan arrived, seconds.
        """
        fitted = np.empty(len(device_s))
        steps = np.flatnonzero(np.diff(np.floor(device_s / _STEP_S)) > 0) + 1
        for part in np.split(np.arange(len(device_s)), steps):
            if len(part):
                fitted[part] = self._step(device_s[part], arrival_s[part])
        if not len(fitted):
            return fitted
        fitted = np.maximum.accumulate(np.maximum(fitted, self._last_s))
        self._last_s = float(fitted[-1])
        return fitted

    def _step(
        self, device_s: NDArray[np.float64], arrival_s: NDArray[np.float64]
    ) -> NDArray[np.float64]:
        delay_s = arrival_s - device_s
        if self._last_s == -np.inf:
            fitted: NDArray[np.float64] = device_s + np.minimum.accumulate(delay_s)
            self._last_s = float(fitted[0])
        else:
            fitted = device_s * self._fit.rate + self._fit.host_s(0.0)
        earliest = int(np.argmin(delay_s))
        self._fit.add(float(device_s[earliest]), float(arrival_s[earliest]))
        return fitted
