"""Dates with times, and times of day, as loggers write them into tables: seconds from texts.

Read are ISO 8601, `2024-03-01T12:00:00.250Z`, also with a blank for the T and without an offset,
as ROS writes them, `2024/03/01/12:00:00.250` and `2024/03/01 12:00:00.250`, and times of day,
`12:00:00.250`. Nothing else is: whether 03/04 is in March or April is not certain. Knows nothing
about tables' forms or recordings.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from datetime import UTC, datetime, time
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from taxel.errors import BadTable

_SHORTEST = len("12:00")
"""Characters; a number such as 20240301 would be read as a date."""
_SLASHES = re.compile(r"^([0-9]{4})/([0-9]{2})/([0-9]{2})[/ T](?=[0-9])")
"""What stands before the time of a stamp whose year comes first."""


def is_stamp(cell: str) -> bool:
    """Return whether a cell is a date with a time, or a time of day."""
    return stamp_s(cell) is not None


def seconds_of(path: Path, cells: Sequence[str], name: str, first_line: int) -> NDArray[np.float64]:
    """Return a column of time stamps as seconds, shape (rows,): since 1970 in UTC, or midnight.

    Stamps without an offset count as UTC: only differences matter. Digits beyond microseconds are
    left out.

    Args:
        path: For messages.
        cells: The stamps.
        name: Of their column.
        first_line: Number of the first one's line.

    Raises:
        BadTable: A cell is no time stamp; says line and column.
    """
    times_s = np.empty(len(cells))
    for row, cell in enumerate(cells):
        seconds = stamp_s(cell)
        if seconds is None:
            raise BadTable(
                "a time stamp such as 2024-03-01T12:00:00.250, 2024-03-01 12:00:00.250, "
                "2024/03/01/12:00:00.250 or 12:00:00.250",
                f"{cell[:80]!r} in {path}, line {row + first_line}, column {name[:80]!r}",
                "write times so, or as seconds, or give a rate instead of a time column",
            )
        times_s[row] = seconds
    return times_s


def stamp_s(cell: str) -> float | None:
    """Return a time stamp as `seconds_of` does; None where it is none."""
    text = _SLASHES.sub(r"\1-\2-\3T", cell.strip(), count=1)
    if len(text) < _SHORTEST or ":" not in text:
        return None
    try:
        if "-" not in text[1:]:
            own = time.fromisoformat(text)
            return own.hour * 3600 + own.minute * 60 + own.second + own.microsecond * 1e-6
        stamp = datetime.fromisoformat(text)
        return (stamp if stamp.tzinfo else stamp.replace(tzinfo=UTC)).timestamp()
    except (ValueError, OverflowError):
        return None
