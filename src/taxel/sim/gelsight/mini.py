"""A simulated GelSight Mini looking at a gel into which a handle is pressed.

Slopes of the gel (`surface`) are coloured by the shading of a real sensor
(`taxel.gel.shading`), markers are carried along (`markers`), light, wear, grain and
exposure differ from sensor to sensor (`camera`). Knows nothing about forces or files.
"""

from __future__ import annotations

from functools import cache

import numpy as np
from numpy.typing import NDArray

from taxel.gel.shading import Shading, read_shading
from taxel.sim.gelsight.camera import (
    HEIGHT_PX,
    WIDTH_PX,
    CameraTimes,
    NoisePool,
    SensorNuisance,
    camera_times,
    cv2,
    draw_sensor,
    exposure,
    lamp_light,
    wear,
)
from taxel.sim.gelsight.markers import MarkerLayer
from taxel.sim.gelsight.shear import ShearView
from taxel.sim.gelsight.surface import HALF_PX, GelSurface
from taxel.sim.pour.state import GelMotion, HandleShape
from taxel.sim.pour.views import FaceShear

__all__ = ["CameraTimes", "GelCamera", "SensorNuisance", "camera_times", "draw_sensor"]

_SIZE = (WIDTH_PX, HEIGHT_PX)


@cache
def _shipped_shading() -> Shading:
    """Read once: each new shading computes a table that takes 0.1 s."""
    return read_shading()


class GelCamera:
    """One sensor that looks at one handle.

    Args:
        shape: The handle in this gel.
        sensor: This sensor's light, markers and noise: see `draw_sensor`.
        seed: Of grain, wear and the print of the markers.
        shading: How the gel's colour follows its slope; None takes a GelSight Mini's.
    """

    def __init__(
        self,
        shape: HandleShape,
        sensor: SensorNuisance,
        seed: int,
        shading: Shading | None = None,
    ) -> None:
        self._axis_rad = shape.axis_rad
        self._sensor = sensor
        self._shading = _shipped_shading() if shading is None else shading
        self._surface = GelSurface(shape, sensor.mm_per_px)
        self._shear = ShearView(sensor.mm_per_px)
        light = lamp_light(sensor)
        self._markers = MarkerLayer(sensor, seed, self._shading, light)
        self._still = light + wear(sensor, np.random.default_rng((seed, 0x3EA2)))
        middle = light[HEIGHT_PX // 2 - 8 : HEIGHT_PX // 2 + 8, WIDTH_PX // 2 - 8 :][:, :16]
        self._relative_light = np.sqrt(cv2.resize(light, HALF_PX) / middle.mean(axis=(0, 1)))
        self._relative_light *= np.asarray(sensor.gain, np.float32)
        self._noise = NoisePool(sensor, seed)

    def frame(
        self, motion: GelMotion, index: int, time_s: float, shear: FaceShear | None = None
    ) -> NDArray[np.uint8]:
        """Return the image at one moment, shape (240, 320, 3), red first.

        Args:
            motion: How handle and gel move.
            index: Which moment of `motion`; also picks the frame's grain.
            time_s: Seconds since the recording began: exposure settles, brightness drifts.
            shear: How the gel's face shears as an elastic layer; None moves the gel under the
                contact as one rigid piece.
        """
        image: NDArray[np.float32] = self._light(motion, index, shear)
        noise, flicker = self._noise.at(index)
        cv2.add(image, noise, dst=image)
        factor, offset = exposure(self._sensor, time_s, flicker)
        np.maximum(image, 0, out=image)
        return np.asarray(cv2.convertScaleAbs(image, alpha=factor, beta=offset), np.uint8)

    def face(
        self, motion: GelMotion, index: int, shear: FaceShear | None = None
    ) -> tuple[NDArray[np.float32], NDArray[np.float32], NDArray[np.float32]]:
        """Return the gel's face before it is coloured: its slopes (along x, along y), shape
        (120, 160) each, mm per mm, and what its markers leave of the light, shape (240, 320, 3).

        Args:
            motion: How handle and gel move.
            index: Which moment of `motion`.
            shear: As for `frame`.
        """
        depth_mm = float(motion.depth_mm[index])
        middle_mm, turned_rad = motion.object_mm[index], float(motion.object_rad[index])
        sheared = None if shear is None else self._shear.look(shear)
        free = None if sheared is None else sheared[2:]
        slopes = self._surface.slopes(depth_mm, middle_mm, turned_rad, free)
        moved = self._markers.displacement_px(
            depth_mm=depth_mm,
            middle_mm=middle_mm,
            axis_rad=self._axis_rad + turned_rad,
            patch_mm=motion.patch_mm[index],
            gel_mm=motion.gel_mm[index],
            gel_rad=float(motion.gel_rad[index]),
            face_mm=None if sheared is None else sheared[:2],
        )
        return *slopes, np.asarray(self._markers.light(*moved), np.float32)

    def _light(self, motion: GelMotion, index: int, shear: FaceShear | None) -> NDArray[np.float32]:
        """Return the image without noise, grey levels, shape (240, 320, 3)."""
        right, down, markers = self.face(motion, index, shear)
        change = self._shading.render(right, down)
        cv2.multiply(change, self._relative_light, dst=change)
        image = cv2.resize(change, _SIZE, interpolation=cv2.INTER_LINEAR)
        cv2.add(image, self._still, dst=image)
        return np.asarray(cv2.multiply(image, markers, dst=image), np.float32)
