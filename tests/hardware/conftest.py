"""What the hardware tests share: host programs of the firmware's plain C, and emulated boards.

Each skips with one reason where its tools are missing.
"""

from __future__ import annotations

import shutil
import subprocess
from collections.abc import Callable, Iterator
from functools import cache
from pathlib import Path

import pytest

from taxel.bench.boards.emulator import INSTALL, Firmware, build_firmware, missing_parts

FIRMWARE = Path(__file__).parents[2] / "firmware"
STRICT = ("-std=c11", "-Wall", "-Wextra", "-Werror", "-g", "-O1",
          "-fsanitize=address,undefined", "-fno-sanitize-recover=all")  # fmt: skip
_WIRE = FIRMWARE / "libraries" / "TaxelWire" / "src"
SOURCES = {
    "wire": (_WIRE / "taxel_frame.c", _WIRE / "taxel_message.c"),
    "hand": (FIRMWARE / "hand_control" / "hand_logic.c", _WIRE / "taxel_message.c"),
    "daq": (FIRMWARE / "teng_daq" / "daq_logic.c", _WIRE / "taxel_message.c"),
}
"""What each host program tests, beside its own file in firmware/tests."""


class HostProgram:
    """The firmware's plain C on this machine: one line to it, one line back."""

    def __init__(self, path: Path) -> None:
        self._process = subprocess.Popen(
            [str(path)], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True, bufsize=1
        )

    def ask(self, line: str) -> str:
        """Return the answer to a line."""
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        self._process.stdin.write(line + "\n")
        self._process.stdin.flush()
        answer = self._process.stdout.readline()
        assert answer, f"the program ended at: {line[:200]}"
        return answer.rstrip("\n")

    def close(self) -> None:
        """End it; a complaint of a sanitizer is a failure."""
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        self._process.stdin.close()
        self._process.stdout.close()
        assert self._process.wait(10) == 0


@pytest.fixture(scope="session")
def built(tmp_path_factory: pytest.TempPathFactory) -> Callable[[str], Path]:
    """Build a host program of `SOURCES`, once a session."""

    @cache
    def build(name: str) -> Path:
        compiler = shutil.which("gcc")
        if compiler is None:
            pytest.skip("needs a C compiler: apt install gcc")
        program = tmp_path_factory.mktemp(name) / name
        sources = [FIRMWARE / "tests" / f"{name}_host.c", *SOURCES[name]]
        includes = [f"-I{folder}" for folder in sorted({path.parent for path in sources})]
        command = [compiler, *STRICT, *includes, "-o", str(program), *map(str, sources)]
        made = subprocess.run(command, capture_output=True, text=True, check=False)
        assert made.returncode == 0, made.stderr
        return program

    return build


def _running(program: Path) -> Iterator[HostProgram]:
    running = HostProgram(program)
    yield running
    running.close()


@pytest.fixture
def wire(built: Callable[[str], Path]) -> Iterator[HostProgram]:
    yield from _running(built("wire"))


@pytest.fixture
def hand(built: Callable[[str], Path]) -> Iterator[HostProgram]:
    yield from _running(built("hand"))


@pytest.fixture
def daq(built: Callable[[str], Path]) -> Iterator[HostProgram]:
    yield from _running(built("daq"))


@pytest.fixture(scope="session")
def firmware() -> Firmware:
    """The firmware built for the ATmega2560, and the emulator."""
    missing = missing_parts()
    if missing:
        pytest.skip(f"no {', '.join(missing)}: {INSTALL}")
    return build_firmware()
