"""Frames of one camera from a video, a folder of images, one image, or an array of images.

A video's coding has no check sums: damage that the decoder can conceal is not noticed. Images of
a folder come in the order of the numbers in their names. Knows nothing about tables, trials or
recordings.

Background of our choices: docs/decisions/0041.
"""

from __future__ import annotations

import hashlib
import math
import re
from collections.abc import Callable, Iterator, Sequence
from decimal import Decimal
from itertools import pairwise
from pathlib import Path
from typing import TypeVar

import cv2
import numpy as np
from numpy.typing import NDArray

from taxel.errors import BadFile, BadSource, BadTable
from taxel.foreign.files import MIB, open_file, read_bytes
from taxel.frame_codec import decode_still, still_size
from taxel.jpeg_head import EIGHT_BITS, check_size
from taxel.plain_text import number_of
from taxel.raster_head import is_raster
from taxel.recordings.footage_files import IMAGES
from taxel.recordings.imports.frame_arrays import ENDING, FrameArray, file_digest
from taxel.recordings.imports.video_rows import CAMERA_FILE, no_file

LARGEST_SIDE = 8192
"""Pixels; beyond it a frame alone takes 200 MB. Source: our choice."""
LARGEST_IMAGE = 64 * MIB
"""Bytes of an image's file. Source: our choice."""
NO_RATE_HZ = 25.0
"""Frames a second of images without a clock, unless the table says: a GelSight Mini's nominal
rate. Source: our choice, docs/decisions/0041."""
_GREY = 3.0
"""Mean difference between colours, grey levels, below which a video has no colour."""
_BLACK = 16
"""Largest value, grey levels, of frames that may hold 10 or 12 bits in 16. Source: 4095 / 257."""
HIDDEN = "."
"""First letter of names that are passed over in a folder: macOS leaves `._frame1.png` beside each
image on a stick."""
Result = TypeVar("Result")


def open_footage(path: Path) -> Footage:
    """Open a video, a folder of images, one image (footage of one frame), or a `.npy` of images.

    Raises:
        BadTable: It is missing, empty, cut short, or larger than any camera's.
    """
    if path.is_dir() or (path.is_file() and path.suffix.lower() in IMAGES):
        return Images(path)
    if path.suffix.lower() == ENDING:
        return FrameArray(path, NO_RATE_HZ)
    return Video(path)


_MOST_UNEVEN = 0.5
"""Of a frame's period, by which the steps of a video may differ: cameras jitter. Source: our
choice, docs/decisions/0041."""
_WITHOUT_COUNT = (".mkv", ".webm", ".mpg", ".mpeg")
"""Endings of files that do not say how many frames they hold: OpenCV guesses it by their length in
time or in bytes and their rate."""
_DECIMAL = re.compile(r"(.*?)(\d+)\.(\d+)")
"""A stem that ends in a decimal, as of images named by their moments."""


def _opened(path: Path) -> cv2.VideoCapture:
    """Return an open file. FFmpeg takes what is before a colon, as in 10:30, for a protocol."""
    return cv2.VideoCapture(str(path.absolute()))


class Video:
    """An open video file that knows whether it is whole."""

    def __init__(self, path: Path) -> None:
        self.path = path
        if not path.is_file():
            raise no_file(path)
        _refuse_cut(path)
        self._capture = _opened(path)
        self.steps_s: tuple[float, float] | None = None
        """Shortest and longest time from frame to frame, by the file's time stamps, once `frames`
        has given two."""
        self.count = int(self._capture.get(cv2.CAP_PROP_FRAME_COUNT))
        self.rate_hz = float(self._capture.get(cv2.CAP_PROP_FPS))
        self.width = int(self._capture.get(cv2.CAP_PROP_FRAME_WIDTH))
        self.height = int(self._capture.get(cv2.CAP_PROP_FRAME_HEIGHT))
        _refuse_side(path, self.width, self.height)
        if not self._capture.isOpened() or self.count < 1 or self.rate_hz <= 0:
            raise BadTable(
                f"a video with frames, an image ({', '.join(IMAGES)}), or a .npy of images",
                f"{path} of {number_of(path.stat().st_size, 'byte')} without any",
                "copy or record it again",
            )
        _refuse_large(path, self.width, self.height)
        if path.suffix.lower() in _WITHOUT_COUNT:
            self.count = 0
            while self._capture.grab():
                self.count += 1
            if not self.count:
                raise _none_decoded(path)
            self._capture = _opened(path)

    def digest(self) -> str:
        """Return the SHA-256 of the file, hexadecimal."""
        return file_digest(self.path)

    def frames(self) -> Iterator[NDArray[np.uint8]]:
        """Yield the frames, shape (height, width, 3), red first.

        Raises:
            BadTable: There are fewer or more than the file says, or one has another size.
        """
        before_s = math.nan
        for number in range(self.count):
            read, bgr = self._capture.read()
            if not read and not number:
                raise _none_decoded(self.path)
            if not read:
                raise BadTable(
                    f"the {number_of(self.count, 'frame')} that {self.path} says it has",
                    f"{number}: it is cut short, or its rate varies",
                    "copy it again; if it plays to its end, write it anew at one rate: "
                    "ffmpeg -i VIDEO -r RATE NEW",
                )  # fmt: skip
            time_s = self._capture.get(cv2.CAP_PROP_POS_MSEC) / 1000.0
            if not time_s < before_s:  # else 0: of an AVI's last frames, FFmpeg may know no time
                if number:
                    step_s = time_s - before_s
                    least_s, most_s = self.steps_s or (step_s, step_s)
                    self.steps_s = min(least_s, step_s), max(most_s, step_s)
                before_s = time_s
            _same_size(self, bgr)
            if number == self.count - 1 and self._capture.grab():
                raise BadTable(
                    f"the {number_of(self.count, 'frame')} that {self.path} says it has", "more",
                    "write it anew at one rate: ffmpeg -i VIDEO -r RATE NEW",
                )  # fmt: skip
            yield np.asarray(cv2.cvtColor(bgr, cv2.COLOR_BGR2RGB), np.uint8)

    def uneven(self) -> bool:
        """Return whether times from frame to frame differ by more than half a frame's period."""
        return self.steps_s is not None and (
            (self.steps_s[1] - self.steps_s[0]) * self.rate_hz > _MOST_UNEVEN
        )

    def frames_at(self, numbers: Sequence[int]) -> Iterator[NDArray[np.uint8]]:
        """Yield some frames by their numbers from 0, shape (height, width, 3), red first.

        Raises:
            BadTable: One is not there, or has another size.
        """
        for number in numbers:
            self._capture.set(cv2.CAP_PROP_POS_FRAMES, number)
            read, bgr = self._capture.read()
            if not read:
                raise BadTable(
                    f"frame {number} of {self.path}, which says it has {self.count}",
                    "none: it is cut short", "copy it again, or cut it at a whole frame",
                )  # fmt: skip
            _same_size(self, bgr)
            yield np.asarray(cv2.cvtColor(bgr, cv2.COLOR_BGR2RGB), np.uint8)

    def close(self) -> None:
        """Let go of the file."""
        self._capture.release()


class Images:
    """A folder of images of one size, one a frame; or a single image, of one frame."""

    def __init__(self, path: Path) -> None:
        self.path = path
        inside = path.iterdir() if path.is_dir() else [path]
        self._files = sorted(
            (
                file
                for file in inside
                if file.suffix.lower() in IMAGES
                and not (file.name.startswith(HIDDEN) and file != path)
            ),
            key=_in_order,
        )
        _refuse_unclear(self._files)
        if not self._files:
            raise BadTable(
                f"images ({', '.join(IMAGES)}) in the folder of a camera", f"none in {path}",
                "check the path",
            )  # fmt: skip
        self.count = len(self._files)
        self.rate_hz = NO_RATE_HZ
        self.width, self.height = _readable(self._files[0], still_size)
        _refuse_side(path, self.width, self.height)

    def digest(self) -> str:
        """Return the SHA-256 over all images in order, hexadecimal."""
        whole = hashlib.sha256()
        for file in self._files:
            whole.update(hashlib.sha256(read_bytes(file, LARGEST_IMAGE)).digest())
        return whole.hexdigest()

    def frames(self) -> Iterator[NDArray[np.uint8]]:
        """Yield the frames, shape (height, width, 3), red first.

        Raises:
            BadTable: An image is damaged, or has another size than the first.
        """
        for file in self._files:
            rgb = _readable(file, decode_still)
            _same_size(self, rgb, file.name)
            yield rgb

    def close(self) -> None:
        """Do nothing: no file stays open."""


Footage = Video | Images | FrameArray
"""What `open_footage` gives: count, rate_hz, width, height, path and frames."""


def coloured(footage: Footage) -> Iterator[NDArray[np.uint8]]:
    """Yield the frames, shape (height, width, 3), and refuse grey ones.

    Imports serve grasp monitors too, which need colour.

    Camera trials in place do without: they are seen in grey, but for one small view.

    Raises:
        BadTable: The first frames have no colour; and as `frames` raises.
    """
    colour, brightest = 0.0, 0
    for number, rgb in enumerate(footage.frames()):
        if number < 5:
            spread = rgb[:, :, ::2].astype(np.int16) - rgb[:, :, 1:2]
            colour = max(colour, float(np.abs(spread).mean()))
            brightest = max(brightest, int(rgb.max()))
        if number == min(4, footage.count - 1) and colour < _GREY:
            if brightest <= _BLACK:
                raise BadTable(
                    "colour frames", f"nearly black ones in {footage.path}: none is brighter than "
                    f"{brightest} of 255", "if the file holds 10 or 12 bits in 16, scale the "
                    "values to all 16 bits, or save them as 8 bits",
                )  # fmt: skip
            raise BadTable(
                "colour frames", f"grey ones in {footage.path}",
                "use the sensor's own colour stream; or do not import camera trials: taxel "
                "train-trials takes their table as it is, grey or not",
            )  # fmt: skip
        yield rgb


def _none_decoded(path: Path) -> BadTable:
    return BadTable(
        "a video whose frames can be decoded", f"{path}, of which none can",
        "write it in another coding, without loss: ffmpeg -i VIDEO -c:v ffv1 NEW.mkv; if that "
        "fails, it is damaged",
    )  # fmt: skip


def _in_order(file: Path) -> list[tuple[int, int, str]]:
    """Return a key by which frame2 comes before frame10."""
    return [
        (1, int(part[:18]), part) if part.isdecimal() else (0, 0, part)
        for part in re.split(r"(\d+)", file.name)
    ]


def _refuse_unclear(files: Sequence[Path]) -> None:
    """Refuse images whose order their names leave open.

    Raises:
        BadTable: Two differ in their ending alone, or decimals would stand in another order.
    """
    stems = {file.stem: file.name for file in files}
    if len(stems) < len(files):
        double = next(file for file in files if stems[file.stem] != file.name)
        raise BadTable(
            "one image a frame", f"{double.name} and {stems[double.stem]} in {double.parent}",
            "leave one of the endings out",
        )  # fmt: skip
    moments = [_DECIMAL.fullmatch(file.stem) for file in files]
    for before, after in pairwise(moments):
        if before is None or after is None or before.groups()[:2] != after.groups()[:2]:
            continue
        counted = str(int(before[3]) + 1) == after[3] and before[3] == str(int(before[3]))
        if not counted and Decimal(f"0.{before[3]}") >= Decimal(f"0.{after[3]}"):
            raise BadTable(
                "names in whose order nothing is open", f"{before[0]} and {after[0]} in "
                f"{files[0].parent}: decimals, or numbers that follow each other",
                "write as many digits behind each point, or number the images",
            )  # fmt: skip


def _bytes_of(file: Path) -> bytes:
    try:
        return read_bytes(file, LARGEST_IMAGE)
    except (BadFile, OSError) as error:
        raise BadTable("images that can be read", f"{file}: {error}", "check the folder") from error


def _readable(file: Path, read: Callable[[bytes], Result]) -> Result:
    """Return what is read from an image; its head is looked at before it is decoded.

    Raises:
        BadTable: It is no image that is known, damaged, or larger than any camera's.
    """
    image = _bytes_of(file)
    try:
        return read(image)
    except BadSource as error:
        raise BadTable(
            f"{error.needed}, as PNG, JPEG, BMP or TIFF", f"{file}: {error.got}",
            error.mend if is_raster(image) or error.mend == EIGHT_BITS else "save or copy it again",
        ) from error  # fmt: skip


def _same_size(footage: Footage, bgr: NDArray[np.generic], file: str = "") -> None:
    if bgr.shape[:2] != (footage.height, footage.width):
        raise BadTable(
            f"frames of {footage.width} × {footage.height} px throughout {footage.path}",
            f"one of {bgr.shape[1]} × {bgr.shape[0]} px{f', {file}' if file else ''}",
            "write it again at one size",
        )  # fmt: skip


def _refuse_side(path: Path, width: int, height: int) -> None:
    if max(width, height) > LARGEST_SIDE:
        raise BadTable(
            f"frames with sides of at most {LARGEST_SIDE} pixels",
            f"{width}×{height} in {path}", "make the video smaller",
        )  # fmt: skip


def _refuse_large(path: Path, width: int, height: int) -> None:
    """Refuse a video that declares frames no camera has, before the first is decoded.

    Raises:
        BadTable: They are larger than `taxel.jpeg_head.LARGEST_PX`, or empty.
    """
    try:
        check_size(width, height)
    except BadSource as error:
        raise BadTable(
            f"{error.needed} in {path}", error.got, "write it again at the sensor's own size"
        ) from error


def _refuse_cut(path: Path) -> None:
    """Refuse an AVI that is shorter than its own head says: decoders do not care.

    Raises:
        BadTable: It is cut short, or cannot be read.
    """
    try:
        with open_file(path) as file:
            head = file.read(8)
    except BadFile as error:
        raise BadTable(CAMERA_FILE, error.got, "check the path") from error
    except OSError as error:
        raise BadTable(
            "a video that can be read", f"{path}: {error.strerror or error}", "check its rights"
        ) from error
    size = path.stat().st_size
    stated = int.from_bytes(head[4:8], "little") + 8
    if head[:4] == b"RIFF" and size < stated:
        raise BadTable(
            f"the {stated:,} bytes that {path} says it has", f"{size:,}: it is cut short",
            "copy it again, or write it again with a video tool",
        )  # fmt: skip
