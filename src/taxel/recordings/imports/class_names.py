"""Labels that are numbers of classes, and the list that names these classes: from:objects[y].

Knows nothing about files or axes.

Background of our choices: docs/decisions/0011.
"""

from __future__ import annotations

from collections.abc import Sequence

from taxel.errors import BadTable
from taxel.plain_text import number_of, visible

MOST_SHOWN = 8
"""Classes in a note. Source: our choice."""


def named_classes(
    numbers: Sequence[str], names: Sequence[str], first: int, cell: str, where: str
) -> list[str]:
    """Return the name of each trial's class.

    Args:
        numbers: Each trial's number, as text.
        names: What the classes are called, in the order of their numbers.
        first: The first class's number, 0 or 1.
        cell: The table's cell, for messages.
        where: Table and line, for messages.

    Raises:
        BadTable: A value is no number of a class, or two classes have one name.
    """
    if len(set(names)) < len(names):
        again = next(name for name in names if names.count(name) > 1)
        raise BadTable(
            "a name of its own for each class", f"{again[:80]!r} twice by {cell[:80]!r} in {where}",
            "name the array in which each class stands once, in the order of the numbers",
        )  # fmt: skip
    places = {str(number): name for number, name in enumerate(names, start=first)}
    odd = next((number for number in numbers if number not in places), None)
    if odd is not None:
        counted = cell.replace("]", "-1]") if first == 0 else cell.replace("-1]", "]")
        others = {str(number) for number in range(1 - first, 1 - first + len(names))}
        fits = others.issuperset(numbers)
        raise BadTable(
            f"numbers of classes from {first} to {first + len(names) - 1}, for "
            f"{number_of(len(names), 'name')}",
            f"{odd[:80]!r} of trial {numbers.index(odd) + 1} by {cell[:80]!r} in {where}",
            f"write {counted[:80]} if they count from {1 - first}, or name another array" if fits
            else "leave out trials without a class, or name another array",
        )  # fmt: skip
    return [places[number] for number in numbers]


def remark_on(numbers: Sequence[str], names: Sequence[str], first: int, cell: str) -> str:
    """Return which number was taken for which class, and whether the first one never comes."""
    classes = [f"{number} is {visible(name)}" for number, name in enumerate(names, start=first)]
    more = f" and {len(classes) - MOST_SHOWN} more" if len(classes) > MOST_SHOWN else ""
    doubt = (
        "; no trial has the number 0: if the numbers count from 1, write "
        f"{visible(cell.replace(']', '-1]'))}"
        if first == 0 and "0" not in numbers
        else ""
    )
    return f"{visible(cell)}: {', '.join(classes[:MOST_SHOWN])}{more}{doubt}"
