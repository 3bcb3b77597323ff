"""Compile the C and run it on an emulated ATmega2560, whose clocks count.

The emulator's program lies in `firmware/teng_classify/emulate` of a checkout and links libsimavr,
which is under the GPL: it runs as a process of its own. Knows nothing about bundles or accuracy.
"""

from __future__ import annotations

import shutil
import subprocess
import tempfile
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from taxel.bundles.avr.integers import BoardAnswers
from taxel.errors import BadInput
from taxel.plain_text import number_of

CLOCK_HZ = 16_000_000
"""Of the Arduino Mega 2560."""
HARNESS = Path(__file__).parents[4] / "firmware" / "teng_classify" / "emulate"
AVR_PACKAGES = "gcc-avr avr-libc libsimavr-dev libelf-dev gcc"
_SIMAVR = Path("/usr/include/simavr")
_LONGEST_S = 600.0
_STRICT = ("-std=gnu11", "-Wall", "-Wextra", "-Werror")
_AVR = ("-mmcu=atmega2560", "-DF_CPU=16000000UL", "-Os", *_STRICT)
"""-Os is what the Arduino IDE compiles with."""


@dataclass(frozen=True, slots=True)
class OnBoard:
    """What an emulated ATmega2560 did."""

    answers: BoardAnswers
    clocks: NDArray[np.int64]
    """Shape (n,): from the window in 8 bits to the answer."""
    flash_bytes: int
    """Of a program that only classifies: network, run-time, and the chip's start."""
    ram_bytes: int
    """Its variables, a window of raw counts among them, and the deepest stack."""

    @property
    def milliseconds(self) -> float:
        """The slowest window at 16 MHz."""
        return 1000.0 * int(self.clocks.max()) / CLOCK_HZ


def without_board() -> str:
    """Return why no board can be emulated here; empty where one can."""
    if not HARNESS.is_dir():
        return "no emulator's program: it comes with a checkout, not with pip"
    libraries = _SIMAVR.is_dir()
    if libraries and all(shutil.which(tool) for tool in ("gcc", "avr-gcc", "avr-size")):
        return ""
    return f"no emulator: apt install {AVR_PACKAGES}"


def run_on_board(
    folder: Path, counts: NDArray[np.uint16], classes: int, options: tuple[str, ...] = ()
) -> OnBoard:
    """Return what the C says on an emulated ATmega2560, and what it takes.

    Args:
        folder: With the C.
        counts: Windows, shape (n, rows, columns), n ≥ 1; 25 a second or so are emulated.
        classes: How many there are.
        options: More of the compiler's, such as ("-DTAXEL_PLAIN_C",).

    Raises:
        BadInput: There is no emulator here, or a compiler refuses.
    """
    if missing := without_board():
        raise BadInput("an emulated ATmega2560", missing, "install it, or leave the figures out")
    with tempfile.TemporaryDirectory(prefix="taxel-") as scratch:
        elf, emulator = Path(scratch) / "windows.elf", Path(scratch) / "run_windows"
        _compile(["avr-gcc", *_AVR, *options, f"-I{folder}", "-o", str(elf),
                  str(HARNESS / "windows_avr.c"), str(folder / "taxel_cnn.c")])  # fmt: skip
        _compile(["gcc", "-O2", "-isystem", str(_SIMAVR), "-o", str(emulator),
                  str(HARNESS / "run_windows.c"), "-lsimavr", "-lelf"])  # fmt: skip
        sizes = _compile(["avr-size", str(elf)]).splitlines()[1].split()
        process = subprocess.run(
            [emulator, elf, str(counts[0].size), str(classes)],
            input=counts.astype("<u2").tobytes(), capture_output=True, check=False,
            timeout=_LONGEST_S,
        )  # fmt: skip
    lines = [line.split() for line in process.stdout.decode().splitlines()]
    rows = [line for line in lines if len(line) == 4 + classes and line[0].isdigit()]
    if process.returncode or len(rows) != len(counts):
        raise BadInput(
            f"answers for {number_of(len(counts), 'window')} from the emulator",
            f"{len(rows)} ({process.stderr.decode().strip()[-200:]})", "report this as a fault",
        )  # fmt: skip
    every = np.array(rows, np.int64)
    text, data, bss = (int(size) for size in sizes[:3])
    return OnBoard(
        answers=BoardAnswers(
            every[:, 0].astype(np.intp), every[:, 1].astype(np.uint8), every[:, 4:].astype(np.int32)
        ),
        clocks=every[:, 2],
        flash_bytes=text + data,
        ram_bytes=data + bss + int(every[:, 3].max()),
    )


def equal_windows(first: BoardAnswers, other: BoardAnswers) -> NDArray[np.bool_]:
    """Return which windows' answers are the same to the last bit, shape (n,)."""
    same = (first.best == other.best) & (first.confidence == other.confidence)
    found: NDArray[np.bool_] = same & (first.logits == other.logits).all(axis=1)
    return found


def _compile(command: list[str]) -> str:
    done = subprocess.run(command, capture_output=True, text=True, check=False, timeout=_LONGEST_S)
    if done.returncode:
        lines = (done.stderr.strip() or "no word").splitlines()
        error = next((line for line in lines if "error" in line), lines[0])
        raise BadInput(f"{command[0]} to compile the network", error, "report this as a fault")
    return done.stdout
