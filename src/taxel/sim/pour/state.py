"""What the pour dynamics hand to the optics: one handle pressed into two gels over time.

Coordinates of a sensor: x to the right, y down, origin at the image's middle, millimetres;
angles in radians, clockwise positive as seen in the image. Pure values: knows nothing about
forces, pixels or files.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True, slots=True, kw_only=True)
class HandleShape:
    """The part of a cup's handle that is pressed into a gel."""

    radius_across_mm: float
    """Radius of the cross-section, millimetres: across the handle's axis."""
    radius_along_mm: float
    """Radius of the bend along the handle's axis, millimetres; infinity where straight."""
    width_mm: float
    """Width of the handle across its axis, millimetres: beyond it nothing touches."""
    axis_rad: float
    """Direction of the handle's axis in the image at the grasp, 0 = vertical."""
    texture_um: float
    """Root mean square of the surface's texture, micrometres."""
    texture_mm: float
    """Typical wavelength of the texture, millimetres."""
    texture_along: float
    """0…1: 0 an isotropic texture, 1 ridges that run along the handle's axis."""
    texture_seed: int
    """Seed of the texture's pattern; each sensor's side of the handle has its own."""


@dataclass(frozen=True, slots=True, kw_only=True)
class GelMotion:
    """How one gel and the handle in it move, at n moments."""

    depth_mm: NDArray[np.float64]
    """Shape (n,): deepest indentation, millimetres."""
    object_mm: NDArray[np.float64]
    """Shape (n, 2): the handle's movement (x, y) since the grasp, millimetres: its imprint
    and texture move by this."""
    object_rad: NDArray[np.float64]
    """Shape (n,): its rotation about the patch's middle since the grasp."""
    gel_mm: NDArray[np.float64]
    """Shape (n, 2): the gel surface's movement (x, y) in the middle of the patch since the
    grasp, millimetres: markers there move by this; equal to `object_mm` while nothing slips."""
    gel_rad: NDArray[np.float64]
    """Shape (n,): the gel surface's twist under the patch since the grasp."""
    patch_mm: NDArray[np.float64]
    """Shape (n, 2): half axes of the contact patch across and along the handle, millimetres."""


@dataclass(frozen=True, slots=True, kw_only=True)
class PadHold:
    """How a handle stands between two gels, and how hard they hold it, at one moment."""

    time_s: float
    """Since the grasp."""
    place: NDArray[np.float64]
    """Shape (3,): the handle's move since the grasp, x and y (mm), and its turn (rad)."""
    normal_n: float
    """Grip force on each side."""
    friction: NDArray[np.float64]
    """Shape (2,): load-weighted coefficient of each side, between static and kinetic."""
    patch_mm: tuple[float, float]
    """Half axes of the contact, across and along the handle."""
    dropped: bool
    """True once nothing is held any more."""
    release_s: float
    """Time constant in which the gels then spring back."""


TRUTH_CHANNELS = (
    "slip", "slip_fraction", "rotation", "descent", "load", "grip", "poured", "dropped"
)  # fmt: skip
"""Physics truth recorded beside the images, in this order."""
TRUTH_UNITS = ("um", "1", "deg", "mm", "N", "N", "g", "1")
"""slip: load-weighted slip distance since the grasp, larger of the two gels; slip_fraction:
share of the normal load on cells that slide; rotation and descent of the cup in the gripper;
load: weight and pour reaction; grip: true grip force; dropped: 1 once the cup has left."""

LAYER_CHANNELS = (
    "slip_left", "slip_right", "at_limit_left", "at_limit_right", "gel_turn_left", "gel_turn_right"
)  # fmt: skip
"""Further truth of gels that shear as layers (version 2), in this order."""
LAYER_UNITS = ("um", "um", "1", "1", "deg", "deg")
"""slip: load-weighted path of the handle over that gel's face since the grasp, by the layer's own
friction; at_limit: share of the contact's area that friction no longer holds, Mindlin's annulus;
gel_turn: load-weighted turn of the gel's face since the grasp: rotation less it is rigid slip."""


MOTION_CHANNELS = (
    "shift", "lift", "tilt", "accel_x", "accel_y", "outside_x", "outside_y", "grasp"
)  # fmt: skip
"""Further truth of runs with a scene, last of all, in this order."""
MOTION_UNITS = ("mm", "mm", "deg", "m/s^2", "m/s^2", "N", "N", "1")
"""shift, lift, tilt: of the gripper since time zero, to the right, up and clockwise; accel: its
own, in its frame, right and down; outside: what table, person and obstacle push the cup with, in
the gripper's frame; grasp: a `GraspPhase`. `load` is then what the gels bear."""


class GraspPhase(IntEnum):
    """How far a grasp is."""

    OPEN = 0
    CLOSING = 1
    """A gel touches."""
    HELD = 2
    """Both press as commanded."""


def truth_columns(gel: int, scene: bool) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """Return the channels and units of the truth that is recorded.

    Args:
        gel: How the gels shear; with 2 there is more to say.
        scene: True where the gripper moves, or a grasp is made.
    """
    channels: tuple[str, ...] = TRUTH_CHANNELS
    units: tuple[str, ...] = TRUTH_UNITS
    if gel == 2:
        channels, units = channels + LAYER_CHANNELS, units + LAYER_UNITS
    return (channels + MOTION_CHANNELS, units + MOTION_UNITS) if scene else (channels, units)


def has_truth(channels: tuple[str, ...]) -> bool:
    """Return True where recorded channels begin with the truth of a simulated pour."""
    return channels[: len(TRUTH_CHANNELS)] == TRUTH_CHANNELS
