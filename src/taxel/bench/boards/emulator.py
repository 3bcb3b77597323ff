"""Build the firmware, and run it on emulated boards in virtual or real time.

The emulator is a program of its own (`firmware/emulator`, GPL, since it links libsimavr); this
module starts it and talks to it through pipes. Boards appear as pseudo-terminals. Works
in a checkout only: the firmware is no part of the installed package. Knows nothing about
what the boards say.

Background of our choices: docs/decisions/0020.
"""

from __future__ import annotations

import fcntl
import os
import shutil
import subprocess
import tempfile
import termios
import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Self

import numpy as np
from numpy.typing import NDArray

from taxel.errors import BadInput

FOLDER = Path(__file__).resolve().parents[4] / "firmware"
INSTALL = "apt install gcc-avr avr-libc arduino-core-avr libsimavr-dev libelf-dev gcc make"
"""What a Debian machine needs."""
_PARTS = {
    "gcc-avr": "avr-gcc",
    "gcc": "gcc",
    "make": "make",
    "avr-libc": "/usr/lib/avr/include/avr/io.h",
    "arduino-core-avr": "/usr/share/arduino/hardware/arduino/avr/cores/arduino/Arduino.h",
    "libsimavr-dev": "/usr/include/simavr/sim_avr.h",
    "libelf-dev": "/usr/include/libelf.h",
}
PINS = 16
CYCLES_S = 16_000_000
"""Cycles a second of the boards' processors."""
_READERS_S = 1.0
"""How long `wait_for_readers` waits for a reader that does not read, real seconds. Our choice."""
_TURN_S = 0.003
"""What the system and a reading thread are given to pass bytes on, real seconds. Our choice."""
_CONVERSION = np.dtype(
    [
        ("cycle", "<u8"),
        ("pin", "u1"),
        ("reference", "u1"),
        ("tenths_mv", "<u2"),
        ("count", "<u2"),
        ("prescaler", "<u2"),
    ]
)


def missing_parts() -> list[str]:
    """Return the Debian packages that this machine lacks for emulated boards."""
    return [
        package
        for package, part in _PARTS.items()
        if not (Path(part).exists() if part.startswith("/") else shutil.which(part))
    ]


@dataclass(frozen=True, slots=True)
class Firmware:
    """The firmware, built."""

    folder: Path

    def elf(self, name: str) -> Path:
        """Return a sketch's program, such as teng_daq_0 or hand_control; see the Makefile."""
        return self.folder / f"{name}.elf"

    @property
    def emulator(self) -> Path:
        """The program that runs it."""
        return self.folder / "taxel_boards"


def build_firmware() -> Firmware:
    """Build what is not built yet, once on this machine at a time.

    Raises:
        BadInput: There is no firmware, tools are missing, or it does not build.
    """
    if not (FOLDER / "Makefile").exists():
        raise BadInput(
            "the firmware's sources beside taxel", f"none in {FOLDER}", "run it in a checkout"
        )
    missing = missing_parts()
    if missing:
        raise BadInput(
            "tools of the emulated boards", f"no {', '.join(missing)}", f"run: {INSTALL}"
        )
    build = FOLDER / "build"
    build.mkdir(exist_ok=True)
    with (build / ".lock").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        done = subprocess.run(
            ["make", "-s", "-C", str(FOLDER), "all"], capture_output=True, text=True, check=False
        )
    if done.returncode:
        raise BadInput(
            "firmware that builds", done.stderr.strip()[-500:], f"mend it: make -C {FOLDER}"
        )
    return Firmware(build)


@dataclass(frozen=True, slots=True, kw_only=True)
class BoardSetup:
    """One board and what is soldered to it."""

    elf: Path
    """Its firmware."""
    volts: NDArray[np.float64] | None = None
    """Shape (n, 16): the analog pins, volts; held between rows, and after the last."""
    volts_hz: int = 1000
    """Rows a second of the board's own clock."""
    sensors: int = 0
    """INA226 on its I2C: 0, 1 for all motors, or 4 for one each."""
    ppm: float = 0.0
    """How much faster than true time its resonator is, parts per million."""
    boots: int = 0
    """How often it was started before."""


@dataclass(frozen=True, slots=True)
class Event:
    """Something that happened to a board."""

    board: int
    at_s: float
    """The emulator's time, seconds."""
    what: str
    """motor, contact, i2c, power or hang."""
    values: tuple[str, ...]
    """motor: number, direction (−1 opens, 0 off, 1 closes), duty of 255."""


def tenths_of_millivolts(volts: NDArray[np.float64]) -> NDArray[np.uint16]:
    """Return a waveform in the emulator's unit: tenths of a millivolt, 0…6.5 V."""
    return np.clip(np.rint(volts * 1e4), 0, 65535).astype("<u2")


class EmulatedBoards:
    """Boards that advance together in one process; use it in a `with` block.

    Args:
        firmware: As built.
        boards: What to run; numbered in this order.
        live: Let time pass as outside; otherwise `run` makes it pass.

    Raises:
        BadInput: The emulator does not start.
    """

    def __init__(
        self, firmware: Firmware, boards: Sequence[BoardSetup], *, live: bool = False
    ) -> None:
        self._folder = tempfile.TemporaryDirectory(prefix="taxel-boards-")
        self.events: list[Event] = []
        """All that happened, oldest first."""
        self.now_s = 0.0
        """Virtual time, seconds."""
        self.sent = [0] * len(boards)
        """Bytes that each board has sent."""
        self.waiting = [0] * len(boards)
        """Of these, bytes that its port has not taken."""
        self._setups = list(boards)
        command = [str(firmware.emulator), *(["--live"] if live else [])]
        for number, board in enumerate(boards):
            command += ["--board", self._options(number, board, live)]
        self._process = subprocess.Popen(
            command,
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
            bufsize=1,
        )
        if not self._line().startswith("ready"):
            self.close()
            raise BadInput("an emulator that starts", "none", f"run it by hand: {command[0]}")

    def _options(self, number: int, board: BoardSetup, live: bool) -> str:
        options = {
            "elf": board.elf,
            "port": self.port(number),
            "sensors": board.sensors,
            "ppm": board.ppm,
            "boots": board.boots - 1,
            "hz": board.volts_hz,
        }
        if not live:
            options |= {"log": self._file(number, "log"), "tap": self._file(number, "tap")}
        if board.volts is not None:
            wave = self._file(number, "wave")
            tenths_of_millivolts(board.volts).tofile(wave)
            options["wave"] = wave
        return ",".join(f"{key}={value}" for key, value in options.items())

    def _file(self, board: int, kind: str) -> Path:
        return Path(self._folder.name) / f"board{board}.{kind}"

    def port(self, board: int) -> Path:
        """Return the path of a board's serial port."""
        return self._file(board, "port")

    def run(self, seconds: float) -> None:
        """Let virtual time pass, seconds; events are gathered."""
        self.command(f"run {round(seconds * 1e6)}")
        while not (line := self._line()).startswith("done"):
            self._take(line)
        numbers = [int(word) for word in line.split()[1:]]
        self.now_s = numbers[0] * 1e-6
        self.sent, self.waiting = numbers[1::2], numbers[2::2]

    def command(self, line: str) -> None:
        """Give the emulator an order, such as "contact 0 2 1"; firmware/emulator/main.c lists them.

        Its events come with the next `run`.
        """
        assert self._process.stdin is not None
        self._process.stdin.write(line + "\n")
        self._process.stdin.flush()

    def wait_for_holders(self) -> None:
        """Wait, in real time, until another program or thread holds each port; a second at most.

        Opening a port throws away what is in it, so boards should not run before.
        """
        until_s = time.monotonic() + _READERS_S
        while time.monotonic() < until_s:
            if all(self._held(n) for n in range(len(self._setups))):
                break
            time.sleep(_TURN_S)
        time.sleep(10 * _TURN_S)  # from the lock to the end of opening

    def _held(self, board: int) -> bool:
        fd = os.open(self.port(board), os.O_RDONLY | os.O_NOCTTY | os.O_NONBLOCK)
        try:
            fcntl.flock(fd, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            return True
        finally:
            os.close(fd)
        return False

    def wait_for_readers(self, among: Sequence[int] | None = None) -> None:
        """Wait, in real time, until others have read what the ports hold; a second at most.

        Args:
            among: Boards whose ports others read; all unless given.
        """
        numbers = range(len(self._setups)) if among is None else among
        until_s = time.monotonic() + _READERS_S
        while time.monotonic() < until_s:
            time.sleep(_TURN_S)
            if not any(self._unread(n) for n in numbers):
                return

    def _unread(self, board: int) -> int:
        fd = os.open(self.port(board), os.O_RDONLY | os.O_NOCTTY | os.O_NONBLOCK)
        try:
            return int.from_bytes(fcntl.ioctl(fd, termios.FIONREAD, bytes(4)), "little")
        finally:
            os.close(fd)

    def conversions(self, board: int) -> NDArray[np.void]:
        """Return all that a board's converter did: cycle, pin, tenths_mv, count, prescaler."""
        return np.fromfile(self._file(board, "log"), _CONVERSION)

    def bytes_sent(self, board: int) -> bytes:
        """Return all that a board has sent."""
        return self._file(board, "tap").read_bytes()

    def counts(self, board: int, reference_mv: int = 5000) -> NDArray[np.int64]:
        """Return what each conversion should give, shape (n,): from the waveform and the moment
        of the sample alone, by the converter's own formula, count = 1024 · volts / reference.
        """
        setup, found = self._setups[board], self.conversions(board)
        assert setup.volts is not None, "a board without a waveform"
        wave = tenths_of_millivolts(setup.volts).astype(np.int64)
        row = found["cycle"].astype(np.int64) * setup.volts_hz // CYCLES_S
        tenths = wave[np.minimum(row, len(wave) - 1), found["pin"]]
        counts: NDArray[np.int64] = np.minimum(tenths * 1024 // (10 * reference_mv), 1023)
        return counts

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """End the emulator."""
        process = self._process
        process.kill()
        process.wait()
        for pipe in (process.stdin, process.stdout, process.stderr):
            if pipe is not None:
                pipe.close()
        self._folder.cleanup()

    def _line(self) -> str:
        assert self._process.stdout is not None
        assert self._process.stderr is not None
        line = self._process.stdout.readline()
        if not line:
            why = self._process.stderr.read().strip()
            raise BadInput("an emulator that runs", why or "an end", "see firmware/emulator")
        return line

    def _take(self, line: str) -> None:
        _, board, at_us, what, *values = line.split()
        self.events.append(Event(int(board), float(at_us) * 1e-6, what, tuple(values)))


class VirtualClock:
    """The emulator's time as a clock: whoever sleeps on it lets the boards run.

    Args:
        boards: Whose time it is.
        readers: Other threads read the ports: time does not run ahead of them.
    """

    def __init__(self, boards: EmulatedBoards, *, readers: bool = False) -> None:
        self._boards = boards
        self._readers = readers
        self._began = False

    def now_s(self) -> float:
        """Return the boards' virtual time, seconds."""
        return self._boards.now_s

    def sleep(self, duration_s: float) -> None:
        """Let the boards run for a duration, seconds."""
        if duration_s > 0:
            if self._readers and not self._began:
                self._boards.wait_for_holders()
            self._began = True
            self._boards.run(duration_s)
            if self._readers:
                self._boards.wait_for_readers()
