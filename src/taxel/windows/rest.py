"""A grasp at rest: which frames it is, and features seen against it.

The same offline and live. Knows nothing about images, labels or models.
"""

from __future__ import annotations

from typing import Literal

import numpy as np
from numpy.typing import NDArray

Tare = Literal["none", "change", "size", "local-size"]
"""none: features as they are; change: less those at rest; size: the absolute value of that;
local-size: the same at each place of the image, then the mean over places, so that changes of
opposite sign at two places do not cancel. Source: our choice, docs/decisions/0013."""

SETTLE = slice(9, 24)
"""Frames whose median is the settled grasp: at 60 Hz the first 0.15 s may be an
exposure transient, and no pour begins before 0.4 s. Source: our choice, docs/decisions/0013."""


def settled(features: NDArray[np.float32]) -> NDArray[np.float32]:
    """Return the features of the settled grasp: the median over its frames.

    Args:
        features: Of the settled frames, shape (frames, …).

    Returns:
        Shape (…).
    """
    return np.asarray(np.median(features, axis=0), dtype=np.float32)


def seen(
    features: NDArray[np.float32], rest: NDArray[np.float32], tare: Tare
) -> NDArray[np.float32]:
    """Return what a head sees of features, before scaling; same shape.

    Args:
        features: Shape (…, cameras, features); for "local-size" those that `compared` gave, which
            are handed on as they are.
        rest: Those of the settled grasp, shape (cameras, features).
        tare: See `HeadConfig.tare`.
    """
    if tare in ("none", "local-size"):
        return features
    change = features - rest
    return np.abs(change) if tare == "size" else change


def compared(places: NDArray[np.float32], rest: NDArray[np.float32]) -> NDArray[np.float32]:
    """Return the mean size of the change over all places of an image, shape (…, features).

    Args:
        places: Features of each place, shape (…, places, features).
        rest: Those of the settled grasp, of the same shape or one that broadcasts to it.
    """
    return np.asarray(np.abs(places - rest).mean(axis=-2), np.float32)
