"""Sheets of workbooks (.xlsx) as lines of text: cells separated by tabs, a line for each row.

A child (`sheet_child.py`) reads the file, for its XML may unpack to anything and openpyxl holds all
of its texts; the system ends it where its time or memory is spent. What it writes is a file without
a name, which is gone when this process ends. A path may name a sheet behind the file:
FILE.xlsx[SHEET]; else it is the first one that is not hidden. Knows nothing about tables.

Background of our choices: docs/decisions/0033.
"""

from __future__ import annotations

import codecs
import json
import os
import re
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path
from threading import Lock
from typing import IO, Any

from taxel.errors import BadFile, MissingExtra
from taxel.foreign.files import MIB, in_words, open_file
from taxel.plain_text import visible

ENDING = ".xlsx"
_SHEET = re.compile(r"(.*\.xlsx)\[([^\[\]]+)\]", re.IGNORECASE | re.DOTALL)
_CHILD = Path(__file__).with_name("sheet_child.py")
_LEAST_S, _LONGEST_S = 180.0, 1200.0
"""The parent's own clock, which ends a child that sleeps, for small files and for any."""
_BLOCK = MIB
_KEPT = 2
"""Sheets that are kept as text, at most 1 GiB each."""


def without_sheet(name: str) -> str:
    """Return a file's name, or path, without the sheet that stands behind it."""
    match = _SHEET.fullmatch(name)
    return match[1] if match else name


def file_behind(path: Path) -> Path:
    """Return the file of a path that may name a sheet of it."""
    return Path(without_sheet(str(path)))


def is_sheet(path: Path) -> bool:
    """Return whether a path names a workbook or a sheet of one."""
    return without_sheet(path.name).lower().endswith(ENDING)


def sheet_lines(path: Path, most: int) -> Iterator[str]:
    """Yield the rows of a sheet as lines without ends, all with as many tabs.

    Empty rows above the first that holds something are remarks, "#"; none stand at the end.

    Args:
        path: The workbook, or FILE.xlsx[SHEET].
        most: Bytes that the lines may have.

    Raises:
        BadFile: It is no whole workbook, has no such sheet, or takes too much time or memory.
        MissingExtra: openpyxl is not installed.
        OSError: It is not there, or may not be read.
    """
    sheet = _sheet_of(path)
    count, begun = 0, False
    for line in sheet.lines():
        cells = line.count("\t") + 1 if line else 0
        begun = begun or bool(line)
        padded = line + "\t" * (sheet.width - max(cells, 1)) if begun else "#"
        count += len(padded) + 1
        if count > most:
            raise BadFile(f"a sheet of at most {in_words(most)}", f"more in {path}",
                          "check that it is the file that you mean")  # fmt: skip
        yield padded


def sheet_names(path: Path) -> list[str]:
    """Return the names of a workbook's first sheets.

    Raises:
        BadFile: It is no whole workbook, or takes too much time or memory.
        MissingExtra: openpyxl is not installed.
        OSError: It is not there, or may not be read.
    """
    names: list[str] = _answer(path, [], subprocess.DEVNULL)["names"]
    return names


def chosen_of(path: Path) -> str:
    """Return which sheet is read where none is named and there are several; else nothing."""
    if _SHEET.fullmatch(path.name):
        return ""
    sheet = _sheet_of(path)
    others = [repr(name) for name in sheet.names if name != sheet.name][:3]
    more = " …" * (sheet.count > len(others) + 1)
    return f"{sheet.name!r}, not {', '.join(others)}{more}" if others else ""


@dataclass(slots=True)
class _Sheet:
    """A sheet's rows as text, in a file without a name."""

    file: IO[bytes]
    name: str
    names: list[str]
    count: int
    """Of the workbook's sheets."""
    width: int
    lock: Lock

    def lines(self) -> Iterator[str]:
        """Yield the lines; several may be read beside each other."""
        place, rest = 0, ""
        decoder = codecs.getincrementaldecoder("utf-8")()
        while True:
            with self.lock:
                self.file.seek(place)
                block = self.file.read(_BLOCK)
            if not block:
                return
            place += len(block)
            *whole, rest = (rest + decoder.decode(block)).split("\n")
            yield from whole

    def __del__(self) -> None:
        self.file.close()


_kept: dict[tuple[str, int, int, str], _Sheet] = {}
"""By path, size, time of change and sheet, the last one last."""


def _sheet_of(path: Path) -> _Sheet:
    """Return a sheet, read now or lately."""
    match = _SHEET.fullmatch(path.name)
    file, wanted = file_behind(path), match[2] if match else ""
    found = file.stat()
    key = (str(file.resolve()), found.st_size, found.st_mtime_ns, wanted)
    if key not in _kept:
        out = tempfile.TemporaryFile()  # noqa: SIM115  # closed by _Sheet
        try:
            heard = _answer(path, [wanted], out)
            sheet = _Sheet(file=out, name=heard["name"], names=heard["names"], count=heard["count"],
                           width=heard["width"], lock=Lock())  # fmt: skip
        except BaseException:
            out.close()
            raise
        while len(_kept) >= _KEPT:
            del _kept[next(iter(_kept))]
        _kept[key] = sheet
    return _kept[key]


def _answer(path: Path, wanted: list[str], out: IO[bytes] | int) -> dict[str, Any]:
    """Return what the child found; it writes a sheet's rows into a file."""
    file = file_behind(path)
    if find_spec("openpyxl") is None:
        raise MissingExtra("openpyxl", "xlsx", "Excel workbooks")
    with open_file(file) as opened:  # a plain file
        size = os.fstat(opened.fileno()).st_size
    # -P: the folder that the user stands in is nobody's package.
    child = subprocess.Popen(
        [sys.executable, "-P", str(_CHILD), os.path.abspath(file), *wanted],
        stdin=subprocess.DEVNULL, stdout=out, stderr=subprocess.PIPE,
    )  # fmt: skip
    try:
        _, heard = child.communicate(timeout=min(_LEAST_S + 100 * size / MIB, _LONGEST_S))
    except subprocess.TimeoutExpired:
        heard = b""
    finally:
        child.kill()
        child.wait()
        assert child.stderr is not None
        child.stderr.close()
    if child.returncode or not heard:
        raise BadFile("a workbook that can be read",
                      f"{path}, where it breaks off or takes too much time or 1 GiB of memory",
                      "save the sheet as CSV")  # fmt: skip
    found: dict[str, Any] = json.loads(heard)
    if "needed" in found:
        raise BadFile(found["needed"], f"{visible(found['got'])} in {path}", found["mend"])
    return found
