"""JPEG to pixels and back: the one place where tactile images are coded.

Knows nothing about cameras, files or models.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from taxel.errors import BadSource, MissingExtra

try:
    import cv2
except ModuleNotFoundError as error:  # the array path needs no images
    raise MissingExtra("opencv-python-headless", "camera", "tactile cameras") from error

JPEG_QUALITY = 90
"""Of frames that taxel itself encodes, 0…100. Source: our choice, docs/decisions/0012."""


def encode_jpeg(rgb: NDArray[np.uint8], quality: int = JPEG_QUALITY) -> bytes:
    """Return an image as JPEG.

    Args:
        rgb: Shape (height, width, 3), red first.
        quality: 0…100.
    """
    bgr = cv2.cvtColor(rgb, cv2.COLOR_RGB2BGR)
    done, coded = cv2.imencode(".jpg", bgr, [cv2.IMWRITE_JPEG_QUALITY, quality])
    if not done:
        raise ValueError(f"needed an image that JPEG can hold; got shape {rgb.shape}")
    return coded.tobytes()


def decode_jpeg(jpeg: bytes) -> NDArray[np.uint8]:
    """Return a JPEG's pixels, shape (height, width, 3), red first.

    Raises:
        BadSource: It is no JPEG, or is cut short.
    """
    bgr = cv2.imdecode(np.frombuffer(jpeg, np.uint8), cv2.IMREAD_COLOR) if jpeg else None
    if bgr is None or not jpeg.endswith(b"\xff\xd9"):
        raise BadSource(
            "a whole JPEG image", f"{len(jpeg)} bytes that are none", "check the camera's cable"
        )
    return np.asarray(cv2.cvtColor(bgr, cv2.COLOR_BGR2RGB), dtype=np.uint8)
