"""A crop as a small picture: the colours of its middle frame in 32×32 pixels.

Finer than the plain picture, and nothing else is measured: of where exactly something is pressed,
the means of a coarse grid say too little. Of one frame only, for its many columns take long to
learn. Knows nothing about labels, models or files.

Background of our choices: docs/decisions/0041.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import cv2
import numpy as np
from numpy.typing import NDArray

SIDE: Final = 32
"""Rows and columns of pixels, whatever a camera's shape. Source: our choice, decision 41."""
COLUMNS: Final = SIDE * SIDE * 3
"""Red, green and blue of each pixel, row by row."""
VERSION: Final = "miniature-1"


def look_at_miniature(images: Sequence[NDArray[np.uint8]]) -> NDArray[np.float32]:
    """Return a crop's middle frame, shape (1, columns), 0…255.

    Args:
        images: Of one camera, shape (height, width, 3) each, red first.
    """
    middle = images[(len(images) - 1) // 2].astype(np.float32)
    small = cv2.resize(middle, (SIDE, SIDE), interpolation=cv2.INTER_AREA)
    return np.asarray(small.reshape(1, COLUMNS), np.float32)
