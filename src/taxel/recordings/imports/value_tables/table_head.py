"""Lines that stand around a table's names, as instruments write them: a head above, units below.

A head is passed over only where the table names columns, and one line alone can be the line of
their names. Knows nothing about numbers of columns, times or recordings.

Background of our choices: docs/decisions/0011.
"""

from __future__ import annotations

import csv
import re
from collections.abc import Callable, Collection, Iterator, Sequence
from itertools import chain, islice

MOST_ABOVE = 200
"""Lines of a head. LabVIEW and force plates write some 20 to 60. Source: our choice."""
_HINT = re.compile(r'"?sep=."?')
"""Excel's own first line, which says what separates."""
NO_VALUE = frozenset(("na", "n/a", "#n/a", "<na>", "null", "none", "ol", "ovld", "overload"))
"""Cells without a value, in small letters, beside NaN: what R, Excel and SQL write, and what
pandas.read_csv takes for it; and what meters write for a value beyond their range."""
_NO_UNITS = NO_VALUE | {"nan", "missing", "#value!"}
"""Words that stand for a missing value, so that their line is one of values. Our choice."""
_LONGEST_UNIT = 16
"""Characters, brackets included. Source: our choice."""


def below_head(lines: Iterator[str], wanted: Collection[str]) -> tuple[int, Iterator[str]]:
    """Return how many lines stand above that of the names, and the lines from there on.

    Nothing is passed over unless one of the first lines holds all of the wanted names, and none
    above it does; Excel's `sep=;` always is.

    Args:
        lines: Without their ends.
        wanted: Names of columns; numbers of columns name no line.
    """
    held = list(islice(lines, MOST_ABOVE))
    first = 1 if held and _HINT.fullmatch(held[0].strip()) else 0
    names = {name for name in wanted if not (name.isascii() and name.isdecimal())}
    for number, line in enumerate(held[first:] if names else (), start=first):
        if line.lstrip().startswith("#"):
            continue  # a remark may hold the names, too: table_form.py looks there
        if any(names <= set(_words(line, separator)) for separator in ",;\t "):
            return number, chain(held[number:], lines)
    return first, chain(held[first:], lines)


def holds_units(
    second: Sequence[str], third: Sequence[str], is_value: Callable[[str], bool]
) -> bool:
    """Return whether the line below the names holds units, not values.

    It does where none of its cells is a value, one looks like a unit at least, and the line below
    it, of as many cells, is numbers for the most part.

    Args:
        second: Cells of the line below the names.
        third: Cells of the line below that.
        is_value: Whether a cell is a number.
    """
    words = [cell.strip().lower() for cell in second]
    values = sum(map(is_value, third))
    return (
        len(second) == len(third) > 1
        and not any(is_value(word) or word in _NO_UNITS for word in words)
        and any(0 < len(word) <= _LONGEST_UNIT for word in words)
        and 2 * values >= len(third)
    )


def _words(line: str, separator: str) -> list[str]:
    if separator == " ":
        return line.split()
    if '"' not in line:
        return [word.strip() for word in line.split(separator)]
    try:
        return [word.strip() for word in next(csv.reader((line,), delimiter=separator))]
    except csv.Error:
        return []
