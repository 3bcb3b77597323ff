"""Where a gripper goes: moves of minimum jerk that add up, and an arm that stops itself.

Coordinates of the world are those of the untilted gripper's image: x to the right, y down, a tilt
clockwise. Closed forms, so that a moment needs no history. Knows nothing about cups or forces.

Sources: minimum jerk, Flash and Hogan, J. Neurosci. 5 (1985) 1688; sizes and durations of moves,
docs/decisions/0045.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

PEAK_ACCELERATION = 10.0 / 3.0**0.5
"""Largest acceleration of a move of minimum jerk, 5.77, in way over its duration squared. Source:
the second derivative of 10 s³ − 15 s⁴ + 6 s⁵, largest at s = ½ − 1/√12."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Move:
    """One move from rest to rest."""

    start_s: float
    duration_s: float
    x_mm: float = 0.0
    """To the right, in the world."""
    up_mm: float = 0.0
    tilt_rad: float = 0.0
    """Clockwise."""

    def at(self, time_s: float) -> tuple[float, float, float]:
        """Return the share of the way that is done, and its first two derivatives."""
        s = min(max((time_s - self.start_s) / self.duration_s, 0.0), 1.0)
        return (
            s * s * s * (10.0 - 15.0 * s + 6.0 * s * s),
            30.0 * s * s * (1.0 - s) * (1.0 - s) / self.duration_s,
            60.0 * s * (1.0 - s) * (1.0 - 2.0 * s) / (self.duration_s * self.duration_s),
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class ArmStop:
    """An arm that ends its move early, as when it feels a collision."""

    at_s: float
    """When it begins to brake."""
    brake_m_s2: float
    """How hard, metres a second squared."""


@dataclass(frozen=True, slots=True)
class GripperMoment:
    """The gripper at one moment, as its own frame sees the world."""

    state: Array
    """Shape (3, 3), in the world, as `GripperPath.world`."""
    pull_m_s2: Array
    """Shape (2,): gravity less the gripper's acceleration, x and down, in the gripper's frame: what
    a kilogram at the pads seems to be pulled with."""
    accel_m_s2: Array
    """Shape (2,): the gripper's own acceleration, in its frame."""


@dataclass(frozen=True, slots=True, kw_only=True)
class GripperPath:
    """All moves of one grasp."""

    moves: tuple[Move, ...] = ()
    stop: ArmStop | None = None

    def world(self, time_s: float) -> Array:
        """Return the gripper in the world, shape (3, 3): rows right (mm), down (mm), tilt (rad);
        columns place, velocity, acceleration.
        """
        if self.stop is None or time_s <= self.stop.at_s:
            return self._moved(time_s)
        state = self._moved(self.stop.at_s)
        velocity = state[:, 1].copy()
        speed_mm_s = float(np.hypot(velocity[0], velocity[1]))
        brakes_s = max(speed_mm_s / (1000.0 * self.stop.brake_m_s2), 1e-6)
        since_s = min(time_s - self.stop.at_s, brakes_s)
        state[:, 0] += velocity * since_s * (1.0 - since_s / (2.0 * brakes_s))
        state[:, 1] = velocity * (1.0 - since_s / brakes_s)
        state[:, 2] = -velocity / brakes_s if since_s < brakes_s else 0.0
        return state

    def _moved(self, time_s: float) -> Array:
        state = np.zeros((3, 3))
        for move in self.moves:
            if time_s > move.start_s:
                way = (move.x_mm, -move.up_mm, move.tilt_rad)
                state += np.outer(way, move.at(time_s))
        return state

    def at(self, time_s: float, gravity_m_s2: float) -> GripperMoment:
        """Return the gripper at a moment.

        Args:
            time_s: Since time zero.
            gravity_m_s2: Downwards in the world.
        """
        state = self.world(time_s)
        cos, sin = math.cos(state[2, 0]), math.sin(state[2, 0])
        right, down = state[0, 2] / 1000.0, state[1, 2] / 1000.0
        accel = np.array([cos * right + sin * down, cos * down - sin * right])
        return GripperMoment(
            state=state,
            pull_m_s2=np.array([sin * gravity_m_s2, cos * gravity_m_s2]) - accel,
            accel_m_s2=accel,
        )
