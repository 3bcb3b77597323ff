"""Markers printed under a gel's coat, and how the gel carries them along.

The gel moves as one under the contact patch and less and less outside it, unless it is given how
its face shears; an indentation pushes it outwards. Both are smooth fields, computed at a quarter
of the image's resolution; the layer of markers is then warped, so that markers move by fractions
of a pixel. Knows nothing about noise or about what is pressed in.

Background of our choices: docs/decisions/0012.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from taxel.gel.shading import Shading
from taxel.sim.gelsight.camera import HEIGHT_PX, WIDTH_PX, SensorNuisance, cv2

Image = NDArray[np.float32]

_MARGIN_PX = 64
"""Markers beyond the image, that a shear may bring into it."""
_EDGE_PX = 3.0
"""Width over which a marker's rim fades. Source: real frames."""
_UNEVEN = 0.02
"""Of a marker's rim, standard deviation per wave, relative. Source: real frames."""
_RELIEF_BLUR_PX = 2.0
"""Reach of the coloured rim round a marker. Source: real frames."""
_INK_RGB = np.array([1.15, 1.0, 0.88])
"""Brightness of the ink in red, green, blue, relative. Source: real frames."""
_SPECKLE = 0.035
"""Of the ink, standard deviation, share of the background. Source: real frames."""
_QUARTER_PX = (WIDTH_PX // 4, HEIGHT_PX // 4)
_DECAY_MM = 4.0
"""Distance beyond the patch at which the gel's movement has fallen to 1/e. Source: our choice,
about the gel's thickness of 4.5 mm."""
_DILATION = 0.07
"""Outward movement at the patch's rim, millimetres per millimetre of indentation. Source: our
choice within what FOTS (RA-L 2024) fits to a GelSight."""


class MarkerLayer:
    """The markers of one sensor, as a mask that moves."""

    def __init__(self, sensor: SensorNuisance, seed: int, shading: Shading, light: Image) -> None:
        self._mm_per_px = sensor.mm_per_px
        self._mask = _printed(sensor, np.random.default_rng((seed, 0x3A2)), shading, light)
        x = (np.arange(_QUARTER_PX[0]) + 0.5) * 4 - 0.5
        y = (np.arange(_QUARTER_PX[1]) + 0.5) * 4 - 0.5
        self._x, self._y = (grid.astype(np.float32) for grid in np.meshgrid(x, y))
        self._full_x, self._full_y = (
            grid.astype(np.float32) + _MARGIN_PX
            for grid in np.meshgrid(np.arange(WIDTH_PX), np.arange(HEIGHT_PX))
        )

    def displacement_px(
        self,
        *,
        depth_mm: float,
        middle_mm: NDArray[np.float64],
        axis_rad: float,
        patch_mm: NDArray[np.float64],
        gel_mm: NDArray[np.float64],
        gel_rad: float,
        face_mm: tuple[Image, Image] | None = None,
    ) -> tuple[Image, Image]:
        """Return the gel's movement (x, y) at a quarter of the resolution, pixels, (60, 80) each.

        Args:
            depth_mm: Deepest indentation.
            middle_mm: Middle of the contact patch (x, y) from the image's middle.
            axis_rad: Direction of the patch's long axis, 0 = vertical, clockwise.
            patch_mm: Half axes of the patch (across, along).
            gel_mm: Movement of the gel in the middle of the patch (x, y).
            gel_rad: Its twist there, clockwise.
            face_mm: Movement (x, y) of the gel's face by shear, of any resolution, in place of
                what `gel_mm` and `gel_rad` say; None moves the gel as one rigid piece.
        """
        scale = np.float32(self._mm_per_px)
        x = (self._x - np.float32((WIDTH_PX - 1) / 2)) * scale - np.float32(middle_mm[0])
        y = (self._y - np.float32((HEIGHT_PX - 1) / 2)) * scale - np.float32(middle_mm[1])
        cos, sin = np.float32(np.cos(axis_rad)), np.float32(np.sin(axis_rad))
        half = np.maximum(patch_mm, 0.5).astype(np.float32)
        across, along = (cos * x + sin * y) / half[0], (cos * y - sin * x) / half[1]
        radius = np.sqrt(across * across + along * along)
        push = np.exp(np.float32(0.5) - radius * radius / 2) * np.float32(
            _DILATION * max(depth_mm, 0.0) / half.mean()
        )
        if face_mm is None:
            right, down = _rigid_mm(x, y, radius, gel_mm, gel_rad)
        else:
            right, down = (
                np.asarray(
                    cv2.resize(each, _QUARTER_PX, interpolation=cv2.INTER_LINEAR), np.float32
                )
                for each in face_mm
            )
        return (right + push * x) / scale, (down + push * y) / scale

    def light(self, right_px: Image, down_px: Image) -> Image:
        """Return the share of light that the moved markers leave, shape (240, 320, 3)."""
        size = (WIDTH_PX, HEIGHT_PX)
        from_x = self._full_x - cv2.resize(right_px, size, interpolation=cv2.INTER_LINEAR)
        from_y = self._full_y - cv2.resize(down_px, size, interpolation=cv2.INTER_LINEAR)
        return np.asarray(
            cv2.remap(
                self._mask, from_x, from_y, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE
            ),
            np.float32,
        )


def _rigid_mm(
    x: Image, y: Image, radius: Image, gel_mm: NDArray[np.float64], gel_rad: float
) -> tuple[Image, Image]:
    """Return a rigid movement (x, y) under the patch that fades beyond its rim, radius 1."""
    beyond = 1 - 1 / np.maximum(radius, np.float32(1))
    outside = np.hypot(x, y) * beyond * np.float32(1 / _DECAY_MM)
    carried = np.exp(-outside * outside)
    less, turn = np.float32(1 - np.cos(gel_rad)), np.float32(np.sin(gel_rad))
    return (
        carried * (np.float32(gel_mm[0]) + less * x - turn * y),
        carried * (np.float32(gel_mm[1]) + turn * x + less * y),
    )


def _printed(
    sensor: SensorNuisance, random: np.random.Generator, shading: Shading, light: Image
) -> Image:
    """Return the share of light the markers leave, with a margin: shape (368, 448, 3).

    A marker stands out of the coat a little, so that the lamps colour its rim.
    """
    height, width = HEIGHT_PX + 2 * _MARGIN_PX, WIDTH_PX + 2 * _MARGIN_PX
    cover = np.zeros((height, width), np.float32)
    reach = int(np.hypot(height, width) / 2 / sensor.marker_spacing_px) + 2
    steps = np.arange(-reach, reach + 1) * sensor.marker_spacing_px
    cos, sin = np.cos(sensor.marker_tilt_rad), np.sin(sensor.marker_tilt_rad)
    for step_y in steps:
        for step_x in steps:
            x = (width - 1) / 2 + sensor.marker_offset_px[0] + cos * step_x - sin * step_y
            y = (height - 1) / 2 + sensor.marker_offset_px[1] + sin * step_x + cos * step_y
            x, y = np.array([x, y]) + random.normal(0, 0.012 * sensor.marker_spacing_px, 2)
            if 16 < x < width - 16 and 16 < y < height - 16:
                _print_one(cover, float(x), float(y), sensor, random)
    bump = cv2.GaussianBlur(cover, (0, 0), _RELIEF_BLUR_PX)
    steepest = 1 / (_RELIEF_BLUR_PX * np.sqrt(2 * np.pi))
    down, right = np.gradient(bump * sensor.marker_relief / steepest)
    rim = shading.render(right, down) / light.mean(axis=(0, 1))
    speckle = cv2.GaussianBlur(random.normal(0, 1, cover.shape), (0, 0), 0.7)
    ink = (sensor.marker_darkness + _SPECKLE * speckle / speckle.std()).clip(0.15, 0.9)
    left = (1 - cover[..., None] * (1 - ink[..., None] * _INK_RGB)) * (1 + rim).clip(0.5, 1.6)
    return np.asarray(left, dtype=np.float32)


def _print_one(
    cover: Image, x: float, y: float, sensor: SensorNuisance, random: np.random.Generator
) -> None:
    """Print one marker: a disc with a slightly uneven rim."""
    radius = sensor.marker_diameter_px / 2 * random.uniform(0.95, 1.05)
    left, top, side = int(x) - 15, int(y) - 15, 31
    right, down = np.meshgrid(np.arange(left, left + side) - x, np.arange(top, top + side) - y)
    angle = np.arctan2(down, right)
    uneven = sum(
        random.normal(0, _UNEVEN) * np.cos(wave * angle + random.uniform(0, 6.3))
        for wave in (2, 3, 4)
    )
    disc = ((radius * (1 + uneven) - np.hypot(right, down)) / _EDGE_PX + 0.5).clip(0, 1)
    patch = cover[top : top + side, left : left + side]
    patch[:] = np.maximum(patch, disc * disc * (3 - 2 * disc))
