"""Recordings' frames as video files, one a camera, with the times at which they were taken.

Motion JPEG in Matroska holds the camera's own JPEG, byte by byte. H.264 in MP4 plays in every
browser and is for looking at only: it moves the gel quantities by 0.4 of their standard deviation
(docs/decisions/0051). Depth is left out: a video has 8 bits a colour. Knows nothing about touch.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from contextlib import ExitStack, suppress
from fractions import Fraction
from pathlib import Path
from typing import Any, Literal

import av

from taxel.errors import BadDataset, BadSource
from taxel.exchange.output import new_tree
from taxel.frame_codec import decode_jpeg
from taxel.jpeg_head import read_head
from taxel.plain_text import visible
from taxel.recordings.reader import iterate_jpeg, read_manifest
from taxel.signals import CameraInfo, Frame

Codec = Literal["mjpeg", "h264"]
ENDINGS = {"mjpeg": ".mkv", "h264": ".mp4"}
SIGN = ".taxel-videos"
"""An empty file in every such folder, so that it may be replaced."""
_BASE = Fraction(1, 1000)
"""Seconds of a tick. Source: Matroska's default TimestampScale, 1 ms."""
_FINE = Fraction(1, 90_000)
"""The same of MP4: in the encoder's own, a frame's length, two frames of a camera that jitters fall
on one. Source: the clock of MPEG's systems, ISO/IEC 13818-1."""
_CRF = "23"
"""x264's own default quality."""


def write_videos(
    paths: Sequence[Path],
    output: Path,
    *,
    codec: Codec = "mjpeg",
    overwrite: bool = False,
    progress: Callable[[int, int], None] = lambda done, of: None,
) -> dict[str, int]:
    """Write a video for each camera of each recording: NAME.CAMERA.mkv or .mp4.

    Args:
        paths: The recordings.
        output: Folder to be made.
        codec: How frames are kept.
        overwrite: Replace an older such folder.
        progress: Called with recordings done and in all.

    Returns:
        File → frames; a video without frames is not written.

    Raises:
        BadDataset: A recording has no cameras of JPEG, or a frame that is not of its camera's size.
        BadSource: A frame that is to be coded again cannot be decoded.
        BadRecording: One is damaged or cut short.
        RecordingFailed: The disk refused.
    """
    frames_written: dict[str, int] = {}
    with new_tree(output, SIGN, (*ENDINGS.values(),), overwrite=overwrite) as made:
        (made / SIGN).touch()
        for done, path in enumerate(paths, 1):
            cameras = read_manifest(path).of_jpeg
            if not cameras:
                raise BadDataset("a recording of cameras", f"{path} without",
                                 "name recordings with cameras")  # fmt: skip
            frames_written |= _write(path, cameras, made, codec)
            progress(done, len(paths))
    return frames_written


def _write(path: Path, cameras: Sequence[CameraInfo], folder: Path, codec: Codec) -> dict[str, int]:
    plain = _apart([_plain(camera.name) for camera in cameras])
    names = [f"{path.stem}.{name}{ENDINGS[codec]}" for name in plain]
    counts = dict.fromkeys(names, 0)
    with ExitStack() as stack:
        videos = [
            stack.enter_context(_Video(folder / name, path, camera, codec))
            for name, camera in zip(names, cameras, strict=True)
        ]
        for frame in iterate_jpeg(path):
            videos[frame.camera].add(frame)
            counts[names[frame.camera]] += 1
    return counts


class _Video:
    """A video file that is being written."""

    def __init__(self, path: Path, recording: Path, camera: CameraInfo, codec: Codec) -> None:
        self._recording, self._camera, self._codec = recording, camera, codec
        # FFmpeg takes what stands before a colon in a relative path, as in 10:30, for a protocol.
        self._file: Any = av.open(os.path.abspath(path), "w")
        rate = Fraction(camera.rate_hz or 25).limit_denominator(1000)
        self._stream: Any = self._file.add_stream(
            "mjpeg" if codec == "mjpeg" else "libx264", rate=rate,
            options={} if codec == "mjpeg" else {"crf": _CRF},
        )  # fmt: skip
        self._base = _BASE if codec == "mjpeg" else _FINE
        if codec == "h264":
            self._stream.time_base = self._stream.codec_context.time_base = _FINE
        self._stream.width, self._stream.height = camera.width, camera.height
        even = not (camera.width % 2 or camera.height % 2)
        h264 = "yuv420p" if even else "yuv444p"  # the former halves both sides
        self._stream.pix_fmt = "yuvj420p" if codec == "mjpeg" else h264
        self._first_s: float | None = None
        self._last = -1

    def add(self, frame: Frame) -> None:
        """Add a frame at its time; two within a tick come a tick apart."""
        self._first_s = frame.fitted_s if self._first_s is None else self._first_s
        tick = max(round((frame.fitted_s - self._first_s) / self._base), self._last + 1)
        self._last = tick
        if self._codec == "mjpeg":
            self._check_size(frame)
            packet = av.Packet(frame.jpeg)
            packet.stream = self._stream
            packet.pts = packet.dts = tick
            packet.time_base = self._base
            packet.is_keyframe = True
            self._file.mux(packet)
            return
        image = av.VideoFrame.from_ndarray(decode_jpeg(frame.jpeg, self._camera), format="rgb24")
        image.pts, image.time_base = tick, self._base
        for packet in self._stream.encode(image):
            self._file.mux(packet)

    def _check_size(self, frame: Frame) -> None:
        """Refuse a frame of another size, as players draw all as the file declares them; one that
        is damaged is kept as it came.

        Raises:
            BadDataset: It is of another size.
        """
        size = self._camera.width, self._camera.height
        found = size
        with suppress(BadSource):
            head = read_head(frame.jpeg)
            found = head.width, head.height
        if found != size:
            raise BadDataset(
                f"frames of {size[0]}×{size[1]} from {visible(self._camera.name)}",
                f"one of {found[0]}×{found[1]} in {self._recording}", "leave that recording out",
            )  # fmt: skip

    def __enter__(self) -> _Video:
        return self

    def __exit__(self, kind: object, error: object, trace: object) -> None:
        try:
            if kind is None and self._codec == "h264":
                for packet in self._stream.encode():
                    self._file.mux(packet)
        finally:
            self._file.close()


def _apart(names: Sequence[str]) -> list[str]:
    """Return names that differ: one that others share has its camera's number behind it."""
    shared = {name for name in names if names.count(name) > 1}
    taken, found = set(names), []
    for number, name in enumerate(names, 1):
        own = f"{name}-{number}" if name in shared else name
        while name in shared and own in taken:
            own += f"-{number}"
        taken.add(own)
        found.append(own)
    return found


def _plain(name: str) -> str:
    return "".join(letter if letter.isalnum() or letter in "-_" else "_" for letter in name)
