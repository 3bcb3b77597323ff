"""Crops as a camera would have shown them that sits a little differently in its holder.

Between sessions a gel or a camera is taken off and put back, and every image is shifted, turned and
scaled by a little. Such copies of a crop are learned from, so that a recogniser does not rely on
where exactly things appeared on the day that it learned. Knows nothing about labels, models or
files.

Source: docs/decisions/0041, "Copies of a camera that sits a little differently".
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import cv2
import numpy as np
from numpy.typing import NDArray

from taxel.windows.trial_crops import LEAST_CROP
from taxel.windows.trial_network import IMAGES

Image = NDArray[np.uint8]
SHIFTED: Final = ("stills", "picture", "miniature")
"""Views of whose copies models learn. What moves is seen relative to a crop's first frames, and
hardly changes with the camera's place."""
WHOLE: Final = ("touch", "network")
"""Views of encoders that look at eight images of a crop, evenly apart, each as it is."""
ASKED: Final = (*SHIFTED, *WHOLE)
"""Views of copies on which models are compared: what an encoder sees shifts, too, but nothing
learned from copies of the image network's goes on better."""
TURN_DEG: Final = 2.0
SCALE: Final = 0.02
SHIFT: Final = 0.02
"""Standard deviations of the turn, of the scale, and of the shift each way as a share of the
image's width. Source: our choice, docs/decisions/0041."""
VERSION: Final = "shifted-1"
"""For caches."""


def stills_of(images: Sequence[Image]) -> list[Image]:
    """Return a crop of `LEAST_CROP` images whose first, middle and last are those of a crop.

    Args:
        images: Of one camera, shape (height, width, 3) each; of fewer than `LEAST_CROP` the last
            one stands still.
    """
    held = _held(images)
    last, half = len(held) - 1, (LEAST_CROP - 1) // 2
    return [*[held[0]] * half, *[held[last // 2]] * (LEAST_CROP - 1 - half), held[last]]


def looked_at(view: str, images: Sequence[Image]) -> list[Image]:
    """Return as few images as show a view the same as a crop's all: the others need not move.

    Args:
        view: In `ASKED`.
        images: As of `stills_of`.
    """
    if view not in WHOLE:
        return stills_of(images)
    held = _held(images)
    return [held[at] for at in (np.arange(IMAGES) * len(held) // IMAGES).tolist()]


def shifted(images: Sequence[Image], seed: Sequence[int]) -> list[Image]:
    """Return images, all shifted, turned and scaled alike; edges are continued outwards.

    Args:
        images: Of one camera, shape (height, width, 3) each.
        seed: Of the shift.
    """
    height, width = images[0].shape[:2]
    turn, scale, across, down = np.random.default_rng(list(seed)).normal(size=4)
    middle = (width / 2, height / 2)
    matrix = cv2.getRotationMatrix2D(middle, TURN_DEG * turn, 1 + SCALE * scale)
    matrix = np.asarray(matrix, np.float64)
    matrix[:, 2] = matrix[:, 2] + np.array([across, down]) * SHIFT * width

    def move(image: Image) -> Image:
        moved = cv2.warpAffine(image, matrix, (width, height), borderMode=cv2.BORDER_REPLICATE)
        return np.asarray(moved, np.uint8)

    found = {key: move(image) for key, image in {id(image): image for image in images}.items()}
    return [found[id(image)] for image in images]


def _held(images: Sequence[Image]) -> list[Image]:
    return [*images, *[images[-1]] * (LEAST_CROP - len(images))]
