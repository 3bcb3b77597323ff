"""Which arrays of a file hold trials: one, those of cells, or those whose names fit a pattern.

Knows nothing about axes, channels or labels.

Background of our choices: docs/decisions/0011.
"""

from __future__ import annotations

import re
from dataclasses import dataclass

from taxel.errors import BadTable
from taxel.foreign.held_arrays import Cells, Numbers, table_of
from taxel.plain_text import visible
from taxel.recordings.imports.spelling import by_numbers
from taxel.recordings.imports.trial_sets import AND, MOST_TRIALS, OpenedFile

STAR = "*"
"""In a name: anything but a slash, a point or an @."""
_ANYTHING = r"([^/.@]*)"


@dataclass(frozen=True, slots=True)
class Member:
    """One array of a file: it holds one trial, or the stack of all trials."""

    name: str
    cell: int | None
    """Which of an array's cells it is; None for the array itself."""
    stars: tuple[str, ...]
    """What stands for each * of the pattern."""

    def fill(self, pattern: str, trials: str) -> str:
        """Return a pattern with this member's own words in the places of its stars.

        Args:
            pattern: With as many stars as the trials'; or with fewer, if it is the same up to its
                last one: subject*@age for subject*/trial_*.
            trials: The pattern of the trials.

        Raises:
            BadTable: It has another number of stars.
        """
        parts = pattern.split(STAR)
        count = len(parts) - 1
        same = trials.startswith(pattern[: pattern.rfind(STAR) + 1])
        if count != len(self.stars) and not (count < len(self.stars) and same):
            raise BadTable(
                f"as many * as in the column 'trials', {len(self.stars)}, or its first part",
                f"{count} in {pattern!r}", "correct it",
            )  # fmt: skip
        return "".join(map("".join, zip(parts, (*self.stars[:count], ""), strict=True)))


def only_array(file: OpenedFile) -> str:
    """Return the name of the only array that may hold trials: numbers of three axes, or cells.

    Raises:
        BadTable: There is none, or there are several.
    """
    names = file.opened().names()
    found = list(names) if len(names) == 1 else [name for name in names if _fits(file, name)]
    if len(found) != 1:
        raise BadTable(
            "the name of the array of trials",
            f"none in the table, where {file.path} holds {table_of(file.opened())}",
            "write it in the column 'trials'",
        )  # fmt: skip
    return found[0]


def _fits(file: OpenedFile, name: str) -> bool:
    try:
        held = file.get(name)
    except BadTable:  # of a kind that is not taken
        return False
    if isinstance(held, Cells):
        return all(isinstance(item, Numbers) and min(item.shape) > 1 for item in held.items)
    return isinstance(held, Numbers) and len(held.shape) > 2


def members_of(file: OpenedFile, what: str) -> list[Member]:
    """Return the arrays of the trials, in the order of their names; of cells, in the file's.

    Args:
        file: The file.
        what: The array's name, or a pattern.

    Raises:
        BadTable: There is none, or there are too many, or several would have to be joined.
    """
    _refuse_joined(file, what)
    found: list[Member] = []
    for name, stars in _matching(file, what):
        held = file.get(name)
        cells = range(len(held.items)) if isinstance(held, Cells) else [None]
        found += [Member(name, cell, stars) for cell in cells]
    if not 1 <= len(found) <= MOST_TRIALS:
        raise BadTable(
            f"between 1 and {MOST_TRIALS:,} arrays {visible(what)}",
            f"{len(found):,}, where {file.path} holds {table_of(file.opened())}",
            "correct the column 'trials'",
        )  # fmt: skip
    return found


def _refuse_joined(file: OpenedFile, what: str) -> None:
    """Refuse several arrays as one, F0+F1, as a text may have several columns that mark trials."""
    parts = [part.strip() for part in what.split(AND)]
    if len(parts) < 2 or what in file.opened().names():
        return
    known = [_matching(file, part) for part in parts]
    if all(matches and matches[0][0] in file.opened().names() for matches in known):
        raise BadTable(
            f"one array of trials in the column 'trials', as no arrays are joined (in {file.path})",
            f"{len(parts)}, {visible(what)}",
            "save one array that holds the channels of all, as numpy.concatenate joins them along "
            "the axis of channels, or name one of them",
        )  # fmt: skip


def numbers_of(file: OpenedFile, member: Member) -> Numbers:
    """Return a member's array.

    Raises:
        BadTable: It does not hold real numbers.
    """
    held = file.get(member.name)
    if isinstance(held, Cells) and member.cell is not None:
        held = held.items[member.cell]
    if not isinstance(held, Numbers) or held.dtype.kind not in "biuf":
        raise BadTable(
            f"real numbers in {visible(member.name) or 'the array'}",
            f"{held} in {file.path}",
            "name another array; of complex numbers save the real part or the amplitude",
        )
    return held


def _matching(file: OpenedFile, what: str) -> list[tuple[str, tuple[str, ...]]]:
    names = file.opened().names()
    if STAR not in what or what in names:
        return [(what, ())]
    pattern = re.compile(_ANYTHING.join(map(re.escape, what.split(STAR))))
    matches = [match for name in names if (match := pattern.fullmatch(name))]
    return sorted(
        ((match[0], match.groups()) for match in matches), key=lambda pair: by_numbers(pair[0])
    )
