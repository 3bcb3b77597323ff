"""How the object and the gel under it have each moved since the grasp, an image at a time.

The object's pose is its imprint's, the gel's is that of the dots inside the contact; both are
rigid, about the image's middle. Knows nothing about millimetres, time, slip or forces.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from taxel.gel.imprint_pose import ImprintFollower, ImprintPose, Pose
from taxel.gel.markers import MarkerFlow, MarkerTracker, Rgb
from taxel.gel.motion import TUKEY
from taxel.gel.ring_slip import GelRings
from taxel.gel.scale import ROW_PX
from taxel.gel.slip_features import median_frame

_WHOLE, _NONE = 1.2, 1.7
"""Standard deviations of the imprint's places within which a dot counts fully, and beyond which
not at all: the gel follows the contact less and less outside it, and an imprint that is an even
ellipse ends at 2. Source: our choice on training cups, docs/decisions/0036."""
_RIM: Final = (1.0, 1.4, 2.0, 2.5)
"""Standard deviations between which dots count towards the rim's motion: from none to full, full,
to none. On gels that shear as layers dots within 1.2 move with what sticks until gross slip,
those from 1.7 to 2.2 carry 0.75 of the turn at 20 um of slip and 0.50 at 300 um. Source: 24
rendered training pours, docs/decisions/0037."""
_FAST_PX, _FAST_RAD = 1.0, 0.03
"""Motion of the gel from one image to the next from which on the imprint is looked for where the
gel went, too.
Source: pushes of training cups, docs/decisions/0036."""
_FEWEST_DOTS = 4
_DOT_PX = 0.03
"""Noise of one dot's centre, px: measured on still gels. Floor of the robust scale."""


@dataclass(frozen=True, slots=True)
class TouchPose:
    """Object and gel in one image; poses in px of a 320-pixel row and radians."""

    object: Pose
    """Shape (3,): x, y, turn of the imprint since the reference, about the image's middle."""
    gel: Pose
    """Shape (3,): the same of the gel inside the contact."""
    slip: Pose
    """Shape (3,): the object's motion less the gel's, at the imprint's middle."""
    shear: Pose
    """Shape (3,): the gel's motion at the imprint's middle."""
    spread: Pose
    """Shape (3,): standard deviation of `slip` by both fits' residuals."""
    seen: bool
    """False where the imprint or the dots could not be followed: poses are then the last known."""


class TouchFollower:
    """Follows object and gel from a settled grasp on.

    Args:
        reference_frames: One or more images of the settled grasp; their median is the reference.

    Raises:
        BadSource: There is none, or their shapes differ.
    """

    def __init__(self, reference_frames: Sequence[Rgb]) -> None:
        reference = median_frame(reference_frames)
        self._scale = ROW_PX / reference.shape[1]
        height, width = reference.shape[:2]
        self._middle = np.array([(width - 1) / 2, (height - 1) / 2])
        self._imprint = ImprintFollower(reference)
        self._tracker = MarkerTracker(reference)
        self._gel, self._rim = np.zeros(3), np.zeros(3)
        self._rings = GelRings()
        middle, shape = self._imprint.placed(np.zeros(3))
        still = np.ones(len(self.dots), np.bool_)
        self._newest = (
            MarkerFlow(self.dots, self.dots, still),
            ImprintPose(np.zeros(3), np.zeros(3), True, middle, shape),
        )
        self._gel_then = np.zeros(3)
        """The gel's pose in the last image in which the imprint was seen."""

    def follow(self, rgb: Rgb) -> TouchPose:
        """Return the next image's poses.

        Args:
            rgb: Shape as the reference's, red first.

        Raises:
            BadSource: The image has another shape than the reference.
        """
        dots = self._tracker.track(rgb)
        imprint = self._imprint.follow(rgb, self._fast_step(dots))
        self._newest = dots, imprint
        if imprint.seen:
            before = (dots.reference - self._middle) * self._scale
            now = (dots.moved - self._middle) * self._scale
            carried = _placed(before, imprint.pose) - before
            self._rings.push(now - before, carried, self._far(dots, imprint), dots.seen)
        fitted = self._fit(dots, imprint)
        spread = np.full(3, np.inf)
        if fitted is not None:
            self._gel, gel_spread = fitted
            if imprint.seen:
                self._gel_then = self._gel
            spread = np.hypot(imprint.spread, gel_spread)
        at = imprint.middle - _shift_at(imprint.pose, imprint.middle)  # where the middle was
        moved, carried = (_motion_at(pose, at) for pose in (imprint.pose, self._gel))
        return TouchPose(
            object=imprint.pose,
            gel=self._gel.copy(),
            slip=moved - carried,
            shear=carried,
            spread=spread,
            seen=imprint.seen and fitted is not None,
        )

    def _fast_step(self, dots: MarkerFlow) -> Pose | None:
        """Return the gel's motion since the imprint was last seen, where it is large, shape (3,).

        A push turns the imprint further in one image than its own fit reaches; the dots are found
        one by one, and what holds the object moves with it.
        """
        fitted = self._fit(dots, self._newest[1])
        if fitted is None:
            return None
        step = _since(fitted[0], self._gel_then)
        moved = step[:2] + _turned(self._newest[1].middle, step[2]) - self._newest[1].middle
        fast = np.hypot(moved[0], moved[1]) > _FAST_PX or abs(step[2]) > _FAST_RAD
        return step if fast else None

    @property
    def dots(self) -> NDArray[np.float32]:
        """Shape (m, 2): centres (x, y) of the reference's dots, px of the image."""
        return self._tracker.reference

    def rim(self) -> Pose:
        """Return the gel's rigid motion around the contact's rim in the newest image, shape (3,).

        Where gels shear, slip begins there. Units as `TouchPose.gel`; the last known where too few
        dots show.
        """
        dots, imprint = self._newest
        far = self._far(dots, imprint)
        begin, full, fade, end = _RIM
        near = np.clip((far - begin) / (full - begin), 0, 1)
        weights = near * np.clip((end - far) / (end - fade), 0, 1) * dots.seen
        if (weights > 0.5).sum() >= _FEWEST_DOTS:
            self._rim, _ = self._moved_by(dots, weights)
        return self._rim.copy()

    @property
    def rings(self) -> NDArray[np.float64]:
        """Shape (18,), as `taxel.gel.ring_slip.RING_FEATURES`, after the newest image.

        The last known where the imprint is lost.
        """
        return self._rings.values

    def _fit(self, dots: MarkerFlow, imprint: ImprintPose) -> tuple[Pose, Pose] | None:
        """Return the rigid motion of the dots inside the contact, and its spread."""
        far = self._far(dots, imprint)
        weights = np.clip((_NONE - far) / (_NONE - _WHOLE), 0, 1) * dots.seen
        if (weights > 0.5).sum() < _FEWEST_DOTS:
            if dots.seen.sum() < _FEWEST_DOTS:
                return None
            ranked = np.sort(far[dots.seen])
            weights = (dots.seen & (far <= ranked[_FEWEST_DOTS - 1])).astype(np.float64)
        return self._moved_by(dots, weights)

    def _far(self, dots: MarkerFlow, imprint: ImprintPose) -> NDArray[np.float64]:
        """Return how far each dot is from the imprint's middle, in its standard deviations."""
        off = (dots.moved - self._middle) * self._scale - imprint.middle
        square = np.einsum("ij,jk,ik->i", off, np.linalg.inv(imprint.shape), off)
        return np.asarray(np.sqrt(square), np.float64)

    def _moved_by(self, dots: MarkerFlow, weights: NDArray[np.float64]) -> tuple[Pose, Pose]:
        before = (dots.reference - self._middle) * self._scale
        now = (dots.moved - self._middle) * self._scale
        return _rigid(before, now, weights)


def _rigid(
    before: NDArray[np.float64], now: NDArray[np.float64], weights: NDArray[np.float64]
) -> tuple[Pose, Pose]:
    """Return the rigid motion about the origin and its spread; outliers lose their weight.

    Source: least squares in closed form (Umeyama, PAMI 13 (1991) 376, without scale), Tukey's
    weights once.
    """
    pose = _closed_form(before, now, weights)
    size = np.linalg.norm(now - _placed(before, pose), axis=1)
    held = weights > 0
    scale = TUKEY * max(1.4826 * float(np.median(size[held])), _DOT_PX)
    trusted = weights * np.clip(1 - (size / scale) ** 2, 0, 1) ** 2
    if (trusted > 0).sum() >= _FEWEST_DOTS:
        weights = trusted
        pose = _closed_form(before, now, weights)
        size = np.linalg.norm(now - _placed(before, pose), axis=1)
    total = weights.sum()
    noise = max(float(weights @ size**2 / total) / 2, _DOT_PX**2)
    number = max(total**2 / float(weights @ weights), 2.0)
    middle = weights @ now / total
    reach = max(float(weights @ ((now - middle) ** 2).sum(axis=1)) / total, 1.0)
    turn = np.sqrt(noise / number / reach)
    return pose, np.array([np.sqrt(noise / number), np.sqrt(noise / number), turn])


def _closed_form(
    before: NDArray[np.float64], now: NDArray[np.float64], weights: NDArray[np.float64]
) -> Pose:
    share = weights / weights.sum()
    from_middle, to_middle = share @ before, share @ now
    x, y = (before - from_middle).T
    u, v = (now - to_middle).T
    turn = float(np.arctan2(share @ (x * v - y * u), share @ (x * u + y * v)))
    shift = to_middle - _turned(from_middle, turn)
    return np.array([shift[0], shift[1], turn])


def _since(now: Pose, before: Pose) -> Pose:
    """Return the motion that is left when `before` is taken from `now`."""
    turn = float(now[2] - before[2])
    shift = now[:2] - _turned(before[:2], turn)
    return np.array([shift[0], shift[1], turn])


def _turned(places: NDArray[np.float64], turn: float) -> NDArray[np.float64]:
    cos, sin = np.cos(turn), np.sin(turn)
    return np.asarray(places @ np.array([[cos, sin], [-sin, cos]]))


def _placed(places: NDArray[np.float64], pose: Pose) -> NDArray[np.float64]:
    return _turned(places, float(pose[2])) + pose[:2]


def _shift_at(pose: Pose, now: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return how far a place that is now at `now` has moved."""
    return now - _turned(now - pose[:2], -float(pose[2]))


def _motion_at(pose: Pose, before: NDArray[np.float64]) -> Pose:
    """Return the same motion about another place: its shift there, and the turn."""
    shift = _placed(before, pose) - before
    return np.array([shift[0], shift[1], pose[2]])
