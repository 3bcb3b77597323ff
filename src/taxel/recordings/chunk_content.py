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

from taxel.recordings.frame_layout import FRAME_CHANNEL, decode_frame
from taxel.recordings.mcap_file import RECORD_HEAD
from taxel.recordings.scan_layout import (
    MARK_CHANNEL,
    MESSAGE_HEAD,
    MESSAGE_OPCODE,
    SCAN_CHANNEL,
    decode_mark,
    decode_scans,
    end_of_scans,
    record_dtype,
)
from taxel.recordings.slip_layout import decode_slip, slip_channel
from taxel.signals import Frame, Mark, Samples, SlipNote

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


def decode_chunk(content: bytes, channels: int, cameras: int) -> ChunkContent:
    """Return what a chunk's uncompressed bytes hold; messages of other channels are passed over.

    Args:
        content: The chunk's bytes, whose CRC was checked.
        channels: The number of channels that the manifest gives.
        cameras: The number of cameras that it gives.

    Raises:
        ValueError: A record is cut short or is not laid out as FORMAT.md says.
    """
    found = ChunkContent()
    dtype: np.dtype[Any] = record_dtype(channels)
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
            channel = struct.unpack_from("<H", content, at + RECORD_HEAD.size)[0]
            body = at + RECORD_HEAD.size + MESSAGE_HEAD.size
            if channel == SCAN_CHANNEL:
                end = end_of_scans(content, at, dtype)
                spans.append((at, end))
            elif channel == MARK_CHANNEL:
                if len(found.marks) >= _MOST_MARKS:
                    raise ValueError(f"more than {_MOST_MARKS:,} marks in a chunk")
                found.marks.append(decode_mark(content[body:end]))
            elif 0 <= channel - FRAME_CHANNEL < cameras:
                found.frames.append(decode_frame(channel, content[body:end]))
            elif channel == slip_channel(cameras):
                found.slips.append(decode_slip(content[body:end]))
        at = end
    if spans:
        found.runs.append(_joined(content, spans, dtype))
    return found


def _joined(content: bytes, spans: list[tuple[int, int]], dtype: np.dtype[Any]) -> NDArray[np.void]:
    """Return the scans of some stretches; a single one is not copied."""
    if len(spans) == 1:
        ((start, end),) = spans
        return np.frombuffer(content, dtype, (end - start) // dtype.itemsize, start)
    return np.frombuffer(b"".join(content[start:end] for start, end in spans), dtype)
