"""The slope of a gel into which a handle is pressed: shape, texture, the gel's own smoothness.

All at half the image's resolution (160 × 120), where a pixel is about 0.13 mm: finer detail
than that the gel does not pass on. Knows nothing about colour, markers or noise.

Background of our choices: docs/decisions/0012.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from taxel.sim.gelsight.camera import HEIGHT_PX, WIDTH_PX, cv2
from taxel.sim.pour.state import HandleShape

Image = NDArray[np.float32]

HALF_PX = (WIDTH_PX // 2, HEIGHT_PX // 2)
_TOUCH_FROM = 0.5
"""Share of the deepest indentation at which contact ends: a long cylinder's sag at the rim of
its elastic contact is half its indentation (Johnson, Contact Mechanics, section 4.2)."""
_FADE = 0.2
"""Share of the deepest indentation over which the free gel rises to its rest. Source: our
choice; real imprints of round objects show no rim."""
_FULL_TOUCH_MM = 0.1
"""Indentation below which the imprint fades, so that letting go leaves no jump."""
_EDGE_SLOPE = 1.2
"""Slope of the handle's flank beyond its width: as steep as any calibrated."""
_FILLET_MM = 0.5
"""Length over which the flank turns down. Source: our choice, moulded handles."""
_GEL_BLUR_MM = 0.08
"""Detail that the gel's coat smooths away, standard deviation. Source: our choice; ridges
0.3 mm apart are still seen in real frames."""
_TEXTURE_MM_PER_PX = 0.1
_TEXTURE_SIDE = 640
"""64 mm: what a 26 mm image diagonal can reach in a slide of 15 mm."""
_TEXTURE_SLOPE_LIMIT = 0.5
_LEAST_DEPTH_MM = 1e-3
"""Below it nothing is seen, and nothing is divided by it."""


class GelSurface:
    """Slopes of one gel under one handle."""

    def __init__(self, shape: HandleShape, mm_per_px: float) -> None:
        self._shape = shape
        self._mm_per_px = mm_per_px
        x = ((np.arange(HALF_PX[0]) + 0.5) * 2 - WIDTH_PX / 2) * mm_per_px
        y = ((np.arange(HALF_PX[1]) + 0.5) * 2 - HEIGHT_PX / 2) * mm_per_px
        self._x, self._y = (grid.astype(np.float32) for grid in np.meshgrid(x, y))
        self._texture = _texture_slopes(
            shape.texture_um, shape.texture_mm, shape.texture_along, shape.texture_seed
        )

    def slopes(
        self,
        depth_mm: float,
        object_mm: NDArray[np.float64],
        object_rad: float,
        free: tuple[Image, Image] | None = None,
    ) -> tuple[Image, Image]:
        """Return (d depth/dx, d depth/dy), shape (120, 160) each, mm per mm.

        Args:
            depth_mm: Deepest indentation; less than a micrometre gives a flat gel.
            object_mm: The handle's movement (x, y) since the grasp.
            object_rad: Its rotation, clockwise as seen.
            free: Slopes (along x, y) of the gel where nothing touches it, of any resolution.
        """
        if depth_mm < _LEAST_DEPTH_MM:
            flat = np.zeros_like(self._x)
            return (flat, flat) if free is None else _at_half(free)
        angle = self._shape.axis_rad + object_rad
        cos, sin = np.float32(np.cos(angle)), np.float32(np.sin(angle))
        x = self._x - np.float32(object_mm[0])
        y = self._y - np.float32(object_mm[1])
        across, along = cos * x + sin * y, cos * y - sin * x
        slope_across, drop_across = self._profile_across(across)
        slope_along = np.float32(-1 / self._shape.radius_along_mm) * along
        pressed = np.float32(1 - _TOUCH_FROM) - (
            drop_across - slope_along * along / 2
        ) / np.float32(depth_mm)
        touch = _soft_step(pressed / np.float32(_FADE))
        touch *= np.float32(min(depth_mm / _FULL_TOUCH_MM, 1.0))
        texture = self._texture_at(object_mm, cos, sin)
        slope_across = (slope_across + texture[..., 0]) * touch
        slope_along = (slope_along + texture[..., 1]) * touch
        right = cos * slope_across - sin * slope_along
        down = sin * slope_across + cos * slope_along
        if free is not None:
            untouched, (free_right, free_down) = 1 - touch, _at_half(free)
            right += untouched * free_right
            down += untouched * free_down
        return right, down

    def _profile_across(self, across: Image) -> tuple[Image, Image]:
        """Return the handle's (slope, drop in mm) at distances across its axis, millimetres."""
        beyond = np.maximum(np.abs(across) - np.float32(self._shape.width_mm / 2), 0)
        fillet = np.minimum(beyond, np.float32(_FILLET_MM))
        steep = np.float32(_EDGE_SLOPE / _FILLET_MM) * fillet
        round_slope = across * np.float32(1 / self._shape.radius_across_mm)
        drop = round_slope * across / 2 + steep * (beyond - fillet / 2)
        return -round_slope - np.copysign(steep, across), drop

    def _texture_at(
        self, object_mm: NDArray[np.float64], cos: np.float32, sin: np.float32
    ) -> Image:
        """Return the texture's slopes (across, along) where the handle now is."""
        scale = 2 * self._mm_per_px / _TEXTURE_MM_PER_PX
        middle = (_TEXTURE_SIDE - 1) / 2
        turn = np.array([[cos, sin], [-sin, cos]])
        start = np.array([self._x[0, 0], self._y[0, 0]]) - object_mm
        matrix = np.column_stack([turn * scale, turn @ start / _TEXTURE_MM_PER_PX + middle])
        return np.asarray(
            cv2.warpAffine(
                self._texture,
                matrix,
                HALF_PX,
                flags=cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP,
                borderMode=cv2.BORDER_REFLECT_101,
            ),
            np.float32,
        )


def _at_half(slopes: tuple[Image, Image]) -> tuple[Image, Image]:
    """Return slopes at half the image's resolution."""
    right, down = (
        np.asarray(cv2.resize(each, HALF_PX, interpolation=cv2.INTER_LINEAR), np.float32)
        for each in slopes
    )
    return right, down


def _soft_step(value: Image) -> Image:
    """Return 0…1 through ½ at 0: the logistic function, cheap and without overflow."""
    return np.asarray(np.tanh(value / 2) / 2, np.float32) + np.float32(0.5)


@lru_cache(maxsize=4)
def _texture_slopes(rms_um: float, wavelength_mm: float, ridges: float, seed: int) -> Image:
    """Return a texture's slopes in the handle's frame, shape (640, 640, 2): across, along.

    Kept for a cup's next pours, both sides of two cups: 13 MB.
    """
    if rms_um <= 0:
        return np.zeros((_TEXTURE_SIDE, _TEXTURE_SIDE, 2), np.float32)
    random = np.random.default_rng((seed, 0x7E57))
    height = np.zeros((_TEXTURE_SIDE, _TEXTURE_SIDE))
    for share, along in ((1 - ridges, 1.0), (ridges, 12.0)):
        if share > 0:
            height += share * _band(wavelength_mm, along, random)
    height *= rms_um / 1000 / height.std()
    smooth = cv2.GaussianBlur(height, (0, 0), _GEL_BLUR_MM / _TEXTURE_MM_PER_PX)
    down, right = np.gradient(smooth, _TEXTURE_MM_PER_PX)
    both = np.stack([right, down], axis=-1).clip(-_TEXTURE_SLOPE_LIMIT, _TEXTURE_SLOPE_LIMIT)
    slopes = np.asarray(both, dtype=np.float32)
    slopes.flags.writeable = False
    return slopes


def _band(wavelength_mm: float, stretch: float, random: np.random.Generator) -> NDArray[np.float64]:
    """Return unit noise around one wavelength, `stretch` times longer along the handle."""
    frequency = np.fft.fftfreq(_TEXTURE_SIDE, _TEXTURE_MM_PER_PX)
    across, along = np.meshgrid(frequency, frequency)
    radius = np.hypot(across, along * stretch) * wavelength_mm
    pass_band = np.exp(-(((radius - 1) / 0.4) ** 2))
    white = np.fft.fft2(random.standard_normal((_TEXTURE_SIDE, _TEXTURE_SIDE)))
    band = np.fft.ifft2(white * pass_band).real
    return np.asarray(band / band.std())
