"""Read text layouts that are not plain tables, by a named function or one of the user's own.

A layout is a function `read(path) -> (values, time_s, names, units)`:

    values: shape (n, channels), numbers, oldest first
    time_s: shape (n,), seconds, increasing
    names, units: one a channel

Put one into LAYOUTS, or name your own as "module.py:function" in the column
`layout` of an import table: it is loaded only with --allow-code, because it
runs as you. Knows nothing about recordings.
"""

from __future__ import annotations

import importlib.util
from collections.abc import Callable, Sequence
from pathlib import Path
from types import ModuleType

import numpy as np
from numpy.typing import NDArray

from taxel.errors import BadFile, BadTable
from taxel.foreign.files import MIB, read_text
from taxel.plain_text import number_of

_LARGEST_BYTES = 8 * MIB
"""Of a text that is read as a whole; the longest grasp of the iCub's has 0.1 MB."""
LayoutReader = Callable[
    [Path], tuple[NDArray[np.float64], NDArray[np.float64], Sequence[str], Sequence[str]]
]

ICUB_FINGERS = ("thumb", "index", "middle", "ring", "little")
ICUB_TAXELS = 12
"""Taxels a fingertip (the data set's COPYRIGHT-AND-FORMAT.txt)."""
ICUB_JOINTS = tuple(range(7, 16))
"""Joints of the hand whose encoders are given (same source)."""
ICUB_STEP_S = 1.0
"""The files hold no times; steps are counted as if 1 s apart (docs/decisions/0004)."""


def read_icub(
    path: Path,
) -> tuple[NDArray[np.float64], NDArray[np.float64], tuple[str, ...], tuple[str, ...]]:
    """Read a grasp of the iCub Grasp Dataset: 60 taxels, 5 finger maxima, 9 joint encoders.

    Each step is seven lines: 9 encoders; the largest of (255 − taxel) for
    each finger; 12 taxels for each of five fingers. The first line of the file
    means nothing.

    Raises:
        BadTable: A line has another number of values, or a step is cut short.

    Source:
        Soh, Su, Demiris, IROS 2012; the data set's COPYRIGHT-AND-FORMAT.txt.
    """
    widths = (len(ICUB_JOINTS), len(ICUB_FINGERS), *[ICUB_TAXELS] * len(ICUB_FINGERS))
    rows = [_numbers(path, i, line) for i, line in enumerate(_lines(path), start=1)][1:]
    if not rows or len(rows) % len(widths):
        raise BadTable(
            f"steps of {number_of(len(widths), 'line')} after the first line",
            f"{number_of(len(rows), 'line')} in {path}",
            "copy the file again: it is cut short",
        )
    for i, row in enumerate(rows):
        if len(row) != widths[i % len(widths)]:
            raise BadTable(
                number_of(widths[i % len(widths)], "value"),
                f"{len(row)} in {path}, line {i + 2}",
                "copy the file again",
            )
    steps = [rows[i : i + len(widths)] for i in range(0, len(rows), len(widths))]
    values = np.array([np.concatenate([*step[2:], step[1], step[0]]) for step in steps])
    taxels = [f"{finger}_{i}" for finger in ICUB_FINGERS for i in range(1, ICUB_TAXELS + 1)]
    strongest = [f"{finger}_strongest" for finger in ICUB_FINGERS]
    names = (*taxels, *strongest, *(f"joint_{joint}" for joint in ICUB_JOINTS))
    units = ("count",) * (len(taxels) + len(strongest)) + ("deg",) * len(ICUB_JOINTS)
    time_s = np.arange(len(values), dtype=np.float64) * ICUB_STEP_S
    return values, time_s, names, units


LAYOUTS: dict[str, LayoutReader] = {"icub": read_icub}
"""Name in the column `layout` → its reader."""


def find_layout(name: str, folder: Path, allow_code: bool) -> LayoutReader:
    """Return the reader of a layout.

    Args:
        name: A key of LAYOUTS, or "module.py:function".
        folder: What a module's path is relative to.
        allow_code: Whether the user agreed to run the module.

    Raises:
        BadTable: There is no such layout, or code was not allowed.
    """
    if name in LAYOUTS:
        return LAYOUTS[name]
    file, colon, function = name.rpartition(":")
    if not colon or not file.endswith(".py"):
        raise BadTable(
            f"one of the layouts csv, {', '.join(LAYOUTS)}, or module.py:function",
            repr(name),
            "correct the column 'layout'",
        )
    if not allow_code:
        raise BadTable(
            "leave to run code", f"the layout {name}", "read the module, then add --allow-code"
        )
    reader = getattr(_load(folder / file), function, None)
    if not callable(reader):
        raise BadTable(f"a function {function} in {file}", "none", "correct the column 'layout'")
    found: LayoutReader = reader
    return found


def _load(path: Path) -> ModuleType:
    spec = importlib.util.spec_from_file_location(f"taxel_layout_{path.stem}", path)
    if spec is None or spec.loader is None or not path.is_file():
        raise BadTable("a Python module", f"{path}, which is not there", "check the path")
    module = importlib.util.module_from_spec(spec)
    try:
        spec.loader.exec_module(module)
    except Exception as error:  # a user's module may raise anything
        raise BadTable(
            "a module that can be loaded", f"{path}: {type(error).__name__}: {error}", "mend it"
        ) from error
    return module


def _lines(path: Path) -> list[str]:
    try:
        return [line for line in read_text(path, _LARGEST_BYTES).splitlines() if line.strip()]
    except (OSError, BadFile) as error:
        got = getattr(error, "got", error)
        raise BadTable("a text file that can be read", f"{path}: {got}", "check it") from error


def _numbers(path: Path, line: int, text: str) -> list[float]:
    try:
        return [float(word) for word in text.split()]
    except ValueError as error:
        raise BadTable("numbers", f"{path}, line {line}: {error}", "mend the file") from error
