"""Small windows around dots, and the darkness-weighted centre of each.

The inner loop of marker tracking. Knows nothing about which dot is which.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

_BLACK, _BARE = 0.5, 0.82
"""Brightness against a window's rim that weighs fully and not at all: measured 0.3 to 0.5 in
a dot, 1 beside it. What is inside a dot (glints) weighs the same, so it cannot pull."""
CLEAR_PX = 2.0
"""Between a window and its neighbour's rim. Source: our choice, docs/decisions/0012."""
_CENTRED_PX = 1.0
"""A window further off than this is taken again: its rim would touch the dot."""
_GREY = 110.0
"""Level that bare gel is brought to, of 255: leaves room for an exposure twice as long."""


@dataclass(frozen=True, slots=True)
class DotWindows:
    """Offsets of one dot's window in a padded, flattened image."""

    offsets: NDArray[np.intp]
    """Shape (p,): pixels of the window, relative to its middle."""
    weights: NDArray[np.float32]
    """Shape (p, 3): x and y from the middle, px, and 1."""
    rim: slice
    """Which of the p pixels are the rim."""
    plane: NDArray[np.float32]
    """Shape (rim, 3): gives the slopes and the level of the plane through the rim."""
    pad: int
    """Pixels that are added around the image."""
    stride: int
    """Pixels a row of the padded image."""
    shape: tuple[int, int]
    """Height and width of the image, px."""

    @staticmethod
    def around(diameter_px: float, spacing_px: float, shape: tuple[int, ...]) -> DotWindows:
        """Return round windows that hold a dot and its rim but no neighbour.

        Args:
            diameter_px: Of a dot.
            spacing_px: Between neighbours; limits the window.
            shape: The image's height and width, px.
        """
        radius = min(0.5 * diameter_px + 4.5, spacing_px - 0.5 * diameter_px - CLEAR_PX)
        whole = int(np.ceil(radius))
        y, x = np.mgrid[-whole : whole + 1, -whole : whole + 1].astype(np.float32)
        r = np.hypot(x, y)
        order = np.argsort(r, axis=None, kind="stable")
        order = order[r.ravel()[order] <= radius]
        rim = int((r.ravel()[order] <= radius - 1.5).sum())
        pad, stride = whole + 1, int(shape[1]) + 2 * (whole + 1)
        x, y = x.ravel()[order], y.ravel()[order]
        offsets = (y * stride + x).astype(np.intp)
        rim_part = slice(rim, len(order))
        weights = np.stack([x, y, np.ones_like(x)], axis=1)
        plane = np.linalg.pinv(weights[rim_part]).T.astype(np.float32)
        return DotWindows(
            offsets, weights, rim_part, plane, pad, stride, (int(shape[0]), int(shape[1]))
        )


def levels_of(rgb: NDArray[np.uint8]) -> NDArray[np.float32]:
    """Return the gain of each colour that brings bare gel to one grey, shape (3,)."""
    usual = np.median(rgb[::4, ::4].reshape(-1, 3), axis=0)
    return np.asarray(_GREY / np.maximum(usual, 4.0), np.float32)


def level_image(rgb: NDArray[np.uint8], levels: NDArray[np.float32]) -> NDArray[np.uint8]:
    """Return the brightest of three levelled colours: dark only where all are dark.

    Args:
        rgb: Shape (h, w, 3).
        levels: Gain of each colour, shape (3,).
    """
    red, green, blue = (
        cv2.convertScaleAbs(part, alpha=float(gain))
        for part, gain in zip(cv2.split(rgb), levels, strict=True)
    )
    return np.asarray(cv2.max(cv2.max(red, green), blue), np.uint8)


def centroids(
    image: NDArray[np.uint8], at: NDArray[np.float32], windows: DotWindows
) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Return the darkness-weighted centre of each window, and its darkness.

    Brightness counts against a plane through the window's own rim, so
    exposure and the lamps' fall-off cancel. Windows that were not centred on
    their dot are taken again around what was found.

    Args:
        image: Shape (h, w), from `level_image`.
        at: Shape (m, 2): x, y of the windows' middles, px.
        windows: Their shape.

    Returns:
        Shapes (m, 2), px, and (m,), px of full darkness; a window without a
        dot keeps its middle.
    """
    pad = windows.pad
    bordered = cv2.copyMakeBorder(image, pad, pad, pad, pad, cv2.BORDER_REPLICATE)
    padded = np.asarray(bordered, np.uint8).ravel()
    centres, mass = _weigh(padded, at, windows)
    off = np.abs(centres - np.rint(at)).max(axis=1) > _CENTRED_PX
    if off.any():
        centres[off], mass[off] = _weigh(padded, centres[off], windows)
    return centres, mass


def _weigh(
    padded: NDArray[np.uint8], at: NDArray[np.float32], windows: DotWindows
) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    height, width = windows.shape
    middle = np.clip(np.rint(at), 0, (width - 1, height - 1))
    start = (middle[:, 1] + windows.pad) * windows.stride + middle[:, 0] + windows.pad
    level = padded[start.astype(np.intp)[:, None] + windows.offsets].astype(np.float32)
    bare = (level[:, windows.rim] @ windows.plane) @ windows.weights.T
    level *= np.float32(-1 / (_BARE - _BLACK)) / np.maximum(bare, np.float32(1.0))
    level += np.float32(_BARE / (_BARE - _BLACK))
    dark = np.clip(level, 0, 1, out=level)
    sums = dark @ windows.weights
    mass = sums[:, 2]
    held = mass > 1.0
    moved = sums[:, :2] / np.where(held, mass, 1.0)[:, None]
    found = np.where(held[:, None], middle + moved, at)
    return found.astype(np.float32), mass
