"""What one chunk of a recording holds: runs of scans, marks and frames.

Knows nothing about files or check sums.

Background of our choices: docs/decisions/0004.
"""

from __future__ import annotations

import struct
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from taxel.recordings import frame_layout, mark_layout, slip_layout, version_1
from taxel.recordings.frame_layout import FRAME_CHANNEL
from taxel.recordings.manifest import FORMAT_VERSION
from taxel.recordings.mark_layout import MARK_CHANNEL
from taxel.recordings.mcap_file import RECORD_HEAD
from taxel.recordings.messages import MESSAGE_HEAD, MESSAGE_OPCODE
from taxel.recordings.scan_layout import SCAN_CHANNEL, decode_scans, end_of_scans, record_dtype
from taxel.signals import Frame, Mark, Samples, SlipNote

_CHANNEL_SEQUENCE = struct.Struct("<HI")
_MOST_MARKS = 50_000
"""In a chunk; one that taxel writes has room for 2,000. Source: our choice."""


@dataclass(slots=True)
class ChunkContent:
    """The messages of a chunk, by kind, each in the order of the file."""

    runs: list[NDArray[np.void]] = field(default_factory=list)
    """Scans as message records: none, or all in one array."""
    marks: list[Mark] = field(default_factory=list)
    frames: list[Frame] = field(default_factory=list)
    slips: list[SlipNote] = field(default_factory=list)

    def samples(self, channels: int) -> Samples:
        """Return the chunk's scans, which may be none."""
        if not self.runs:
            return decode_scans(np.zeros(0, record_dtype(channels)))
        return decode_scans(np.concatenate(self.runs))


def decode_chunk(
    content: bytes, channels: int, cameras: int, version: str = FORMAT_VERSION
) -> ChunkContent:
    """Return what a chunk's uncompressed bytes hold; messages of other channels are passed over.

    Args:
        content: The chunk's bytes, whose CRC was checked.
        channels: The number of channels that the manifest gives.
        cameras: The number of cameras that it gives.
        version: The recording format that it gives.

    Raises:
        ValueError: A record is cut short or is not laid out as FORMAT.md says.
    """
    decoded = ChunkContent()
    dtype: np.dtype[Any] = record_dtype(channels, version)
    take = (_Version1 if version == "1" else _Version2)(decoded, cameras)
    at = 0
    spans: list[tuple[int, int]] = []
    while at < len(content):
        if at + RECORD_HEAD.size > len(content):
            raise ValueError("a chunk ends within a record's head")
        opcode, length = RECORD_HEAD.unpack_from(content, at)
        end = at + RECORD_HEAD.size + length
        if end > len(content):
            raise ValueError("a record ends beyond its chunk")
        if opcode == MESSAGE_OPCODE:
            if length < MESSAGE_HEAD.size:
                raise ValueError("a message is shorter than its head")
            channel, sequence = _CHANNEL_SEQUENCE.unpack_from(content, at + RECORD_HEAD.size)
            if channel == SCAN_CHANNEL:
                end = end_of_scans(content, at, dtype)
                spans.append((at, end))
            elif MARK_CHANNEL <= channel <= take.last:
                body = at + RECORD_HEAD.size + MESSAGE_HEAD.size
                take.message(channel, sequence, content[body:end])
                if len(decoded.marks) > _MOST_MARKS:
                    raise ValueError(f"more than {_MOST_MARKS:,} marks in a chunk")
        at = end
    take.finish()
    if spans:
        decoded.runs.append(_joined(content, spans, dtype))
    return decoded


class _Version2:
    """Takes the messages of a chunk but for its scans, and puts frames and their times together."""

    def __init__(self, found: ChunkContent, cameras: int) -> None:
        self._found = found
        self._cameras = cameras
        self._images: dict[tuple[int, int], bytes] = {}
        self._times: dict[tuple[int, int], tuple[float, float, float, int]] = {}
        self.last = slip_layout.slip_channel(cameras)
        """The highest channel that it knows."""

    def message(self, channel: int, sequence: int, body: bytes) -> None:
        """Take a message of one of channels 2 to `last`.

        Raises:
            ValueError: It is not laid out as FORMAT.md says.
        """
        camera = channel - FRAME_CHANNEL
        if channel == MARK_CHANNEL:
            self._found.marks.append(mark_layout.decode_mark(body))
        elif channel == self.last:
            self._found.slips.append(slip_layout.decode_slip(body))
        elif camera < self._cameras:
            self._images[camera, sequence] = frame_layout.decode_image(body)
        else:
            self._times[camera - self._cameras, sequence] = frame_layout.decode_times(body)

    def finish(self) -> None:
        """Put each frame together, in the order of the images.

        Raises:
            ValueError: One has no times, or there are times without an image.
        """
        if self._images.keys() != self._times.keys():
            raise ValueError("frames and their times differ in number")
        for (camera, sequence), image in self._images.items():
            fitted_s, device_s, arrival_s, counter = self._times[camera, sequence]
            self._found.frames.append(
                Frame(camera=camera, jpeg=image, counter=counter, device_s=device_s,
                      arrival_s=arrival_s, fitted_s=fitted_s)
            )  # fmt: skip


class _Version1:
    """The same for format 1, in which a frame's times are in its own message."""

    def __init__(self, found: ChunkContent, cameras: int) -> None:
        self._found = found
        self.last = version_1.slip_channel(cameras)

    def message(self, channel: int, sequence: int, body: bytes) -> None:
        """Take a message of one of channels 2 to `last`.

        Raises:
            ValueError: It is not laid out as format 1 says.
        """
        if channel == MARK_CHANNEL:
            self._found.marks.append(version_1.decode_mark(body))
        elif channel == self.last:
            self._found.slips.append(version_1.decode_slip(body))
        else:
            self._found.frames.append(version_1.decode_frame(channel, body))

    def finish(self) -> None:
        """Do nothing: every frame is complete."""


def _joined(content: bytes, spans: list[tuple[int, int]], dtype: np.dtype[Any]) -> NDArray[np.void]:
    """Return the scans of some stretches; a single one is not copied."""
    if len(spans) == 1:
        ((start, end),) = spans
        return np.frombuffer(content, dtype, (end - start) // dtype.itemsize, start)
    return np.frombuffer(b"".join(content[start:end] for start, end in spans), dtype)
