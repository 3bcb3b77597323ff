"""Names in the order in which people count: cup_2 before cup_10.

The one place where this is decided, offline and live. Knows nothing about files or trials.

Background of our choices: docs/decisions/0061.
"""

from __future__ import annotations

import re

Part = str | tuple[int, str]
"""Text between numbers; or a number, as how many digits it has and which."""


def counting_order(name: str) -> tuple[tuple[Part, ...], str]:
    """Return a sorting key by which the numbers in names count as numbers.

    Names that differ in leading zeros alone are ordered as text, so that no two are equal.
    """
    parts = re.split(r"([0-9]+)", name)
    counted = [_number(part) if place % 2 else part for place, part in enumerate(parts)]
    return tuple(counted), name


def _number(digits: str) -> Part:
    """Return a whole number of any length, for comparison."""
    known = digits.lstrip("0")
    return len(known), known
