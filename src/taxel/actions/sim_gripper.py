"""A simulated gripper: fingers that travel, a force that needs time, an object that can drop.

The force answers a command after a dead time, then follows it as a first-order lag with a
limited slope. An object is dropped while the friction of both fingers, 2 μ F, is less than its
load. A stand-in for the real one in demonstrations and tests: fingers and force, no slip before
the drop (that is `sim://cup-pour`). Nothing here opens the fingers on its own.

Background of our choices: docs/decisions/0017.
"""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass

from taxel.actions.gripper import GripperStatus, Motion
from taxel.clock import Clock
from taxel.errors import BadInput

_STEP_S = 0.001
"""Longest step of the integration, seconds. Source: our choice, a tenth of the shortest lag."""
_LONGEST_S = 10.0
"""A longer silence is not integrated beyond this, seconds: everything has settled by then."""


@dataclass(frozen=True, slots=True, kw_only=True)
class FingersConfig:
    """A gripper and what is between its fingers. Source: stroke, force and closing time of a
    PGE-50-26 by its data sheet (26 mm, 15 to 50 N, 0.5 s); the rest our choice,
    docs/decisions/0016.
    """

    stroke_mm: float = 26.0
    """Distance from closed to open, millimetres."""
    closing_s: float = 0.5
    """Time for the whole stroke at full speed, seconds."""
    min_pct: float = 20.0
    """The smallest force setting, percent."""
    max_n: float = 50.0
    """Force at 100 %, newtons."""
    latency_s: float = 0.02
    """From a command to the first change, seconds."""
    lag_s: float = 0.05
    """Time constant of the force, seconds."""
    slew_n_s: float = 300.0
    """The force changes by at most this much a second, newtons per second."""
    width_mm: float = 10.0
    """Width of the object, millimetres; 0 for none."""
    friction: float = 0.5
    """Friction of a finger on the object, unitless."""

    def __post_init__(self) -> None:
        positive = (self.stroke_mm, self.closing_s, self.max_n, self.lag_s, self.slew_n_s)
        if not all(0 < value < math.inf for value in positive):
            raise BadInput("stroke, times and forces above 0", f"{positive}", "choose others")
        if not (0 <= self.latency_s <= 5 and 0 <= self.width_mm < self.stroke_mm):
            raise BadInput(
                f"a latency of 0 to 5 s and a width of 0 to less than {self.stroke_mm:g} mm",
                f"{self.latency_s} s and {self.width_mm} mm",
                "choose others",
            )
        if not (0 <= self.min_pct < 100 and 0 <= self.friction < math.inf):
            raise BadInput(
                "a smallest setting of 0 to 99 % and a friction of at least 0",
                f"{self.min_pct} % and {self.friction}",
                "choose others",
            )


class Fingers:
    """The mechanics, moved forward by `advance`; commands in the gripper's own units."""

    def __init__(self, config: FingersConfig) -> None:
        self.config = config
        self.position_permille = 1000.0
        self.force_n = 0.0
        """The force on the object, newtons."""
        self.load_n = 0.0
        """What pulls the object out of the fingers, newtons; set from outside."""
        self.motion = Motion.REACHED
        self.speed_pct = 100.0
        self.target_permille = 1000.0
        self.set_pct = config.min_pct
        self._object = config.width_mm > 0
        self._lifted = False  # something else bears the object until the grip is there
        self._now_s: float | None = None
        self._waiting: deque[tuple[float, float, float]] = deque()

    @property
    def _object_permille(self) -> float:
        return 1000 * self.config.width_mm / self.config.stroke_mm

    def command(self, target_permille: float, force_pct: float, now_s: float) -> None:
        """Send the fingers somewhere with a force; takes effect after the dead time."""
        self.advance(now_s)
        due_s = now_s + self.config.latency_s
        self._waiting.append((due_s, target_permille, force_pct))

    def advance(self, now_s: float) -> None:
        """Move forward to a moment, monotonic seconds; time that steps back is ignored."""
        if self._now_s is None:
            self._now_s = now_s
        self._now_s = max(self._now_s, now_s - _LONGEST_S)
        while self._now_s < now_s:
            until_s = min(now_s, self._now_s + _STEP_S)
            while self._waiting and self._waiting[0][0] <= until_s:
                _, self.target_permille, self.set_pct = self._waiting.popleft()
            self._step(until_s - self._now_s)
            self._now_s = until_s

    def _step(self, step_s: float) -> None:
        if self.motion is Motion.CAUGHT:
            self._squeeze(step_s)
        else:
            self._travel(step_s)

    def _squeeze(self, step_s: float) -> None:
        config = self.config
        if self.target_permille > self.position_permille + 0.5:
            self.motion, self.force_n = Motion.MOVING, 0.0
            return
        change = (self.set_pct / 100 * config.max_n - self.force_n) * step_s / config.lag_s
        most = config.slew_n_s * step_s
        self.force_n += min(max(change, -most), most)
        settled = abs(change) < 0.01 * config.max_n * step_s / config.lag_s
        carries = 2 * config.friction * self.force_n >= self.load_n
        self._lifted = self._lifted or settled or (carries and self.load_n > 0)
        if (self._lifted and not carries) or not self._object:
            self._object = self._lifted = False
            self.motion, self.force_n = Motion.DROPPED, 0.0

    def _travel(self, step_s: float) -> None:
        config = self.config
        most = 1000 / config.closing_s * self.speed_pct / 100 * step_s
        way = self.target_permille - self.position_permille
        stop = self._object_permille
        if self._object and way < 0 and self.position_permille + max(way, -most) <= stop:
            self.position_permille, self.motion = stop, Motion.CAUGHT
            return
        self.position_permille += min(max(way, -most), most)
        if abs(way) <= most:
            self.motion = Motion.DROPPED if self.motion is Motion.DROPPED else Motion.REACHED
        elif self.motion is not Motion.DROPPED or way > 0:
            self.motion = Motion.MOVING


class SimGripper:
    """A `Gripper` on simulated fingers, moved forward by the clock whenever it is looked at."""

    def __init__(self, config: FingersConfig, clock: Clock) -> None:
        self.fingers = Fingers(config)
        self._clock = clock
        self._connected = False

    def connect(self) -> None:
        self.fingers.advance(self._clock.now_s())
        self._connected = True

    def grip(self, force_pct: float, expires_s: float = math.inf) -> None:
        now_s = self._clock.now_s()
        if now_s >= expires_s or math.isnan(force_pct):
            return
        pct = min(max(force_pct, self.fingers.config.min_pct), 100.0)
        self.fingers.command(0.0, pct, now_s)

    def hold(self) -> None:
        self.fingers.advance(self._clock.now_s())

    def stop(self) -> None:
        fingers = self.fingers
        fingers.advance(self._clock.now_s())
        if fingers.motion is not Motion.CAUGHT:
            fingers.command(fingers.position_permille, fingers.set_pct, self._clock.now_s())

    def status(self) -> GripperStatus:
        now_s = self._clock.now_s()
        self.fingers.advance(now_s)
        return GripperStatus(
            initialised=self._connected,
            motion=self.fingers.motion,
            position_permille=self.fingers.position_permille,
            force_pct=self.fingers.set_pct,
            read_s=now_s,
        )

    def close(self) -> None:
        self._connected = False
