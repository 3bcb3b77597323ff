"""The units that a text of numbers states itself, in its names or in the line below them.

The import table's units are kept: a file that says something else is noted, never converted.
Knows nothing about how a file is read.

Background of our choices: docs/decisions/0011.
"""

from __future__ import annotations

import re
from collections.abc import Sequence

from taxel.plain_text import visible

_IN_BRACKETS = re.compile(r"[\[(]\s*([^\[\]()]{1,12}?)\s*[\])]\s*$")
"""A unit at the end of a name, as in "Force [mN]"."""
_WORDS = {
    "sec": "s", "secs": "s", "second": "s", "seconds": "s", "msec": "ms", "usec": "us",
    "newton": "N", "newtons": "N", "volt": "V", "volts": "V", "counts": "count", "kohm": "kohm",
    "ohms": "ohm", "degrees": "deg",
}  # fmt: skip
_KNOWN = frozenset(
    (
        *(prefix + base for base in ("N", "Pa", "V", "s", "Hz", "ohm")
          for prefix in ("p", "n", "u", "m", "", "k", "M", "G")),
        *("pA", "nA", "uA", "mA", "pF", "nF", "uF", "um", "mm", "cm", "mg", "kg"),
        *("min", "h", "bar", "mbar", "psi", "deg", "rad", "count"),
    )
)  # fmt: skip
"""Units that are compared. One letter alone that often numbers sensors, such as A, is none of them.
Source: our choice."""
_MOST_SHOWN = 3
"""Columns that a note names."""


def stated_in(name: str, below: str = "") -> str:
    """Return the unit that a text states for a column; empty where it states none.

    Args:
        name: The column's name, such as "Force [mN]".
        below: The cell below it, where that line holds units.
    """
    bracketed = _IN_BRACKETS.search(name)
    return bracketed[1] if bracketed else below.strip().strip("[]() ")


def other_units(stated: Sequence[tuple[str, str]], units: Sequence[str]) -> str:
    """Return which columns have another unit in the file than in the import table; or nothing.

    Args:
        stated: Each column's name in the file, and the unit that the file states, or nothing.
        units: Of the same columns, as the import table says.
    """
    odd = []
    for (name, own), unit in zip(stated, units, strict=True):
        of_file, of_table = _known(own), _known(unit)
        if of_file and of_table and of_file != of_table:
            odd.append(f"{visible(own)} instead of {visible(unit)} for {visible(name)}")
    return ", ".join(odd[:_MOST_SHOWN]) + (" …" * (len(odd) > _MOST_SHOWN))


def _known(unit: str) -> str:
    """Return a unit in one spelling; empty where it is none of those that are compared."""
    plain = unit.strip().replace("\u00b5", "u").replace("\u03bc", "u")
    plain = plain.replace("\u2126", "ohm").replace("\u03a9", "ohm").replace("Ohm", "ohm")
    plain = _WORDS.get(plain.lower(), plain)
    return plain if plain in _KNOWN else ""
