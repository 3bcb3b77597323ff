"""What a recording holds, written chunk by chunk: scans, frames and marks, and their ledger.

Knows nothing about threads, names of files or what to do when a disk refuses.
"""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from typing import Any, BinaryIO

import numpy as np
from mcap.records import Schema

from taxel.recordings import frame_layout, mark_layout, slip_layout
from taxel.recordings import scan_layout as layout
from taxel.recordings.manifest import Manifest, to_record
from taxel.recordings.mcap_file import McapFile, Messages
from taxel.recordings.tally import FrameTally, Tally
from taxel.signals import Frame, Mark, Samples, SlipNote

Item = Samples | Mark | Frame | SlipNote
CHUNK_BYTES = 256 * 1024
"""Largest content of a chunk: what one damaged byte may take. At 1 kHz the flush comes first."""


class ChunkWriter:
    """Write the content of one recording.

    Begins with everything that says what the recording is, before any scan.

    Args:
        raw: Where to, open for unbuffered writing.
        manifest: What is being recorded.

    Raises:
        OSError: The disk refused.
    """

    def __init__(self, raw: BinaryIO, manifest: Manifest) -> None:
        self._manifest = manifest
        self._tally = Tally()
        self._slips = self._channels = 0
        self._frame_tallies = [FrameTally() for _ in manifest.cameras]
        pairs = to_record(manifest)
        file = self._file = McapFile(raw, manifest.software)
        file.add_metadata("taxel", pairs)
        sensor = manifest.sensor
        name, fields = layout.scan_schema(sensor.channels, sensor.units)
        self._add_channel(layout.scan_topic(sensor.name), name, fields, pairs)
        self._add_channel(
            mark_layout.MARK_TOPIC, mark_layout.MARK_SCHEMA_NAME, mark_layout.MARK_SCHEMA
        )
        for camera in manifest.cameras:
            self._add_channel(
                frame_layout.frame_topic(camera.name), frame_layout.FRAME_SCHEMA_NAME,
                frame_layout.FRAME_SCHEMA,
            )  # fmt: skip
        for camera in manifest.cameras:
            self._add_channel(
                frame_layout.times_topic(camera.name), frame_layout.TIMES_SCHEMA_NAME,
                frame_layout.TIMES_SCHEMA,
            )  # fmt: skip

    @property
    def size(self) -> int:
        """Bytes written so far."""
        return self._file.size

    @property
    def empty(self) -> bool:
        """True until the first scan, frame or mark is written."""
        frames = sum(tally.frames for tally in self._frame_tallies)
        return self._tally.scans + self._tally.marks + frames == 0

    def statistics(self) -> dict[str, Any]:
        """Return the ledger of what is in the file so far."""
        ledger: dict[str, Any] = self._tally.as_dict()
        if self._manifest.cameras:
            ledger["cameras"] = {
                camera.name: tally.as_dict()
                for camera, tally in zip(self._manifest.cameras, self._frame_tallies, strict=True)
            }
        return ledger

    def write(self, batch: Sequence[Item]) -> None:
        """Write what was handed over, scans first; each kind keeps its order.

        Raises:
            OSError: The disk refused.
        """
        runs = [item for item in batch if isinstance(item, Samples) and len(item)]
        marks = [item for item in batch if isinstance(item, Mark)]
        frames = [item for item in batch if isinstance(item, Frame)]
        if runs:
            self._write_scans(Samples.join(runs))
        while frames:
            frames = self._write_frames(frames)
        if marks:
            self._write_marks(marks)
        slips = [item for item in batch if isinstance(item, SlipNote)]
        if slips:
            self._write_slips(slips)

    def finish(self, ended: str) -> None:
        """Write the ledger and what completes the file; leave it open.

        Args:
            ended: Kept in the ledger.

        Raises:
            OSError: The disk refused.
        """
        ledger = self.statistics() | {"ended": ended}
        pairs = {key: json.dumps(value) for key, value in ledger.items()}
        self._file.add_metadata("taxel.statistics", pairs)
        self._file.finish()

    def _add_channel(
        self, topic: str, name: str, fields: bytes, pairs: Mapping[str, str] | None = None
    ) -> None:
        """Add a channel of ROS 2 messages; its number is the next."""
        self._channels += 1
        schema = Schema(id=self._channels, name=name, encoding="ros2msg", data=fields)
        self._file.add_channel(topic, "cdr", schema, pairs)

    def _write_scans(self, samples: Samples) -> None:
        channels = samples.values.shape[1]
        step = max(1, CHUNK_BYTES // layout.record_dtype(channels).itemsize)
        for first in range(0, len(samples), step):
            part = samples[first : first + step]
            anchor_ns = self._manifest.wall_anchor_ns
            records = layout.encode_scans(part, self._tally.scans, anchor_ns)
            size = records.dtype.itemsize
            self._file.add_chunk(
                [
                    Messages(
                        channel=layout.SCAN_CHANNEL,
                        content=records.tobytes(),
                        log_ns=records["log_ns"],
                        offsets=np.arange(len(records), dtype=np.uint64) * np.uint64(size),
                    )
                ]
            )
            self._tally.add(part)

    def _write_frames(self, frames: list[Frame]) -> list[Frame]:
        """Write frames of about a chunk's size, cameras apart inside it; return the rest."""
        taken, size = 0, 0
        while taken < len(frames) and size < CHUNK_BYTES:
            size += len(frames[taken].jpeg)
            taken += 1
        images: list[Messages] = []
        times: list[Messages] = []
        for camera, tally in enumerate(self._frame_tallies):
            own = [frame for frame in frames[:taken] if frame.camera == camera]
            if own:
                image, exact = self._frame_messages(camera, own, tally)
                images.append(image)
                times.append(exact)
        parts = images + times
        self._file.add_chunk(parts)
        return frames[taken:]

    def _frame_messages(
        self, camera: int, frames: list[Frame], tally: FrameTally
    ) -> tuple[Messages, Messages]:
        """Return a camera's images and, on a channel of their own, their exact times."""
        cameras, stamps, contents, exact = self._manifest.cameras, [], [], []
        for frame in frames:
            stamp, image, times = frame_layout.encode_frame(
                frame, cameras[camera].name, len(cameras), tally.frames,
                self._manifest.wall_anchor_ns,
            )  # fmt: skip
            tally.add(frame)
            stamps.append(stamp)
            contents.append(image)
            exact.append(times)
        channel = frame_layout.FRAME_CHANNEL + camera
        image_messages = _messages(channel, stamps, contents)
        offsets = np.arange(len(exact), dtype=np.uint64) * np.uint64(len(exact[0]))
        times_messages = Messages(
            channel=channel + len(cameras), content=b"".join(exact), log_ns=image_messages.log_ns,
            offsets=offsets,
        )  # fmt: skip
        return image_messages, times_messages

    def _write_marks(self, marks: list[Mark]) -> None:
        """Write marks as a chunk of their own: a damaged one costs no scan."""
        log_ns: list[int] = []
        contents: list[bytes] = []
        for mark in marks:
            sequence = self._tally.marks + len(contents)
            stamp, content = mark_layout.encode_mark(mark, sequence, self._manifest.wall_anchor_ns)
            log_ns.append(stamp)
            contents.append(content)
        self._file.add_chunk([_messages(mark_layout.MARK_CHANNEL, log_ns, contents)])
        self._tally.marks += len(marks)

    def _write_slips(self, slips: list[SlipNote]) -> None:
        """Write slip as a chunk of its own; the first brings its channel with it."""
        cameras = len(self._manifest.cameras)
        if not self._slips:
            self._add_channel(
                slip_layout.SLIP_TOPIC, slip_layout.SLIP_SCHEMA_NAME, slip_layout.SLIP_SCHEMA
            )
        stamps, contents = [], []
        for note in slips:
            stamp, content = slip_layout.encode_slip(
                note, self._slips, cameras, self._manifest.wall_anchor_ns
            )
            self._slips += 1
            stamps.append(stamp)
            contents.append(content)
        channel = slip_layout.slip_channel(cameras)
        self._file.add_chunk([_messages(channel, stamps, contents)])


def _messages(channel: int, log_ns: list[int], contents: list[bytes]) -> Messages:
    lengths = np.array([0, *map(len, contents)], np.uint64)
    return Messages(
        channel=channel,
        content=b"".join(contents),
        log_ns=np.array(log_ns, np.uint64),
        offsets=np.cumsum(lengths)[:-1],
    )
