"""A ring of messages in shared memory: one writer, any number of readers.

The writer never waits: it drops the oldest messages when the ring is full, whether they were
read or not. A reader that was overtaken goes on with the oldest that is left and knows how many
it lost; it may sleep on the head until a message comes. No lock exists, so a process that is
killed at any moment leaves nothing locked behind. Knows nothing about what the messages mean.

    head  u64   bytes written since the ring was made
    tail  u64   where the oldest intact message begins
    count u64   messages written
    then the bytes, at their position modulo the ring's size; each message is
    length u32 · crc32 u32 · number u64 · put f64 (monotonic, s) · content, padded to 8 bytes

Background of our choices: docs/decisions/0019.
"""

from __future__ import annotations

import shutil
import struct
import zlib
from collections.abc import Sequence
from multiprocessing import shared_memory
from pathlib import Path
from time import monotonic
from typing import Self

from taxel.errors import BadInput
from taxel.live.station.shared import create_shared
from taxel.live.station.waking import Word, sleep_on

_MESSAGE = struct.Struct("<IIQd")
_LENGTH = struct.Struct("<I")
_PLACES = 64
"""Bytes before the messages: head, tail and count, with room."""
_SHARED = Path("/dev/shm")
_HEAD, _TAIL, _COUNT = 0, 1, 2
_LOOKS = 1000
"""Looks at a message whose check sum fails before it is given up. Our choice."""


def _need_room(size: int) -> None:
    """Refuse a ring that shared memory cannot hold: writing to it would end the process.

    Raises:
        BadInput: There is too little.
    """
    if _SHARED.exists() and (free := shutil.disk_usage(_SHARED).free) < size + _PLACES:
        raise BadInput(
            f"{size / 2**20:.0f} MiB of shared memory in {_SHARED}", f"{free / 2**20:.0f} MiB free",
            "enlarge it (docker run --shm-size=256m)",
        )  # fmt: skip


def bytes_of(memory: shared_memory.SharedMemory) -> memoryview:
    """Return the bytes of shared memory.

    Raises:
        ValueError: It was closed.
    """
    found = memory.buf
    if found is None:
        raise ValueError("needed shared memory that is open; got a closed one")
    return found


class Ring:
    """The shared memory of a ring, for as long as its maker lives.

    Args:
        size: Bytes for messages; a multiple of 8.
    """

    def __init__(self, size: int) -> None:
        if size < 64 or size % 8:
            raise BadInput("a ring of at least 64 bytes, a multiple of 8", str(size), "round it")
        _need_room(size)
        self._memory = create_shared(_PLACES + size)
        self.name = self._memory.name
        # Every page is written to now: the memory is there, and cannot be refused later.
        bytes_of(self._memory)[: _PLACES + size] = bytes(_PLACES + size)

    def close(self) -> None:
        """Give the memory back; readers and writers that are still attached keep theirs."""
        self._memory.close()
        self._memory.unlink()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()


class _Attached:
    """One end's view of a ring."""

    def __init__(self, name: str) -> None:
        self._memory = shared_memory.SharedMemory(name)
        self._places = bytes_of(self._memory)[:_PLACES].cast("Q")
        self._bytes = bytes_of(self._memory)[_PLACES:]
        self._size = len(self._bytes) // 8 * 8
        self._word = Word(bytes_of(self._memory), 8 * _HEAD)

    def close(self) -> None:
        """Let go of the memory."""
        self._word.close()
        self._places.release()
        self._bytes.release()
        self._memory.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def _read(self, position: int, length: int) -> bytes:
        first = position % self._size
        end = first + length
        if end <= self._size:
            return bytes(self._bytes[first:end])
        return bytes(self._bytes[first : self._size]) + bytes(self._bytes[: end - self._size])


class RingWriter(_Attached):
    """The ring's only writer. One that follows a killed one goes on where that stopped.

    Args:
        name: The ring's.
    """

    @property
    def written(self) -> int:
        """Messages written since the ring was made."""
        return int(self._places[_COUNT])

    def put(self, content: bytes) -> None:
        """Write a message, and wake who sleeps for it; the oldest make room. Never waits.

        Raises:
            BadInput: It is larger than half of the ring.
        """
        length = _MESSAGE.size + len(content)
        padded = (length + 7) // 8 * 8
        if padded > self._size // 2:
            raise BadInput(
                f"messages of at most {self._size // 2} bytes", str(len(content)),
                "choose a smaller image or a larger ring",
            )  # fmt: skip
        places = self._places
        head, tail, number = places[_HEAD], places[_TAIL], places[_COUNT]
        while head + padded - tail > self._size:
            (oldest,) = _LENGTH.unpack_from(self._bytes, tail % self._size)
            tail += (oldest + _MESSAGE.size + 7) // 8 * 8
        places[_TAIL] = tail
        check = zlib.crc32(content)
        self._write(head, _MESSAGE.pack(len(content), check, number, monotonic()))
        self._write(head + _MESSAGE.size, content)
        places[_COUNT] = number + 1
        places[_HEAD] = head + padded
        self._word.wake()

    def _write(self, position: int, content: bytes) -> None:
        first = position % self._size
        room = self._size - first
        if len(content) <= room:
            self._bytes[first : first + len(content)] = content
        else:
            self._bytes[first : self._size] = content[:room]
            self._bytes[: len(content) - room] = content[room:]


class RingReader(_Attached):
    """One reader's place in a ring; it disturbs neither the writer nor other readers.

    Args:
        name: The ring's.
        from_oldest: Begin with what is in the ring; else with what comes next.
    """

    def __init__(self, name: str, *, from_oldest: bool = False) -> None:
        super().__init__(name)
        self._at = int(self._places[_TAIL] if from_oldest else self._places[_HEAD])
        self._next: int | None = None if from_oldest else int(self._places[_COUNT])
        self._broken = 0
        self.taken = 0
        """Messages given out."""
        self.lost = 0
        """Messages that were overwritten before this reader came to them."""
        self.put_s = 0.0
        """When the newest message that was given out was put, monotonic seconds."""

    @property
    def waiting(self) -> bool:
        """True where there is a message to take."""
        return int(self._places[_HEAD]) > self._at

    def wait(self, longest_s: float) -> bool:
        """Sleep until there is a message to take; return whether there is.

        Args:
            longest_s: How long at most, seconds.
        """
        return wait_for_any((self,), longest_s)

    @property
    def word(self) -> tuple[Word, int]:
        """The shared word that changes with each message, and its value at the last one taken."""
        return self._word, self._at

    def take(self, most: int = 1_000_000) -> list[bytes]:
        """Return the messages that came since the last call, oldest first; never waits.

        Args:
            most: Leave the rest for the next call.
        """
        found: list[bytes] = []
        while len(found) < most and self._places[_HEAD] > self._at:
            message = self._one()
            if message is not None:
                found.append(message)
        self.taken += len(found)
        return found

    @property
    def place(self) -> int:
        """Number of the message that comes next; 0 where that is not known yet."""
        return self._next or 0

    def go_back(self, number: int, lost: int) -> None:
        """Go on where another reader of this ring stood, as if this one had been it.

        Args:
            number: The first message to give out; those before it that are gone count as lost.
            lost: Messages that the other had lost.
        """
        self._at, self._next = int(self._places[_TAIL]), None
        while self.waiting:
            before = self._at
            self._one()
            if self.place > number:
                self._at = before
                break
        self._next, self._broken = number, 0
        self.taken, self.lost = number - lost, lost

    def newest(self) -> bytes | None:
        """Return the last message that came since the last call; those before it count as lost."""
        every = self.take()
        self.taken -= max(0, len(every) - 1)
        self.lost += max(0, len(every) - 1)
        return every[-1] if every else None

    def _one(self) -> bytes | None:
        """Return the message at this place; None where it was overtaken on the way."""
        self._at = max(self._at, int(self._places[_TAIL]))
        length, check, number, put_s = _MESSAGE.unpack(self._read(self._at, _MESSAGE.size))
        sound = length <= self._size // 2
        content = self._read(self._at + _MESSAGE.size, length) if sound else b""
        if self._places[_TAIL] > self._at:
            return None
        if not sound or zlib.crc32(content) != check:
            # Where stores are seen out of order the next look finds it whole.
            self._broken += 1
            if self._broken > _LOOKS:
                self._at, self._broken = int(self._places[_HEAD]), 0
            return None
        self._broken = 0
        if self._next is not None:
            # The count is stored before the head: of a message under way while this reader
            # attached it is one too high.
            self.lost += max(0, number - self._next)
        self._next = number + 1
        self.put_s = put_s
        self._at += (length + _MESSAGE.size + 7) // 8 * 8
        return content


def wait_for_any(readers: Sequence[RingReader], longest_s: float) -> bool:
    """Sleep until one of several rings has a message to take; return whether one has.

    A signal ends it early, so that a process that shall end does.

    Args:
        readers: Those who wait, all of this process.
        longest_s: How long at most, seconds.
    """
    until_s = monotonic() + longest_s
    while not (there := any(reader.waiting for reader in readers)):
        left_s = until_s - monotonic()
        if left_s <= 0 or not sleep_on([reader.word for reader in readers], left_s):
            break
    return there
