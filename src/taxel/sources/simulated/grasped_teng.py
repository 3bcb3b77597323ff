"""The pads of the simulated hand that grasps on command, as a source.

Its scans come from the same fingers that `taxel.actions.sim_hand` moves. Knows nothing about
motors, files or models.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Self

import numpy as np
from numpy.typing import NDArray

from taxel.clock import Clock
from taxel.signals import CameraInfo, Frame, Mark, Samples, SensorInfo, flag_values
from taxel.sim.teng.grasped_hand import STEP_S, GraspedHand
from taxel.sim.teng.hand import sensor_info


class GraspedTeng:
    """A source of 1,000 scans a second.

    Args:
        plant: Fingers and pads.
        clock: Whose time the scans carry.
        advance: Lets the fingers catch up with the clock; what moves them calls `take`.
    """

    def __init__(self, plant: GraspedHand, clock: Clock, advance: Callable[[], None]) -> None:
        self._plant = plant
        self._clock = clock
        self._advance = advance
        self._charge: list[NDArray[np.float64]] = []
        self._count = 0
        self._info = replace(sensor_info(plant.config), rate_hz=1 / STEP_S)

    @property
    def info(self) -> SensorInfo:
        return self._info

    @property
    def cameras(self) -> tuple[CameraInfo, ...]:
        return ()

    @property
    def ended(self) -> bool:
        return False

    def take(self, charge: NDArray[np.float64]) -> None:
        """Take in the charge of one millisecond, shape (12,), volts."""
        self._charge.append(charge)

    def read(self, timeout_s: float = 0.1) -> Samples:
        self._advance()
        if not self._charge and timeout_s > 0:
            self._clock.sleep(min(timeout_s, STEP_S))
            self._advance()
        charge, self._charge = self._charge, []
        if not charge:
            return Samples.empty(len(self._info.channels))
        values = self._plant.volts(np.stack(charge))
        n = len(values)
        counter = self._count + np.arange(n, dtype=np.int64)
        self._count += n
        # The newest scan is of this moment; those before it a millisecond apart.
        time_s = np.asarray(self._clock.now_s() - STEP_S * np.arange(n - 1, -1, -1), np.float64)
        return Samples(
            values=values,
            counter=counter,
            device_s=np.asarray(counter * STEP_S, np.float64),
            arrival_s=time_s,
            fitted_s=time_s,
            validity=flag_values(values, self._info.full_scale),
        )

    def frames(self) -> list[Frame]:
        return []

    def marks(self) -> list[Mark]:
        return []

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self._charge = []
