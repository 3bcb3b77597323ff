"""How far the markers under a contact depart from a rigid movement, and where they do.

In a gel that moves as one piece, nothing is left over when a rigid movement has been fitted to
the markers in contact; in a real gel the rim lags behind the middle. Real and simulated videos
are treated alike, with nothing learned. Knows nothing about files or labels.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from taxel.gel.contact import ContactFinder, ContactShape, contact_shape, imprint_mask
from taxel.gel.markers import MarkerFlow, MarkerTracker, Rgb
from taxel.gel.slip_features import median_frame

BANDS = ((0.0, 0.5), (0.5, 1.0), (1.0, 1.5), (1.5, 2.0))
"""Distances from the contact's middle, as multiples of its rim's."""
LEAST_MOVE_PX = 2.0
"""Root mean square movement in contact below which a marker's noise, 0.1 px, would count."""
_LEAST_DOTS = 6
_CORE = 0.7
"""Markers nearer than this to the middle give the movement that the bands are compared with."""
_LEAST_CORE = 4
_LEAST_SEEN = 0.7
"""Share of the markers that a frame must show: fewer is a blurred or wrong frame."""
_STEP = 1.1
"""A later frame counts if its markers have moved by so much more than any before."""
_LEAST_AREA = 0.02
"""Of the image: a smaller mask is no contact of a grasp."""

Points = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class MarkerResidual:
    """What is left over about when a video's markers have moved most."""

    frame: int
    """Which one, from the first after the reference."""
    dots: int
    """Markers in contact."""
    move_px: float
    """Root mean square of their movement since the reference."""
    turning: float
    """Share of the rigid movement's mean square that is a turn, 0…1."""
    non_rigid: float
    """Root mean square of what a rigid movement leaves over, relative to `move_px`."""
    non_affine: float
    """Likewise, after an affine one."""
    carried: tuple[float, ...]
    """Of the movement that the middle's would give, the share that each of `BANDS` makes; NaN
    where too few markers are."""


def marker_residual(reference: Sequence[Rgb], frames: Iterable[Rgb]) -> MarkerResidual | None:
    """Return a video's residual, or None where no contact or too little movement is seen.

    Args:
        reference: The settled first frames, each (height, width, 3), red first.
        frames: Those after them, in order.

    Raises:
        BadSource: The frames' shapes differ.
    """
    middle = median_frame(reference)
    tracker, finder = MarkerTracker(middle), ContactFinder(middle)
    settled = imprint_mask(middle)
    most, found = LEAST_MOVE_PX / 2.0, None
    for number, frame in enumerate(frames):
        flow = tracker.track(frame)
        if flow.seen.mean() < _LEAST_SEEN or _rms(flow.shift[flow.seen]) < most:
            continue
        most = _STEP * _rms(flow.shift[flow.seen])
        mask = settled | finder.mask(frame)
        if mask.mean() >= _LEAST_AREA:
            found = _judge(number, flow, contact_shape(mask)) or found
    return found


def _judge(number: int, flow: MarkerFlow, shape: ContactShape) -> MarkerResidual | None:
    away = _distance(flow.reference, shape)
    at = flow.reference.astype(np.float64) - shape.centre_px
    moved = flow.shift.astype(np.float64)
    held = flow.seen & (away <= 1.0)
    if held.sum() < _LEAST_DOTS or _rms(moved[held]) < LEAST_MOVE_PX:
        return None
    rigid = _rigid(at[held], moved[held])
    straight = moved[held].mean(axis=0)
    total = float((rigid**2).sum())
    turning = 1.0 - len(rigid) * float(straight @ straight) / max(total, 1e-12)
    terms = np.column_stack([np.ones(held.sum()), at[held]])
    affine = terms @ np.linalg.lstsq(terms, moved[held], rcond=None)[0]
    move = _rms(moved[held])
    return MarkerResidual(
        frame=number,
        dots=int(held.sum()),
        move_px=move,
        turning=turning,
        non_rigid=_rms(moved[held] - rigid) / move,
        non_affine=_rms(moved[held] - affine) / move,
        carried=_carried(at, moved, np.where(flow.seen, away, np.inf)),
    )


def _carried(at: Points, moved: Points, away: Points) -> tuple[float, ...]:
    core = away <= _CORE
    if core.sum() < _LEAST_CORE:
        return (float("nan"),) * len(BANDS)
    matrix = _rigid_terms(at[core])
    motion = np.linalg.lstsq(matrix, moved[core].ravel(), rcond=None)[0]
    expected = (_rigid_terms(at) @ motion).reshape(-1, 2)
    shares = []
    for low, high in BANDS:
        band = (away >= low) & (away < high)
        size = float((expected[band] ** 2).sum())
        few = band.sum() < 2 or size < LEAST_MOVE_PX**2
        shares.append(float("nan") if few else float((moved[band] * expected[band]).sum() / size))
    return tuple(shares)


def _distance(points: NDArray[np.floating], shape: ContactShape) -> Points:
    """Return distances from a contact's middle, 1 at the rim of its ellipse, shape (m,)."""
    cos, sin = np.cos(shape.angle_rad), np.sin(shape.angle_rad)
    x, y = (points.astype(np.float64) - shape.centre_px).T
    long_px, short_px = np.maximum(shape.axes_px, 1.0)
    return np.asarray(np.hypot((x * cos + y * sin) / long_px, (y * cos - x * sin) / short_px))


def _rigid(at: Points, moved: Points) -> Points:
    matrix = _rigid_terms(at)
    return (matrix @ np.linalg.lstsq(matrix, moved.ravel(), rcond=None)[0]).reshape(-1, 2)


def _rigid_terms(at: Points) -> Points:
    """Return the matrix (2 m, 3) from (x, y, turn) to movements, for turns of some degrees."""
    matrix = np.zeros((len(at), 2, 3))
    matrix[:, 0, 0] = matrix[:, 1, 1] = 1.0
    matrix[:, 0, 2], matrix[:, 1, 2] = -at[:, 1], at[:, 0]
    return matrix.reshape(-1, 3)


def _rms(moved: NDArray[np.floating]) -> float:
    return float(np.sqrt((moved.astype(np.float64) ** 2).sum(axis=1).mean()))
