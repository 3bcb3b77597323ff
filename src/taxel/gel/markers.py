"""The gel's black dots: where they are, and where each has gone.

Input: RGB images of one gel. Output: positions in pixels, x to the right, y
down, of pixel centres. Knows nothing about cameras, files, contact or models.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import cv2
import numpy as np
from numpy.typing import NDArray

from taxel.errors import BadSource
from taxel.gel.dot_windows import CLEAR_PX, DotWindows, centroids, level_image, levels_of
from taxel.gel.scale import ROW_PX

Rgb = NDArray[np.uint8]
Points = NDArray[np.float32]

_SMALLEST_PX, _LARGEST_PX = 7.0, 26.0
"""Diameters that a dot may have: measured 10 to 18, with room for shear and blur."""
_SEARCH_SCALE: Final = 2.0
"""The whole image is searched at half size: 160 pixels a row; the centres are not."""
_CLOSING_PX = 29
"""Wider than the widest dot, narrower than the widest spacing (43.5)."""
_DARK = 0.68
"""A dot's pixels against their surroundings: measured 0.3 to 0.5; the half-way point."""
_DARKEST_FRAME = 12.0
"""Mean grey level under which a frame shows nothing."""
_FILL, _ROUND = 0.5, 0.42
"""Least share of the box around a dot that it fills, and least short side over long side."""
_ODD_SIZE = 2.6
"""Times the median area, or below its inverse: dust, scratches and merged dots."""
_RIM_PX = 1.0
"""Between a whole dot and the image's border: nearer, its centre is pulled."""
_FEWEST = 4
_NEAREST = 6
_JUMP = 0.2
"""Of a spacing: a dot that went further in one frame is looked for again in the whole image."""
_REACH = 0.62
"""Of a spacing: how far a dot is looked for in one frame; above a half, for bent grids."""
_LEAST_MASS, _MOST_MASS = 0.45, 1.9
"""Of the reference's darkness: outside, the dot is covered, cut or merged with another."""
_MANY_LOST = 0.3
_TURNS: Final = (0.0, 0.08, -0.08, 0.16, -0.16, 0.24, -0.24, 0.32, -0.32)
"""Turns between two frames that a search tries, rad: pushes of a cup reach 0.25 in 40 ms."""
_FITS, _ENOUGH_FIT = 0.15, 0.8
"""Of a spacing: how near a finding fits; share of dots that fit from which on no other
turn is tried."""
_RETRY_FRAMES = 8
"""Frames between two searches of the whole image while many dots stay lost."""


@dataclass(frozen=True, slots=True)
class MarkerFlow:
    """Where each dot was in the reference and is now."""

    reference: Points
    """Shape (m, 2): x, y in the reference frame, px."""
    moved: Points
    """Shape (m, 2): x, y now, px; a guess from the neighbours where not seen."""
    seen: NDArray[np.bool_]
    """Shape (m,): True where the dot was measured in this frame."""

    @property
    def shift(self) -> Points:
        """Shape (m, 2): movement since the reference, px."""
        return self.moved - self.reference


def find_markers(rgb: Rgb) -> Points:
    """Return the centres of all whole dots, sub-pixel, row by row.

    A dot is darker than its surroundings in every colour, round, and of about
    the size that most others have. Dots that the border cuts are left out:
    their centre cannot be measured.

    Args:
        rgb: Shape (height, width, 3), red first.

    Returns:
        Shape (m, 2), x then y, px; m is 0 on a gel without dots, or where an image is so small that
        no window between two of them holds a pixel.

    Raises:
        BadSource: The image is not of that shape.
    """
    check_rgb(rgb)
    scale = rgb.shape[1] / ROW_PX
    rough, diameter = _rough_dots(rgb, scale)
    if len(rough) < _FEWEST:
        return np.zeros((0, 2), np.float32)
    spacing = _spacing(rough)
    if spacing <= 0.5 * diameter + CLEAR_PX:
        return np.zeros((0, 2), np.float32)
    windows = DotWindows.around(diameter, spacing, rgb.shape[:2])
    image = level_image(rgb, levels_of(rgb))
    at, _ = centroids(image, rough, windows)
    gone = np.linalg.norm(at - rough, axis=1) > 0.35 * diameter
    at[gone] = rough[gone]
    order = np.lexsort((at[:, 0], np.round(at[:, 1] / (2.0 * diameter))))
    return np.asarray(at[order], np.float32)


def check_rgb(rgb: Rgb) -> None:
    """Refuse what is no RGB image.

    Raises:
        BadSource: Another shape or type than (height, width, 3), uint8.
    """
    if rgb.ndim != 3 or rgb.shape[2] != 3 or rgb.dtype != np.uint8:
        raise BadSource(
            "frames of shape (height, width, 3), uint8, red first",
            f"shape {rgb.shape}, {rgb.dtype}",
            "give colour frames; a grey camera shows no gradients",
        )


def check_like(rgb: Rgb, shape: tuple[int, ...]) -> None:
    """Refuse what is no RGB image, or not of the reference's shape.

    Raises:
        BadSource: It is not.
    """
    check_rgb(rgb)
    if rgb.shape != shape:
        raise BadSource(
            f"frames of shape {shape}, as the reference", f"{rgb.shape}",
            "give both from one camera",
        )  # fmt: skip


def relative_brightness(rgb: Rgb, closing_px: int) -> NDArray[np.float32]:
    """Return each pixel's brightness against its surroundings, dots filled in.

    The largest of the three colours' ratios is taken: an imprint darkens one
    colour and lightens another, only ink darkens them all.

    Args:
        rgb: Shape (h, w, 3).
        closing_px: Dark things narrower than this are filled in, px.

    Returns:
        Shape (h, w): about 1 on bare gel, 0.3 to 0.5 in a dot.
    """
    smooth = cv2.GaussianBlur(rgb, (3, 3), 0)
    filled = cv2.morphologyEx(smooth, cv2.MORPH_CLOSE, np.ones([closing_px | 1] * 2, np.uint8))
    around = cv2.blur(filled, [closing_px | 1] * 2)
    ratio = cv2.divide(smooth, np.maximum(around, 1), dtype=cv2.CV_32F)
    return brightest(np.asarray(ratio, np.float32))


def brightest(image: NDArray[np.float32]) -> NDArray[np.float32]:
    """Return the largest of an image's three colours, shape (h, w)."""
    red, green, blue = cv2.split(image)
    return np.asarray(cv2.max(cv2.max(red, green), blue), np.float32)


def _rough_dots(rgb: Rgb, scale: float) -> tuple[Points, float]:
    """Return the centres of dark, round, equally large spots, and their diameter, px."""
    nothing = np.zeros((0, 2), np.float32), 0.0
    if float(rgb.mean()) < _DARKEST_FRAME:
        return nothing
    shrink = scale * _SEARCH_SCALE
    height, width = round(rgb.shape[0] / shrink), round(rgb.shape[1] / shrink)
    small = np.asarray(cv2.resize(rgb, (width, height), interpolation=cv2.INTER_AREA), np.uint8)
    dark = relative_brightness(small, round(_CLOSING_PX / _SEARCH_SCALE)) < _DARK
    _, _, stats, centres = cv2.connectedComponentsWithStats(dark.astype(np.uint8), connectivity=4)
    boxes, middles = stats[1:].astype(np.float64), centres[1:].astype(np.float32)
    left, top, wide, tall, area = boxes.T
    size = np.sqrt(4 / np.pi * area) * _SEARCH_SCALE
    good = (size > _SMALLEST_PX * 0.7) & (size < _LARGEST_PX)
    good &= (np.minimum(wide, tall) > _ROUND * np.maximum(wide, tall)) & (
        area > _FILL * wide * tall
    )
    good &= (left > 0) & (top > 0) & (left + wide < width) & (top + tall < height)
    if good.sum() < _FEWEST:
        return nothing
    usual = float(np.median(area[good]))
    good &= (area < usual * _ODD_SIZE) & (area > usual / _ODD_SIZE)
    grown = (middles[good] + 0.5) * shrink - 0.5
    return grown.astype(np.float32), float(np.sqrt(4 / np.pi * usual) * shrink)


def _spacing(points: Points) -> float:
    """Return the median distance to the nearest neighbour, px."""
    apart = np.linalg.norm(points[:, None] - points[None], axis=2)
    np.fill_diagonal(apart, np.inf)
    return float(np.median(apart.min(axis=1)))


class MarkerTracker:
    """Follows each dot of a reference frame from frame to frame.

    The usual frame costs one small window a dot, around where it was. A dot
    that went far or vanished starts a search of the whole image, in which
    dots are matched by their common shift and turn, so that none takes another's
    place as long as they move less than half a spacing between two frames.

    Args:
        reference_rgb: Shape (height, width, 3), red first. It may have no
            dots: the flow is then empty.
    """

    def __init__(self, reference_rgb: Rgb) -> None:
        self._reference = find_markers(reference_rgb)
        self._shape = reference_rgb.shape
        self._moved = self._reference.copy()
        self._seen = np.ones(len(self._reference), np.bool_)
        self._wait = 0
        self.spacing_px: float = 0.0
        """Median distance between neighbouring dots in the reference, px; 0 without dots."""
        self.diameter_px: float = 0.0
        """Of a dot in the reference, px; 0 without dots."""
        if len(self._reference):
            self._prepare(reference_rgb)

    def _prepare(self, rgb: Rgb) -> None:
        self.spacing_px = _spacing(self._reference)
        self.diameter_px = _rough_dots(rgb, rgb.shape[1] / ROW_PX)[1]
        self._windows = DotWindows.around(self.diameter_px, self.spacing_px, rgb.shape[:2])
        self._levels = levels_of(rgb)
        image = level_image(rgb, self._levels)
        _, self._mass = centroids(image, self._reference, self._windows)
        apart = np.linalg.norm(self._reference[:, None] - self._reference[None], axis=2)
        self._near = np.argsort(apart, axis=1)[:, 1 : 1 + _NEAREST]

    def __len__(self) -> int:
        return len(self._reference)

    @property
    def reference(self) -> Points:
        """Shape (m, 2): x, y of each dot in the reference frame, px."""
        return self._reference

    def track(self, rgb: Rgb) -> MarkerFlow:
        """Return where the dots are in the next frame.

        Args:
            rgb: Shape as the reference's, the frame after the last one given.

        Raises:
            BadSource: The frame has another shape than the reference.
        """
        check_rgb(rgb)
        if rgb.shape != self._shape:
            raise BadSource(
                f"frames of shape {self._shape}", f"{rgb.shape}", "make a new tracker for them"
            )
        if len(self._reference):
            self._follow(rgb)
        return MarkerFlow(self._reference, self._moved.copy(), self._seen.copy())

    def _follow(self, rgb: Rgb) -> None:
        image = level_image(rgb, self._levels)
        start = self._moved
        at, mass = centroids(image, start, self._windows)
        good = self._believable(at, mass)
        jumped = np.linalg.norm(at - start, axis=1) > _JUMP * self.spacing_px
        odd = self._seen & (jumped | ~good)
        self._wait = max(0, self._wait - 1)
        if (self._wait == 0 and odd.mean() > _MANY_LOST) or (good & self._seen & jumped).any():
            at, good = self._search(rgb, image)
            self._wait = 0 if good.mean() > 1 - _MANY_LOST else _RETRY_FRAMES
        self._settle(at, good)

    def _believable(self, at: Points, mass: NDArray[np.float32]) -> NDArray[np.bool_]:
        """True where the darkness is that of one whole dot."""
        height, width = self._shape[:2]
        edge = 0.5 * self.diameter_px + _RIM_PX
        inside = (at > edge).all(axis=1) & (at < (width - 1 - edge, height - 1 - edge)).all(axis=1)
        share = mass / np.maximum(self._mass, 1e-3)
        return np.asarray(inside & (share > _LEAST_MASS) & (share < _MOST_MASS))

    def _search(self, rgb: Rgb, image: NDArray[np.uint8]) -> tuple[Points, NDArray[np.bool_]]:
        """Match all dots of the image to those of the last frame by their common shift and turn."""
        found = find_markers(rgb)
        if not len(found):
            return self._moved.copy(), np.zeros(len(self._reference), np.bool_)
        steps = self._rigid_steps(found)
        for _ in range(3):
            match, good = _mutual(self._moved + steps, found, 0.4 * self.spacing_px)
            steps = self._smoothed(found[match] - self._moved, good, steps)
        match, good = _mutual(self._moved + steps, found, 0.35 * self.spacing_px)
        at = np.where(good[:, None], found[match], self._moved + steps).astype(np.float32)
        refined, mass = centroids(image, at, self._windows)
        return np.where(good[:, None], refined, at), good & self._believable(refined, mass)

    def _rigid_steps(self, found: Points) -> Points:
        """Return each dot's step by the turn and the shift that most findings agree with.

        A turn of 0.2 rad moves the outer dots by half a spacing, which no common step explains:
        turns are tried where the dots do not fit without.
        """
        middle = self._moved[self._seen].mean(axis=0) if self._seen.any() else self._moved.mean(0)
        best, most = np.zeros_like(self._moved), -1
        for turn in _TURNS:
            cos, sin = np.cos(turn), np.sin(turn)
            turned = (self._moved - middle) @ np.array([[cos, sin], [-sin, cos]]) + middle
            moved = turned + _common_step(turned[self._seen], found, self.spacing_px)
            fits = int(_mutual(moved, found, _FITS * self.spacing_px)[1].sum())
            if fits > most:
                best, most = np.asarray(moved - self._moved, np.float32), fits
            if fits > _ENOUGH_FIT * min(len(found), len(self._moved)):
                break
        return best

    def _smoothed(self, steps: Points, good: NDArray[np.bool_], fallback: Points) -> Points:
        """Return each dot's step as the median of its matched neighbours' steps."""
        if good.all():
            around = np.concatenate([steps[:, None], steps[self._near]], axis=1)
            return np.asarray(np.median(around, axis=1), np.float32)
        known = np.where(good[:, None], steps, np.nan)
        around = np.concatenate([known[:, None], known[self._near]], axis=1)
        enough = np.isfinite(around[..., 0]).sum(axis=1) > 0
        result = fallback.copy()
        result[enough] = np.nanmedian(around[enough], axis=1)
        return result

    def _settle(self, at: Points, good: NDArray[np.bool_]) -> None:
        """Keep what is believable; put the others where their neighbours say they are."""
        good = good & self._apart(at, good)
        shift = self._smoothed(at - self._reference, good, self._moved - self._reference)
        off = np.linalg.norm(at - self._reference - shift, axis=1)
        good = good & (off < _REACH * self.spacing_px)
        self._moved = np.where(good[:, None], at, self._reference + shift).astype(np.float32)
        self._seen = good

    def _apart(self, at: Points, good: NDArray[np.bool_]) -> NDArray[np.bool_]:
        """False for dots that fell upon a neighbour's place."""
        far = np.linalg.norm(at[:, None] - at[self._near], axis=2) > 0.5 * self.diameter_px
        return np.asarray((far | ~good[self._near]).all(axis=1))


def _common_step(before: Points, after: Points, spacing_px: float) -> NDArray[np.float32]:
    """Return the movement that most dots share, shape (2,), px."""
    if not len(before):
        return np.zeros(2, np.float32)
    steps = (after[None] - before[:, None]).reshape(-1, 2)
    steps = steps[np.linalg.norm(steps, axis=1) < _REACH * spacing_px]
    if not len(steps):
        return np.zeros(2, np.float32)
    close = np.linalg.norm(steps[:, None] - steps[None], axis=2) < 0.12 * spacing_px
    votes = close.sum(axis=1) - 1e-3 * np.linalg.norm(steps, axis=1)
    return np.asarray(steps[close[int(np.argmax(votes))]].mean(axis=0), np.float32)


def _mutual(
    expected: Points, found: Points, reach_px: float
) -> tuple[NDArray[np.intp], NDArray[np.bool_]]:
    """Return each dot's nearest finding, and True where each is the other's nearest."""
    apart = np.linalg.norm(expected[:, None] - found[None], axis=2)
    match, back = apart.argmin(axis=1), apart.argmin(axis=0)
    rows = np.arange(len(expected))
    return match, (back[match] == rows) & (apart[rows, match] < reach_px)
