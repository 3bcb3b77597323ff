"""Which of an array's channels are taken, and what they are called.

An array has no names of its own: its channels are called by their numbers from 1, in a grid by row
and column (r1c1), or by as many names of one's own as there are channels. Knows nothing about
files.

Background of our choices: docs/decisions/0011.
"""

from __future__ import annotations

import re
from collections.abc import Sequence

from taxel.errors import BadTable
from taxel.plain_text import number_of
from taxel.recordings.imports.value_tables.tables import ALL, MOST_CHANNELS, Column

_OWN = re.compile(r"\d+(_\d+)?|(r\d+)?(c\d+)?(_\d+){0,2}")
"""What arrays call their channels."""


def channel_counts(columns: Sequence[Column], with_time: bool) -> range:
    """Return how many channels an array may have, by what the table calls them.

    Args:
        columns: The table's column `channels`.
        with_time: Whether one of the array's channels is time.
    """
    names = [column.name for column in columns]
    if all(name.isdecimal() and len(name) < 6 for name in names):
        return range(max(1, *map(int, names)), MOST_CHANNELS + 1)
    if names == [ALL] or all(map(_OWN.fullmatch, names)):
        return range(1, MOST_CHANNELS + 1)
    count = len(names) + int(with_time)
    return range(count, count + 1)


def take_channels(
    columns: Sequence[Column], names_in_file: Sequence[str], time: str, where: str
) -> tuple[list[int], list[Column], int | None]:
    """Return which of an array's channels are wanted, what they are called, and which is time.

    Args:
        columns: The table's column `channels`.
        names_in_file: What the array calls its channels.
        time: The channel that holds time, by the array's name; or empty.
        where: Table and line, for messages.

    Raises:
        BadTable: A name is none of the array's, or there are too many or too few.
    """
    places = {name: place for place, name in enumerate(names_in_file)}
    if time and time not in places:
        raise BadTable(
            f"a channel that holds time ({_range(names_in_file)}), or from: and an array of times",
            f"{time[:80]!r} in {where}, column 'time'",
            "write from: in front of it if arrays have that name, or a rate, as in rate:100Hz",
        )
    time_place = places.get(time) if time else None
    rest = [place for place in range(len(names_in_file)) if place != time_place]
    names = [column.name for column in columns]
    if names == [ALL]:
        return (
            rest,
            [Column(name=names_in_file[at], unit=columns[0].unit) for at in rest],
            time_place,
        )
    if all(name in places for name in names):
        return [places[name] for name in names], list(columns), time_place
    if len(names) == len(rest) and not any(n in places or n.isdecimal() for n in names):
        return rest, list(columns), time_place
    raise _no_channels([name for name in names if name not in places], names_in_file, where)


def _no_channels(odd: Sequence[str], own: Sequence[str], where: str) -> BadTable:
    return BadTable(
        f"channels by what the array calls them, {_range(own)}, or "
        f"{number_of(len(own), 'name')} of your own",
        f"{odd[0][:80]!r} in {where}", f"correct it, or write {ALL}[UNIT] for all of them",
    )  # fmt: skip


def _range(own: Sequence[str]) -> str:
    return f"{own[0]} to {own[-1]}" if len(own) > 1 else own[0]
