"""Whether a stream's rows come as often as those that a bundle was trained on.

Knows nothing about models or screens.

Background of our choices: docs/decisions/0010.
"""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass

import numpy as np

from taxel.signals import Samples
from taxel.windows.config import MOST_RATE_CHANGE

_ROWS = 65
"""Periods that are looked at, an odd number: most of them must be of another rate.
Source: our choice, docs/decisions/0010."""


@dataclass(frozen=True, slots=True)
class RateChange:
    """A stream whose rate is another than before."""

    time_s: float
    """When it was noticed, fitted clock, seconds."""
    rate_hz: float
    """Rows a second now."""
    trained_hz: float
    """Rows a second of the training recordings."""

    @property
    def fits(self) -> bool:
        """True where the bundle's rows come as often again."""
        ratio = self.rate_hz / self.trained_hz
        return 1 / MOST_RATE_CHANGE <= ratio <= MOST_RATE_CHANGE

    def words(self) -> str:
        """In a few words, for a person."""
        if self.fits:
            return f"rows come at {self.rate_hz:.4g} Hz again, as in training"
        return (
            f"rows come at {self.rate_hz:.4g} Hz, in training at {self.trained_hz:.4g} Hz: "
            "do not trust the answers; check the board"
        )


class RateWatch:
    """Looks at the median period of the latest rows, and reports where it no longer fits.

    Args:
        rate_hz: Rows a second of the training recordings.
    """

    def __init__(self, rate_hz: float) -> None:
        self._rate_hz = rate_hz
        self._times_s: deque[float] = deque(maxlen=_ROWS + 1)
        self._fits = True
        self._found: list[RateChange] = []

    def look(self, samples: Samples) -> None:
        """Take in rows of the stream."""
        self._times_s.extend(samples.fitted_s.tolist())
        if not len(samples) or len(self._times_s) <= _ROWS:
            return
        period_s = float(np.median(np.diff(np.array(self._times_s))))
        if period_s <= 0:
            return
        change = RateChange(self._times_s[-1], 1.0 / period_s, self._rate_hz)
        if change.fits != self._fits:
            self._fits = change.fits
            self._found.append(change)

    def take(self) -> list[RateChange]:
        """Return what was found since the last call, oldest first."""
        found, self._found = self._found, []
        return found
