"""How a crop looks to the touch encoder: eight images through it, and what their features do.

The encoder lies beside this file as ONNX, the same weights as the backbone touch. Knows nothing
about labels or models behind it.

Background of our choices: docs/decisions/0058.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache
from pathlib import Path
from typing import Any, Final

import cv2
import numpy as np
from numpy.typing import NDArray

Image = NDArray[np.uint8]
FEATURES: Final = 192
HEIGHT_PX, WIDTH_PX = 120, 160
"""Of the image that it takes, pixels."""
IMAGES: Final = 8
"""Of a crop, evenly apart: 0.24 s where it has 48 frames of 25 a second. Source: our choice."""
VERSION: Final = "touch-1"
"""For caches and bundles; changes with the weights."""
MODEL: Final = Path(__file__).with_name("ready") / "touch.onnx"


def look_through_touch(images: Sequence[Image]) -> NDArray[np.float32]:
    """Return the features of eight images of a crop, shape (8, 192).

    Args:
        images: All of the crop, shape (height, width, 3) each, red first.
    """
    chosen = np.arange(IMAGES) * len(images) // IMAGES
    small = [
        cv2.resize(images[at], (WIDTH_PX, HEIGHT_PX), interpolation=cv2.INTER_AREA)
        for at in chosen.tolist()
    ]
    found = [_session().run(None, {"frames": image[None]})[0] for image in small]
    return np.asarray(np.concatenate(found), np.float32)


def touch_courses(values: NDArray[np.float32]) -> NDArray[np.float32]:
    """Return mean, deviation and mean absolute difference in time, shape (cameras, 3 · 192).

    Args:
        values: Shape (images, cameras, 192).
    """
    steps = np.abs(np.diff(values, axis=0))
    each = [values.mean(axis=0), values.std(axis=0), steps.mean(axis=0)]
    return np.asarray(np.concatenate(each, axis=1), np.float32)


@cache
def _session() -> Any:
    import onnxruntime

    options = onnxruntime.SessionOptions()
    options.intra_op_num_threads = options.inter_op_num_threads = 1
    return onnxruntime.InferenceSession(
        MODEL.read_bytes(), options, providers=["CPUExecutionProvider"]
    )
