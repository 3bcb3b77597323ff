"""From a surface's slopes to its normals and its height.

Depth grows into the gel; x to the right, y down. Knows nothing about colours.
"""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from taxel.errors import BadSource

Gradient = NDArray[np.float32]


def normals_of(gx: Gradient, gy: Gradient) -> NDArray[np.float32]:
    """Return unit normals of slopes, shape (height, width, 3): x, y, z; z out of the gel."""
    normal = np.stack([gx, gy, np.ones_like(gx)], axis=-1)
    return np.asarray(normal / np.linalg.norm(normal, axis=-1, keepdims=True), np.float32)


def depth_from_gradients(gx: Gradient, gy: Gradient, mm_per_px: float) -> NDArray[np.float32]:
    """Return the surface whose slopes are nearest to those given, mm.

    Least squares (Poisson's equation with free borders), solved exactly by
    cosine transforms. The level is set by the image's border, whose median
    depth is 0.

    Args:
        gx: d depth/dx, mm per mm, shape (height, width).
        gy: d depth/dy, mm per mm, same shape.
        mm_per_px: Size of a pixel on the gel, mm.

    Raises:
        BadSource: The two shapes differ or are not two-dimensional.

    Source:
        Frankot & Chellappa 1988, with cosine transforms for free borders.
    """
    if gx.ndim != 2 or gx.shape != gy.shape:
        raise BadSource("two slopes of one shape", f"{gx.shape}, {gy.shape}", "give both whole")
    height, width = gx.shape
    even = (height + height % 2, width + width % 2)
    across, down = (_padded(part * np.float32(mm_per_px), even) for part in (gx, gy))
    spectrum = cv2.dct(_divergence(across, down)) / _eigenvalues(*even)
    spectrum[0, 0] = 0.0
    depth = np.asarray(cv2.idct(spectrum), np.float32)[:height, :width]
    border = np.concatenate([depth[0], depth[-1], depth[:, 0], depth[:, -1]])
    return np.asarray(depth - np.median(border), np.float32)


def _padded(part: Gradient, shape: tuple[int, int]) -> NDArray[np.float32]:
    """Return an array of even sides, flat beyond its end."""
    extra = [(0, shape[0] - part.shape[0]), (0, shape[1] - part.shape[1])]
    return np.pad(np.asarray(part, np.float32), extra)


def _divergence(across: Gradient, down: Gradient) -> NDArray[np.float32]:
    """Return the divergence of steps between pixels, none across the border."""
    between_x = 0.5 * (across[:, 1:] + across[:, :-1])
    between_y = 0.5 * (down[1:] + down[:-1])
    result = np.zeros_like(across)
    result[:, :-1] += between_x
    result[:, 1:] -= between_x
    result[:-1] += between_y
    result[1:] -= between_y
    return result


def _eigenvalues(height: int, width: int) -> NDArray[np.float32]:
    """Return those of the five-point Laplacian with free borders; 1 in place of the first, 0."""
    rows = 2 * np.cos(np.pi * np.arange(height) / height) - 2
    columns = 2 * np.cos(np.pi * np.arange(width) / width) - 2
    values = rows[:, None] + columns[None]
    values[0, 0] = 1.0
    return np.asarray(values, np.float32)
