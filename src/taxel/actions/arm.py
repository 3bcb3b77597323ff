"""What an arm can be asked for when a grasp fails, and a simulated arm that obeys its limits.

Three things only: hold still, lower what is held by a few millimetres, stop. No method but
`connect` and `close` waits for the arm. Knows nothing about decisions or grippers.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Protocol

from taxel.clock import Clock
from taxel.errors import BadInput


@dataclass(frozen=True, slots=True, kw_only=True)
class ArmLimits:
    """How far and how fast taxel may ever move an arm. Source: our choice, docs/decisions/0016;
    250 mm/s is the reduced speed of ISO 10218-1 for hand-guided and manual operation.
    """

    lowest_mm: float = 200.0
    """The largest way down of one command, millimetres."""
    speed_mm_s: float = 50.0
    """The largest speed, millimetres per second; at most 250."""
    accel_mm_s2: float = 200.0
    """The acceleration, millimetres per second squared."""

    def __post_init__(self) -> None:
        good = (
            0 < self.lowest_mm <= 1000
            and 0 < self.speed_mm_s <= 250
            and 0 < self.accel_mm_s2 <= 2000
        )
        if not good:
            raise BadInput(
                "a way of up to 1000 mm, a speed of up to 250 mm/s, up to 2000 mm/s², all above 0",
                f"{self.lowest_mm}, {self.speed_mm_s} and {self.accel_mm_s2}",
                "choose smaller ones",
            )

    def lowering(self, way_mm: float, speed_mm_s: float | None) -> tuple[float, float]:
        """Return way and speed of a lowering, kept within the limits.

        Raises:
            BadInput: The way is not above 0 mm or the speed not above 0 mm/s.
        """
        speed = self.speed_mm_s if speed_mm_s is None else speed_mm_s
        if not (0 < way_mm < math.inf and 0 < speed < math.inf):
            raise BadInput(
                "a way down above 0 mm and a speed above 0 mm/s",
                f"{way_mm} mm and {speed} mm/s",
                "this interface only lowers",
            )
        return min(way_mm, self.lowest_mm), min(speed, self.speed_mm_s)


@dataclass(frozen=True, slots=True, kw_only=True)
class ArmStatus:
    """What is known of an arm."""

    ready: bool = False
    """True where it is powered, enabled and obeys."""
    moving: bool = False
    """True while it moves."""
    height_mm: float = math.nan
    """Height of the tool in the arm's own frame, millimetres; NaN unknown."""
    fault: str = ""
    """What is wrong, in words; empty where all is well."""
    read_s: float = -math.inf
    """When this was read, monotonic seconds."""

    @property
    def ok(self) -> bool:
        """True where it is ready and nothing is wrong."""
        return self.ready and not self.fault


class Arm(Protocol):
    """An arm that carries a gripper."""

    def connect(self) -> None:
        """Open the arm; waits for its first answer. It is neither powered nor enabled by this.

        Raises:
            BadInput: There is no such arm, or it does not answer as it should.
        """
        ...

    def hold(self, expires_s: float = math.inf) -> None:
        """End a motion that this interface began, and stay.

        Args:
            expires_s: From this moment on it is not sent, monotonic seconds.
        """
        ...

    def lower(
        self,
        way_mm: float,
        speed_mm_s: float | None = None,
        expires_s: float = math.inf,
        number: int = 0,
    ) -> None:
        """Go straight down, within the limits.

        Args:
            way_mm: How far, millimetres.
            speed_mm_s: How fast, millimetres a second; the limits' by default.
            expires_s: From this moment on it is not sent, monotonic seconds.
            number: Of the alarm that asks. The same number again asks for the same lowering,
                which is sent once; 0 always asks for another.

        Raises:
            BadInput: The way or the speed is not above 0.
        """
        ...

    def stop(self) -> None:
        """End all motion, whoever began it."""
        ...

    def status(self) -> ArmStatus:
        """Return what is known, at once."""
        ...

    def close(self) -> None:
        """Let go of the arm; a motion under way is stopped."""
        ...


class SimArm:
    """A simulated arm: a tool that goes up to speed, down and to rest, moved by the clock.

    Speed follows a trapezoid of `accel_mm_s2`; a stop brakes with the same.
    """

    def __init__(self, limits: ArmLimits, clock: Clock, height_mm: float = 400.0) -> None:
        self._limits = limits
        self._clock = clock
        self._height_mm = height_mm
        self._speed = 0.0
        self._goal_mm = height_mm
        self._most = 0.0
        self._now_s = clock.now_s()
        self._ready = False
        self._number = 0

    def connect(self) -> None:
        self._advance()
        self._ready = True

    def hold(self, expires_s: float = math.inf) -> None:
        if self._clock.now_s() < expires_s:
            self.stop()

    def lower(
        self,
        way_mm: float,
        speed_mm_s: float | None = None,
        expires_s: float = math.inf,
        number: int = 0,
    ) -> None:
        self._advance()
        way, speed = self._limits.lowering(way_mm, speed_mm_s)
        again = number != 0 and number == self._number
        if self._ready and not again and self._clock.now_s() < expires_s:
            self._most, self._number = speed, number
            self._goal_mm = max(0.0, self._height_mm - way)

    def stop(self) -> None:
        self._advance()
        braking_mm = self._speed**2 / (2 * self._limits.accel_mm_s2)
        self._goal_mm = self._height_mm - braking_mm

    def status(self) -> ArmStatus:
        self._advance()
        return ArmStatus(
            ready=self._ready,
            moving=self._speed > 0,
            height_mm=self._height_mm,
            read_s=self._now_s,
        )

    def close(self) -> None:
        self.stop()
        self._ready = False

    def _advance(self) -> None:
        """Move forward to now in steps of at most 1 ms; 60 s and more have come to rest."""
        until_s = self._clock.now_s()
        self._now_s = max(self._now_s, until_s - 60.0)
        while self._now_s < until_s:
            step_s = min(0.001, until_s - self._now_s)
            self._step(step_s)
            self._now_s = until_s if step_s < 0.001 else self._now_s + step_s

    def _step(self, step_s: float) -> None:
        accel = self._limits.accel_mm_s2
        left_mm = self._height_mm - self._goal_mm
        if left_mm <= 1e-6:
            self._height_mm, self._speed = min(self._height_mm, self._goal_mm), 0.0
            return
        allowed = min(self._most, math.sqrt(2 * accel * left_mm))
        self._speed = min(self._speed + accel * step_s, allowed)
        self._height_mm -= min(self._speed * step_s, left_mm)
