"""One serial port that may vanish and come back: a thread that reads, stamps and reopens it.

Bytes are stamped right after the system hands them over. Knows nothing about frames,
lines or boards.

Background of our choices: docs/decisions/0014.
"""

from __future__ import annotations

import contextlib
import errno
import os
import select
import termios
import threading
from collections import deque
from dataclasses import dataclass

import serial

from taxel.clock import Clock

REOPEN_S = 0.02
"""How often a path that is gone is tried again, seconds. Source: docs/decisions/0014."""
_LOOK_S = 0.005
"""How long a read waits before it says that nothing came so far, seconds. Our choice."""
_AT_ONCE = 65536
"""Bytes taken at most by one read. Our choice: above any driver's buffer."""
_KEPT_CHUNKS = 60_000
"""Chunks kept while nobody reads, at 1 kHz about a minute; then the oldest are dropped and
counted. Our choice."""
_WRITE_S = 0.2
"""A write that takes longer has failed, seconds. Our choice."""


@dataclass(frozen=True, slots=True)
class Chunk:
    """Bytes as they came, or a change of the port."""

    arrival_s: float
    """The host's clock right after the read, seconds."""
    data: bytes
    opened: bool = False
    """The port was opened, for the first time or again."""
    gone: bool = False
    """The port was lost."""


class SerialPort:
    """A port held open for as long as it exists, from a thread of its own.

    Args:
        path: A device such as /dev/serial/by-id/…; resolved anew at each opening.
        baud: Bits a second.
        clock: Stamps arrivals.
    """

    def __init__(self, path: str, baud: int, clock: Clock) -> None:
        self.path = path
        self.trouble = ""
        """Why the last try to open it failed, in plain words; empty where it did not."""
        self.overrun = 0
        """Chunks that were dropped since nobody took them."""
        self._looked_s = clock.now_s()
        self._baud = baud
        self._clock = clock
        self._chunks: deque[Chunk] = deque()
        self._queue = threading.Lock()
        self._port: serial.Serial | None = None
        self._lock = threading.Lock()
        self._ending = threading.Event()
        self._thread = threading.Thread(target=self._run, name=f"taxel {path}", daemon=True)
        self._thread.start()

    @property
    def is_open(self) -> bool:
        """True while the device is there and held."""
        return self._port is not None

    @property
    def looked_s(self) -> float:
        """Up to when all that came has been read, on the clock: later than this, it may be that
        this thread had no turn, and not that nothing came. The present while it is not open.
        """
        return self._looked_s if self.is_open else self._clock.now_s()

    def take(self) -> list[Chunk]:
        """Return what came since the last call, oldest first; never waits."""
        with self._queue:
            taken = list(self._chunks)
            self._chunks.clear()
        return taken

    def write(self, data: bytes) -> bool:
        """Send bytes; False where the port is not there or does not take them."""
        with self._lock:
            if self._port is None:
                return False
            try:
                return bool(self._port.write(data) == len(data))
            except (OSError, termios.error):  # the reading thread sees to a port that is gone
                return False

    def close(self) -> None:
        """End the thread and let go of the port."""
        self._ending.set()
        self._thread.join()

    def _run(self) -> None:
        while not self._ending.is_set():
            port = self._open()
            if port is None:
                self._ending.wait(REOPEN_S)
                continue
            self._looked_s = self._clock.now_s()
            with self._lock:
                self._port = port
            self._put(Chunk(self._clock.now_s(), b"", opened=True))
            self._read(port.fileno())
            with self._lock:
                self._port = None
                port.close()
            self._put(Chunk(self._clock.now_s(), b"", gone=True))

    def _open(self) -> serial.Serial | None:
        if not os.path.exists(self.path):
            self.trouble = "no such device"
            return None
        try:
            port = serial.Serial(
                self.path, self._baud, timeout=0, write_timeout=_WRITE_S, exclusive=True
            )
        except (OSError, ValueError, termios.error) as error:
            self.trouble = why_not_open(error)
            return None
        with contextlib.suppress(OSError, ValueError, NotImplementedError, AttributeError):
            # Else an FTDI chip holds bytes back for 16 ms. Not every driver has it.
            port.set_low_latency_mode(True)
        self.trouble = ""
        return port

    def _read(self, fd: int) -> None:
        """Read until the port is gone or the end is asked for."""
        while not self._ending.is_set():
            try:
                if not select.select([fd], [], [], _LOOK_S)[0]:
                    self._looked_s = self._clock.now_s()
                    continue
                data = os.read(fd, _AT_ONCE)
            except BlockingIOError:
                continue
            except OSError:
                return
            if not data:
                return
            now_s = self._clock.now_s()
            self._put(Chunk(now_s, data))
            self._looked_s = now_s

    def _put(self, chunk: Chunk) -> None:
        with self._queue:
            if len(self._chunks) >= _KEPT_CHUNKS and chunk.data:
                oldest = (place for place, kept in enumerate(self._chunks) if kept.data)
                place = next(oldest, None)
                if place is not None:  # that the port was lost, or opened again, is kept
                    del self._chunks[place]
                    self.overrun += 1
            self._chunks.append(chunk)


def trouble_of(path: str, baud: int) -> str:
    """Return why a port cannot be opened, in plain words, by trying once; empty where it can be.

    Args:
        path: A device such as /dev/serial/by-id/….
        baud: Bits a second.
    """
    try:
        serial.Serial(path, baud, exclusive=True).close()
    except (OSError, ValueError, termios.error) as error:
        return why_not_open(error)
    return ""


def why_not_open(error: Exception) -> str:
    """Return in plain words why a port could not be opened, where the system says it."""
    number = getattr(error, "errno", None)
    if number == errno.EACCES:
        return "no permission: add yourself to the group dialout, and log in again"
    if number in (errno.EAGAIN, errno.EBUSY) or "exclusively lock" in str(error):
        return "another program holds it"
    if number == errno.ENOENT:
        return "no such device"
    return str(error)
