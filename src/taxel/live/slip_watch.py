"""Slip from the cameras of one grasp, moment by moment: images in, slip and its features out.

The first moments are the settled grasp, against which all later ones are seen; they wait until
it is over and are then gone through in order. An image that a camera shows again changes nothing,
nor does one that comes sooner than what is learned assumes. Adds no maths of its own. Knows nothing
about models, decisions or screens.
"""

from __future__ import annotations

import copy
import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from taxel.frame_codec import decode_jpeg
from taxel.gel.border_light import BorderLight
from taxel.gel.markers import Rgb
from taxel.gel.rim_slip import RimSlip
from taxel.gel.scale import mm_per_row_px
from taxel.gel.slip_signal import PAIR_FEATURES, GelSlip, PairSlip, Slip
from taxel.gel.touch_poses import TouchFollower
from taxel.signals import CameraInfo, Frame
from taxel.windows.pairs import FrameSet
from taxel.windows.rest import SETTLE

_SOONEST_S = 0.025
"""A camera's images that come sooner than this after the last that was followed are left out: rates
over so many images are learned from 25 a second, which come at least 0.033 s apart. Source: our
choice, docs/decisions/0036."""
_Known = tuple[TouchFollower, GelSlip, NDArray[np.float64], RimSlip]
"""What is known of a gel, and of the rims of all: follower, slip, its rim's turns, the rims."""


class SlipWatch:
    """Follows the slip over all gels of one grasp.

    Args:
        cameras: The source's; one that does not state its mm a px is taken for a GelSight Mini.
        settle: Which moments are the settled grasp.
        columns: How many of `taxel.gel.ring_slip.WITH_RINGS` are wanted, from the first on.
    """

    def __init__(
        self,
        cameras: Sequence[CameraInfo],
        settle: slice = SETTLE,
        columns: int = len(PAIR_FEATURES),
    ) -> None:
        self._to_mm = [
            np.array([mm, mm, 1.0])
            for mm in (mm_per_row_px(own.width, own.mm_per_px) for own in cameras)
        ]
        self._settle = settle
        self._cameras = tuple(cameras)
        self._followers: list[TouchFollower] = []
        self._lights: list[BorderLight] = []
        self._kept: dict[int, _Known] = {}
        """Camera → what was known of its gel before the images that it is doubted for."""
        self._early: list[tuple[tuple[Rgb, ...], tuple[float, ...], float]] = []
        self._shown: tuple[Rgb, ...] = ()
        self._jpegs: list[bytes] = [b""] * len(cameras)
        self._images: list[Rgb | None] = [None] * len(cameras)
        self._pair = PairSlip(len(cameras))
        self._columns = columns
        self._rim = RimSlip()
        self._rim_rad = np.zeros((len(cameras), 2))
        """Turn of each gel's rim, and of the object less the rim, as sizes."""
        self._taken_s: tuple[float, ...] = (math.nan,) * len(cameras)
        """When the newest images were taken."""
        self._followed_s = [math.nan] * len(cameras)
        """At which moment an image of each was followed last."""
        self._missed = [False] * len(cameras)
        """Whether no slip was measured in the newest image."""

    @property
    def settling(self) -> bool:
        """True until the settled first moments are over."""
        return not self._followers

    def lost(self, longest_s: float) -> int | None:
        """Return a camera whose gel's slip is older than its newest image by more than a time.

        Its imprint or dots could not be followed since, or its clock was set back or stands still.
        None where all are followed, and while the grasp settles.

        Args:
            longest_s: That time, seconds.
        """
        for camera, gel in enumerate(self._pair.gels):
            age_s = self._taken_s[camera] - gel.measured_s
            if self._missed[camera] and not 0 < age_s <= longest_s:
                return camera
        return None

    @property
    def exchanged(self) -> int | None:
        """A camera whose images are not those of this grasp; None where all are."""
        return next((at for at, light in enumerate(self._lights) if light.exchanged), None)

    @property
    def waiting(self) -> int:
        """Moments of the settled grasp that wait until it is over."""
        return len(self._early)

    @property
    def slip(self) -> Slip:
        """Of the gel on which the object has slipped furthest."""
        return self._pair.slip

    @property
    def gels(self) -> tuple[Slip, ...]:
        """Of each gel."""
        return tuple(gel.slip for gel in self._pair.gels)

    def push(
        self, images: Sequence[Rgb], taken_s: Sequence[float], time_s: float
    ) -> list[NDArray[np.float32]]:
        """Take in what each camera shows now; return the features of the moments that are ready.

        None before the settled grasp is over, then those of all waiting moments, then of this one.

        Args:
            images: One a camera; the very same object again is no new image.
            taken_s: When each was taken, seconds: see `taken_of`.
            time_s: This moment on a clock that the cameras share, seconds.

        Raises:
            BadSource: An image has another shape than those before.
        """
        if self._followers:
            return [self._step(tuple(images), taken_s, time_s)]
        self._early.append((tuple(images), tuple(taken_s), time_s))
        if len(self._early) < self._settle.stop:
            return []
        early, self._early = self._early, []
        for camera in range(len(self._to_mm)):
            part = [shown[camera] for shown, _, _ in early[self._settle]]
            fresh = [image for i, image in enumerate(part) if i == 0 or image is not part[i - 1]]
            self._followers.append(TouchFollower(fresh))
            self._lights.append(BorderLight(fresh))
        return [self._step(*moment) for moment in early]

    def see(self, found: FrameSet) -> list[NDArray[np.float32]]:
        """Take in a set of frames as it came; return as `push` does.

        Raises:
            BadSource: A frame cannot be decoded, or has another shape than those before.
        """
        for camera, frame in enumerate(found.frames):
            if frame.jpeg != self._jpegs[camera]:
                self._images[camera] = decode_jpeg(frame.jpeg, self._cameras[camera])
                self._jpegs[camera] = frame.jpeg
        images = [image for image in self._images if image is not None]
        return self.push(images, [taken_of(frame) for frame in found.frames], found.time_s)

    def _step(
        self, images: tuple[Rgb, ...], taken_s: Sequence[float], time_s: float
    ) -> NDArray[np.float32]:
        shown = list(self._shown or images)
        fresh = False
        for camera, image in enumerate(images):
            again = bool(self._shown) and image is shown[camera]
            if again or 0 < time_s - self._followed_s[camera] < _SOONEST_S:
                continue
            fresh = True
            shown[camera], self._followed_s[camera] = image, time_s
            if self._is_exchanged(camera, image, taken_s[camera]):
                continue
            pose = self._followers[camera].follow(image)
            to_mm = self._to_mm[camera]
            self._missed[camera] = not self._pair.gels[camera].push(
                pose.object * to_mm, pose.gel * to_mm, pose.spread * to_mm, taken_s[camera],
                pose.seen,
            )  # fmt: skip
            rim_rad = float(self._followers[camera].rim()[2])
            if not self._missed[camera]:
                self._rim_rad[camera] = abs(rim_rad), abs(float(pose.object[2]) - rim_rad)
        self._shown, self._taken_s = tuple(shown), tuple(taken_s)
        pair = self._pair.features()
        if fresh:
            rim, slip = self._rim_rad.mean(axis=0).astype(np.float32)
            self._rim.push(pair, float(rim), float(slip), time_s)
        rings = np.mean([follower.rings for follower in self._followers], axis=0)
        every = np.concatenate([pair, self._rim.features, rings.astype(np.float32)])
        return np.asarray(every[: self._columns], np.float32)

    def _is_exchanged(self, camera: int, image: Rgb, taken_s: float) -> bool:
        """Return whether a camera's images are not those of this grasp; nothing is followed then.

        What was followed in the first of them is taken back.
        """
        light, gels = self._lights[camera], self._pair.gels
        before, doubted = light.exchanged, light.doubted
        light.take(image, taken_s)
        if light.doubted and not doubted:
            known = self._followers[camera], gels[camera], self._rim_rad[camera], self._rim
            self._kept[camera] = copy.deepcopy(known)
        elif light.exchanged and not before:
            kept = self._kept.pop(camera)
            self._followers[camera], gel, self._rim_rad[camera], self._rim = kept
            self._pair.gels = (*gels[:camera], gel, *gels[camera + 1 :])
        elif not light.doubted:
            self._kept.pop(camera, None)
        if light.exchanged:
            nowhere = np.zeros(3)
            self._missed[camera] = True
            self._pair.gels[camera].push(nowhere, nowhere, nowhere, taken_s, seen=False)
        return light.exchanged


def taken_of(frame: Frame) -> float:
    """Return when a frame's image was taken: by the camera's own clock where it has one."""
    return frame.device_s if math.isfinite(frame.device_s) else frame.fitted_s
