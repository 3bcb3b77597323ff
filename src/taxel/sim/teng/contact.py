"""How four fingers press an object: pressure on each pad, and contact over time.

The hand closes on an object whose size and pose differ from grasp to grasp; the
object's geometry spreads the pressure over fingers and phalanges. Knows nothing
about charge, volts or converters.

Background of our choices: docs/decisions/0005.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from taxel.sim.teng import constants
from taxel.sim.teng.unknown_objects import PRISM_HALF_ANGLE_RAD
from taxel.sim.teng.unknown_objects import RELATIVE_RISE as UNKNOWN_RISE

_FINGER_MM = np.array([-33.0, -11.0, 11.0, 33.0])
"""The fingers' places across the hand, millimetres. Our choice: 22 mm apart."""
_PHALANX_RAD = np.array([-0.75, 0.0, 0.75])
"""Where the phalanges meet a round object, angle around it. Our choice."""
HALF_WIDTH_MM = (28.0, 40.0)
"""Half of an object's width, millimetres, in data sets. Our choice, docs/decisions/0005."""
_TURN_DEVIATION_RAD = 0.06
"""Spread of how far an object is turned in the hand, radians. Our choice, docs/decisions/0005."""
_GIVE_MM = 9.0
"""How far soft pads and linked fingers follow a surface that falls away. Our choice."""
_RELATIVE_RISE = constants.RELATIVE_RISE | UNKNOWN_RISE


@dataclass(frozen=True, slots=True)
class Grasp:
    """What happens in one grasp."""

    shape: str
    material: str
    size_mm: float
    """Half of the object's width."""
    force_n: float
    pressure: NDArray[np.float64]
    """Shape (12,): share of full contact on each pad, about 1 on average."""
    delay_s: NDArray[np.float64]
    """Shape (12,): first touch of each pad after the grasp's start."""
    rise_s: float
    period_s: float
    hold_share: float
    presses: int
    rest_s: float
    """Open hand before the grasp."""
    moving_hz: float
    """Rate at which a moving object modulates the contact; 0 for a still one."""
    moving_phase: float

    @property
    def duration_s(self) -> float:
        """Rest and presses together, seconds."""
        return self.rest_s + self.presses * self.period_s


def draw_grasp(
    rng: np.random.Generator,
    shape: str,
    material: str,
    force_n: tuple[float, float],
    moving: float,
    size_mm: tuple[float, float] = HALF_WIDTH_MM,
    angle_deg: float = 0.0,
) -> Grasp:
    """Draw a grasp; its nuisances do not depend on shape or material.

    Args:
        rng: The grasp's own generator.
        shape: One of `SHAPES`, or of `UNKNOWN_SHAPES`.
        material: One of `MATERIALS`, or of `UNKNOWN_MATERIALS`.
        force_n: Range of the grip force, newtons.
        moving: Share of grasps whose object moves, 0…1.
        size_mm: Range of half of the object's width, millimetres.
        angle_deg: How much further the object is turned in the hand than grasps scatter,
            degrees, to the side to which it is turned anyway.
    """
    half_mm = rng.uniform(*size_mm)
    across_mm = rng.normal(0.0, 3.0)
    turned_rad = rng.normal(0.0, _TURN_DEVIATION_RAD)
    turned_rad += np.copysign(np.deg2rad(angle_deg), turned_rad)
    scatter = np.exp(rng.normal(0.0, constants.GRASP_DEVIATION, 12))
    pressure = pad_pressure(shape, half_mm, across_mm, turned_rad) * scatter
    finger_delay = rng.uniform(0.0, constants.FINGER_DELAY_S, 4)
    low, high = np.log(force_n[0]), np.log(force_n[1])
    return Grasp(
        shape=shape,
        material=material,
        size_mm=half_mm,
        force_n=float(np.exp(rng.uniform(low, high))),
        pressure=pressure,
        delay_s=np.repeat(finger_delay, 3) + rng.uniform(0.0, 0.01, 12),
        rise_s=rng.uniform(*constants.RISE_S) * _RELATIVE_RISE[material],
        period_s=rng.uniform(*constants.PERIOD_S),
        hold_share=rng.uniform(*constants.HOLD_SHARE),
        presses=int(rng.integers(constants.PRESSES[0], constants.PRESSES[1] + 1)),
        rest_s=rng.uniform(*constants.REST_S),
        moving_hz=rng.uniform(*constants.MOVING_HZ) if rng.random() < moving else 0.0,
        moving_phase=rng.uniform(0.0, 2 * np.pi),
    )


def pad_pressure(
    shape: str, size_mm: float, across_mm: float = 0.0, turned_rad: float = 0.0
) -> NDArray[np.float64]:
    """Return the pressure on each pad, shape (12,), fingers × phalanges, mean 1.

    Sphere: its surface falls away from the middle fingers, r − √(r² − y²).
    Cylinder: its axis runs across the fingers, all of which wrap it alike.
    Rectangle: proximal and distal pads meet an edge, the middle one bridges a
    flat face.
    Prism: three-sided and longer than the hand is wide, its axis across the fingers. One
    face rests on the palm, so an edge points at the middle pads, and both faces beside it
    fall away from the proximal and distal ones.

    Args:
        shape: One of `SHAPES`, or of `UNKNOWN_SHAPES`.
        size_mm: Half of the object's width, millimetres.
        across_mm: How far off the hand's middle the object lies, millimetres.
        turned_rad: How far it is turned in the hand, radians.
    """
    y = _FINGER_MM - across_mm
    angle = _PHALANX_RAD + turned_rad
    if shape == "sphere":
        inside = np.sqrt(np.maximum(size_mm**2 - y**2, 0.0))
        finger = np.exp(-(size_mm - inside) / _GIVE_MM)
        phalanx = np.maximum(np.cos(angle), 0.0) ** 0.5
    elif shape == "cylinder":
        finger = np.exp(-np.abs(y * np.sin(turned_rad)) / _GIVE_MM)
        phalanx = np.cos(0.8 * angle)
    elif shape == "prism":
        finger = np.exp(-np.abs(y * np.sin(turned_rad)) / _GIVE_MM)
        phalanx = np.exp(-(size_mm - _prism_radius(size_mm, angle)) / _GIVE_MM)
    else:
        finger = np.exp(-np.abs(y * np.sin(turned_rad)) / _GIVE_MM)
        edge = size_mm * (np.abs(np.cos(angle)) + np.abs(np.sin(angle)) - 1.0)
        phalanx = 0.35 + 0.65 * (1.0 - np.exp(-edge / _GIVE_MM))
    pattern = np.outer(finger, phalanx).ravel()
    pattern /= pattern.mean()
    return np.asarray(1.0 + constants.CONTRAST * (pattern - 1.0))


def _prism_radius(size_mm: float, angle: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return how far a three-sided prism reaches from its axis, millimetres.

    An edge reaches its size; a face, half of it at its middle.

    Args:
        size_mm: From the axis to an edge, millimetres.
        angle: Away from the edge, radians, at most 60° either way.
    """
    half = PRISM_HALF_ANGLE_RAD
    return np.asarray(size_mm * np.cos(half) / np.cos(half - np.abs(angle)))


def contact_over_time(grasp: Grasp, time_s: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return each pad's contact, shape (n, 12), 0 open … pressure when held.

    Each press rises and falls along a smooth step; the release takes as long as
    the touch.

    Args:
        grasp: What happens.
        time_s: Shape (n,), seconds since the grasp's start (the rest comes first).
    """
    since = time_s[:, None] - grasp.rest_s - grasp.delay_s
    press = np.floor(since / grasp.period_s)
    phase_s = since - press * grasp.period_s
    held = smooth_step(phase_s / grasp.rise_s) - smooth_step(
        (phase_s - grasp.hold_share * grasp.period_s) / grasp.rise_s
    )
    held *= (press >= 0) & (press < grasp.presses)
    if grasp.moving_hz:
        turn = 2 * np.pi * grasp.moving_hz * time_s + grasp.moving_phase
        held *= (1.0 + constants.MOVING_DEPTH * np.sin(turn))[:, None]
    return np.asarray(held * grasp.pressure)


def smooth_step(x: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return 0 below 0, 1 above 1, and between them a rise without a corner; of any shape."""
    clipped = np.clip(x, 0.0, 1.0)
    return np.asarray(clipped * clipped * (3.0 - 2.0 * clipped))
