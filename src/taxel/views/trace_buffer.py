"""What a view keeps of a stream: the latest seconds, and counts and ranges since the start.

Knows nothing about how it is drawn, sources or files.

Background of our choices: docs/decisions/0018.
"""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from taxel.signals import Samples, SensorInfo, Validity

_LEAST_SCANS = 40
"""A slow array is looked at for as long as it takes to give so many scans. Our choice."""


def span_s(info: SensorInfo, least_s: float) -> float:
    """Return how long to look at an array, seconds: `least_s`, or longer where it is slow."""
    return max(least_s, _LEAST_SCANS / info.rate_hz) if info.rate_hz > 0 else least_s


@dataclass(frozen=True, slots=True)
class ChannelRange:
    """What one channel showed since the start."""

    name: str
    unit: str
    least: float
    """Smallest usable value, in the unit; NaN where there was none."""
    most: float
    """Largest usable value."""
    latest: float
    """The last scan's value; NaN where it may not be used."""


class TraceBuffer:
    """Collects a stream in constant memory.

    Args:
        info: The array.
        kept_s: Seconds of scans to keep.
    """

    def __init__(self, info: SensorInfo, kept_s: float) -> None:
        self.info = info
        self.kept_s = kept_s
        self.scans = 0
        self.lost = 0
        self._parts: deque[Samples] = deque()
        self._counter: int | None = None
        self._flags = {flag: 0 for flag in Validity if flag}
        self._least = np.full(len(info.channels), np.nan, np.float32)
        self._most = self._least.copy()

    def add(self, samples: Samples) -> None:
        """Take in new scans."""
        if not len(samples):
            return
        self.scans += len(samples)
        self._count_lost(samples.counter)
        for flag in self._flags:
            self._flags[flag] += int(((samples.validity & np.uint8(flag)) != 0).any(axis=1).sum())
        shown = usable_values(samples)
        self._least = np.fmin(self._least, np.fmin.reduce(shown, axis=0))
        self._most = np.fmax(self._most, np.fmax.reduce(shown, axis=0))
        self._parts.append(samples)
        while self._parts[0].fitted_s[-1] < samples.fitted_s[-1] - self.kept_s:
            self._parts.popleft()

    @property
    def kept(self) -> Samples:
        """The scans of the last `kept_s` seconds."""
        if not self._parts:
            return Samples.empty(len(self.info.channels))
        joined = Samples.join(self._parts)
        kept = joined[joined.fitted_s > joined.fitted_s[-1] - self.kept_s]
        self._parts = deque([kept])
        return kept

    @property
    def flags(self) -> dict[str, int]:
        """Flag's name → scans since the start with a value that carries it, where any do."""
        return {
            str(flag.name).lower().replace("_", " "): count
            for flag, count in self._flags.items()
            if count
        }

    @property
    def rate_hz(self) -> float:
        """Scans a second, measured over what is kept; NaN for fewer than two scans."""
        return measured_rate_hz(self.kept)

    def ranges(self) -> list[ChannelRange]:
        """Return what each channel showed."""
        kept = self.kept
        latest = usable_values(kept[-1:])[0] if len(kept) else np.full_like(self._least, np.nan)
        columns = zip(
            self.info.channels, self.info.units, self._least, self._most, latest, strict=True
        )
        return [
            ChannelRange(name, unit, float(least), float(most), float(now))
            for name, unit, least, most, now in columns
        ]

    def scale(self) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
        """Return the ends of each channel's scale, shape (channels,) each.

        With a full scale all go from zero to it. Otherwise each begins at its
        own least value and spans what the liveliest channel of its unit spans,
        so that a silent one looks silent beside it.
        """
        if self.info.full_scale is not None:
            zeros = np.zeros_like(self._least)
            return zeros, np.full_like(zeros, self.info.full_scale)
        spans = np.nan_to_num(self._most - self._least)
        units = np.array(self.info.units)
        widest = np.array([spans[units == unit].max() for unit in self.info.units], np.float32)
        low = np.nan_to_num(self._least)
        return low, low + np.where(widest > 0, widest, np.float32(1.0))

    def summary(self) -> dict[str, Any]:
        """Return everything that a script may want to know."""
        return {
            "sensor": self.info.name,
            "serial": self.info.serial,
            "scans": self.scans,
            "rate_hz": self.rate_hz,
            "nominal_rate_hz": self.info.rate_hz,
            "lost_scans": self.lost,
            "flagged_scans": self.flags,
            "channels": [
                {
                    "name": channel.name,
                    "unit": channel.unit,
                    "least": channel.least,
                    "most": channel.most,
                    "latest": channel.latest,
                }
                for channel in self.ranges()
            ],
        }

    def _count_lost(self, counter: NDArray[np.int64]) -> None:
        """Count gaps of the device's counter; one that jumps back was restarted."""
        if counter[0] < 0:
            return
        before = counter[0] - 1 if self._counter is None else self._counter
        steps = np.diff(counter, prepend=before) - 1
        self.lost += int(steps[steps > 0].sum())
        self._counter = int(counter[-1])


def usable_values(samples: Samples) -> NDArray[np.float32]:
    """Return the values, shape (n, channels), NaN where they may not be used."""
    return np.where(samples.usable, samples.values, np.float32(np.nan))


def measured_rate_hz(samples: Samples) -> float:
    """Return scans a second; NaN for fewer than two scans."""
    time_s = samples.fitted_s
    length_s = float(time_s[-1] - time_s[0]) if len(time_s) > 1 else 0.0
    return (len(time_s) - 1) / length_s if length_s > 0 else float("nan")
