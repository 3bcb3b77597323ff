"""`taxel flash`: build a sketch, write it to a board, and hear the board say what it runs.

Background of our choices: docs/decisions/0020.
"""

from __future__ import annotations

import re
import subprocess
import tempfile
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, ClassVar, Literal

import tyro

from taxel.cli.devices.flash_tools import BOARDS, BoardKind, commands, find_sketch
from taxel.cli.options.rules import Only
from taxel.cli.printing import print_json, say, say_aside
from taxel.clock import SystemClock
from taxel.errors import BadInput, BadSource, MissingExtra
from taxel.plain_text import number_of, shell_words
from taxel.wire.framing import FrameDecoder, frame_of
from taxel.wire.messages import EVERY_BOARD, PROTOCOL, Command, Hello, Order, pack, unpack

if TYPE_CHECKING:
    from taxel.sources.boards.port import SerialPort

_LOOK_S = 1.0
"""How long a port may take to open, seconds. Our choice."""
_ASK_S = 0.2
"""How often a board is asked for its hello, seconds. Source: protocol/SPEC.md."""
_LONGEST_S = 300.0
"""A command that takes longer is stopped, seconds. Our choice: a first build takes a minute."""
_IDENTIFY = frame_of(pack(Command(board=EVERY_BOARD, seq=0, t_us=0, order=Order.IDENTIFY)))


@dataclass(frozen=True, kw_only=True)
class Flash:
    """Build a sketch, write it to a board, and check what the board then reports.

    Uses arduino-cli, or avrdude with the AVR compiler, whichever is there. Whatever ran on the
    board is replaced.
    """

    board: tyro.conf.Positional[Literal["mega"]]
    """Kind of board: mega is the Arduino Mega 2560."""
    sketch: tyro.conf.Positional[str]
    """teng_daq (sensor board), hand_control (fingers), a sketch's folder, or a .hex file."""
    port: str | None = None
    """Port of the board, such as /dev/serial/by-id/…; the only such board unless given."""
    board_number: int | None = None
    """Its number in the hand, 0 to 254; as the sketch's settings.h says unless given."""
    board_id: str | None = None
    """Its name, at most 32 letters, digits, dots, dashes; as settings.h says unless given."""
    define: tuple[str, ...] = ()
    """Other settings for the compiler, NAME=VALUE, as in TAXEL_RATE_HZ=500."""
    firmware: Path | None = None
    """Folder of the firmware, where it is not the repository's."""
    tool: Literal["auto", "arduino-cli", "avrdude"] = "auto"
    """What to write with."""
    expect: str | None = None
    """Firmware version that the board must report, as in 1.0.0; the sketch's own unless given."""
    baud: int = 500_000
    """Baud rate of the board afterwards, bits a second."""
    wait_s: float = 8.0
    """How long to wait for the board's first message, s."""
    dry_run: bool = False
    """Print the commands and do nothing."""
    json: bool = False
    """Print what was done as JSON."""

    RULES: ClassVar = (Only(("expect", "baud", "wait-s"), "no --dry-run", lambda o: not o.dry_run),)

    def run(self) -> None:
        """Build, write and check, or say in one line why not."""
        kind = BOARDS[self.board]
        sketch = find_sketch(self.sketch, self.firmware)
        expected = sketch.version if self.expect is None else _version(self.expect)
        defines = self._defines()
        if not 0.1 <= self.wait_s <= 600:
            raise BadInput("--wait-s from 0.1 to 600", f"{self.wait_s:g}", "choose another")
        with tempfile.TemporaryDirectory(prefix="taxel-flash-") as build:
            port = self.port or _only_board(kind)
            steps = commands(kind, sketch, port, Path(build), defines, self.tool)
            if self.dry_run:
                self._print_commands(steps)
                return
            check_port(port, self.baud)
            for step in steps:
                _run(step)
        hello = hear_hello(port, self.baud, self.wait_s)
        self._check(hello, expected, port)
        self._print(steps, port, hello)

    def _defines(self) -> list[str]:
        """Return all settings for the compiler, checked: they go into command lines."""
        found = list(self.define)
        for board in found:
            if not re.fullmatch(r"[A-Za-z_]\w*=[\w., +-]*", board, re.ASCII):
                raise BadInput("--define NAME=VALUE of letters and numbers", repr(board), "mend it")
        if self.board_number is not None:
            if not 0 <= self.board_number <= 254:
                raise BadInput("--board-number from 0 to 254", str(self.board_number), "mend it")
            found.append(f"TAXEL_BOARD={self.board_number}")
        if self.board_id is not None:
            if not re.fullmatch(r"[A-Za-z0-9._-]{1,32}", self.board_id):
                raise BadInput(
                    "--board-id of at most 32 letters, digits, dots, dashes",
                    repr(self.board_id),
                    "choose another",
                )
            found.append(f'TAXEL_BOARD_ID="{self.board_id}"')
        return found

    def _check(self, hello: Hello, expected: tuple[int, int, int] | None, port: str) -> None:
        """Raise BadSource where the board's hello differs from what was written to it."""
        settings = [
            ("protocol", str(hello.protocol), str(PROTOCOL)),
            ("firmware", _dotted(hello.firmware), expected and _dotted(expected)),
            ("number", str(hello.board), self.board_number),
            ("name", hello.board_id, self.board_id),
        ]
        for what, is_now, wanted in settings:
            if wanted is not None and is_now != str(wanted):
                raise BadSource(
                    f"{what} {wanted} from the board at {port} after writing",
                    f"{what} {is_now}",
                    "flash it again, and look whether the port is the board that was meant",
                )

    def _print_commands(self, steps: list[list[str]]) -> None:
        if self.json:
            print_json({"commands": steps})
            return
        for step in steps:
            say(shell_words(*step))

    def _print(self, steps: list[list[str]], port: str, hello: Hello) -> None:
        if self.json:
            print_json(
                {
                    "port": port,
                    "commands": steps,
                    "firmware": _dotted(hello.firmware),
                    "protocol": hello.protocol,
                    "board": hello.board,
                    "board_id": hello.board_id,
                    "rate_hz": hello.rate_hz,
                    "channels": hello.channels,
                    "reference_mv": hello.reference_mv,
                }
            )
            return
        does = (
            f"{number_of(hello.channels, 'channel')} at {hello.rate_hz} Hz, "
            if hello.channels
            else ""
        )
        say(
            f"{port}: board {hello.board}, {hello.board_id or 'no name'}, runs firmware "
            f"{_dotted(hello.firmware)}: {does}reference {hello.reference_mv} mV"
        )
        say(f"next:  taxel view 'serial://{port}'" if hello.channels
            else f"next:  taxel hand status 'hand://{port}'")  # fmt: skip


def check_port(path: str, baud: int) -> None:
    """Open a port and close it again.

    Raises:
        BadSource: It is not there, held by another program, or not yours to open.
        MissingExtra: There is no pyserial.
    """
    clock = SystemClock()
    port = _serial_port()(path, baud, clock)
    try:
        until_s = clock.now_s() + _LOOK_S
        while not port.is_open and clock.now_s() < until_s:
            if port.trouble:
                break
            clock.sleep(0.005)
        if not port.is_open:
            raise BadSource(
                f"a board at {path}", port.trouble or "a port that does not open",
                "look at the cable, end what holds the port; taxel find lists boards",
            )  # fmt: skip
    finally:
        port.close()


def hear_hello(path: str, baud: int, wait_s: float) -> Hello:
    """Return what a board says it is, asking until it answers.

    Args:
        path: Its port; opening it restarts an Arduino.
        baud: Bits a second.
        wait_s: How long to wait, seconds.

    Raises:
        BadSource: The port is not there, or no hello came.
        MissingExtra: There is no pyserial.
    """
    clock = SystemClock()
    port, decoder, heard = _serial_port()(path, baud, clock), FrameDecoder(), 0
    try:
        until_s, ask_s = clock.now_s() + wait_s, clock.now_s()
        while clock.now_s() < until_s:
            for chunk in port.take():
                heard += len(chunk.data)
                for payload in decoder.feed(chunk.data):
                    message = unpack(payload)
                    if isinstance(message, Hello):
                        return message
            if port.is_open and clock.now_s() >= ask_s:
                port.write(_IDENTIFY)
                ask_s = clock.now_s() + _ASK_S
            clock.sleep(0.005)
        got = f"{number_of(heard, 'byte')} and no hello"
        if not port.is_open:
            got = port.trouble or "a port that does not open"
    finally:
        port.close()
    raise BadSource(
        f"a hello from the board at {path} within {wait_s:g} s after writing",
        got,
        f"press its reset button and try: taxel doctor; it should speak at {baud} baud",
    )


def _only_board(kind: BoardKind) -> str:
    """Return the path of the only board of this kind, by its lasting name."""
    from taxel.sources.boards.finding import list_boards

    found = [board for board in list_boards() if board["vid_pid"] in kind.usb]
    paths = [str(board["by_id"] or board["path"]) for board in found]
    if len(paths) != 1:
        raise BadSource(
            "exactly one such board, or --port", ", ".join(paths) or "none", "name it with --port"
        )
    return paths[0]


def _run(command: list[str]) -> None:
    """Run one command; its output goes to the error stream.

    Raises:
        BadInput: It failed, was missing, or took too long; with its last line.
    """
    say_aside(f"+ {shell_words(*command)}")
    try:
        process = subprocess.run(
            command,
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
            errors="replace",
            timeout=_LONGEST_S,
            check=False,
        )
    except (OSError, subprocess.TimeoutExpired) as error:
        why = f"more than {_LONGEST_S:g} s" if isinstance(error, subprocess.TimeoutExpired) else (
            error.strerror or str(error))  # fmt: skip
        raise BadInput(f"{command[0]} to run", why, "look at that program by itself") from error
    if process.returncode:
        for line in process.stdout.splitlines():
            say_aside(line)
        lines = [line.strip() for line in process.stdout.splitlines() if line.strip()]
        last = lines[-1] if lines else "without a word"
        raise BadInput(
            f"{command[0]} to succeed", f"exit code {process.returncode}: {last[:200]}",
            "its output stands above",
        )  # fmt: skip


def _serial_port() -> type[SerialPort]:
    try:
        from taxel.sources.boards.port import SerialPort
    except ModuleNotFoundError as error:
        raise MissingExtra(error.name or "pyserial", "serial", "boards on a serial port") from error
    return SerialPort


def _version(text: str) -> tuple[int, int, int]:
    parts = text.split(".")
    if len(parts) != 3 or not all(part.isascii() and part.isdecimal() for part in parts):
        raise BadInput("--expect as in 1.0.0", repr(text), "mend it")
    return int(parts[0]), int(parts[1]), int(parts[2])


def _dotted(version: tuple[int, int, int]) -> str:
    return ".".join(map(str, version))
