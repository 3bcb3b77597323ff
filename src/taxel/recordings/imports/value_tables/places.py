"""Where the wanted columns stand among a file's: by name, or by number from 1.

Knows nothing about how a file is read.

Background of our choices: docs/decisions/0011.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from taxel.errors import BadTable
from taxel.recordings.imports.value_tables.table_form import is_whole

_MOST_PLACES = 6
"""Columns of one name that a message counts up. Source: our choice, docs/decisions/0011."""


def places_of(path: Path, names: Sequence[str], wanted: Sequence[str], what: str) -> list[int]:
    """Return where each wanted name stands, from 0; a number counts columns where no name is one.

    Where a name is a whole number, a second meaning of numbers would take another column unseen.

    Args:
        path: For messages.
        names: Of all columns, in order.
        wanted: Names, or numbers from 1.
        what: The file's columns, for messages.

    Raises:
        BadTable: There is no such column, or there are several of that name.
    """
    counted = not any(map(is_whole, names))
    found: dict[str, int] = {}
    twice: set[str] = set()
    for index, name in enumerate(names):
        if found.setdefault(name, index) != index:
            twice.add(name)
    for name in wanted:
        if name in twice:
            raise _several(path, name, names, what, counted=counted)
        if name not in found:
            index = as_number(name) if counted else 0
            if not 1 <= index <= len(names):
                longer = _longer_name(name, names) if counted else 0
                raise _no_column(path, name, "no such column", what, longer)
            found[name] = index - 1
    return [found[name] for name in wanted]


def place_by_number(path: Path, name: str, columns: int) -> int:
    """Return the place, from 0, of a column of a file that has no names.

    Raises:
        BadTable: It is no number from 1 to that of the columns.
    """
    index = as_number(name)
    if not 1 <= index <= columns:
        raise BadTable(
            f"columns by their numbers, 1 to {columns}: no names are in {path}", repr(name[:80]),
            "write channels as 1[N] 2[N] in the import table",
        )  # fmt: skip
    return index - 1


def as_number(name: str) -> int:
    """Return the number, from 1, that a column is called by; 0 where its name is none."""
    return int(name) if is_whole(name) and len(name) < 10 else 0


def _longer_name(name: str, names: Sequence[str]) -> int:
    """Return the number of the only column called so with a unit or words behind, else 0."""
    found = [number for number, own in enumerate(names, start=1)
             if own.startswith(name) and own[len(name)] in " [("]  # fmt: skip
    return found[0] if len(found) == 1 else 0


def _no_column(path: Path, name: str, problem: str, what: str, longer: int) -> BadTable:
    mend = "correct it"
    if longer:
        mend = f"write its number, {longer}, since its name holds blanks or brackets"
    if is_whole(name) and what.startswith("a header"):
        mend = "write a name as it stands there; if line 1 holds values, put names above it"
    return BadTable(f"the column {name[:80]!r}", f"{problem} in {path} ({what})", mend)


def _several(path: Path, name: str, names: Sequence[str], what: str, *, counted: bool) -> BadTable:
    """Return the error of a name that several columns have: it says which."""
    places = [number for number, own in enumerate(names, start=1) if own == name]
    shown = ", ".join(map(str, places[:_MOST_PLACES])) + (" …" if places[_MOST_PLACES:] else "")
    mend = "rename all but one of them in the file"
    if counted:
        mend = f"write the number of the one that is meant, such as {places[0]}, or {mend}"
    return BadTable(
        f"the column {name[:80]!r}",
        f"{len(places)} columns of that name in {path}, columns {shown} ({what})", mend,
    )  # fmt: skip


def some_names(names: Sequence[str]) -> str:
    """Return the first twelve names, and how many more there are."""
    named = [name for name in names if name]
    more = f" and {len(named) - 12} more" if len(named) > 12 else ""
    return ", ".join(name[:40] for name in named[:12]) + more
