"""Record scans, frames and marks to a file, on a thread of its own, loudly.

While it runs, the file is called NAME.mcap.part; a clean close gives it its
name. Whatever was handed over more than `flush_s` ago has reached the
operating system, so a kill -9 takes at most that much. The first refusal of
the disk is latched: every later call raises it again. Knows nothing about
sources, windows or models.
"""

from __future__ import annotations

import contextlib
import errno
import os
import struct
import threading
import time
from collections import deque
from collections.abc import Callable
from pathlib import Path
from typing import Any, BinaryIO, Self

import numpy as np

from taxel.errors import BadInput, RecordingFailed
from taxel.held import output_of
from taxel.plain_text import number_of
from taxel.recordings.chunk_writer import ChunkWriter, Item
from taxel.recordings.frame_layout import check_times
from taxel.recordings.manifest import Manifest, check_manifest
from taxel.recordings.mark_layout import encode_mark
from taxel.recordings.part_file import (
    check_there,
    let_go,
    open_part,
    part_path,
    recover_command,
    refuse_existing,
    remove_part,
    take_name,
)
from taxel.recordings.scan_layout import FURTHEST_S
from taxel.signals import Frame, Mark, Samples, SlipNote

FLUSH_S = 0.05
"""Half of the 0.1 s that a kill -9 may take (docs/decisions/0004)."""
QUEUE_SCANS = 60_000
"""Scans that may wait for the disk: a minute at 1 kHz."""
QUEUE_BYTES = 64 * 1024 * 1024
"""Frames that may wait for the disk: a minute of two 60 Hz cameras."""
LOOK_S = 1.0
"""How often it is looked whether the part still has its name, seconds. Our choice,
docs/decisions/0004."""
STALL_S = 10.0
"""How long the disk may stand still with a full queue before the recorder gives up."""


class Recorder:
    """Write one recording. Use it in a `with` block.

    An error inside the block still closes the file properly, so that what was
    measured is kept; call `discard` where a half is worth nothing.

    Args:
        path: The recording to be, ending in .mcap; its folder is made.
        manifest: What is being recorded.
        flush_s: Longest time between a scan's arrival here and its being in the file, seconds.
        queue_scans: How many scans may wait for the disk.
        stall_s: How long `write` waits for room and `close` for the disk, seconds.
        overwrite: Replace an existing recording, and an unfinished one.
        opener: Opens the file for unbuffered writing; tests pass a full disk.

    Raises:
        BadInput: The file exists, or its unfinished part does, or another process is recording
            to it; or the manifest could not be read again.
        RecordingFailed: The file cannot be created.
    """

    def __init__(
        self,
        path: Path | str,
        manifest: Manifest,
        *,
        flush_s: float = FLUSH_S,
        queue_scans: int = QUEUE_SCANS,
        stall_s: float = STALL_S,
        overwrite: bool = False,
        opener: Callable[[Path], BinaryIO] | None = None,
    ) -> None:
        self._path = path = Path(path)
        self._part = part_path(path)
        self._overwrite = overwrite
        self._manifest = manifest
        self._flush_s = flush_s
        self._queue_scans = queue_scans
        self._stall_s = stall_s
        self._waiting: deque[Item] = deque()
        self._scans_waiting = 0
        self._bytes_waiting = 0
        self.handed = 0
        """Pieces handed over so far: scans that came together, frames, marks, slip."""
        self.written = 0
        """Those of them that are in the file, in the order in which they came."""
        self._flush_asked = False
        self._closing = False
        self._closed = False
        self._error: RecordingFailed | None = None
        self._change = threading.Condition()
        self._thread = threading.Thread(target=self._run, name="taxel-recorder", daemon=True)
        check_manifest(manifest)
        refuse_existing(path, overwrite)
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
            self._raw = opener(self._part) if opener else open_part(path, overwrite)
        except OSError as error:
            raise self._failed(error) from error
        try:
            self._content = ChunkWriter(self._raw, manifest)
        except OSError as error:
            self._clear_away()
            raise self._failed(error) from error
        self._thread.start()

    @property
    def failed(self) -> bool:
        """True once the disk has refused; nothing is recorded after that."""
        return self._error is not None

    @property
    def path(self) -> Path:
        """The recording's name once it is closed."""
        return self._path

    @property
    def size(self) -> int:
        """Bytes in the file so far."""
        return self._content.size

    def write(self, samples: Samples) -> None:
        """Hand over scans, oldest first; returns before they are on disk.

        The arrays are not copied: do not change them afterwards.

        Raises:
            RecordingFailed: The disk refused, now or earlier, or has stood still too long.
            BadInput: The scans do not fit the manifest, or a fitted time is not finite.
        """
        if samples.values.shape[1] != len(self._manifest.sensor.channels):
            raise BadInput(
                f"scans of {number_of(len(self._manifest.sensor.channels), 'channel')}",
                f"{samples.values.shape[1]}",
                "let the manifest describe the source that is recorded",
            )
        if not (np.abs(samples.fitted_s) <= FURTHEST_S).all():
            raise BadInput(
                f"a finite fitted time for every scan, at most {FURTHEST_S:g} s",
                "NaN, infinity or more",
                "check the source's clock",
            )
        self._put(samples, len(samples))

    def mark(self, mark: Mark) -> None:
        """Hand over a labelled stretch of time; it may lie anywhere, also in the past.

        Raises:
            RecordingFailed: The disk refused, now or earlier, or has stood still too long.
            BadInput: Its times are not finite, or a label or group is no text.
        """
        if not all(abs(time_s) <= FURTHEST_S for time_s in (mark.start_s, mark.end_s)):
            raise BadInput("a mark with finite times", f"{mark.start_s}, {mark.end_s}", "mend it")
        try:  # on the recorder's thread, it would end the recording
            encode_mark(mark, 0, self._manifest.wall_anchor_ns)
        except (AttributeError, TypeError, ValueError) as error:
            got = f"labels {mark.labels} and groups {mark.groups}"
            raise BadInput("texts as a mark's labels and groups", got, "write str(…)") from error
        self._put(mark, 1)

    def frame(self, frame: Frame) -> None:
        """Hand over a camera's frame; returns before it is on disk.

        Raises:
            RecordingFailed: The disk refused, now or earlier, or has stood still too long.
            BadInput: The manifest has no such camera, the image is no bytes, or a time or the
                counter cannot be recorded.
        """
        if not 0 <= frame.camera < len(self._manifest.cameras):
            raise BadInput(
                f"frames of the manifest's {number_of(len(self._manifest.cameras), 'camera')}",
                f"one of camera {frame.camera}",
                "let the manifest describe the source that is recorded",
            )
        if not abs(frame.fitted_s) <= FURTHEST_S:
            raise BadInput("a finite fitted time", f"{frame.fitted_s}", "check the source's clock")
        if type(frame.jpeg) not in (bytes, bytearray):
            got = type(frame.jpeg).__name__
            raise BadInput("a frame's image as bytes", got, "encode it with encode_jpeg")
        try:  # on the recorder's thread, it would end the recording
            check_times(frame, self._manifest.wall_anchor_ns)
        except (struct.error, OverflowError) as error:
            got = (f"fitted {frame.fitted_s}, of the device {frame.device_s}, of arrival "
                   f"{frame.arrival_s}, counter {frame.counter}")  # fmt: skip
            raise BadInput(
                "a frame's times in seconds, of a clock that is right, and a whole counter", got,
                "check the source's clock; give NaN and -1 for what it does not know",
            ) from error  # fmt: skip
        self._put(frame, 1)

    def slip(self, note: SlipNote) -> None:
        """Hand over the slip that a monitor measured; returns before it is on disk.

        Raises:
            RecordingFailed: The disk refused, now or earlier, or has stood still too long.
            BadInput: Its time is not finite.
        """
        if not abs(note.time_s) <= FURTHEST_S:
            raise BadInput("slip at a finite time", f"{note.time_s}", "check the source's clock")
        self._put(note, 1)

    def flush(self) -> None:
        """Wait until everything handed over is in the file, in a chunk of its own.

        Raises:
            RecordingFailed: The disk refused, now or earlier, or has stood still too long.
        """
        with self._change:
            self._flush_asked = True
            self._change.notify_all()
            self._change.wait_for(lambda: self.failed or self._scans_waiting == 0, self._stall_s)
            if self._error is None and self._scans_waiting:
                self._error = RecordingFailed(self._line("the disk has stood still"))
            if self._error is not None:
                raise self._error

    def close(self, ended: str = "cleanly") -> None:
        """Write what waits, complete the file and give it its name. Once is enough.

        Args:
            ended: Kept in the recording's statistics.

        Raises:
            RecordingFailed: The disk refused, now or earlier; the part is kept for `taxel recover`.
        """
        if not self._closed:
            self._closed = True
            self._stop_thread()
            if not self.failed:
                self._finish(ended)
            self._close_file()
        if self._error is not None:
            raise self._error

    def discard(self) -> None:
        """Stop and remove the unfinished file."""
        if not self._closed:
            self._closed = True
            with contextlib.suppress(RecordingFailed):
                self._stop_thread()
            self._clear_away()

    def statistics(self) -> dict[str, Any]:
        """Return the ledger of what is in the file so far."""
        return self._content.statistics()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: object, error: BaseException | None, trace: object) -> None:
        if error is None:
            self.close()
            return
        with contextlib.suppress(RecordingFailed):
            if self._content.empty and not self._waiting and not self.failed:
                self.discard()
            else:
                self.close(f"cut short: {type(error).__name__}")

    def _put(self, item: Item, scans: int) -> None:
        with self._change:
            if self._closed:
                raise self._error or RecordingFailed(f"{self._path} is closed; nothing was written")
            self._change.wait_for(lambda: self.failed or self._has_room(scans), self._stall_s)
            if self._error is None and not self._has_room(scans):
                self._error = RecordingFailed(self._line("the disk has stood still"))
            if self._error is not None:
                raise self._error
            self._waiting.append(item)
            self.handed += 1
            self._scans_waiting += scans
            self._bytes_waiting += _bytes_of(item)
            if self._crowded():
                self._change.notify_all()

    def _has_room(self, scans: int) -> bool:
        """True where the queue takes the scans; an empty one takes any number."""
        fits = self._scans_waiting + scans <= self._queue_scans
        return self._scans_waiting == 0 or (fits and self._bytes_waiting < QUEUE_BYTES)

    def _crowded(self) -> bool:
        return (
            self._scans_waiting >= self._queue_scans // 4 or self._bytes_waiting >= QUEUE_BYTES // 4
        )

    def _run(self) -> None:
        """Empty the queue into the file, every `flush_s` seconds, until closed."""
        due = time.monotonic() + self._flush_s
        look = due + LOOK_S
        while True:
            with self._change:
                self._change.wait_for(self._hurry, max(0.0, due - time.monotonic()))
                batch, closing = list(self._waiting), self._closing
                self._flush_asked = False
                self._waiting.clear()
            due = time.monotonic() + self._flush_s
            try:
                self._content.write(batch)
                self.written += len(batch)
                if due >= look and not closing:
                    look = due + LOOK_S
                    check_there(self._raw, self._path)
            except RecordingFailed as error:
                self._error = error
            except OSError as error:
                self._error = self._failed(error)
            except Exception as error:  # anything else must be as loud: nobody sees this thread
                self._error = RecordingFailed(self._line(f"{type(error).__name__}: {error}"))
            with self._change:
                self._scans_waiting = sum(
                    len(item) if isinstance(item, Samples) else 1 for item in self._waiting
                )
                self._bytes_waiting = sum(map(_bytes_of, self._waiting))
                self._change.notify_all()
            if closing or self.failed:
                return

    def _hurry(self) -> bool:
        return self._closing or self._flush_asked or self._crowded()

    def _finish(self, ended: str) -> None:
        try:
            self._content.finish(ended)
            os.fsync(self._raw.fileno())
            take_name(self._raw, self._path, self._overwrite)
        except RecordingFailed as error:
            self._error = error
        except OSError as error:
            self._error = self._failed(error)

    def _clear_away(self) -> None:
        """Remove the unfinished file NAME.mcap.part, if there is one, and close it."""
        remove_part(self._raw, self._path)
        self._close_file()

    def _close_file(self) -> None:
        """Close the file; where the disk still holds the thread, as soon as that is done with it.

        Closed under the thread, its descriptor could be another file's when the thread writes.
        """
        busy = self._thread.is_alive()

        def close() -> None:
            if busy:
                self._thread.join()
            let_go(self._raw)

        if busy:
            threading.Thread(target=close, name="taxel-recorder-close", daemon=True).start()
        else:
            close()

    def _stop_thread(self) -> None:
        with self._change:
            self._closing = True
            self._change.notify_all()
        self._thread.join(self._stall_s)
        if self._thread.is_alive() and self._error is None:
            self._error = RecordingFailed(self._line("the disk has stood still"))

    def _failed(self, error: OSError) -> RecordingFailed:
        if error.errno in (errno.EEXIST, errno.ENOTDIR) and output_of(self._path) is None:
            return RecordingFailed(
                f"needed a folder {self._path.parent} for recordings; got a file where a folder "
                "should be; move it away or choose another folder, then record again."
            )
        full = error.errno in (errno.ENOSPC, errno.EDQUOT, errno.EFBIG)
        reason = "the disk is full" if full else f"the disk refused ({error.strerror or error})"
        return RecordingFailed(self._line(reason))

    def _line(self, reason: str) -> str:
        output = output_of(self._path)
        if output is not None:  # which takes its name when all of it is complete, and else goes
            return (f"needed room to write {output}; {reason}; "
                    "free space or choose another folder, then start again.")  # fmt: skip
        mend = f"free space, then run: {recover_command(self._path)}"
        if not self._part.is_file():
            mend = "free space or choose another folder, then record again"
        return f"needed room to record {self._path}; {reason}; {mend}."


def _bytes_of(item: Item) -> int:
    return len(item.jpeg) if isinstance(item, Frame) else 0
