"""A crop as small pictures: the colours of its first, middle and last frame in 32×32 pixels.

Finer than the plain picture, and nothing else is measured: of where exactly something is pressed,
the means of a coarse grid say too little. Knows nothing about labels, models or files.

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
"""Of a frame: red, green and blue of each pixel, row by row."""
VERSION: Final = "miniature-1"


def look_at_miniatures(images: Sequence[NDArray[np.uint8]]) -> NDArray[np.float32]:
    """Return a crop's first, middle and last frame, shape (3, columns), 0…255.

    Args:
        images: Of one camera, shape (height, width, 3) each, red first.
    """
    last = len(images) - 1
    found = [
        cv2.resize(images[at].astype(np.float32), (SIDE, SIDE), interpolation=cv2.INTER_AREA)
        for at in (0, last // 2, last)
    ]
    return np.asarray(np.stack(found).reshape(len(found), COLUMNS), np.float32)


def sum_up_miniatures(values: NDArray[np.float32]) -> NDArray[np.float32]:
    """Return what was seen, side by side, shape (cameras, 3 · columns).

    Args:
        values: Shape (3, cameras, columns).
    """
    return np.concatenate(list(values), axis=1)
