"""Where the imprint of what is held is now: its shift and turn since the reference image.

The imprint's shading moves with the object. Dots are masked, slow light is divided out, and a
rigid motion is fitted to the imprint's own pixels by inverse-compositional Lucas–Kanade, from the
last pose on. Colours turn with the slopes, so a linear mix of the reference's colours is fitted
beside the motion. Knows nothing about dots' movement, millimetres, time or slip.

Source: Baker & Matthews, IJCV 56 (2004) 221, section 3.2; the mix of colours eliminated by
blocks as there in section 4 (part 3) for appearance; where this departs: docs/decisions/0036.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import cv2
import numpy as np
from numpy.typing import NDArray

from taxel.gel.markers import Rgb, relative_brightness
from taxel.gel.scale import ROW_PX

Pose = NDArray[np.float64]
"""Shape (3,): x, y (px of a 320-pixel row, about the image's middle) and turn (rad, x to y)."""

_WORK_WIDTH: Final = 160
"""Pixels a row at which the imprint is followed: finer detail is JPEG's and the image sensor's."""
_CLOSING_PX = 15
_INK = 0.85
_RIM_PX = 7
"""At the working width: dots are widened by an ellipse of this, as their rims are coloured. At 5
the rims pull the turn by half as much again (docs/decisions/0036)."""
_FILL_PX = 15
"""At that width: dots are filled with the mean over this before slow light is taken off, so that
a dot that moves does not move the light."""
_LEVEL_PX = 37
"""At that width: slower shading is the lamps' and the indentation's."""
_ENERGY_PX = 5.0
"""At that width: over which the energy of the imprint's slopes is averaged, standard deviation."""
_SHARE = 0.35
"""Of the pixels, those with most slope around them: with the background among them the robust
scale collapses to its noise, and the pose sticks."""
_MOST_PIXELS = 2400
_FEWEST_PIXELS = 150
"""Fewer than this show no imprint that could be followed."""
_ROUNDS = 6
_WEIGHING_ROUNDS = 1
"""Rounds after the first in which pixels are weighed anew: later ones keep their weights."""
_STILL_PX, _STILL_RAD = 0.004, 5e-5
"""A step below these ends the rounds: a tenth of the noise of an image."""
_CAUCHY = 2.0
"""Times the median residual: where a pixel's weight has fallen to a half."""
_RIDGE = 1e-3
"""Of the reference's energy, added to the mix of colours so that it is never undetermined."""
_NEW_KEY_PX, _NEW_KEY_RAD = 9.0, 0.3
"""Movement since the key image at which a new one is taken, px of a 320-pixel row: renewing
often adds up its bias."""
_LOST_PX, _LOST_RAD = 12.0, 0.35
"""A motion in one image beyond these is no following, but a lost imprint."""


@dataclass(frozen=True, slots=True)
class ImprintPose:
    """The imprint's pose in one image."""

    pose: Pose
    """Since the reference; the last one known where `seen` is False."""
    spread: Pose
    """Standard deviation of the pose by the fit's own residuals, same units; infinity where not
    seen. It knows of independent noise only: not of what grain and JPEG add to all pixels alike."""
    seen: bool
    """False where too little imprint shows, or it was lost."""
    middle: NDArray[np.float64]
    """Shape (2,): the imprint's middle now, px of a 320-pixel row from the image's middle."""
    shape: NDArray[np.float64]
    """Shape (2, 2): covariance of the imprint's places now, px²."""


class ImprintFollower:
    """Follows the imprint from a reference image on, an image at a time.

    Args:
        reference: Shape (height, width, 3), red first: the settled grasp.
    """

    def __init__(self, reference: Rgb) -> None:
        height, width = reference.shape[:2]
        self._size = (_WORK_WIDTH, round(height * _WORK_WIDTH / width))
        self._rim = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (_RIM_PX, _RIM_PX))
        self._last = np.zeros(3)
        self._key_pose = np.zeros(3)
        self._key: _Key | None = None
        image = self._prepare(reference)
        self._key = _Key.of(image)

    def follow(self, rgb: Rgb, carried: Pose | None = None) -> ImprintPose:
        """Return the imprint's pose in the next image, shape as the reference's.

        Args:
            rgb: The image.
            carried: Motion of what carries the imprint since it was last seen, where that is large:
                following begins there too, and the better fit is kept.
        """
        key = self._key
        if key is None:
            return self._lost()
        image = self._prepare(rgb)
        starts = [self._last] if carried is None else [self._last, _after(carried, self._last)]
        tried = []
        for begin in starts:
            start = _after(begin, _inverse(self._key_pose))
            aligned = key.align(image, start)
            if aligned is not None and not _went_far(aligned.pose - start):
                tried.append(aligned)
        if not tried:
            return self._lost()
        best = min(tried, key=lambda each: each.misfit)
        since_key = best.pose
        pose = _after(since_key, self._key_pose)
        self._last = pose
        middle, shape = key.placed(since_key)
        if np.hypot(since_key[0], since_key[1]) > _NEW_KEY_PX or abs(since_key[2]) > _NEW_KEY_RAD:
            fresh = _Key.of(image)
            if fresh is not None:
                self._key, self._key_pose = fresh, pose
        return ImprintPose(pose.copy(), best.spread, True, middle, shape)

    def placed(self, pose: Pose) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return the imprint's middle, shape (2,), px, and covariance, (2, 2), px², at a pose.

        Args:
            pose: Since the reference, shape (3,).
        """
        if self._key is None:
            return np.zeros(2), np.eye(2) * (ROW_PX / 6.0) ** 2
        return self._key.placed(_after(pose, _inverse(self._key_pose)))

    def _lost(self) -> ImprintPose:
        middle, shape = self.placed(self._last)
        return ImprintPose(self._last.copy(), np.full(3, np.inf), False, middle, shape)

    def _prepare(self, rgb: Rgb) -> NDArray[np.float32]:
        """Return the imprint's shading and, last, 1 where it is no ink, shape (h, w, 4)."""
        small = np.asarray(cv2.resize(rgb, self._size, interpolation=cv2.INTER_AREA), np.uint8)
        ink = (relative_brightness(small, _CLOSING_PX) < _INK).astype(np.uint8)
        inked = np.asarray(cv2.dilate(ink, self._rim), np.uint8)
        keep = np.asarray(1 - inked, np.uint8)
        bare = cv2.bitwise_and(small, small, mask=keep)
        side = (_FILL_PX, _FILL_PX)
        count = cv2.boxFilter(keep, cv2.CV_32F, side)
        around = cv2.boxFilter(bare, cv2.CV_32F, side)
        filled = small.astype(np.float32)
        share = np.maximum(count, np.float32(1e-3))
        cv2.copyTo(cv2.divide(around, cv2.merge([share] * 3)), inked, filled)
        fine = filled - cv2.blur(filled, (_LEVEL_PX, _LEVEL_PX))
        usual = np.median(small[::4, ::4].reshape(-1, 3), axis=0)
        even = np.asarray(fine * (1 / np.maximum(usual, 4.0)).astype(np.float32), np.float32)
        return np.asarray(cv2.merge([even, keep.astype(np.float32)]), np.float32)


@dataclass(frozen=True, slots=True)
class _Normal:
    """Normal equations of one image: weights once found serve the rounds that follow."""

    weighted: NDArray[np.float32]
    """Shape (n, mixed + 9): the key's columns times the pixels' weights."""
    mix: NDArray[np.float64]
    """Shape (mixed, mixed): of what is no motion, with its ridge."""
    solved: NDArray[np.float64]
    """Shape (mixed, 9): what of each colour's motion the mix could take."""
    inverse: NDArray[np.float64]
    """Shape (3, 3): of the motion's own square."""
    weights: NDArray[np.float32]
    """Shape (n,)."""

    def step(self, left: NDArray[np.float32]) -> Pose:
        """Return the step that is left in the key's own frame, shape (3,)."""
        toward = (self.weighted.T @ left).astype(np.float64)
        n = len(self.mix)
        right = np.zeros(3)
        for colour in range(3):
            part = slice(3 * colour, 3 * colour + 3)
            right += toward[n:][part, colour] - self.solved[:, part].T @ toward[:n, colour]
        return np.asarray(self.inverse @ right)

    def spread(self, left: NDArray[np.float32]) -> Pose:
        """Return the step's standard deviation by the residuals that neither part explains."""
        toward = (self.weighted[:, : len(self.mix)].T @ left).astype(np.float64)
        squares = float(np.einsum("i,ij,ij->", self.weights, left, left))
        squares -= float((toward * np.linalg.solve(self.mix, toward)).sum())
        noise = max(squares, 0.0) / (3 * max(float(self.weights.sum()), 1.0))
        return np.sqrt(np.maximum(np.diag(self.inverse), 0) * noise)


@dataclass(frozen=True, slots=True)
class _Aligned:
    """A key moved upon an image."""

    pose: Pose
    """Of the image since the key."""
    spread: Pose
    """Its standard deviation, as `ImprintPose.spread`."""
    misfit: float
    """Median square of what is left in a pixel: less is better."""


class _Key:
    """The image that the imprint is compared with: its pixels, their slopes and their places."""

    def __init__(
        self, places: NDArray[np.float32], values: NDArray[np.float32], slopes: NDArray[np.float32]
    ) -> None:
        self._places = places
        """Shape (n, 2): x, y from the image's middle, working px."""
        self._values = values
        """Shape (n, 3)."""
        count = len(places)
        x, y = places.T
        motion = np.empty((count, 3, 3), np.float32)  # pixel, colour, parameter
        motion[..., 0] = slopes[..., 0]
        motion[..., 1] = slopes[..., 1]
        motion[..., 2] = slopes[..., 1] * x[:, None] - slopes[..., 0] * y[:, None]
        mix = _mix_columns(values, places)
        self._columns = np.ascontiguousarray(
            np.concatenate([mix, motion.reshape(count, 9)], axis=1)
        )
        """Shape (n, 24): what the mix may take, then each colour's motion."""
        self._mixed = mix.shape[1]
        self._middle = places.mean(axis=0).astype(np.float64)
        self._shape = np.cov(places.T.astype(np.float64))

    @staticmethod
    def of(image: NDArray[np.float32]) -> _Key | None:
        """Return the key of a prepared image; None where it shows too little imprint."""
        fine, keep = image[..., :3], image[..., 3]
        core = cv2.erode(keep, np.ones((3, 3), np.uint8))
        core[:2] = core[-2:] = 0
        core[:, :2] = core[:, -2:] = 0
        slopes = _slopes(np.ascontiguousarray(fine))
        squares = np.asarray((slopes * slopes).sum(axis=(2, 3)), np.float32)
        energy = cv2.GaussianBlur(squares * core, (0, 0), _ENERGY_PX)
        energy = energy / np.maximum(cv2.GaussianBlur(core, (0, 0), _ENERGY_PX), np.float32(0.05))
        whole = core > 0
        if whole.sum() < _FEWEST_PIXELS or float(energy.max()) <= 1e-7:
            return None
        chosen = whole & (energy >= np.quantile(energy[whole], 1 - _SHARE))
        rows, columns = np.nonzero(chosen)
        if len(rows) > _MOST_PIXELS:
            part = np.linspace(0, len(rows) - 1, _MOST_PIXELS).round().astype(int)
            rows, columns = rows[part], columns[part]
        if len(rows) < _FEWEST_PIXELS:
            return None
        height, width = keep.shape
        places = np.stack([columns - (width - 1) / 2, rows - (height - 1) / 2], axis=1)
        return _Key(places.astype(np.float32), fine[rows, columns], slopes[rows, columns])

    def align(self, image: NDArray[np.float32], start: Pose) -> _Aligned | None:
        """Return what moves this key upon an image; None where it fails.

        Args:
            image: Prepared, shape (h, w, 4).
            start: Pose to begin at, px of a 320-pixel row.
        """
        scale = _WORK_WIDTH / ROW_PX
        pose = start * (scale, scale, 1.0)
        normal: _Normal | None = None
        for number in range(_ROUNDS):
            left, good = self._left(image, pose)
            if good.sum() < _FEWEST_PIXELS:
                return None
            if normal is None or number <= _WEIGHING_ROUNDS:
                normal = self._normal(left, good)
                if normal is None:
                    return None
            step = normal.step(left)
            pose = _after(pose, _inverse(step))
            if np.hypot(step[0], step[1]) < _STILL_PX and abs(step[2]) < _STILL_RAD:
                break
        assert normal is not None  # there is at least one round
        to_width = (scale, scale, 1.0)
        misfit = _usual(np.einsum("ij,ij->i", left[good], left[good]))
        return _Aligned(pose / to_width, normal.spread(left) / to_width, misfit)

    def _left(
        self, image: NDArray[np.float32], pose: Pose
    ) -> tuple[NDArray[np.float32], NDArray[np.bool_]]:
        """Return what the image has beyond this key, shape (n, 3), and where it is seen, (n,)."""
        height, width = image.shape[:2]
        x, y = _moved(self._places, pose)
        x += np.float32((width - 1) / 2)
        y += np.float32((height - 1) / 2)
        seen = cv2.remap(image, x[None], y[None], cv2.INTER_LINEAR)[0]  # outside: 0, not kept
        return seen[:, :3] - self._values, seen[:, 3] > 0.98

    def _normal(self, left: NDArray[np.float32], good: NDArray[np.bool_]) -> _Normal | None:
        """Return the weighted normal equations; None where they are undetermined."""
        squares = np.einsum("ij,ij->i", left, left)
        usual = _usual(squares[good])
        weights = np.asarray(good / (1 + squares / np.float32(_CAUCHY**2 * usual)), np.float32)
        weighted = self._columns * weights[:, None]
        products = (weighted.T @ self._columns).astype(np.float64)
        n = self._mixed
        mix = products[:n, :n] + _RIDGE * np.trace(products[:n, :n]) / n * np.eye(n)
        own = [slice(3 * colour, 3 * colour + 3) for colour in range(3)]
        solved = np.linalg.solve(mix, products[:n, n:])
        across = products[n:, n:] - products[:n, n:].T @ solved
        square = sum((across[part, part] for part in own), np.zeros((3, 3)))
        if not np.linalg.cond(square) < 1e9:
            return None
        return _Normal(weighted, mix, solved, np.linalg.inv(square), weights)

    def placed(self, pose: Pose) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return the imprint's middle and covariance at a pose, px of a 320-pixel row."""
        scale = ROW_PX / _WORK_WIDTH
        cos, sin = np.cos(pose[2]), np.sin(pose[2])
        turn = np.array([[cos, -sin], [sin, cos]])
        return turn @ self._middle * scale + pose[:2], turn @ self._shape @ turn.T * scale**2


def _went_far(step: Pose) -> bool:
    """Return whether a fit ended too far from where it began to be believed."""
    return bool(np.hypot(step[0], step[1]) > _LOST_PX or abs(step[2]) > _LOST_RAD)


def _usual(squares: NDArray[np.float32]) -> float:
    """Return the median of squares, shape (n,), above 0."""
    half = len(squares) // 2
    return max(float(np.partition(squares, half)[half]), 1e-12)


def _mix_columns(values: NDArray[np.float32], places: NDArray[np.float32]) -> NDArray[np.float32]:
    """Return what is no motion: the colours, mixed otherwise in each place, and smooth light.

    Shape (n, 15): level, then quadratic in the place; the three colours, and each times x and y.
    The lamps colour a slope by where it is, so an imprint that moves or turns is coloured anew.
    """
    x, y = (places / np.float32(_WORK_WIDTH * 3 / 8)).T[:, :, None]
    light = [np.ones_like(x), x, y, x * y, x * x, y * y]
    return np.concatenate([*light, values, values * x, values * y], axis=1)


def _slopes(fine: NDArray[np.float32]) -> NDArray[np.float32]:
    """Return each colour's slope to the right and down, shape (h, w, 3, 2), a px."""
    right = cv2.sepFilter2D(fine, cv2.CV_32F, np.array([-0.5, 0, 0.5]), np.array([0.0, 1, 0]))
    down = cv2.sepFilter2D(fine, cv2.CV_32F, np.array([0.0, 1, 0]), np.array([-0.5, 0, 0.5]))
    return np.stack([right, down], axis=-1)


def _moved(
    places: NDArray[np.float32], pose: Pose
) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Return x and y of places turned about the middle, then shifted, shape (n,) each."""
    cos, sin = np.float32(np.cos(pose[2])), np.float32(np.sin(pose[2]))
    x, y = places.T
    return cos * x - sin * y + np.float32(pose[0]), sin * x + cos * y + np.float32(pose[1])


def _after(first: Pose, second: Pose) -> Pose:
    """Return the pose that does `second`, then `first`."""
    cos, sin = np.cos(first[2]), np.sin(first[2])
    x, y, turn = second
    return np.array([cos * x - sin * y + first[0], sin * x + cos * y + first[1], first[2] + turn])


def _inverse(pose: Pose) -> Pose:
    cos, sin = np.cos(pose[2]), np.sin(pose[2])
    x, y, turn = pose
    return np.array([-cos * x - sin * y, sin * x - cos * y, -turn])
