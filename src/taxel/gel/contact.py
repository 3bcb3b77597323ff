"""Where something touches the gel: the change of colour against a touch-free frame.

Exposure is divided out and dots are left out before the comparison. Knows
nothing about shape, force or movement.

Background of our choices: docs/decisions/0012.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from taxel.gel.markers import Rgb, brightest, check_like, check_rgb, relative_brightness

_WORK_WIDTH = 160
"""Pixels a row at which change is judged: finer is noise, and four times the work."""
_CLOSING_PX = 15
"""At that width: wider than the widest dot (9), narrower than the widest spacing (22)."""
_INK = 0.8
"""Brightness against the surroundings under which a pixel belongs to a dot or its rim."""
_RIM_PX = 5
"""Dots are widened by this at that width: their rims throw coloured shadows in real frames."""
_LEAST_CHANGE = 0.06
"""Share of the reference's brightness: our choice; measured noise after blurring is 0.01."""
_OF_STRONGEST = 0.3
"""Of the strongest change: the gel also slopes around a contact. Source: our fit on Taxim's 24
ball presses (overlap with the annotated circles 0.35 without it, 0.64 with it)."""
_NOISE_MULTIPLE = 6.0
"""Robust standard deviations of the bare gel's change: our choice."""
_MOST_ASKED = 0.18
"""Change that is always contact: where most of the gel is touched, "noise" is contact too.
Source: 0.3 of a ball press's strongest change, 0.6."""
_DIM = 4.0
"""Grey levels added before dividing, so that noise in dark corners is no change."""
_OPENING_PX, _JOINING_PX = 3, 9
"""At that width: specks smaller than the first go, gaps smaller than the second close."""
_LEAST_SHARE = 0.002
"""Of the image: the smallest touch that is reported, 150 px of 320x240."""


@dataclass(frozen=True, slots=True)
class ContactShape:
    """A contact's place, size and direction."""

    area_px: float
    """Pixels in contact; 0 without contact, and then all of the rest is 0."""
    centre_px: NDArray[np.float32]
    """Shape (2,): x, y, px."""
    axes_px: NDArray[np.float32]
    """Shape (2,): half axes of the ellipse of equal moments, long first, px."""
    angle_rad: float
    """Of the long axis, from x towards y, in (-pi/2, pi/2], radians."""


class ContactFinder:
    """Compares frames with one touch-free (or settled) reference.

    Args:
        reference: Shape (height, width, 3), red first.
    """

    def __init__(self, reference: Rgb) -> None:
        check_rgb(reference)
        self._shape = reference.shape
        shrink = max(1.0, reference.shape[1] / _WORK_WIDTH)
        self._size = (round(reference.shape[1] / shrink), round(reference.shape[0] / shrink))
        small = self._small(reference)
        self._ink = ink_mask(small)
        self.reference: NDArray[np.float32] = _without_ink(small, self._ink)
        """Shape about (120, 160, 3): the reference without dots, smoothed, grey levels + 4."""

    def _small(self, rgb: Rgb) -> Rgb:
        return np.asarray(cv2.resize(rgb, self._size, interpolation=cv2.INTER_AREA), np.uint8)

    def change(self, rgb: Rgb) -> NDArray[np.float32]:
        """Return how much each place changed, as a share of the reference's brightness.

        Args:
            rgb: Shape as the reference's.

        Returns:
            Shape about (120, 160), unitless, at least 0.

        Raises:
            BadSource: The frame has another shape than the reference.
        """
        check_like(rgb, self._shape)
        small = self._small(rgb)
        bare = _without_ink(small, self._ink | ink_mask(small))
        ratio = np.asarray(cv2.divide(bare, self.reference), np.float32)
        exposure = np.median(ratio[::6, ::6].reshape(-1, 3), axis=0)
        even = ratio * (1 / np.maximum(exposure, 1e-3)).astype(np.float32)
        return brightest(np.abs(even - np.float32(1)))

    def mask(self, rgb: Rgb) -> NDArray[np.bool_]:
        """Return where the gel is touched, shape (height, width).

        Raises:
            BadSource: The frame has another shape than the reference.
        """
        return self.mask_of(self.change(rgb))

    def mask_of(self, change: NDArray[np.float32]) -> NDArray[np.bool_]:
        """Return `mask` for what `change` has returned, shape (height, width) of a frame."""
        height, width = self._shape[:2]
        whole = cv2.resize(_touched(change), (width, height), interpolation=cv2.INTER_LINEAR)
        return np.asarray(whole > 0)

    def at_work(self, mask: NDArray[np.bool_]) -> NDArray[np.bool_]:
        """Return a mask of a frame, shape (height, width), at the size of `change`."""
        small = cv2.resize(mask.astype(np.uint8), self._size, interpolation=cv2.INTER_NEAREST)
        return np.asarray(small > 0)


def contact_mask(rgb: Rgb, reference: Rgb) -> NDArray[np.bool_]:
    """Return where the gel is touched in one frame but not in another.

    Args:
        rgb: Shape (height, width, 3), red first.
        reference: The same gel untouched (or as it settled: then the change
            of contact is found), same shape.

    Returns:
        Shape (height, width).

    Raises:
        BadSource: Shapes differ, or are none of colour images.
    """
    return ContactFinder(reference).mask(rgb)


def contact_shape(mask: NDArray[np.bool_]) -> ContactShape:
    """Return a contact's area, middle and half axes.

    Args:
        mask: Shape (height, width).
    """
    moments = cv2.moments(mask.astype(np.uint8), binaryImage=True)
    area = moments["m00"]
    if area <= 0:
        return ContactShape(0.0, np.zeros(2, np.float32), np.zeros(2, np.float32), 0.0)
    centre = np.array([moments["m10"], moments["m01"]]) / area
    xx, yy, xy = (moments[name] / area for name in ("mu20", "mu02", "mu11"))
    spread = float(np.hypot(xx - yy, 2 * xy))
    axes = np.sqrt(np.maximum(2.0 * np.array([xx + yy + spread, xx + yy - spread]), 0.0))
    angle = 0.5 * float(np.arctan2(2 * xy, xx - yy))
    return ContactShape(float(area), centre.astype(np.float32), axes.astype(np.float32), angle)


def imprint_mask(rgb: Rgb) -> NDArray[np.bool_]:
    """Return where one frame alone shows an imprint, shape (height, width).

    For a settled reference that is already in touch: what departs from a
    cubic surface of light. A flat, smooth contact does not show.

    Args:
        rgb: Shape (height, width, 3), red first.
    """
    finder = ContactFinder(rgb)
    bare = finder.reference
    height, width = bare.shape[:2]
    y, x = np.mgrid[-1 : 1 : height * 1j, -1 : 1 : width * 1j]
    terms = np.stack([x**i * y**j for i in range(4) for j in range(4 - i)], axis=-1)
    sparse = terms[::4, ::4].reshape(-1, terms.shape[-1])
    light = terms @ np.linalg.lstsq(sparse, bare[::4, ::4].reshape(-1, 3), rcond=None)[0]
    change = np.abs(bare / np.maximum(light, _DIM) - 1).max(axis=2)
    return finder.mask_of(np.asarray(change, np.float32))


def ink_mask(rgb: Rgb) -> NDArray[np.uint8]:
    """Return 1 on dots and their rims, shape (h, w), for an image about 160 pixels wide."""
    ink = (relative_brightness(rgb, _CLOSING_PX) < _INK).astype(np.uint8)
    return np.asarray(cv2.dilate(ink, np.ones((_RIM_PX, _RIM_PX), np.uint8)), np.uint8)


def _without_ink(rgb: Rgb, ink: NDArray[np.uint8]) -> NDArray[np.float32]:
    """Return the smoothed image with dots filled from beside them, plus `_DIM`.

    Shape (h, w, 3), grey levels.
    """
    keep = np.asarray(1 - ink, np.float32)
    bare = cv2.multiply(rgb, cv2.merge([keep] * 3), dtype=cv2.CV_32F)
    near = [cv2.GaussianBlur(part, (9, 9), 1.5) for part in (bare, keep)]
    far = [cv2.blur(part, (13, 13)) for part in (bare, keep)]
    total, share = (a + 0.02 * b for a, b in zip(near, far, strict=True))
    smooth = cv2.divide(total, cv2.merge([np.maximum(share, 1e-6)] * 3))
    return np.asarray(smooth + np.float32(_DIM), np.float32)


def _touched(change: NDArray[np.float32]) -> NDArray[np.uint8]:
    """Return 1 where the change is that of a touch, shape as the change's."""
    usual = change[::4, ::4]
    noise = 1.4826 * float(np.median(usual[usual <= np.median(usual)]))
    strongest = float(np.partition(change[::2, ::2], -3, axis=None)[-3])
    asked = min(max(_NOISE_MULTIPLE * noise, _OF_STRONGEST * strongest), _MOST_ASKED)
    return _tidy((change > max(_LEAST_CHANGE, asked)).astype(np.uint8))


def _tidy(touched: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """Drop specks, close gaps, fill holes (a flat contact's middle) and drop what is small."""
    small = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (_OPENING_PX, _OPENING_PX))
    wide = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (_JOINING_PX, _JOINING_PX))
    opened = cv2.morphologyEx(touched, cv2.MORPH_OPEN, small)
    joined = cv2.morphologyEx(opened, cv2.MORPH_CLOSE, wide)
    outlines, _ = cv2.findContours(joined, cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_SIMPLE)
    filled = np.zeros_like(touched)
    large = [o for o in outlines if cv2.contourArea(o) >= _LEAST_SHARE * touched.size]
    cv2.drawContours(filled, large, -1, 1, cv2.FILLED)
    return filled
