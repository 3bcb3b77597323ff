"""What the pour dynamics hand to the optics: one handle pressed into two gels over time.

Coordinates of a sensor: x to the right, y down, origin at the image's middle, millimetres;
angles in radians, clockwise positive as seen in the image. Pure values: knows nothing about
forces, pixels or files.
"""

from __future__ import annotations

from dataclasses import dataclass

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


TRUTH_CHANNELS = (
    "slip", "slip_fraction", "rotation", "descent", "load", "grip", "poured", "dropped"
)  # fmt: skip
"""Physics truth recorded beside the images, in this order."""
TRUTH_UNITS = ("um", "1", "deg", "mm", "N", "N", "g", "1")
"""slip: load-weighted slip distance since the grasp, larger of the two gels; slip_fraction:
share of the normal load on cells that slide; rotation and descent of the cup in the gripper;
load: weight and pour reaction; grip: true grip force; dropped: 1 once the cup has left."""
