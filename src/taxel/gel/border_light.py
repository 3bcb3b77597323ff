"""Whether a camera still shows the gel of this grasp: by the light at its image's borders.

Lamps, lens and camera give the left and right border a light of their own, which touch hardly
changes: an imprint that slides over it is gone again, or covers less than a third of it. A picture
that is mirrored, turned, shifted or another gel's changes nearly all of it at once, and for good.
Even changes of brightness or of one colour are taken off. Knows nothing about slip or decisions.

Source: docs/decisions/0037.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import cv2
import numpy as np
from numpy.typing import NDArray

from taxel.gel.markers import Rgb

_FINE: Final = (64, 48)
_PLACES: Final = (16, 12)
_BLUR: Final = 2.0
"""Columns and rows to which an image is shrunk for the blur, the blur's standard deviation there,
and the places that are compared. Source: our choice, decision 37."""
_COLUMNS: Final = 3
"""Columns of places at either side that are compared. Source: our choice, decision 37."""
_SHARE: Final = 0.35
"""Share of the places that may be as they were. Source: our choice, decision 37."""
_DIM: Final = 4.0
"""Grey levels added before the logarithm, so that noise in dark corners is no change."""
_DARKEST: Final = 12.0
"""Mean grey level of the border below which it shows no light that could be compared: such an image
changes nothing. Source: our choice, decision 37."""
_CHANGE: Final = 0.032
"""Change of the logarithm of the light, from one image to the next, that touch does not make in
`_IMAGES` images: simulated grasps reach 0.019. Source: our choice, decision 37."""
_STEP_S: Final = 0.04
"""Time between images at which `_CHANGE` holds; it grows with the root of longer times, as motion
between images does. Source: our choice, decision 37."""
_LONGEST_S: Final = 0.2
"""Time beyond which it grows no more. Source: our choice, decision 37."""
_IMAGES: Final = 3
"""Images in a row that must show another light, or again the earlier one: an object that falls out
of the picture crosses the border in two. Source: our choice, decision 37."""
_LASTS_S: Final = 0.07
"""Time for which they must at least show it, where a camera is quick: less than two images take of
a GelSight Mini. Source: our choice, decision 37."""

Light = NDArray[np.float32]
"""Shape (12 · 2 · 3, 3): logarithm of the light at each place, by colour."""


class BorderLight:
    """Follows the light of one camera's images from a settled grasp on.

    Args:
        settled: One or more images of the settled grasp, each of shape (height, width, 3).
    """

    def __init__(self, settled: Sequence[Rgb]) -> None:
        lights = [border_light(image) for image in settled]
        self._settled = np.asarray(np.median(np.stack(lights), axis=0), np.float32)
        self._good, self._good_s = self._settled, float("-inf")
        self._limit = 0.0
        self._other = self._back = 0
        self._other_s = float("-inf")
        self.exchanged = False
        """True while the images are not those of this grasp."""

    @property
    def doubted(self) -> bool:
        """True where the newest image shows another light, and it is not clear yet for how long."""
        return self._other > 0 and not self.exchanged

    def take(self, rgb: Rgb, taken_s: float) -> None:
        """Take in the next image.

        Args:
            rgb: Shape (height, width, 3), red first.
            taken_s: When it was taken, seconds.
        """
        light = border_light(rgb)
        if float(np.exp(light).mean()) - _DIM < _DARKEST:
            return
        change = light_change(np.stack([self._good, self._settled]), light)
        if not self._other:
            self._limit = _limit(taken_s - self._good_s)
            self._other_s = taken_s
        other = change > self._limit
        if self.exchanged:
            self._back = 0 if other else self._back + 1
            if self._back < _IMAGES:
                return
        elif other:
            self._other += 1
            brief = 0 < taken_s - self._other_s < _LASTS_S
            self.exchanged = self._other >= _IMAGES and not brief
            return
        self._good, self._good_s = light, taken_s
        self._other = self._back = 0
        self.exchanged = False


def border_light(rgb: Rgb) -> Light:
    """Return the light at an image's left and right border, shape (72, 3).

    Args:
        rgb: Shape (height, width, 3), red first.
    """
    fine = cv2.resize(rgb, _FINE, interpolation=cv2.INTER_AREA).astype(np.float32)
    smooth = cv2.GaussianBlur(fine, (0, 0), _BLUR)
    places = cv2.resize(smooth, _PLACES, interpolation=cv2.INTER_AREA)
    border = np.concatenate([places[:, :_COLUMNS], places[:, -_COLUMNS:]], axis=1)
    return np.asarray(np.log(border + _DIM).reshape(-1, 3), np.float32)


def light_change(before: Light, now: Light) -> float:
    """Return by how much the light has changed where it has changed least, as a logarithm.

    Even changes of a colour count nothing; a share of the places changed by no more than this.

    Args:
        before: Shape (n, 72, 3), as `border_light` returns them: the most similar counts.
        now: Shape (72, 3).
    """
    change = now - before
    places = change.shape[1]
    change -= np.sort(change, axis=1)[:, places // 2, None]
    size = np.sort(np.abs(change).max(axis=2), axis=1)
    return float(size[:, round(_SHARE * places)].min())


def _limit(elapsed_s: float) -> float:
    """Return the change that touch does not make within a time; a clock set back tells no time."""
    longer_s = min(elapsed_s, _LONGEST_S) if elapsed_s > _STEP_S else _STEP_S
    return _CHANGE * float(np.sqrt(longer_s / _STEP_S))
