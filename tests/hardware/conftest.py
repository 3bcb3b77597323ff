"""What the hardware tests share: host programs of the firmware's plain C, and emulated boards.

Each skips with one reason where its tools are missing.
"""

from __future__ import annotations

import shutil
import subprocess
from collections.abc import Iterator
from pathlib import Path

import pytest

from taxel.bench.board_emulator import INSTALL, Firmware, build_firmware, missing_parts

FIRMWARE = Path(__file__).parents[2] / "firmware"
STRICT = ("-std=c11", "-Wall", "-Wextra", "-Werror", "-g", "-O1",
          "-fsanitize=address,undefined", "-fno-sanitize-recover=all")  # fmt: skip


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


def _program(folder: Path, name: str, sources: list[Path]) -> Path:
    compiler = shutil.which("gcc")
    if compiler is None:
        pytest.skip("needs a C compiler: apt install gcc")
    program = folder / name
    includes = [f"-I{folder}" for folder in sorted({path.parent for path in sources})]
    command = [compiler, *STRICT, *includes, "-o", str(program), *map(str, sources)]
    built = subprocess.run(command, capture_output=True, text=True, check=False)
    assert built.returncode == 0, built.stderr
    return program


def _running(program: Path) -> Iterator[HostProgram]:
    running = HostProgram(program)
    yield running
    running.close()


@pytest.fixture(scope="session")
def wire_program(tmp_path_factory: pytest.TempPathFactory) -> Path:
    library = FIRMWARE / "libraries" / "TaxelWire" / "src"
    sources = [library / "taxel_frame.c", library / "taxel_message.c"]
    return _program(
        tmp_path_factory.mktemp("wire"), "wire", [FIRMWARE / "tests" / "wire_host.c", *sources]
    )


@pytest.fixture
def wire(wire_program: Path) -> Iterator[HostProgram]:
    yield from _running(wire_program)


@pytest.fixture(scope="session")
def hand_program(tmp_path_factory: pytest.TempPathFactory) -> Path:
    library = FIRMWARE / "libraries" / "TaxelWire" / "src"
    sources = [
        FIRMWARE / "tests" / "hand_host.c",
        FIRMWARE / "hand_control" / "hand_logic.c",
        library / "taxel_message.c",
    ]
    return _program(tmp_path_factory.mktemp("hand"), "hand", sources)


@pytest.fixture
def hand(hand_program: Path) -> Iterator[HostProgram]:
    yield from _running(hand_program)


@pytest.fixture(scope="session")
def daq_program(tmp_path_factory: pytest.TempPathFactory) -> Path:
    library = FIRMWARE / "libraries" / "TaxelWire" / "src"
    sources = [
        FIRMWARE / "tests" / "daq_host.c",
        FIRMWARE / "teng_daq" / "daq_logic.c",
        library / "taxel_message.c",
    ]
    return _program(tmp_path_factory.mktemp("daq"), "daq", sources)


@pytest.fixture
def daq(daq_program: Path) -> Iterator[HostProgram]:
    yield from _running(daq_program)


@pytest.fixture(scope="session")
def firmware() -> Firmware:
    """The firmware built for the ATmega2560, and the emulator."""
    missing = missing_parts()
    if missing:
        pytest.skip(f"no {', '.join(missing)}: {INSTALL}")
    return build_firmware()
