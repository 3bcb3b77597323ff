"""A crop as a plain picture: colour and its spread on a coarse grid, in three frames and changes.

Where nothing moves, what tells classes apart is how the touch looks: means of colour over cells of
a grid, and how much colour varies within each, say it without any idea of markers or edges. Knows
nothing about labels, models or files.

Background of our choices: docs/decisions/0041.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import combinations
from typing import Final

import cv2
import numpy as np
from numpy.typing import NDArray

CELLS: Final = (8, 8)
"""Rows and columns of the grid. Source: our choice, docs/decisions/0041."""
_SIZE: Final = (120, 160)
"""Rows and columns, pixels, to which an image is brought first, so that neither its size nor its
shape changes what the numbers mean. Source: our choice, docs/decisions/0041."""
_OF_CELLS: Final = CELLS[0] * CELLS[1] * 3
COLUMNS: Final = 2 * _OF_CELLS
"""Of a frame or a change: means by cell and colour, then standard deviations."""
VERSION: Final = "picture-1"
_FRAMES: Final = 3
ROWS: Final = 6
"""First, middle and last frame; then first to middle, first to last, middle to last."""


def look_at_picture(images: Sequence[NDArray[np.uint8]]) -> NDArray[np.float32]:
    """Return a crop as a plain picture, shape (6, columns), in steps of 0…255.

    Args:
        images: Of one camera, shape (height, width, 3) each.
    """
    last = len(images) - 1
    height, width = _SIZE
    frames = [
        cv2.resize(images[at], (width, height), interpolation=cv2.INTER_AREA).astype(np.float32)
        for at in (0, last // 2, last)
    ]
    changes = [later - earlier for earlier, later in combinations(frames, 2)]
    return np.stack([_by_cell(picture) for picture in (*frames, *changes)])


def sum_up_picture(values: NDArray[np.float32]) -> NDArray[np.float32]:
    """Return what was seen, side by side, shape (cameras, 6 · columns).

    Args:
        values: Shape (6, cameras, columns).
    """
    return np.concatenate(list(values), axis=1)


def means_by_cell(values: NDArray[np.float32]) -> NDArray[np.float32]:
    """Return the mean of each cell and colour in each frame, shape (…, 3, cameras, 192).

    Args:
        values: Shape (…, 6, cameras, columns), as `look_at_picture` gives them for each camera.

    Returns:
        Grey levels, 0…255.
    """
    return values[..., :_FRAMES, :, :_OF_CELLS]


def brightest(values: NDArray[np.float32]) -> float:
    """Return the highest mean of a cell and colour in any frame, grey levels, 0…255.

    Args:
        values: As of `means_by_cell`.
    """
    return float(means_by_cell(values).max())


def _by_cell(picture: NDArray[np.float32]) -> NDArray[np.float32]:
    """Return means and standard deviations by cell and colour, shape (columns,)."""
    rows, columns = CELLS
    size = columns, rows
    mean = cv2.resize(picture, size, interpolation=cv2.INTER_AREA)
    square = cv2.resize(picture * picture, size, interpolation=cv2.INTER_AREA)
    spread = np.sqrt(np.maximum(square - mean * mean, 0.0))
    return np.asarray(np.concatenate([mean.ravel(), spread.ravel()]), np.float32)
