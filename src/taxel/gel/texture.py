"""How far the imprint of what is held has wandered over the gel image.

The imprint's fine shading moves with the object; the dots move with the gel.
Here the dots are painted over and only the imprint is followed, against a key
frame that is renewed when it has moved far, so small steps do not add up their
noise. Knows nothing about dots' own movement or about slip.

Background of our choices: docs/decisions/0012.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from taxel.gel.markers import Rgb, relative_brightness

_WORK_WIDTH = 160
"""Pixels a row at which the imprint is followed."""
_INK = 0.85
_HIGH_PASS_PX = 13
"""At that width: coarser shading is the lamps' and the indentation's, not the imprint's."""
_CONTRAST = 5.0
"""Gain from grey levels of texture to those that the optical flow sees."""
_LEAST_TEXTURE = 1.2
"""Grey levels of local contrast: a real gel's noise after shrinking is 0.4 to 0.8."""
_MIX = np.array([[0.8, 0.3, -0.3]], np.float32)
"""Weights of red, green and blue: red and blue lamps face each other, so their imprints are
opposite and would cancel in a plain grey. Our choice."""
_GRID = 5
"""Pixels at that width between places at which movement is read."""


@dataclass(frozen=True, slots=True)
class TextureFlow:
    """Movement of the imprint at places that show some, since the key frame."""

    places: NDArray[np.float32]
    """Shape (n, 2): x, y in the key frame, px of the whole image."""
    steps: NDArray[np.float32]
    """Shape (n, 2): movement, px of the whole image."""
    contrast: NDArray[np.float32]
    """Shape (n,): how much texture there is, grey levels."""


class TextureFollower:
    """Follows the imprint from a key frame; call `renew` to make the last frame the key.

    Args:
        shape: Height and width of the frames, px.
    """

    def __init__(self, shape: tuple[int, ...]) -> None:
        self._scale = max(1.0, shape[1] / _WORK_WIDTH)
        self._size = (round(shape[1] / self._scale), round(shape[0] / self._scale))
        self._flow = cv2.DISOpticalFlow.create(cv2.DISOPTICAL_FLOW_PRESET_ULTRAFAST)
        self._flow.setFinestScale(1)
        self._key: tuple[NDArray[np.uint8], NDArray[np.float32]] | None = None
        self._last: tuple[NDArray[np.uint8], NDArray[np.float32]] | None = None
        x = np.arange(_GRID // 2, self._size[0], _GRID)
        y = np.arange(_GRID // 2, self._size[1], _GRID)
        self.px_per_place = (_GRID * self._scale) ** 2
        """Pixels of the whole image for each place at which movement is read."""
        self._at = np.ix_(y, x)
        grid = np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2)
        self._places = ((grid + 0.5) * self._scale - 0.5).astype(np.float32)

    def follow(self, rgb: Rgb) -> TextureFlow:
        """Return the imprint's movement from the key frame to this one; the first is the key."""
        self._last = self._texture(rgb)
        if self._key is None:
            self._key = self._last
        (before, contrast), (now, contrast_now) = self._key, self._last
        flow = self._flow.calc(before, now, np.zeros((*now.shape, 2), np.float32))
        strength = np.minimum(contrast[self._at], contrast_now[self._at]).ravel()
        shown = strength > _LEAST_TEXTURE
        steps = flow[self._at].reshape(-1, 2)[shown] * self._scale
        return TextureFlow(self._places[shown], steps.astype(np.float32), strength[shown])

    def renew(self) -> None:
        """Make the last frame the key frame."""
        self._key = self._last

    def _texture(self, rgb: Rgb) -> tuple[NDArray[np.uint8], NDArray[np.float32]]:
        """Return the imprint without dots about grey 128, and its local contrast, (h, w)."""
        small = np.asarray(cv2.resize(rgb, self._size, interpolation=cv2.INTER_AREA), np.uint8)
        ink = (relative_brightness(small, 15) < _INK).astype(np.uint8)
        keep = (1 - cv2.dilate(ink, np.ones((3, 3), np.uint8))).astype(np.float32)
        grey = cv2.transform(small.astype(np.float32), _MIX)
        bare = cv2.multiply(grey, keep, dtype=cv2.CV_32F)
        side = (_HIGH_PASS_PX, _HIGH_PASS_PX)
        around = cv2.divide(cv2.blur(bare, side), np.maximum(cv2.blur(keep, side), 1e-3))
        fine = (bare - around) * keep
        contrast = cv2.sqrt(cv2.blur(cv2.multiply(fine, fine), (5, 5)))
        image = cv2.convertScaleAbs(fine * np.float32(_CONTRAST) + np.float32(128))
        return np.asarray(image, np.uint8), np.asarray(contrast * keep, np.float32)
