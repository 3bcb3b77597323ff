"""Interference that all leads of the hand pick up alike, for a reference channel to take away.

A slow random walk back to zero, as of a charged body that moves near the leads. It changes all
twelve channels by the same voltage at the same scan. Knows nothing about touch or converters.

Background of our choices: docs/decisions/0047.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.signal import lfilter

TIME_CONSTANT_S = 0.25
"""How long it keeps a level, seconds: as slow as a touch, so that no filter parts the two. Our
choice, docs/decisions/0047."""
PICKUP_SEED = 0x9C
"""Marks its own random generator: what else is drawn stays as without it."""


class Pickup:
    """A first-order (Ornstein–Uhlenbeck) voltage, scan by scan.

    Args:
        deviation_v: Its standard deviation, volts.
        rate_hz: Scans a second.
        rng: Its own generator.
    """

    def __init__(self, deviation_v: float, rate_hz: float, rng: np.random.Generator) -> None:
        self._keep = float(np.exp(-1.0 / (TIME_CONSTANT_S * rate_hz)))
        self._step_v = deviation_v * float(np.sqrt(1.0 - self._keep**2))
        self._rng = rng
        self._state = np.array([self._keep * deviation_v * rng.standard_normal()])

    def next(self, scans: int) -> NDArray[np.float64]:
        """Return the next scans, shape (scans,), volts."""
        steps = self._step_v * self._rng.standard_normal(scans)
        volts, self._state = lfilter([1.0], [1.0, -self._keep], steps, zi=self._state)
        return np.asarray(volts, np.float64)
