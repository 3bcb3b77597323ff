"""Whether a stream's rows come as often as those that a bundle was trained on.

Knows nothing about models or screens.

Background of our choices: docs/decisions/0010.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from taxel.signals import Samples
from taxel.windows.config import MOST_RATE_CHANGE

_ROWS, _SPAN_S = 65, 2.0
"""Least rows and time that a rate is measured over; the same again must agree before a change is
reported. Source: our choice, docs/decisions/0010."""
_PAUSE_S, _PAUSE_PERIODS = 0.1, 5.0
"""A longer pause between two rows, in seconds and in periods of training, is not counted: lines
may come in lumps, trials with pauses. Source: our choice, docs/decisions/0010."""
_BACK = 1.2
"""A rate fits again within this factor: one at the limit is reported once. Our choice."""


@dataclass(frozen=True, slots=True)
class RateChange:
    """A stream whose rate is another than before."""

    time_s: float
    """When it was noticed, fitted clock, seconds."""
    rate_hz: float
    """Rows a second now."""
    trained_hz: float
    """Rows a second of the training recordings."""
    fits: bool
    """True where rows come as often as in training again."""

    def words(self) -> str:
        """In a few words, for a person."""
        if self.fits:
            return f"rows come at {self.rate_hz:.4g} Hz again, as in training"
        return (
            f"rows come at {self.rate_hz:.4g} Hz, in training at {self.trained_hz:.4g} Hz: "
            "do not trust the answers; check the board"
        )


class RateWatch:
    """Measures how often rows come, and reports where that no longer fits.

    Args:
        rate_hz: Rows a second of the training recordings.
    """

    def __init__(self, rate_hz: float) -> None:
        self._rate_hz = rate_hz
        self._most_s = max(_PAUSE_S, _PAUSE_PERIODS / rate_hz)
        self._last_s: float | None = None
        self._rows, self._span_s = 0, 0.0
        self._fits, self._doubts = True, 0
        self._found: list[RateChange] = []

    def look(self, samples: Samples) -> None:
        """Take in rows of the stream."""
        if not len(samples):
            return
        times_s = samples.fitted_s
        periods_s = np.diff(times_s if self._last_s is None else np.r_[self._last_s, times_s])
        self._last_s = float(times_s[-1])
        counted = (periods_s >= 0) & (periods_s <= self._most_s)
        self._rows += int(counted.sum())
        self._span_s += float(periods_s[counted].sum())
        if self._rows >= _ROWS and self._span_s >= _SPAN_S:
            self._weigh(self._rows / self._span_s)
            self._rows, self._span_s = 0, 0.0

    def _weigh(self, rate_hz: float) -> None:
        """Judge the rate of one span; a change is reported when two spans in a row agree on it."""
        most = MOST_RATE_CHANGE if self._fits else _BACK
        fits = 1 / most <= rate_hz / self._rate_hz <= most
        self._doubts = 0 if fits == self._fits else self._doubts + 1
        if self._doubts == 2:
            self._fits, self._doubts = fits, 0
            assert self._last_s is not None
            self._found.append(RateChange(self._last_s, rate_hz, self._rate_hz, fits))

    def take(self) -> list[RateChange]:
        """Return what was found since the last call, oldest first."""
        found, self._found = self._found, []
        return found
