"""A grasp at rest: which frames it is, and features seen against it.

The same offline and live. Knows nothing about images, labels or models.
"""

from __future__ import annotations

from typing import Literal

import numpy as np
from numpy.typing import NDArray

Tare = Literal["none", "change", "size"]
"""none: features as they are; change: less those at rest; size: the absolute value of that."""

SETTLE = slice(9, 24)
"""Frames whose median is the settled grasp: at 60 Hz the first 0.15 s may be an
exposure transient, and no pour begins before 0.4 s. Source: our choice, docs/decisions/0013."""


def settled(features: NDArray[np.float32]) -> NDArray[np.float32]:
    """Return the features of the settled grasp, shape (cameras, features), of its frames."""
    return np.asarray(np.median(features, axis=0), dtype=np.float32)


def seen(
    features: NDArray[np.float32], rest: NDArray[np.float32], tare: Tare
) -> NDArray[np.float32]:
    """Return what a head sees of features, before scaling; same shape.

    Args:
        features: Shape (…, cameras, features).
        rest: Those of the settled grasp, shape (cameras, features).
        tare: See `HeadConfig.tare`.
    """
    if tare == "none":
        return features
    change = features - rest
    return np.abs(change) if tare == "size" else change
