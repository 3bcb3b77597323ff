"""The simulated hand's motor board: what firmware/hand_control does, on simulated motors.

Arms, closes each finger until its motor's current says contact, runs out when it is not refreshed
and stops when its owner falls silent. `advance` lets the fingers catch up with the clock, a
millisecond at a time; whoever reads the pads (`taxel.sources.simulated.grasped_teng`) calls it too.
Source of limits: docs/decisions/0020. Knows nothing about interlocks, plans or files.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from taxel.actions.hand_contract import HandStatus, checked_grip
from taxel.clock import Clock
from taxel.sim.teng.grasped_hand import FINGERS, STEP_S, GraspedHand
from taxel.wire.messages import State

WATCHDOG_S = 0.095
_BLANK_S = 0.08
"""A motor's start-up peak, in which its current means no contact, seconds."""
_READINGS = 2
"""Readings in a row, a millisecond apart, that are a contact."""
_REPORT_S = 0.01
"""Between two readings that are reported, seconds."""
_MOST_BEHIND_S = 2.0
"""How much the fingers catch up at once, seconds: longer ago nobody watched. Our choice."""


@dataclass(frozen=True, slots=True)
class _Grip:
    wanted: np.ndarray
    """Shape (4,): where each finger goes, per mille; NaN where it stays."""
    contact_ma: int
    until_s: float


class SimHand:
    """A `Hand` on simulated motors.

    Args:
        plant: The fingers, pads and object.
        clock: The clock that the fingers follow.
    """

    def __init__(self, plant: GraspedHand, clock: Clock) -> None:
        self.plant = plant
        self._clock = clock
        self._state = State.IDLE
        self._at_s = clock.now_s()
        self._reported_s = -math.inf
        self._owner_s = -math.inf
        self._grip: _Grip | None = None
        self._on_s = np.zeros(FINGERS)
        self._readings_high = np.zeros(FINGERS, int)
        self._contact_ma = np.zeros(FINGERS)  # 0: none; else the limit that stopped it
        self._currents: list[tuple[float, tuple[int, ...]]] = []
        self._newest: tuple[int, ...] = (0,) * FINGERS
        self.contact_to_off_s: list[float] = []
        """For each contact: from the touch to the motor being off, seconds."""
        self._touched_s = np.full(FINGERS, math.nan)
        self.on_charge: Callable[[np.ndarray], None] = lambda _: None
        """Called with the charge of each millisecond, shape (12,), volts."""

    def connect(self) -> None:
        """Nothing to wait for."""

    def refresh(self) -> None:
        self.advance()
        self._owner_s = self._clock.now_s()

    def arm(self) -> None:
        self.advance()
        if self._clock.now_s() - self._owner_s <= WATCHDOG_S and self._state is not State.MOVING:
            self._state = State.ARMED
            self._contact_ma[:] = 0

    def grip(
        self, fingers: int, closed_permille: int, contact_ma: int, lasts_s: float = 0.2
    ) -> None:
        checked_grip(fingers, closed_permille, contact_ma, lasts_s)
        self.advance()
        if self._state not in (State.ARMED, State.MOVING):
            return
        named = np.array([fingers >> finger & 1 for finger in range(FINGERS)], bool)
        way = np.sign(closed_permille - self.plant.position)
        # One that contact stopped goes on only for more current, or the other way.
        free = (self._contact_ma == 0) | (way < 0) | (contact_ma > self._contact_ma)
        self._contact_ma[named & free] = 0
        wanted = np.where(named & free, float(closed_permille), np.nan)
        self._grip = _Grip(wanted, contact_ma, self._clock.now_s() + lasts_s)

    def stop(self) -> None:
        self.advance()
        self._off()
        self._state = State.STOPPED

    def status(self) -> HandStatus:
        self.advance()
        now_s = self._clock.now_s()
        return HandStatus(
            state=self._state, currents_ma=self._newest, current_s=now_s, boot_id=1, heard_s=now_s
        )

    def take_currents(self) -> list[tuple[float, tuple[int, ...]]]:
        self.advance()
        taken, self._currents = self._currents, []
        return taken

    def close(self) -> None:
        self.stop()

    def advance(self) -> None:
        """Let the fingers catch up with the clock."""
        now_s = self._clock.now_s()
        self._at_s = max(self._at_s, now_s - _MOST_BEHIND_S)
        while self._at_s + STEP_S <= now_s + 1e-9:
            self._at_s += STEP_S
            self._control()
            before = self.plant.touching
            self.on_charge(self.plant.step())
            newly = self.plant.touching & ~before
            self._touched_s[newly] = self._at_s
            self._report()

    def _control(self) -> None:
        """What the board does each millisecond."""
        if self._state not in (State.ARMED, State.MOVING):
            return
        if self._at_s - self._owner_s > WATCHDOG_S:
            self._off()
            self._state = State.STOPPED
            return
        if self._grip is not None and self._at_s >= self._grip.until_s:
            self._off()
        self._judge_contact()
        directions = np.zeros(FINGERS, np.int8)
        if self._grip is not None:
            wanted = np.where(self._contact_ma > 0, np.nan, self._grip.wanted)
            way = wanted - self.plant.position
            directions = np.where(np.abs(way) > 0.5, np.sign(np.nan_to_num(way)), 0).astype(np.int8)
        self._on_s = np.where(directions == self.plant.turning, self._on_s + STEP_S, 0.0)
        self.plant.turn(directions)
        self._state = State.MOVING if directions.any() else State.ARMED

    def _judge_contact(self) -> None:
        if self._grip is None:
            return
        size = np.abs(self.plant.currents_ma)
        late = (self.plant.turning != 0) & (self._on_s >= _BLANK_S)
        high = late & (size >= self._grip.contact_ma)
        self._readings_high = np.where(high, self._readings_high + 1, 0)
        for finger in np.flatnonzero(self._readings_high >= _READINGS):
            self._contact_ma[finger] = self._grip.contact_ma
            self._readings_high[finger] = 0
            self.contact_to_off_s.append(float(self._at_s - self._touched_s[finger]))

    def _off(self) -> None:
        self._grip = None
        self.plant.turn(np.zeros(FINGERS, np.int8))

    def _report(self) -> None:
        if self._at_s - self._reported_s >= _REPORT_S - 1e-9:
            self._reported_s = self._at_s
            self._newest = tuple(round(float(ma)) for ma in self.plant.currents_ma)
            self._currents.append((self._at_s, self._newest))
