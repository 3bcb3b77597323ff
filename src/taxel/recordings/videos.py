"""Turn pairs of videos into recordings: one file a camera, frames side by side.

Frames are decoded and kept as JPEG of high quality; equal frames stay equal. A video has no
clock of its own: times are frame number over rate, and the manifest says so. All videos are
read and written before the output folder appears. A video's coding has no
check sums: damage that the decoder can conceal is not noticed. Knows nothing about particular
data sets.

Background of our choices: docs/decisions/0012.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from taxel.errors import BadFile, BadSource, BadTable
from taxel.foreign.files import open_file
from taxel.frame_codec import encode_jpeg
from taxel.jpeg_head import check_size
from taxel.recordings.manifest import NO_ARRAY, Manifest
from taxel.recordings.video_rows import VideoRow
from taxel.recordings.whole import new_folder
from taxel.recordings.writer import Recorder
from taxel.signals import CameraInfo, Frame

QUALITY = 95
"""Of the JPEG that imported frames are kept as, 0…100. Source: our choice, decision 12."""
LARGEST_DIFFERENCE = 2
"""Frames by which the videos of a pair may differ in length; the longer one is cut."""
LARGEST_SIDE = 8192
"""Pixels; beyond it a frame alone takes 200 MB. Source: our choice."""
_GREY = 3.0
"""Mean difference between colours, grey levels, below which a video has no colour."""


def import_videos(
    rows: Sequence[VideoRow],
    output_dir: Path,
    *,
    overwrite: bool = False,
    progress: Callable[[int, int], None] | None = None,
) -> list[Path]:
    """Write one recording for each row, all or none.

    Args:
        rows: What each recording is made of.
        output_dir: Folder to be made.
        overwrite: Replace an existing folder that holds nothing else than these.
        progress: Called with recordings done and in all.

    Raises:
        BadTable: A video is missing, empty, cut short, grey, or unlike its partner.
        RecordingFailed: The disk refused.
    """
    files = [f"{row.name}.mcap" for row in rows]
    with new_folder(output_dir, files, overwrite=overwrite) as made:
        for done, (row, file) in enumerate(zip(rows, files, strict=True), 1):
            _import_row(row, made / file)
            if progress is not None:
                progress(done, len(rows))
    return [output_dir / file for file in files]


class _Video:
    """An open video file that knows whether it is whole."""

    def __init__(self, path: Path) -> None:
        self.path = path
        if not path.is_file():
            raise BadTable("a video of each camera", f"no file {path}", "check the path")
        _refuse_cut(path)
        self._capture = cv2.VideoCapture(str(path))
        self.count = int(self._capture.get(cv2.CAP_PROP_FRAME_COUNT))
        self.rate_hz = float(self._capture.get(cv2.CAP_PROP_FPS))
        self.width = int(self._capture.get(cv2.CAP_PROP_FRAME_WIDTH))
        self.height = int(self._capture.get(cv2.CAP_PROP_FRAME_HEIGHT))
        if max(self.width, self.height) > LARGEST_SIDE:
            raise BadTable(
                f"frames with sides of at most {LARGEST_SIDE} pixels",
                f"{self.width}×{self.height} in {path}", "make the video smaller",
            )  # fmt: skip
        if not self._capture.isOpened() or self.count < 1 or self.rate_hz <= 0:
            raise BadTable(
                "a video with frames", f"{path} of {path.stat().st_size} bytes without any",
                "copy or record it again",
            )  # fmt: skip
        _refuse_large(path, self.width, self.height)

    def frames(self) -> Iterator[NDArray[np.uint8]]:
        """Yield the frames, red first.

        Raises:
            BadTable: There are fewer than the file says, or they are grey.
        """
        colour = 0.0
        for number in range(self.count):
            read, bgr = self._capture.read()
            if not read:
                raise BadTable(
                    f"the {self.count} frames that {self.path} says it has",
                    f"{number}: it is cut short", "copy it again, or cut it at a whole frame",
                )  # fmt: skip
            if bgr.shape[:2] != (self.height, self.width):
                raise BadTable(
                    f"frames of {self.width} × {self.height} px throughout {self.path}",
                    f"one of {bgr.shape[1]} × {bgr.shape[0]} px", "write it anew at one size",
                )  # fmt: skip
            if number < 5:
                spread = bgr[:, :, ::2].astype(np.int16) - bgr[:, :, 1:2]
                colour = max(colour, float(np.abs(spread).mean()))
            if number == min(4, self.count - 1) and colour < _GREY:
                raise BadTable(
                    "colour frames", f"grey ones in {self.path}",
                    "use the sensor's own colour stream",
                )  # fmt: skip
            yield np.asarray(cv2.cvtColor(bgr, cv2.COLOR_BGR2RGB), np.uint8)

    def close(self) -> None:
        """Let go of the file."""
        self._capture.release()


def _refuse_large(path: Path, width: int, height: int) -> None:
    """Refuse a video that declares frames no camera has, before the first is decoded.

    Raises:
        BadTable: They are larger than `taxel.jpeg_head.LARGEST_PX`, or empty.
    """
    try:
        check_size(width, height)
    except BadSource as error:
        raise BadTable(
            f"{error.needed} in {path}", error.got, "write it anew at the sensor's own size"
        ) from error


def _refuse_cut(path: Path) -> None:
    """Refuse an AVI that is shorter than its own head says: decoders do not mind.

    Raises:
        BadTable: It is cut short, or cannot be read.
    """
    try:
        with open_file(path) as file:
            head = file.read(8)
    except BadFile as error:
        raise BadTable("a video of each camera", error.got, "check the path") from error
    except OSError as error:
        raise BadTable(
            "a video that can be read", f"{path}: {error.strerror or error}", "check its rights"
        ) from error
    size = path.stat().st_size
    said = int.from_bytes(head[4:8], "little") + 8
    if head[:4] == b"RIFF" and size < said:
        raise BadTable(
            f"the {said:,} bytes that {path} says it has", f"{size:,}: it is cut short",
            "copy it again, or write it anew with a video tool",
        )  # fmt: skip


def _import_row(row: VideoRow, path: Path) -> None:
    videos = {name: _Video(file) for name, file in row.files.items()}
    try:
        rate_hz = row.rate_hz or _same_rate(row, videos)
        count = _same_length(row, videos)
        cameras = tuple(
            CameraInfo(
                name=name,
                width=video.width,
                height=video.height,
                rate_hz=rate_hz,
                mm_per_px=row.mm_per_px,
                details={"time": "frame number over rate", "file": video.path.name},
            )
            for name, video in videos.items()
        )
        manifest = Manifest(
            sensor=NO_ARRAY, cameras=cameras, labels=dict(row.labels), groups=dict(row.groups)
        )
        with Recorder(path, manifest) as recorder:
            streams = [video.frames() for video in videos.values()]
            for index in range(max(video.count for video in videos.values())):
                for camera, stream in enumerate(streams):
                    rgb = next(stream, None)  # the longer one is read to its end: it may be cut
                    if rgb is not None and index < count:
                        time_s = index / rate_hz
                        recorder.frame(
                            Frame(
                                camera=camera,
                                jpeg=encode_jpeg(rgb, QUALITY),
                                counter=index,
                                device_s=time_s,
                                arrival_s=time_s,
                                fitted_s=time_s,
                            )
                        )
            recorder.close("imported")
    finally:
        for video in videos.values():
            video.close()


def _same_rate(row: VideoRow, videos: Mapping[str, _Video]) -> float:
    rates = {round(video.rate_hz, 3) for video in videos.values()}
    if len(rates) > 1:
        raise BadTable(
            "videos of one rate",
            f"{' and '.join(f'{rate:g} Hz' for rate in sorted(rates))} in {row.name}",
            "give the true rate in the column rate, or record again",
        )  # fmt: skip
    return rates.pop()


def _same_length(row: VideoRow, videos: Mapping[str, _Video]) -> int:
    counts = [video.count for video in videos.values()]
    if max(counts) - min(counts) > LARGEST_DIFFERENCE:
        raise BadTable(
            f"videos whose lengths differ by {LARGEST_DIFFERENCE} frames at most",
            f"{' and '.join(map(str, counts))} in {row.name}", "cut them to the same moments",
        )  # fmt: skip
    return min(counts)
