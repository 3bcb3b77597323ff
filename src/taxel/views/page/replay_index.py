"""A recording read once, and what is remembered of it: where everything lies, and thin traces.

Kept: where each chunk lies in the file, when each image was taken, and the array at 100 scans a
second at most. Every check sum is verified. Knows nothing about cursors and pages.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from mcap.opcode import Opcode
from numpy.typing import NDArray

from taxel.errors import BadRecording
from taxel.foreign.files import open_file
from taxel.recordings.chunk_content import ChunkContent
from taxel.recordings.manifest import Manifest
from taxel.recordings.mcap_file import MAGIC, RECORD_HEAD
from taxel.recordings.reader import decoded
from taxel.recordings.walk import damaged, open_chunk, walk
from taxel.signals import ROUNDING_S, Mark, Samples

KEPT_HZ = 100.0
"""Scans a second that are kept for traces and the map. Source: the common time grid's rate."""


@dataclass(frozen=True, slots=True)
class Place:
    """Where a chunk's payload lies in the file, bytes."""

    offset: int
    length: int


@dataclass(frozen=True, slots=True)
class ReplayIndex:
    """What is remembered of a recording after one reading."""

    start_s: float
    """First scan or image, seconds of the recording's clock."""
    end_s: float
    """Last scan or image."""
    time_s: NDArray[np.float64]
    """Shape (n,): of the kept scans, ascending."""
    values: NDArray[np.float32]
    """Shape (n, channels), in the channels' units; NaN where a value may not be used."""
    marks: list[Mark]
    chunks: list[Place]
    frame_s: list[NDArray[np.float64]]
    """A camera each: when its images were taken, ascending."""
    frame_at: list[NDArray[np.int64]]
    """A camera each, shape (n, 3): chunk, which of its images, bytes of JPEG."""


def read_index(path: Path, manifest: Manifest) -> ReplayIndex:
    """Read a recording once, in memory that grows by some 5 kB a second of a hand of twelve.

    Raises:
        BadRecording: It is missing, cut short, damaged, or holds neither scans nor images.
    """
    chunks: list[Place] = []
    scans: list[tuple[NDArray[np.float64], NDArray[np.float32]]] = []
    marks: list[Mark] = []
    frames: list[list[tuple[float, int, int, int]]] = [[] for _ in manifest.cameras]
    first_s, last_s, at = np.inf, -np.inf, len(MAGIC)
    channels = len(manifest.sensor.channels)
    try:
        for record in walk(path):
            at += RECORD_HEAD.size
            if record.opcode == Opcode.CHUNK:
                content = decoded(open_chunk(record.payload), manifest)
                samples = content.samples(channels)
                if len(samples):
                    scans.append(_thin(samples))
                    first_s = min(first_s, float(samples.fitted_s.min()))
                    last_s = max(last_s, float(samples.fitted_s.max()))
                marks += content.marks
                for which, frame in enumerate(content.frames):
                    where = (frame.fitted_s, len(chunks), which, len(frame.jpeg))
                    frames[frame.camera].append(where)
                chunks.append(Place(at, record.length))
            at += record.length
    except BadRecording:
        raise
    except ValueError as error:
        raise damaged(path, str(error)) from error
    camera_frames = [np.array(sorted(rows), np.float64).reshape(-1, 4) for rows in frames]
    taken = [rows for rows in camera_frames if len(rows)]
    first_s = min([first_s, *(float(rows[0, 0]) for rows in taken)])
    last_s = max([last_s, *(float(rows[-1, 0]) for rows in taken)])
    if not first_s <= last_s:
        raise BadRecording(
            "a recording with scans or images", f"{path}, which has none", "record it again"
        )
    time_s = np.concatenate([np.zeros(0), *(part[0] for part in scans)])
    values = np.concatenate([np.zeros((0, channels), np.float32), *(part[1] for part in scans)])
    order = np.argsort(time_s, kind="stable")
    return ReplayIndex(
        start_s=first_s,
        end_s=last_s,
        time_s=time_s[order],
        values=values[order],
        marks=sorted(marks, key=lambda mark: mark.start_s),
        chunks=chunks,
        frame_s=[rows[:, 0] for rows in camera_frames],
        frame_at=[rows[:, 1:].astype(np.int64) for rows in camera_frames],
    )


def read_chunk(path: Path, place: Place, manifest: Manifest) -> ChunkContent:
    """Read one chunk again.

    Raises:
        BadRecording: The file changed since it was indexed.
    """
    try:
        with open_file(path) as file:
            file.seek(place.offset)
            payload = file.read(place.length)
        return decoded(open_chunk(payload), manifest)
    except (OSError, ValueError) as error:
        raise damaged(path, f"it changed while it was looked at: {error}") from error


def _thin(samples: Samples) -> tuple[NDArray[np.float64], NDArray[np.float32]]:
    """Return scans of a chunk that are a hundredth of a second apart, the first among them."""
    kept, last_s = [], -np.inf
    for row, time_s in enumerate(samples.fitted_s.tolist()):
        if time_s - last_s >= 1 / KEPT_HZ - ROUNDING_S:
            kept.append(row)
            last_s = time_s
    values = np.where(samples.usable[kept], samples.values[kept], np.float32(np.nan))
    return samples.fitted_s[kept], values.astype(np.float32)
