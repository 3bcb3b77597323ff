"""Which commands build a sketch and write it to a board, with the tools that are there.

Only makes command lines; runs none. Knows nothing about ports or what boards say.
"""

from __future__ import annotations

import re
import shutil
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

from taxel.errors import BadInput

SKETCHES = ("teng_daq", "hand_control")
"""What lies in firmware/: the sensor board, the hand's controller."""
_LARGEST_BINARY_BYTES = 4_000_000
_VERSION = re.compile(r"\.firmware\s*=\s*\{\s*(\d+)\s*,\s*(\d+)\s*,\s*(\d+)\s*\}")
_TO_BUILD_BY_HAND = ("make", "avr-gcc", "avr-objcopy")


@dataclass(frozen=True, slots=True, kw_only=True)
class BoardKind:
    """What the tools must know of a board."""

    fqbn: str
    """Its name for arduino-cli."""
    part: str
    """Its chip for avrdude."""
    programmer: str
    """The protocol of its boot loader."""
    baud: int
    """Of the boot loader, bits a second."""
    usb: tuple[str, ...]
    """Vendor and product numbers under which it appears."""


BOARDS = {
    "mega": BoardKind(
        fqbn="arduino:avr:mega:cpu=atmega2560",
        part="atmega2560",
        programmer="wiring",
        baud=115_200,
        usb=("2341:0042", "2341:0010", "2341:0242", "2a03:0010", "2a03:0042"),
    ),
}
"""Source: boards.txt of the Arduino AVR core, board mega."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Sketch:
    """The sketch, or the built file, that is written to a board."""

    path: Path
    """A sketch's folder, or a built file (.hex, .elf)."""
    built: bool
    """It is a built file."""
    version: tuple[int, int, int] | None
    """What its hello will say; None where that cannot be read off."""


def find_sketch(name: str, firmware: Path | None) -> Sketch:
    """Return the sketch of a name, of a folder, or a built file.

    Args:
        name: One of `SKETCHES`, a path to a sketch's folder, or to a .hex or .elf file.
        firmware: The firmware folder; where taxel's repository has it unless given.

    Raises:
        BadInput: There is no such thing.
    """
    path = Path(name)
    if path.suffix in (".hex", ".elf"):
        if not path.is_file() or not 0 < path.stat().st_size <= _LARGEST_BINARY_BYTES:
            raise BadInput("a built sketch (.hex, .elf)", f"{path}, which is not one", "build it")
        return Sketch(path=path, built=True, version=None)
    if name in SKETCHES or not path.is_dir():
        path = (firmware or _own_firmware()) / name
    if not (path / f"{path.name}.ino").is_file():
        raise BadInput(
            f"{' or '.join(SKETCHES)}, a sketch's folder, or a .hex file",
            f"{name!r}: no {path / (path.name + '.ino')}",
            "name the folder of the firmware with --firmware",
        )
    return Sketch(path=path, built=False, version=_version(path))


def _own_firmware() -> Path:
    """Return the repository's firmware folder, seen from here or from the working folder."""
    beside = Path(__file__).resolve().parents[4] / "firmware"
    return beside if beside.is_dir() else Path("firmware")


def _version(folder: Path) -> tuple[int, int, int] | None:
    for file in sorted(folder.glob("*.c")) + sorted(folder.glob("*.ino")):
        found = _VERSION.search(file.read_text(encoding="utf-8", errors="replace"))
        if found:
            major, minor, patch = map(int, found.groups())
            return major, minor, patch
    return None


def commands(
    kind: BoardKind,
    sketch: Sketch,
    port: str,
    build: Path,
    defines: Sequence[str] = (),
    tool: str = "auto",
    which: Callable[[str], str | None] = shutil.which,
) -> list[list[str]]:
    """Return the commands that build and upload, in order.

    Args:
        kind: The board.
        sketch: What to write.
        port: Where the board is.
        build: A folder for what is built.
        defines: Settings for the compiler, NAME=VALUE.
        tool: arduino-cli, avrdude, or auto: the first of them that is there.
        which: Finds a program; tests give their own.

    Raises:
        BadInput: No tool is there, or not what this sketch needs.
    """
    there = [name for name in ("arduino-cli", "avrdude") if which(name)]
    if tool != "auto":
        there = [name for name in there if name == tool]
    if not there:
        raise BadInput(
            f"{'arduino-cli or avrdude' if tool == 'auto' else tool} to write to a board",
            "none on this machine",
            "install one: apt install avrdude, or arduino.github.io/arduino-cli",
        )
    if sketch.built and defines:
        raise BadInput("settings with a sketch that is built here", "a built file", "drop them")
    if there[0] == "arduino-cli" and not (sketch.built and sketch.path.suffix == ".elf"):
        return _arduino_cli(kind, sketch, port, build, defines)
    if "avrdude" not in there:
        raise BadInput("a .hex file for arduino-cli", str(sketch.path), "or install avrdude")
    return _avrdude(kind, sketch, port, build, defines, which)


def _arduino_cli(
    kind: BoardKind, sketch: Sketch, port: str, build: Path, defines: Sequence[str]
) -> list[list[str]]:
    upload = ["arduino-cli", "upload", "--fqbn", kind.fqbn, "--port", port]
    if sketch.built:
        return [[*upload, "--input-file", str(sketch.path)]]
    compiling = ["arduino-cli", "compile", "--fqbn", kind.fqbn]
    libraries = sketch.path.parent / "libraries"
    if libraries.is_dir():
        compiling += ["--libraries", str(libraries)]
    if defines:
        flags = " ".join(f"'-D{flag}'" for flag in defines)
        for language in ("c", "cpp"):
            compiling += ["--build-property", f"compiler.{language}.extra_flags={flags}"]
    compiling += ["--output-dir", str(build), str(sketch.path)]
    return [compiling, [*upload, "--input-dir", str(build), str(sketch.path)]]


def _avrdude(
    kind: BoardKind,
    sketch: Sketch,
    port: str,
    build: Path,
    defines: Sequence[str],
    which: Callable[[str], str | None],
) -> list[list[str]]:
    steps: list[list[str]] = []
    binary = sketch.path
    if not sketch.built:
        firmware, name = sketch.path.parent, sketch.path.name
        missing = [program for program in _TO_BUILD_BY_HAND if not which(program)]
        if missing or not (firmware / "Makefile").is_file() or name not in SKETCHES:
            raise BadInput(
                f"arduino-cli, or a built .hex file, to flash {name}",
                f"avrdude alone{', without ' + ', '.join(missing) if missing else ''}",
                "install arduino-cli, or apt install make gcc-avr avr-libc arduino-core-avr",
            )
        # The Makefile's own variants differ in settings only; the first sensor board's are
        # replaced by those that are asked for.
        variant = "teng_daq_0" if name == "teng_daq" else name
        binary = build / f"{variant}.elf"
        settings = " ".join(f"'-D{flag}'" for flag in defines)
        steps.append(["make", "-C", str(firmware), f"BUILD={build}", f"SET_{variant}={settings}",
                      str(binary)])  # fmt: skip
    if binary.suffix == ".elf":
        hex_file = build / f"{binary.stem}.hex"
        steps.append(["avr-objcopy", "-O", "ihex", "-R", ".eeprom", str(binary), str(hex_file)])
        binary = hex_file
    steps.append(
        ["avrdude", "-p", kind.part, "-c", kind.programmer, "-P", port, "-b", str(kind.baud),
         "-D", "-U", f"flash:w:{binary}:i"]
    )  # fmt: skip
    return steps
