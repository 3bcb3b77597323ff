"""How a patch of gel moved: shift, turn and stretch of the dots upon it.

Least squares over a similarity, made robust by weights. Knows nothing about
images.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from taxel.gel.markers import MarkerFlow

_ROUNDS = 2
TUKEY = 4.7
"""Spreads at which a dot no longer counts. Source: Holland & Welsch 1977, 95 % efficiency."""
_SPREAD_FLOOR_PX = 0.05
"""Tracking noise of a dot: below it, residuals are not outliers."""
_LEAST_DOTS = 2
"""A turn, a stretch and a shift need two dots."""


@dataclass(frozen=True, slots=True)
class Motion:
    """A similarity: turn and stretch about the patch's middle, then shift."""

    translation_px: NDArray[np.float32]
    """Shape (2,): mean movement of the patch, x right and y down, px."""
    rotation_rad: float
    """Turn, radians; positive from x towards y (clockwise on the screen)."""
    dilation: float
    """Relative growth of lengths, unitless; 0.01 is one per cent apart."""
    residual_px: float
    """Root mean square of what the similarity leaves over, px: shear that differs by place."""
    centre_px: NDArray[np.float32]
    """Shape (2,): the patch's middle in the reference, px."""
    dots: int
    """Dots that were used; below 2 all of the above are zero."""

    def at(self, points: NDArray[np.floating]) -> NDArray[np.float32]:
        """Return the movement that the similarity gives to places, shape (n, 2), px."""
        turn = 1 + self.dilation
        cos, sin = turn * np.cos(self.rotation_rad) - 1, turn * np.sin(self.rotation_rad)
        x, y = (np.asarray(points, np.float32) - self.centre_px).T
        moved = np.stack([cos * x - sin * y, sin * x + cos * y], axis=1) + self.translation_px
        return np.asarray(moved, np.float32)


_STILL = Motion(np.zeros(2, np.float32), 0.0, 0.0, 0.0, np.zeros(2, np.float32), 0)


def fit_motion(
    flow: MarkerFlow, weights: NDArray[np.floating] | NDArray[np.bool_] | None = None
) -> Motion:
    """Return the similarity that moves the dots best.

    Args:
        flow: The dots' movement; dots not seen do not count.
        weights: Shape (m,): how much each dot counts, unitless, such as 1 in
            contact and 0 outside; None counts all alike.
    """
    share = np.asarray(flow.seen, np.float64).copy()
    if weights is not None:
        share *= np.asarray(weights, np.float64)
    used = share > 0
    if used.sum() < _LEAST_DOTS:
        return _STILL
    before = flow.reference[used].astype(np.float64)
    return _robust(before, flow.moved[used] - before, share[used])


def _robust(
    before: NDArray[np.float64], step: NDArray[np.float64], share: NDArray[np.float64]
) -> Motion:
    """Fit, and fit again with less weight on what does not follow."""
    trust = np.ones_like(share)
    motion = _fit(before, step, share)
    for _ in range(_ROUNDS if len(share) > 2 * _LEAST_DOTS else 0):
        left = np.linalg.norm(step - motion.at(before), axis=1)
        spread = max(1.4826 * float(np.median(left)), _SPREAD_FLOOR_PX)
        trust = np.clip(1 - (left / (TUKEY * spread)) ** 2, 0, 1) ** 2
        motion = _fit(before, step, share * trust)
    middle = np.asarray(share @ before / share.sum(), np.float32)
    return replace(motion, centre_px=middle, translation_px=motion.at(middle[None])[0])


def _fit(
    before: NDArray[np.float64], step: NDArray[np.float64], share: NDArray[np.float64]
) -> Motion:
    total = share.sum()
    centre = share @ before / total
    shift = share @ step / total
    x, y = (before - centre).T
    u, v = (step - shift).T
    spread = float(share @ (x * x + y * y))
    if spread <= 0:
        return _STILL
    grow = float(share @ (x * u + y * v)) / spread
    turn = float(share @ (x * v - y * u)) / spread
    left_u, left_v = u - (grow * x - turn * y), v - (turn * x + grow * y)
    residual = float(np.sqrt(share @ (left_u**2 + left_v**2) / total))
    return Motion(
        shift.astype(np.float32),
        float(np.arctan2(turn, 1 + grow)),
        float(np.hypot(1 + grow, turn) - 1),
        residual,
        centre.astype(np.float32),
        int((share > 0).sum()),
    )


@dataclass(frozen=True, slots=True)
class RegionMotion:
    """How the gel moved in contact and around it."""

    inside: Motion
    """Of the dots in contact."""
    outside: Motion
    """Of the dots around it."""
    shear_px: NDArray[np.float32]
    """Shape (2,): how much further the contact moved than its surroundings, px."""


def summarise_flow(flow: MarkerFlow, inside: NDArray[np.bool_]) -> RegionMotion:
    """Return the motion of the dots in contact, of the others, and their difference.

    Args:
        flow: The dots' movement.
        inside: Shape (m,): True for dots in contact, as `dots_in` says.
    """
    within, around = fit_motion(flow, inside), fit_motion(flow, ~inside)
    shear = within.translation_px - around.translation_px if within.dots else np.zeros(2)
    return RegionMotion(within, around, np.asarray(shear, np.float32))


def dots_in(points: NDArray[np.floating], mask: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Return which places lie in a mask, shape (m,).

    Args:
        points: Shape (m, 2): x, y, px; places outside the image count as its border.
        mask: Shape (height, width).
    """
    height, width = mask.shape
    column = np.clip(np.rint(points[:, 0]).astype(int), 0, width - 1)
    row = np.clip(np.rint(points[:, 1]).astype(int), 0, height - 1)
    return np.asarray(mask[row, column])
