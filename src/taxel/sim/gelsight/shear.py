"""A sheared face of a gel, in a camera's pixels or at single places: where it moved, how it bulges.

The face's movement is known where the gel was before it moved; a camera sees where it went, so
one step of a fixed point goes from one to the other. Knows nothing about friction or light.

Background of our choices: docs/decisions/0037.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from taxel.sim.gelsight.camera import HEIGHT_PX, WIDTH_PX, cv2
from taxel.sim.pour.views import FaceShear

Image = NDArray[np.float32]


_SHRINK = 8
"""Full pixels between two points at which the face is looked at: half a millimetre, no coarser
than a contact's cells. Source: our choice."""
_SETTLE = 3
"""Steps of the fixed point; a strain of a half leaves an eighth of it. Source: our choice."""


class ShearView:
    """One camera's view of a sheared face.

    Args:
        mm_per_px: Of its full image.
    """

    def __init__(self, mm_per_px: float) -> None:
        x, y = (
            (np.arange(count) - (count - 1) / 2.0) * mm_per_px * _SHRINK
            for count in (WIDTH_PX // _SHRINK, HEIGHT_PX // _SHRINK)
        )
        self._places = np.stack(np.meshgrid(x, y), axis=2).astype(np.float32)
        """Shape (30, 40, 2): where the camera looks (x, y), millimetres."""

    def look(self, shear: FaceShear) -> tuple[Image, Image, Image, Image]:
        """Return movement (x, y), millimetres, and inward slope (along x, y), mm per mm.

        Each at an eighth of the camera's resolution, shape (30, 40).
        """
        field = shear.patch.field(shear.source_mm2)
        rows, columns = field.shape[:2]
        step_x, step_y = shear.patch.step_mm
        cos, sin = float(np.cos(shear.angle_rad)), float(np.sin(shear.angle_rad))
        x, y = (float(part) for part in shear.middle_mm)
        to_field = np.array(
            [
                [cos / step_x, sin / step_x, (columns - 1) / 2 - (cos * x + sin * y) / step_x],
                [-sin / step_y, cos / step_y, (rows - 1) / 2 - (cos * y - sin * x) / step_y],
            ]
        )
        at = cv2.transform(self._places, to_field)
        # To the field's own columns and rows, so that places and movement can be subtracted.
        scale = np.array([[1 / step_x, 0, 0, 0], [0, 1 / step_y, 0, 0]])
        place = at
        for _ in range(_SETTLE):
            place = cv2.subtract(at, cv2.transform(_looked_up(field, place), scale))
        both = np.array([[cos, -sin, 0, 0], [sin, cos, 0, 0], [0, 0, cos, -sin], [0, 0, sin, cos]])
        seen = cv2.transform(_looked_up(field, place), both)
        right, down, slope_x, slope_y = (np.asarray(part, np.float32) for part in cv2.split(seen))
        return right, down, slope_x, slope_y


def _looked_up(values: Image, places: Any) -> Any:
    """Return values (rows, columns, n) at places (h, w, 2), in columns and rows; 0 outside."""
    return cv2.remap(values, places, None, cv2.INTER_LINEAR)  # type: ignore[call-overload]  # None: places hold both
