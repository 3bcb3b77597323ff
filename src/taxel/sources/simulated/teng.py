"""`sim://teng`: the simulated hand as a live source.

Knows nothing about files or models.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from taxel.clock import Clock
from taxel.signals import Mark, Samples
from taxel.sim.teng.hand import GraspStream
from taxel.sources.fitted_time import FittedTime
from taxel.sources.paced_source import PacedSource
from taxel.sources.pacing import Pacer, Stretch, read_speed
from taxel.sources.simulated.teng_options import parse_options


class SimTeng(PacedSource):
    """The simulated hand, grasping without end.

    Options are the fields of `TengHandConfig` (ranges as 30..65, or one number),
    `shape` and `material` to grasp one kind only, `seconds` to end, and `speed`.
    The fitted time is what the clock fit makes of the board's clock and the
    jittering arrivals, as for a real board; device time stays the board's own.

    Args:
        options: As in the address.
        clock: The clock to wait on.

    Raises:
        BadSource: An option is unknown or of the wrong kind.
    """

    def __init__(self, options: dict[str, str], clock: Clock) -> None:
        options = dict(options)
        speed = read_speed(options)
        config, chosen = parse_options(options)
        self._stream = GraspStream(config, shape=chosen.shape, material=chosen.material)
        self._fitted = FittedTime()
        stretches = self._stretches(chosen.seconds * config.rate_hz)
        info = self._stream.info
        super().__init__(info, (), Pacer(stretches, len(info.channels), clock, speed))

    def _stretches(self, scans: float) -> Iterator[Stretch]:
        """Yield grasp after grasp; the last is cut where the time is over, without its mark."""
        while scans >= 1:
            samples, marks = self._stream.next_block()
            if len(samples) > scans:
                samples, marks = samples[: int(scans)], []
            scans -= len(samples)
            yield self._stretch(samples, marks)

    def _stretch(self, samples: Samples, marks: list[Mark]) -> Stretch:
        """Put the fitted time in the place of the true one, which no real board would know."""
        true_s = samples.fitted_s
        fitted_s = self._fitted.of(samples.device_s, samples.arrival_s)
        moved = [
            replace(
                mark,
                start_s=float(np.interp(mark.start_s, true_s, fitted_s)),
                end_s=float(np.interp(mark.end_s, true_s, fitted_s)),
            )
            for mark in marks
        ]
        return replace(samples, fitted_s=fitted_s), moved
