"""How far rings of the gel go with the object: on gels that shear, slip begins outside.

Dots inside the contact stay with the object until gross slip; from its edge inwards they fall
behind, ring by ring. Of each ring: the share of the object's motion that its dots have made since
the grasp, the share that they make now, and what they have lost since that share was largest. Each
is a ratio, so that neither force nor size of the motion matters. Causal: the same class runs live
and over whole pours, so batch equals live. Knows nothing about images, time, models or thresholds.

Source: docs/decisions/0037.
"""

from __future__ import annotations

from collections import deque
from typing import Final

import numpy as np
from numpy.typing import NDArray

from taxel.gel.rim_slip import WITH_RIM

RINGS: Final = (0.6, 1.0, 1.4, 1.8, 2.2, 2.7)
"""Middles of the rings, in standard deviations of the imprint's places. A dot between two counts in
both, by how near it is. Source: training cups, docs/decisions/0037."""
_END: Final = 3.2
"""Where the outermost ring ends. Source: our choice, docs/decisions/0037."""
RING_FEATURES: Final[tuple[str, ...]] = tuple(
    f"ring_{value}_{ring:g}" for value in ("share", "share_now", "share_lost") for ring in RINGS
)
"""Columns after `WITH_RIM`, means over the gels."""
WITH_RINGS: Final[tuple[str, ...]] = (*WITH_RIM, *RING_FEATURES)
"""Columns of all gels together where rings are looked at too."""
_NOW_IMAGES: Final = 8
"""Images over which the present share is taken: 0.32 s at 25 a second. Source: our choice."""
_SOFT_PX, _SOFT_NOW_PX = 0.2, 0.1
"""Motion below which there is only noise: its square is added to what is divided by.
Source: our choice, docs/decisions/0037."""
_MOVED_PX: Final = 1.0
"""Motion of a ring with the object from which on its share counts towards its largest.
Source: our choice, docs/decisions/0037."""
_LEAST_DOTS: Final = 1.0
"""Sum of dots' weights below which a ring keeps its last values. Source: our choice,
docs/decisions/0037."""
Places = NDArray[np.float64]


class GelRings:
    """The columns of `RING_FEATURES` of one gel since the grasp."""

    def __init__(self) -> None:
        self._past: deque[tuple[Places, Places, NDArray[np.bool_]]] = deque(maxlen=_NOW_IMAGES + 1)
        self._largest = np.zeros(len(RINGS))
        self._share, self._now = np.zeros(len(RINGS)), np.zeros(len(RINGS))
        self.values: NDArray[np.float64] = np.zeros(len(RING_FEATURES))
        """Shape (18,), as `RING_FEATURES`, after the last image."""

    def push(
        self, moved: Places, carried: Places, far: NDArray[np.float64], seen: NDArray[np.bool_]
    ) -> NDArray[np.float64]:
        """Take in an image's dots; return `values`.

        Args:
            moved: Shape (m, 2): each dot's motion since the grasp, px of a 320-pixel row.
            carried: Shape (m, 2): the motion that it would have made with the object.
            far: Shape (m,): its distance from the imprint's middle, in standard deviations of the
                imprint's places.
            seen: Shape (m,): False where a dot does not show.
        """
        self._past.append((moved, carried, seen))
        weights = ring_weights(far) * seen
        share, size, known = _share(weights, moved, carried, _SOFT_PX)
        self._share = np.where(known, share, self._share)
        grown = known & (size > _MOVED_PX)
        self._largest = np.where(grown, np.maximum(self._largest, self._share), self._largest)
        then_moved, then_carried, then_seen = self._past[0]
        now, _, known = _share(
            weights * then_seen, moved - then_moved, carried - then_carried, _SOFT_NOW_PX
        )
        self._now = np.where(known, now, self._now)
        lost = np.minimum(self._share - self._largest, 0.0)
        self.values = np.concatenate([self._share, self._now, lost])
        return self.values


def ring_weights(far: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return how much each dot counts in each ring, shape (rings, m); up to the last ring's middle
    the weights of a dot add up to 1.

    Args:
        far: Shape (m,): as in `GelRings.push`.
    """
    knots = np.array([*RINGS, _END])
    place = np.interp(far, knots, np.arange(len(knots)), right=len(knots) - 1)
    return np.asarray(np.clip(1.0 - np.abs(place - np.arange(len(RINGS))[:, None]), 0.0, 1.0))


def _share(
    weights: NDArray[np.float64], moved: Places, carried: Places, soft_px: float
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.bool_]]:
    """Return each ring's share of the object's motion, the size of that, and where they are known.

    Shapes (rings,); the share is that of the least squares of `moved` on `carried`.
    """
    total = weights.sum(axis=1)
    known = total >= _LEAST_DOTS
    count = np.where(known, total, 1.0)
    square = weights @ (carried**2).sum(axis=1)
    share = (weights @ (moved * carried).sum(axis=1)) / (square + count * soft_px**2)
    return share, np.sqrt(square / count), known
