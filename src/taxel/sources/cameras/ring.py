"""Frames from one process to another by shared memory: the newest are kept, nobody waits.

The writer never waits: when the reader is slow the oldest frames are overwritten, and the reader
counts them as dropped. A check sum a frame makes it impossible to read one half overwritten.
The memory has no name: it is gone when both processes are. Knows nothing about cameras.
"""

from __future__ import annotations

import mmap
import os
import struct
import zlib
from collections.abc import Iterator
from dataclasses import dataclass

SLOTS = 32
"""Frames kept: half a second at 60 Hz. Source: our choice, docs/decisions/0015."""
STARTED, WRITTEN, FRAMES, LOST, REPEATED, BAD, REOPENED, RATE_MHZ = range(8)
"""Words of the header: frames begun and done (by the ring), then the writer's own counters."""
_HEADER = 4096
_SLOT = struct.Struct("<QqddIIB")
_SLOT_HEAD = 64


@dataclass(frozen=True, slots=True)
class RingFrame:
    """One frame on its way."""

    jpeg: bytes
    sequence: int
    device_s: float
    arrival_s: float
    monotonic: bool


class FrameRing:
    """The shared memory, for one writer and one reader.

    Args:
        fd: Memory file made by `make_ring`; closed with the ring.
        slot_bytes: Largest frame, bytes; the same on both sides.
    """

    def __init__(self, fd: int, slot_bytes: int) -> None:
        self._fd = fd
        self._slot_bytes = slot_bytes
        self._memory = mmap.mmap(fd, ring_bytes(slot_bytes))
        self.words = memoryview(self._memory)[:_HEADER].cast("Q")
        """The header's counters; each is written by one side only."""
        self._next = 0
        self.dropped = 0
        """Frames that were overwritten before they were read."""

    def put(self, frame: RingFrame) -> bool:
        """Write a frame over the oldest; False where it is larger than a slot."""
        if len(frame.jpeg) > self._slot_bytes:
            return False
        number = self.words[STARTED]
        self.words[STARTED] = number + 1
        at = self._place(number)
        body = at + _SLOT_HEAD
        self._memory[body : body + len(frame.jpeg)] = frame.jpeg
        _SLOT.pack_into(
            self._memory, at, number, frame.sequence, frame.device_s, frame.arrival_s,
            len(frame.jpeg), zlib.crc32(frame.jpeg), frame.monotonic,
        )  # fmt: skip
        self.words[WRITTEN] = number + 1
        return True

    def take(self) -> Iterator[RingFrame]:
        """Yield the frames written since the last call, oldest first."""
        written = self.words[WRITTEN]
        if written - self._next > SLOTS:
            self.dropped += written - SLOTS - self._next
            self._next = written - SLOTS
        while self._next < written:
            found = self._read(self._next)
            self._next += 1
            if found is None:
                self.dropped += 1
            else:
                yield found

    def skip(self) -> None:
        """Let go of all that was written so far, uncounted."""
        self._next = self.words[WRITTEN]

    def close(self) -> None:
        """Let go of the memory."""
        self.words.release()
        self._memory.close()
        os.close(self._fd)

    def _read(self, number: int) -> RingFrame | None:
        at = self._place(number)
        head = _SLOT.unpack_from(self._memory, at)
        found, sequence, device_s, arrival_s, length, check, monotonic = head
        if found != number or length > self._slot_bytes:
            return None
        body = at + _SLOT_HEAD
        jpeg = self._memory[body : body + length]
        if zlib.crc32(jpeg) != check:
            return None
        return RingFrame(jpeg, sequence, device_s, arrival_s, bool(monotonic))

    def _place(self, number: int) -> int:
        return _HEADER + number % SLOTS * (_SLOT_HEAD + self._slot_bytes)


def ring_bytes(slot_bytes: int) -> int:
    """Return the size of a ring's memory, bytes; pages that no frame touches are not taken."""
    return _HEADER + SLOTS * (_SLOT_HEAD + slot_bytes)


def make_ring(slot_bytes: int) -> int:
    """Return the file descriptor of new shared memory, which a child process may inherit."""
    fd = os.memfd_create("taxel-camera")
    os.ftruncate(fd, ring_bytes(slot_bytes))
    return fd
