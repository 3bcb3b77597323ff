"""An emulated sensor board on a pseudo-terminal: real frames, real ports, faults on demand.

For tests and benches without hardware. Its values say which scan they belong to, so that a
lost, repeated or misplaced one is provable. Knows nothing about how it is read.

Background of our choices: docs/decisions/0014.
"""

from __future__ import annotations

import os
import threading
import time
import tty
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path

from taxel.wire.framing import FrameDecoder, frame_of
from taxel.wire.messages import (
    Acknowledge,
    Command,
    Data,
    Hello,
    Message,
    Order,
    Result,
    pack,
    unpack,
)

_WRAP = 1 << 32
_LOOK_S = 0.001
"""How often a running board does what is due, seconds. Our choice."""


class EmulatedBoard:
    """What a board computes: scans and answers, without any port or time of its own.

    Args:
        board: Its number.
        channels: Values a scan.
        rate_hz: Scans a second.
        board_id: Its serial number.
        first_tick: Where its counter starts, to see it wrap.
        first_us: Where its clock starts, microseconds.
    """

    def __init__(
        self,
        *,
        board: int = 0,
        channels: int = 4,
        rate_hz: int = 1000,
        board_id: str = "EMU-0",
        first_tick: int = 0,
        first_us: int = 0,
    ) -> None:
        self.board, self.channels, self.rate_hz, self.board_id = board, channels, rate_hz, board_id
        self.tick, self.boot_id = first_tick, 0x1000 + board
        self._us = float(first_us)
        self._decoder = FrameDecoder()

    @property
    def t_us(self) -> int:
        """Microseconds since boot, wrapped as on the wire."""
        return round(self._us) % _WRAP

    def scan(self) -> bytes:
        """Take the next scan; return its frame."""
        values = tuple(value_at(self.tick, self.board, i) for i in range(self.channels))
        frame = frame_of(pack(Data(self.board, self.tick % _WRAP, self.t_us, values)))
        self.skip(1)
        return frame

    def skip(self, scans: int) -> None:
        """Let ticks pass without a scan."""
        self.tick += scans
        self._us += scans * 1e6 / self.rate_hz

    def reboot(self) -> bytes:
        """Start anew, with another boot id; return what it says then."""
        self.tick, self._us, self.boot_id = 0, 0.0, self.boot_id + 0x10000
        self._decoder = FrameDecoder()
        return b"\x00" + self.hello()

    def hello(self) -> bytes:
        """Return the board's hello message, framed."""
        return self._frame(
            Hello(
                board=self.board,
                seq=self.tick % _WRAP,
                t_us=self.t_us,
                firmware=(1, 0, 0),
                boot_id=self.boot_id,
                rate_hz=self.rate_hz,
                channels=self.channels,
                board_id=self.board_id,
            )
        )

    def hear(self, data: bytes) -> bytes:
        """Take in bytes of the host; return the answers."""
        answers = b""
        for payload in self._decoder.feed(data):
            message = unpack(payload)
            if isinstance(message, Command):
                answers += self._obey(message)
        return answers

    def _obey(self, command: Command) -> bytes:
        if command.order == Order.IDENTIFY:
            return self._answer(command, Result.DONE) + self.hello()
        if command.order != Order.SET_RATE:
            return self._answer(command, Result.UNKNOWN)
        if not command.a:
            return self._answer(command, Result.BAD_ARGUMENT)
        self.rate_hz = command.a
        return self._answer(command, Result.DONE) + self.hello()

    def _answer(self, command: Command, result: Result) -> bytes:
        return self._frame(
            Acknowledge(
                board=self.board,
                seq=self.tick % _WRAP,
                t_us=self.t_us,
                command_seq=command.seq,
                host_us=command.t_us,
                result=result,
            )
        )

    @staticmethod
    def _frame(message: Message) -> bytes:
        return frame_of(pack(message))


def value_at(tick: int, board: int, channel: int) -> int:
    """Return the counts of a scan, 1…1022: never at an end of ten bits, and another for each of
    1022 ticks in a row.
    """
    return 1 + (5 * tick + 131 * channel + 17 * board) % 1022


class PseudoPort:
    """A pseudo-terminal behind a path that can vanish and come back, as a USB device does."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self._fds: tuple[int, int] | None = None

    def plug(self) -> None:
        """Make a new device appear under the path."""
        device, terminal = os.openpty()
        tty.setraw(terminal)
        os.set_blocking(device, False)
        self._fds = (device, terminal)
        os.symlink(os.ttyname(terminal), self.path)

    def unplug(self) -> None:
        """Take the device away; nothing happens where there is none."""
        if self._fds is not None:
            self.path.unlink()
            for fd in self._fds:
                os.close(fd)
            self._fds = None

    def write(self, data: bytes) -> None:
        """Send bytes to whoever reads the path; what its buffer has no room for is dropped."""
        if self._fds is None or not data:
            return
        with suppress(BlockingIOError):
            os.write(self._fds[0], data)

    def read(self) -> bytes:
        """Return the bytes that came; never waits."""
        if self._fds is None:
            return b""
        try:
            return os.read(self._fds[0], 4096)
        except BlockingIOError:
            return b""


class RunningBoard:
    """An emulated board that runs in real time on a port, until its block is left.

    Args:
        board: What it computes.
        path: Where its port appears.
        ppm: How much faster than the host's clock it runs, parts per million.
        damage: Applied to each frame before it is sent.
    """

    def __init__(
        self,
        board: EmulatedBoard,
        path: Path,
        *,
        ppm: float = 0.0,
        damage: Callable[[bytes], bytes] = bytes,
    ) -> None:
        self.board = board
        self.port = PseudoPort(path)
        self._rate = 1.0 + ppm * 1e-6
        self._damage = damage
        self._lock = threading.Lock()
        self._ending = threading.Event()
        self._paused = False
        self._due_s = time.monotonic()
        self._thread = threading.Thread(target=self._run, name=f"board {path}")

    def __enter__(self) -> RunningBoard:
        self.port.plug()
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._ending.set()
        self._thread.join()
        self.port.unplug()

    def unplug(self) -> None:
        """Pull the cable; the board runs on, from a battery."""
        with self._lock:
            self.port.unplug()

    def replug(self, *, reboot: bool = False) -> float:
        """Put the cable back; return when the device was there again, host monotonic, seconds."""
        with self._lock:
            greeting = self.board.reboot() if reboot else b""
            self.port.plug()
            self.port.write(greeting)
            return time.monotonic()

    def reboot(self) -> None:
        """Press the board's button: its port stays."""
        with self._lock:
            self.port.write(self.board.reboot())

    def pause(self, paused: bool = True) -> None:
        """Stop sending, or begin again; scans go on being taken and are not sent."""
        with self._lock:
            self._paused = paused

    def say(self, data: bytes) -> None:
        """Send bytes out of turn."""
        with self._lock:
            self.port.write(data)

    def _run(self) -> None:
        while not self._ending.wait(_LOOK_S):
            with self._lock:
                self.port.write(self.board.hear(self.port.read()))
                now_s = time.monotonic()
                while self._due_s <= now_s:
                    self._due_s += 1.0 / (self.board.rate_hz * self._rate)
                    self._scan()

    def _scan(self) -> None:
        if self._paused:
            self.board.skip(1)
        else:
            self.port.write(self._damage(self.board.scan()))
