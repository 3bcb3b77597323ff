"""What a camera showed last, at the size that a monitor learned from.

Knows nothing about grasps, features or models.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from taxel.decisions.reasons import REASONS
from taxel.errors import BadSource
from taxel.frame_codec import decode_jpeg, scaled_down
from taxel.signals import CameraInfo


class CameraEye:
    """The newest image of one camera.

    Args:
        camera: Which.
        size: Width and height to which its images are scaled down.
    """

    def __init__(self, camera: CameraInfo, size: tuple[int, int]) -> None:
        self._camera = camera
        self._size = size
        self.image: NDArray[np.uint8] | None = None
        self._jpeg = b""

    def differs(self, jpeg: bytes) -> bool:
        """Return whether a frame differs from the one before."""
        return jpeg != self._jpeg

    def see(self, jpeg: bytes) -> None:
        """Take in a frame.

        Raises:
            BadSource: It cannot be decoded, or is not such as this camera sends; the one before
                is kept.
        """
        try:
            self.image = scaled_down(decode_jpeg(jpeg, self._camera), self._size)
        except BadSource as error:
            why = f"needed {error.needed}; got {error.got}"
            raise BadSource(
                error.needed, REASONS["bad image"].say(camera=self._camera.name, why=why),
                error.mend,
            ) from error  # fmt: skip
        self._jpeg = jpeg
