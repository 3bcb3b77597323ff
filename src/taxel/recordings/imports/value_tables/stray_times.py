"""Rows whose times lie far outside those of their neighbours, which increase: garbled stamps.

A line that lost bytes on its way holds such a time. It is no restart, and to sort the rows would
move it. Knows nothing about files or recordings.

Background of our choices: docs/decisions/0011.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from taxel.recordings.imports.value_tables.restarts import begins_anew, restarts_of

FAR = 10.0
"""Usual steps by which a time must lie outside those of its neighbours: rows in a wrong order do
by less. Source: our choice, docs/decisions/0011."""
_RARE = 0.25
"""Share of rows in which time may go back; above, the rows stand in another order. Source: our
choice, docs/decisions/0011."""
_MOST_ROWS = 2
"""Of such times one after another; more are a clock that was set. Source: our choice,
docs/decisions/0011."""


def strays_of(time_s: NDArray[np.float64], *, leaps: bool = False) -> list[range]:
    """Return the rows, from 0, whose times are strays, in lots that follow one another.

    In the first and the last row, which have one neighbour, time must go back; in the last, to
    where it does not begin anew.

    Args:
        time_s: Shape (n,), in any unit.
        leaps: Also a first or last row that lies further off than all others last together. Such
            a row may have been measured after a pause.
    """
    lots: list[range] = []
    with np.errstate(over="ignore", invalid="ignore"):  # not looked at before
        steps = np.diff(time_s)
        ahead, backs = steps[steps > 0], np.flatnonzero(steps < 0) + 1
        if len(backs) > _RARE * len(time_s) or len(ahead) <= len(backs):
            return []
        usual = np.median(np.sort(ahead)[: len(ahead) - len(backs)])  # without leaps to strays
        far = FAR * float(usual)
        for rows in _strays(time_s, backs, far):
            joined = lots and rows.start < lots[-1].stop  # seen as a single one before
            lots.append(range(lots.pop().start, rows.stop) if joined else rows)
        if (not lots or lots[0].start > 1) and _is_first_stray(time_s, far, leaps):
            lots.insert(0, range(1))
        last = len(time_s) - 1
        if (not lots or lots[-1].stop < last) and _is_last_stray(time_s, far, leaps):
            lots.append(range(last, last + 1))
    return lots


def _is_first_stray(time_s: NDArray[np.float64], far: float, leaps: bool) -> bool:
    step, below = time_s[1] - time_s[0], time_s[1:]
    if step > 0:
        return bool(leaps and step > max(far, below.max() - below[0]))
    return bool(-step > far and (below[:2] == np.sort(below[:2])).all())


def _is_last_stray(time_s: NDArray[np.float64], far: float, leaps: bool) -> bool:
    step, above = time_s[-1] - time_s[-2], time_s[:-1]
    if step > 0:
        return bool(leaps and step > max(far, above[-1] - above.min()))
    start = above[[0, *restarts_of(above)][-1]]
    alone = (above[-2:] == np.sort(above[-2:])).all()
    return bool(-step > far and alone and not begins_anew(time_s[-1], above[-1], start))


def _strays(time_s: NDArray[np.float64], backs: NDArray[np.intp], far: float) -> Iterator[range]:
    """Yield those that have two neighbours, around the rows in which time goes back."""
    seen = 0
    for back in backs.tolist():
        if back <= seen:  # back from the stray that is known, or within it
            continue
        for rows in _lots(back, len(time_s)):
            if _are_strays(time_s, rows, far) and not _below(time_s, rows.stop, far):
                yield rows
                seen = rows.stop
                break


def _are_strays(time_s: NDArray[np.float64], rows: range, far: float) -> bool:
    """Return whether the times around some rows increase, and all of theirs lie far outside."""
    if rows.stop >= len(time_s):
        return False
    above, below = time_s[rows.start - 1], time_s[rows.stop]
    own = time_s[rows.start : rows.stop]
    return bool(above < below and np.maximum(own - below, above - own).min() > far)


def _below(time_s: NDArray[np.float64], start: int, far: float) -> bool:
    """Return whether the rows from one on are strays: then the row above them may be a restart."""
    lots = (range(start, start + many) for many in range(1, _MOST_ROWS + 1))
    return any(_are_strays(time_s, rows, far) for rows in lots)


def _lots(back: int, count: int) -> Iterator[range]:
    """Yield the rows that may be strays where time goes back in a row, the fewest first."""
    for many in range(1, _MOST_ROWS + 1):
        for start in range(back - many, back + 1):
            if start >= 1 and start + many < count:
                yield range(start, start + many)


def strays_in_words(
    time_s: NDArray[np.float64],
    strays: Sequence[range],
    first_line: int,
    path: Path | str,
    line: str = "line",
) -> str:
    """Return where the first of some strays stands, between which times, and how many there are.

    Args:
        time_s: Shape (n,), seconds.
        strays: As `strays_of` returns them; at least one.
        first_line: Number of the line that holds the first time.
        path: The file, for messages.
        line: What stands before that number, as in `check_time`.
    """
    rows, count = strays[0], sum(map(len, strays))
    own = " and ".join(f"{time_s[row]:.14g} s" for row in rows)
    lines = " and ".join(str(row + first_line) for row in rows)
    beside = []
    if rows.start > 0:
        beside.append(f"{time_s[rows.start - 1]:.14g} s above")
    if rows.stop < len(time_s):
        beside.append(f"{time_s[rows.stop]:.14g} s below")
    where = "between" if len(beside) > 1 else "beside"
    more = f", the first of {count} such rows" if count > len(rows) else ""
    return (
        f"{own} in {path}, {line if len(rows) == 1 else f'{line}s'} {lines}, {where} "
        f"{' and '.join(beside)}{more}"
    )
