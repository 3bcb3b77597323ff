"""How much each colour of a gel image changed against a reference, dots left out.

Knows nothing about what the change means.
"""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from taxel.gel.markers import Rgb, check_like, check_rgb, relative_brightness
from taxel.gel.scale import ROW_PX

_SMOOTH_PX = 1.0
"""Gaussian blur of the colours before division, px at that width: the noise's grain."""
_FLOOR = 4.0
"""Grey levels added before dividing, so that noise in dark corners is no slope."""
_INK = 0.8
"""Brightness against the surroundings under which a pixel belongs to a dot or its rim."""
_MOST_CHANGE = 2.5
"""Relative change beyond which a pixel is taken as this much: glare, codec blocks."""


def colour_change(rgb: Rgb, reference: Rgb) -> NDArray[np.float32]:
    """Return the relative change of each colour, exposure divided out and dots filled.

    Args:
        rgb: Shape (height, width, 3), red first.
        reference: The same gel untouched, same shape.

    Returns:
        Shape (height, width, 3), unitless: 0 is no change, 1 twice as bright.

    Raises:
        BadSource: Shapes differ, or are none of colour images.
    """
    check_rgb(reference)
    check_like(rgb, reference.shape)
    now, before = _smooth(rgb), _smooth(reference)
    ratio = cv2.divide(now, before)
    exposure = np.median(ratio[::8, ::8].reshape(-1, 3), axis=0)
    even = ratio * (1 / np.maximum(exposure, 1e-3)).astype(np.float32)
    change = np.clip(even - np.float32(1), -1, _MOST_CHANGE)
    ink = _ink(rgb) | _ink(reference)
    return _filled(change, ink) if ink.any() else change


def _smooth(rgb: Rgb) -> NDArray[np.float32]:
    sigma = _SMOOTH_PX * rgb.shape[1] / ROW_PX
    blurred = cv2.GaussianBlur(rgb.astype(np.float32), (0, 0), sigma)
    return np.asarray(blurred + np.float32(_FLOOR), np.float32)


def _ink(rgb: Rgb) -> NDArray[np.uint8]:
    """Return 1 on dots and their rims, shape (h, w)."""
    height, width = rgb.shape[:2]
    size = (ROW_PX // 2, max(1, round(height * ROW_PX / 2 / width)))
    small = np.asarray(cv2.resize(rgb, size, interpolation=cv2.INTER_AREA), np.uint8)
    ink = (relative_brightness(small, 15) < _INK).astype(np.uint8)
    wider = cv2.dilate(ink, np.ones((5, 5), np.uint8))
    whole = cv2.resize(wider, (width, height), interpolation=cv2.INTER_NEAREST)
    return np.asarray(whole, np.uint8)


def _filled(change: NDArray[np.float32], ink: NDArray[np.uint8]) -> NDArray[np.float32]:
    """Return the change with dots replaced by what surrounds them, near places first."""
    keep = (1 - ink).astype(np.float32)
    bare = change * keep[..., None]
    total, share = np.zeros_like(bare), np.full_like(keep, 1e-9)
    for size, weight in ((9, 1.0), (25, 1e-2), (61, 1e-5)):
        total += weight * cv2.blur(bare, (size, size))
        share += weight * cv2.blur(keep, (size, size))
    return np.asarray(np.where(ink[..., None] > 0, total / share[..., None], change), np.float32)
