"""Pixels of a row of 320, in which sizes and poses of this folder are, and their millimetres.

Needs no other package, so that the lightest installation can say what a bundle measures.
"""

from __future__ import annotations

from typing import Final

ROW_PX: Final = 320
"""Pixels a row at which sizes in this folder are meant, and poses are given:
docs/explanation/physics-gel."""
USUAL_MM_PER_PX: Final = 0.065
"""Of a GelSight Mini at 320 × 240 where the camera does not state its own, 0.059 to 0.071."""


def mm_per_row_px(width: int, stated: float | None) -> float:
    """Return the millimetres that a pixel of a 320-pixel row covers.

    Args:
        width: Of the camera's images, pixels.
        stated: Millimetres that one of their pixels covers; a GelSight Mini's where it is None.
    """
    return USUAL_MM_PER_PX if stated is None else stated * width / ROW_PX
