"""Whether the times of rows can be those of scans: they increase from row to row.

Rows whose time is garbled, or repeats that of the row above, may be left out, where these are few.
Knows nothing about how files are read.

Background of our choices: docs/decisions/0011.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from taxel.errors import BadTable
from taxel.plain_text import number_of
from taxel.recordings.imports.value_tables.restarts import RESTARTS, restarts_of
from taxel.recordings.imports.value_tables.stray_times import strays_in_words, strays_of
from taxel.recordings.scan_layout import FURTHEST_S

OnBadTime = Literal["refuse", "drop"]
"""What happens to rows with a time that cannot be a scan's: an error, or they are left out."""

MOST_DROPPED = 0.05
"""Share of a file's rows (or a trial's) that may be left out because their times repeat, and once
more because they are garbled, but a row in any case: where more repeat, the clock is too coarse
for the scans; where more are garbled, no time is certain. Source: our choice,
docs/decisions/0011."""
LARGEST_RATE_HZ = 1e9
"""Scans a second; more is a wrong unit. Source: our choice."""
_INCREASING = "times that increase from row to row"
_MEND_UNIT = "correct the column's unit: s, ms, us or ns"
_DAY_S = 86_400.0
"""A day, seconds."""
_COUNTERS_S = (2**32 * 1e-6, 2**32 * 1e-3, 2**16 * 1e-3)
"""Seconds after which counters begin anew: of 32 bits in microseconds, as Arduino's micros, and in
milliseconds; of 16 bits in milliseconds."""
_AT_MOST = f"drop leaves out {100 * MOST_DROPPED:g} % of a file's rows at most"
"""Why an option does not help, behind its name."""


@dataclass(frozen=True, slots=True, kw_only=True)
class BadTimes:
    """What happens to rows whose times cannot be those of scans."""

    repeated: OnBadTime = "refuse"
    """Rows that repeat the time of the row above."""
    garbled: OnBadTime = "refuse"
    """Rows whose times are strays (stray_times.py)."""


REFUSED = BadTimes()
"""A file with any such row is refused."""


@dataclass(frozen=True, slots=True, kw_only=True)
class DroppedRows:
    """Rows that were left out because of their times, each kind numbered from 0, ascending."""

    repeated: tuple[int, ...] = ()
    """Those that repeat the time of the row above."""
    garbled: tuple[int, ...] = ()
    """Those whose times are strays."""

    @property
    def rows(self) -> list[int]:
        """Both kinds, ascending."""
        return sorted((*self.repeated, *self.garbled))


@dataclass(frozen=True, slots=True)
class _Times:
    """The times of rows, and where they stand in the file."""

    path: Path | str
    """The file, for messages."""
    time_s: NDArray[np.float64]
    """Shape (n,), seconds."""
    lines: NDArray[np.intp]
    """Number of each row's line, shape (n,)."""
    of: int
    """How many rows the file has, with those that were left out."""
    text: bool
    """Whether it is a text, whose trials the column `trials` may tell apart."""
    line: str
    """What stands before the number of a line."""

    def step_to(self, row: int) -> str:
        """Return the time of a row beside that of the row above, and where it stands."""
        return (
            f"{_shown(self.time_s[row])} s after {_shown(self.time_s[row - 1])} s in {self.path}, "
            f"{self.line} {self.lines[row]}"
        )


def _shown(seconds: float) -> str:
    """Return seconds for a reader; since 1970 with their fraction, which six digits would lose."""
    return f"{seconds:.6g}" if abs(seconds) < 1e5 else f"{seconds:.6f}".rstrip("0").rstrip(".")


def check_time(
    path: Path | str,
    time_s: NDArray[np.float64],
    bad_times: BadTimes = REFUSED,
    first_line: int = 1,
    *,
    text: bool = False,
    strays: Sequence[range] | None = None,
    line: str = "line",
) -> DroppedRows:
    """Refuse times that are not finite or do not increase.

    Args:
        path: The file, for messages; and the trial, where it holds several.
        time_s: Shape (n,), seconds.
        bad_times: Whether rows with a garbled time, and then rows that repeat the time of the row
            above, may be left out.
        first_line: Number of the line that holds the first of them.
        text: Whether it is a text, whose trials the column `trials` may tell apart.
        strays: The rows, from 0, whose times are garbled, in lots; by default they are looked for.
        line: What stands before a line's number in messages, such as "line 1, cell" where the
            numbers are those of a line's cells.

    Returns:
        The rows that are to be left out; none where such rows are refused.

    Raises:
        BadTable: Says file and line.
    """
    if not np.isfinite(time_s).all():
        place = f"{line} {int(np.argmin(np.isfinite(time_s))) + first_line}"
        raise BadTable("a time in every row", f"none in {path}, {place}", "mend the file")
    drop = bad_times.garbled == "drop"
    lots = strays_of(time_s) if strays is None else strays
    if drop and strays is None:
        with_leaps = strays_of(time_s, leaps=True)
        if _few(sum(map(len, with_leaps)), len(time_s)):  # a leap alone is no reason to refuse
            lots = with_leaps
    garbled = [row for lot in lots for row in lot]
    if garbled and not (drop and _few(len(garbled), len(time_s))):
        raise _garbled(path, time_s, lots, first_line, line)
    rows = np.delete(np.arange(len(time_s)), garbled)
    times = _Times(path, time_s[rows], rows + first_line, len(time_s), text, line)
    _refuse_far(times)
    again = np.flatnonzero(np.diff(times.time_s) == 0) + 1
    few = bad_times.repeated == "drop" and _few(len(again), times.of)
    if (np.diff(times.time_s) < 0).any() or (len(again) and not few):
        raise _no_increase(times)
    _refuse_close(times)
    return DroppedRows(repeated=tuple(rows[again].tolist()), garbled=tuple(garbled))


def _few(count: int, rows: int) -> bool:
    """Return whether so many of a file's rows may be left out."""
    return count <= max(1, int(MOST_DROPPED * rows))


def _garbled(
    path: Path | str,
    time_s: NDArray[np.float64],
    strays: Sequence[range],
    first_line: int,
    line: str,
) -> BadTable:
    """Return the error of garbled times."""
    count = sum(map(len, strays))
    rows, times = ("that row", "time") if count == 1 else ("these rows", "times")
    mend = (
        f"leave {rows} out with --garbled-times drop, or mend the {times}"
        if _few(count, len(time_s))
        else "mend the times, or give a rate instead of a time column: --garbled-times " + _AT_MOST
    )
    got = strays_in_words(time_s, strays, first_line, path, line)
    return BadTable(_INCREASING, got, f"such a time is garbled: {mend}")


def _refuse_far(times: _Times) -> None:
    """Refuse times that lie too far away for a right unit."""
    far = np.abs(times.time_s) > FURTHEST_S
    if far.any():
        row = int(np.argmax(far))
        got = f"{times.time_s[row]:.6g} s in {times.path}, {times.line} {times.lines[row]}"
        raise BadTable(f"times of at most {FURTHEST_S:g} s", got, _MEND_UNIT)


def _refuse_close(times: _Times) -> None:
    """Refuse times that lie too close together for a right unit."""
    steps = np.diff(times.time_s)
    kept = steps[steps > 0]
    if len(kept) and float(np.median(kept)) < 1.0 / LARGEST_RATE_HZ:
        got = f"{np.median(kept):.3g} s in {times.path}"
        raise BadTable("scans at least 1 ns apart", got, _MEND_UNIT)


def _no_increase(times: _Times) -> BadTable:
    """Return the error of times that stand still or go back; where they begin anew it says so."""
    time_s = times.time_s
    steps, anew = np.diff(time_s), restarts_of(time_s)
    if (wrapped := _began_anew(time_s, steps)) is not None:
        row, mend = wrapped
        return BadTable(_INCREASING, times.step_to(row), mend)
    back = int((steps < 0).sum())
    row = anew[0] if anew else int(np.argmax(steps < 0 if back else steps == 0)) + 1
    got = times.step_to(row)
    often = "once" if back == 1 else f"{back} times"
    if anew:
        own = "" if back == 1 else " each time" if len(anew) == back else f" {len(anew)} of them"
        got += f": time goes back {often},{own} to about where it began"
        mend = "a restart usually begins a new trial: " + (
            f"write {RESTARTS} in the column 'trials' (or beside a column, as in run+{RESTARTS}) "
            "to cut there, or name a column there that numbers the trials" if times.text
            else "save each trial as an array or file of its own"
        )  # fmt: skip
    elif back:
        got += f": time goes back {often}"
        mend = "sort the rows, or give a rate instead of a time column"
    else:
        repeats, mend = _repeats_in_words(int((steps == 0).sum()), times.of)
        got += f": {repeats}"
    return BadTable(_INCREASING, got, mend)


def _repeats_in_words(count: int, rows: int) -> tuple[str, str]:
    """Return how many of some rows repeat the time of the row above, and what to do."""
    has = "has" if count == 1 else "have"
    mend = (
        "leave such rows out with --repeated-times drop, or give a rate instead of a time column"
        if _few(count, rows)
        else "give a rate instead of a time column, for the clock is too coarse: --repeated-times "
        + _AT_MOST
    )
    if 2 * count >= rows - 1 > 1:  # as of a table with a row for each channel
        mend += "; if each row holds one channel, write the channels side by side, in columns"
    return f"{count} of {number_of(rows, 'row')} {has} the time of the row above", mend


def _began_anew(time_s: NDArray[np.float64], steps: NDArray[np.float64]) -> tuple[int, str] | None:
    """Return the row at which a clock began anew within a trial, and what to do; None without one.

    At midnight, or where a counter's bits were used up: both are known by how far time goes back.
    """
    if time_s.min() >= 0 and time_s.max() < _DAY_S and steps.min() < -_DAY_S / 2:
        mend = "if these are times of day, and midnight lies between, write the dates too"
        return int(np.argmin(steps)) + 1, mend
    usual = float(np.median(steps))
    for period in _COUNTERS_S:
        if 0 < 100 * usual < period and abs(period + steps.min() - usual) <= 2 * usual:
            mend = (
                f"if the device's counter of {period:.10g} s began anew there, add {period:.10g} s "
                "to the times from that line on"
            )
            return int(np.argmin(steps)) + 1, mend
    return None
