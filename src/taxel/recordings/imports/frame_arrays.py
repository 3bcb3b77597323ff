"""Frames of one camera from a `.npy` file: an array of 8-bit images, one after another.

Nothing is unpickled, and a file may be larger than memory. Knows nothing about tables, trials or
recordings.

Background of our choices: docs/decisions/0041.
"""

from __future__ import annotations

import hashlib
from collections.abc import Iterator
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from taxel.errors import BadFile, BadSource, BadTable
from taxel.foreign.files import MIB, open_file
from taxel.foreign.held_arrays import Numbers
from taxel.foreign.npz_file import NpyFile
from taxel.jpeg_head import check_size
from taxel.recordings.imports.video_rows import CAMERA_FILE

ENDING = ".npy"
_SHAPES = "8-bit images (uint8) of shape (frames, height, width) or (frames, height, width, 3)"
_COLOURS = (1, 3)


class FrameArray:
    """An open array of frames.

    Args:
        path: A `.npy` file: uint8, shape (frames, height, width), or with a last axis of 1 or 3
            colours, red first; or one image, shape (height, width, 3).
        rate_hz: Frames a second, which such a file does not say.

    Raises:
        BadTable: It is missing, damaged, of another shape or type, or larger than any camera's.
    """

    def __init__(self, path: Path, rate_hz: float) -> None:
        self.path = path
        self.rate_hz = rate_hz
        try:
            array = NpyFile(path).get("")
        except BadFile as error:
            raise BadTable(f"{error.needed} in {path}", error.got, error.mend) from error
        except OSError as error:
            raise BadTable(
                CAMERA_FILE, f"{path}: {error.strerror or error}", "check the path"
            ) from error
        shape = array.shape if isinstance(array, Numbers) else ()
        if len(shape) == 3 and shape[2] == 3:
            shape = (1, *shape)
        colours = shape[3] if len(shape) == 4 else 1
        if (
            not isinstance(array, Numbers) or array.dtype != np.uint8 or len(shape) not in (3, 4)
            or colours not in _COLOURS or not shape[0]
        ):  # fmt: skip
            raise BadTable(
                _SHAPES, f"{array} in {path}",
                "save them so: images of 0…1 times 255, of 16 bits divided by 257, colours last, "
                "without a fourth channel",
            )  # fmt: skip
        self.count, self.height, self.width = (int(side) for side in shape[:3])
        try:
            check_size(self.width, self.height)
        except BadSource as error:
            raise BadTable(f"{error.needed} in {path}", error.got, "make them smaller") from error
        self._held, self._single = array, len(array.shape) == 3 and array.shape[2] == 3

    def digest(self) -> str:
        """Return the SHA-256 of the file, hexadecimal."""
        return file_digest(self.path)

    def frames(self) -> Iterator[NDArray[np.uint8]]:
        """Yield the frames, shape (height, width, 3), red first."""
        for number in range(self.count):
            part = self._held.whole() if self._single else self._held.part(0, number, number + 1)
            image = np.asarray(part, np.uint8).reshape(self.height, self.width, -1)
            yield np.ascontiguousarray(np.broadcast_to(image, (self.height, self.width, 3)))

    def close(self) -> None:
        """Do nothing: the map needs no open file."""


def file_digest(path: Path) -> str:
    """Return the SHA-256 of a file, hexadecimal, read block by block."""
    whole = hashlib.sha256()
    with open_file(path) as file:
        while block := file.read(MIB):
            whole.update(block)
    return whole.hexdigest()
