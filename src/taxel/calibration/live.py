"""Newtons while scans come: what people look at, not what a recogniser is given.

As `apply` does with a whole recording, from the past alone: a moving mean that ends now, and a
baseline that follows the rest of the last half minute. Knows nothing about screens or bundles.

Background of our choices: docs/decisions/0022 and 0047.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from taxel.calibration.apply import described, newtons
from taxel.calibration.baseline import SMOOTH_S
from taxel.calibration.stored import Calibration
from taxel.signals import Samples, SensorInfo
from taxel.sources.contract import Source
from taxel.sources.handed_on import HandedOn
from taxel.windows.following import RecentRest

_FOLLOW_S = 30.0
"""The baseline is the rest of so many of the last seconds: more than twice a grasp of the simulated
hand. Our choice, docs/decisions/0047."""


class LiveNewtons:
    """Turn an array's scans into newtons; the same however the stream is cut.

    Until rest was seen, and for sensors that hold their value (measure "plateau"), whose rest
    cannot be distinguished from a hold, the calibration's own baseline counts.

    Args:
        calibration: Of these sensors.
        sensor: The array.

    Raises:
        BadInput: The calibration is of other sensors.
    """

    def __init__(self, calibration: Calibration, sensor: SensorInfo) -> None:
        calibration.check_fits(sensor, sensor.name)
        self.info = described(sensor, calibration, "N")
        self._channels = calibration.channels
        own = np.array([each.baseline for each in calibration.channels])
        self._rest = np.nan_to_num(own, nan=0.0)
        follows = calibration.measure == "peak"
        self._recent = RecentRest(_FOLLOW_S, sensor.rate_hz) if follows else None
        self._tail = np.full((max(1, round(SMOOTH_S * sensor.rate_hz)) - 1, len(own)), np.nan)

    def push(self, samples: Samples) -> Samples:
        """Return scans in newtons; SATURATED means "at least", NaN that a channel has no curve."""
        if not len(samples):
            return samples
        usable = samples.usable
        calm = self._smoothed(np.where(usable, samples.values, np.nan))
        values = np.empty(samples.values.shape, np.float32)
        validity = np.array(samples.validity)
        for at in self._slices(len(calm)):
            above = calm[at] - self._rest
            for column, channel in enumerate(self._channels):
                values[at, column], flags = newtons(above[:, column], channel)
                validity[at, column] |= flags
            self._follow(calm[at])
        values[~usable] = np.nan
        return replace(samples, values=values, validity=validity)

    def _slices(self, rows: int) -> Iterator[slice]:
        """Yield the parts of a read, each with one baseline."""
        return iter([slice(0, rows)]) if self._recent is None else self._recent.slices(rows)

    def _follow(self, calm: NDArray[np.float64]) -> None:
        found = None if self._recent is None else self._recent.add(calm)
        if found is not None:
            self._rest = np.where(np.isfinite(found[0]), found[0], self._rest)

    def _smoothed(self, values: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the mean of each value and those before it within `SMOOTH_S`, NaN left out."""
        joined = np.concatenate([self._tail, values])
        known = np.isfinite(joined)
        width = len(self._tail) + 1
        total = _moving_sum(np.where(known, joined, 0.0), width)
        count = _moving_sum(known.astype(np.float64), width)
        self._tail = joined[len(joined) - len(self._tail) :]
        return np.where(count > 0, total / np.maximum(count, 1.0), np.nan)


def _moving_sum(values: NDArray[np.float64], width: int) -> NDArray[np.float64]:
    """Return sums over `width` rows, shape (n − width + 1, channels); no rounding runs away."""
    windows = np.lib.stride_tricks.sliding_window_view(values, width, axis=0)
    return np.asarray(windows.sum(axis=-1))


def in_newtons(source: Source, calibration: Calibration) -> HandedOn:
    """Return a source whose scans are in newtons; frames and marks stay as they are.

    Args:
        source: An open source with an array.
        calibration: Of its sensors.

    Raises:
        BadInput: The calibration is of other sensors.
    """
    live = LiveNewtons(calibration, source.info)
    return HandedOn(source, info=live.info, turn=live.push)
