"""What changed between two images of a gel, by place: what the touch encoder learns to predict.

Computed from the images alone: optical flow and differences of grey. Knows nothing about networks.

Background of our choices: docs/decisions/0058.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

FLOW_PLACES = (6, 8)
"""Rows and columns in which flow is averaged."""
GREY_PLACES = (12, 16)
"""Rows and columns of grey differences."""
SIZE_PLACES = (3, 4)
"""Rows and columns of how much changed."""
FLOW_PX, GREY = 1.0, 12.0
"""What counts as 1: pixels of a 160-pixel row, grey levels. Source: our choice."""
_MOST = 5.0
"""At which targets are cut: a hand in front of the camera is no touch. Source: our choice."""
_SLIP_UM = 20.0
"""Slip below this counts little, micrometres. Source: our choice."""


@dataclass(frozen=True, slots=True)
class Change:
    """Of n pairs of images, flattened and scaled."""

    flow: NDArray[np.float32]
    """Shape (n, 2 · 6 · 8): signed."""
    grey: NDArray[np.float32]
    """Shape (n, 12 · 16): signed."""
    size: NDArray[np.float32]
    """Shape (n, 2 · 3 · 4): logarithms of how much grey and flow changed, without sign."""


SIZES = (
    2 * FLOW_PLACES[0] * FLOW_PLACES[1],
    GREY_PLACES[0] * GREY_PLACES[1],
    2 * SIZE_PLACES[0] * SIZE_PLACES[1],
)
"""Numbers of flow, grey and size."""


def changes(first: NDArray[np.uint8], second: NDArray[np.uint8]) -> Change:
    """Return what changed from each first image to its second.

    Args:
        first: Shape (n, height, width, 3), red first.
        second: As above.
    """
    dense = cv2.DISOpticalFlow.create(cv2.DISOPTICAL_FLOW_PRESET_ULTRAFAST)
    flows, greys, sizes = [], [], []
    for image, later in zip(first, second, strict=True):
        before, after = (cv2.cvtColor(image, cv2.COLOR_RGB2GRAY) for image in (image, later))
        moved = np.asarray(dense.calc(before, after, np.zeros((*before.shape, 2), np.float32)))
        grey = after.astype(np.float32) - before
        flows.append(_by_place(moved, FLOW_PLACES) / FLOW_PX)
        greys.append(_by_place(grey, GREY_PLACES) / GREY)
        much = np.stack([np.abs(grey), np.hypot(moved[..., 0], moved[..., 1])], axis=2)
        sizes.append(np.log1p(_by_place(much, SIZE_PLACES)))
    return Change(_cut(flows), _cut(greys), np.array(sizes, np.float32))


def slip_size(before_um: NDArray[np.float32], after_um: NDArray[np.float32]) -> NDArray[np.float32]:
    """Return the logarithm of slip between two moments, shape (n,); NaN where nobody knows it."""
    return np.asarray(np.log1p(np.abs(after_um - before_um) / _SLIP_UM), np.float32)


def _by_place(values: NDArray[Any], places: tuple[int, int]) -> NDArray[np.float32]:
    small = cv2.resize(values, (places[1], places[0]), interpolation=cv2.INTER_AREA)
    return np.asarray(small, np.float32).ravel()


def _cut(rows: list[NDArray[np.float32]]) -> NDArray[np.float32]:
    return np.asarray(np.array(rows).clip(-_MOST, _MOST), np.float32)
