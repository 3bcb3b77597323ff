"""`sim://teng`: the simulated hand as a live source.

Knows nothing about files or models.
"""

from __future__ import annotations

from dataclasses import fields, replace
from types import TracebackType
from typing import Any, Self

import numpy as np

from taxel.clock import Clock, ClockFit
from taxel.errors import BadSource
from taxel.signals import Mark, Samples, SensorInfo
from taxel.sim.teng_hand import GraspStream, TengHandConfig
from taxel.sources.opening import read_speed
from taxel.sources.pacing import Pacer

_CHOICES = {
    "preset": ("honest", "paper"),
    "wiring": ("three-boards", "one-board"),
}
_RANGES = ("force_n", "temperature_c", "humidity_pct", "dust", "moisture")


class SimTeng:
    """The simulated hand, grasping without end.

    Options are the fields of `TengHandConfig` (ranges as 30..65, or one number),
    `shape` and `material` to grasp one kind only, `seconds` to end, and `speed`.
    The fitted time is what `ClockFit` makes of the board's clock and the
    arrivals, as for a real board.

    Args:
        options: As in the address.
        clock: The clock to wait on.

    Raises:
        BadSource: An option is unknown or of the wrong kind.
    """

    def __init__(self, options: dict[str, str], clock: Clock) -> None:
        options = dict(options)
        speed = read_speed(options)
        length = options.pop("seconds", None)
        shape, material = options.pop("shape", None), options.pop("material", None)
        try:
            self._left_s = np.inf if length is None else float(length)
            config = TengHandConfig(**{key: _parse(key, text) for key, text in options.items()})
            self._stream = GraspStream(config, shape=shape, material=material)
        except ValueError as error:
            raise BadSource(
                "options of sim://teng that fit", str(error), "mend the address"
            ) from error
        self._pacer = Pacer(clock, speed, len(self._stream.info.channels))
        self._fit = ClockFit()
        self._last_s = -np.inf

    @property
    def info(self) -> SensorInfo:
        return self._stream.info

    @property
    def ended(self) -> bool:
        return self._left_s <= 0 and self._pacer.empty

    def read(self, timeout_s: float = 0.1) -> Samples:
        if self._pacer.empty and self._left_s > 0:
            self._refill()
        return self._pacer.take(timeout_s)

    def marks(self) -> list[Mark]:
        return self._pacer.marks()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self._left_s = 0.0

    def _refill(self) -> None:
        samples, marks = self._stream.next_block()
        duration_s = len(samples) / self.info.rate_hz
        if duration_s > self._left_s:
            samples = samples[: max(1, round(self._left_s * self.info.rate_hz))]
            marks = []
        self._left_s -= duration_s
        fitted = self._fitted(samples)
        offset = fitted[0] - samples.fitted_s[0]
        moved = [
            replace(m, start_s=m.start_s + offset, end_s=min(m.end_s + offset, fitted[-1]))
            for m in marks
        ]
        self._pacer.put(replace(samples, fitted_s=fitted), moved)

    def _fitted(self, samples: Samples) -> np.ndarray[Any, np.dtype[np.float64]]:
        """Return each scan's time by the fit as it stood then; it never runs backwards.

        The fit learns from the earliest arrival of each tenth of a second, which
        is all that its envelope keeps.
        """
        fitted = np.empty(len(samples))
        step = max(1, round(0.1 * self.info.rate_hz))
        for start in range(0, len(samples), step):
            part = slice(start, start + step)
            device, arrival = samples.device_s[part], samples.arrival_s[part]
            least = int(np.argmin(arrival - device))
            self._fit.add(float(device[least]), float(arrival[least]))
            fitted[part] = device * self._fit.rate + (self._fit.host_s(0.0))
        fitted = np.maximum.accumulate(np.maximum(fitted, self._last_s))
        self._last_s = float(fitted[-1])
        return fitted


def _parse(key: str, text: str) -> Any:
    known = {field.name: field.type for field in fields(TengHandConfig)}
    if key not in known:
        raise ValueError(f"{key!r}, which is none of {', '.join(known)}, shape, material, "
                         "seconds, speed")  # fmt: skip
    if key in _CHOICES:
        if text not in _CHOICES[key]:
            raise ValueError(f"{key}={text}, which is none of {', '.join(_CHOICES[key])}")
        return text
    try:
        if key in _RANGES:
            low, _, high = text.partition("..")
            return float(low), float(high or low)
        return int(text) if known[key] == "int" else float(text)
    except ValueError as error:
        raise ValueError(f"{key}={text}, which is no number") from error
