"""Whether the times of rows can be those of scans: they increase from row to row.

Rows that repeat the time of the row above may be left out, where these are few. Knows nothing about
how files are read.

Background of our choices: docs/decisions/0011.
"""

from __future__ import annotations

from pathlib import Path
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from taxel.errors import BadTable
from taxel.plain_text import number_of
from taxel.recordings.imports.restarts import RESTARTS, restarts_of
from taxel.recordings.imports.stray_times import strays_in_words, strays_of
from taxel.recordings.scan_layout import FURTHEST_S

Repeated = Literal["refuse", "drop"]
"""What happens to rows that repeat the time of the row above: an error, or they are left out."""

MOST_REPEATED = 0.05
"""Share of a file's rows (or a trial's) that may be left out so, but a row in any case: where more
repeat, the clock is too coarse for the scans. Source: our choice, docs/decisions/0011."""
LARGEST_RATE_HZ = 1e9
"""Scans a second; more is a wrong unit. Source: our choice."""
_INCREASING = "times that increase from row to row"
_DAY_S = 86_400.0
"""A day, seconds."""
_COUNTERS_S = (2**32 * 1e-6, 2**32 * 1e-3, 2**16 * 1e-3)
"""Seconds after which counters begin anew: of 32 bits in microseconds, as Arduino's micros, and in
milliseconds; of 16 bits in milliseconds."""


def check_time(
    path: Path | str,
    time_s: NDArray[np.float64],
    repeated: Repeated = "refuse",
    first_line: int = 1,
    *,
    text: bool = False,
) -> NDArray[np.intp]:
    """Refuse times that are not finite or do not increase.

    Args:
        path: The file, for messages; and the trial, where it holds several.
        time_s: Shape (n,), seconds.
        repeated: Whether rows may repeat the time of the row above, to be left out.
        first_line: Number of the line that holds the first of them.
        text: Whether it is a text, whose trials the column `trials` may tell apart.

    Returns:
        The rows, from 0, that are to be left out; none where such rows are refused.

    Raises:
        BadTable: Says file and line.
    """
    if not np.isfinite(time_s).all():
        line = int(np.argmin(np.isfinite(time_s))) + first_line
        raise BadTable("a time in every row", f"none in {path}, line {line}", "mend the file")
    if strays := strays_of(time_s):
        raise BadTable(_INCREASING, *strays_in_words(time_s, strays, first_line, path, " s"))
    if (np.abs(time_s) > FURTHEST_S).any():
        line = int(np.argmax(np.abs(time_s) > FURTHEST_S)) + first_line
        raise BadTable(
            f"times of at most {FURTHEST_S:g} s", f"{time_s[line - first_line]:.6g} s in {path}, "
            f"line {line}", "correct the column's unit: s, ms, us or ns",
        )  # fmt: skip
    steps = np.diff(time_s)
    again = np.flatnonzero(steps == 0) + 1
    few = repeated == "drop" and len(again) <= _most_repeated(len(time_s))
    if (steps < 0).any() or (len(again) and not few):
        raise _no_increase(path, time_s, first_line, text=text)
    kept = steps[steps > 0]
    if len(kept) and float(np.median(kept)) < 1.0 / LARGEST_RATE_HZ:
        raise BadTable(
            "scans at least 1 ns apart", f"{np.median(kept):.3g} s in {path}",
            "correct the column's unit: s, ms, us or ns",
        )  # fmt: skip
    return again


def _most_repeated(rows: int) -> int:
    """Return how many of a file's rows may be left out."""
    return max(1, int(MOST_REPEATED * rows))


def _no_increase(
    path: Path | str, time_s: NDArray[np.float64], first_line: int, *, text: bool
) -> BadTable:
    """Return the error of times that stand still or go back; where they begin anew it says so."""
    steps, anew = np.diff(time_s), restarts_of(time_s)
    if (wrapped := _began_anew(time_s, steps)) is not None:
        row, mend = wrapped
        return BadTable(
            _INCREASING,
            f"{time_s[row]:.6g} s after {time_s[row - 1]:.6g} s in {path}, line {row + first_line}",
            mend,
        )
    back = int((steps < 0).sum())
    row = anew[0] if anew else int(np.argmax(steps < 0 if back else steps == 0)) + 1
    got = f"{time_s[row]:.6g} s after {time_s[row - 1]:.6g} s in {path}, line {row + first_line}"
    often = "once" if back == 1 else f"{back} times"
    if anew:
        own = "" if back == 1 else " each time" if len(anew) == back else f" {len(anew)} of them"
        got += f": time goes back {often},{own} to about where it began"
        mend = "a restart usually begins a new trial: " + (
            f"write {RESTARTS} in the column 'trials' (or beside a column, as in run+{RESTARTS}) "
            "to cut there, or name a column there that numbers the trials" if text
            else "save each trial as an array or file of its own"
        )  # fmt: skip
    elif back:
        got += f": time goes back {often}"
        mend = "sort the rows, or give a rate instead of a time column"
    else:
        repeats, mend = _repeats_in_words(int((steps == 0).sum()), len(time_s))
        got += f": {repeats}"
    return BadTable(_INCREASING, got, mend)


def _repeats_in_words(count: int, rows: int) -> tuple[str, str]:
    """Return how many of some rows repeat the time of the row above, and what to do."""
    has = "has" if count == 1 else "have"
    mend = (
        "leave such rows out with --repeated-times drop, or give a rate instead of a time column"
        if count <= _most_repeated(rows)
        else "give a rate instead of a time column, for the clock is too coarse: --repeated-times "
        f"drop leaves out {100 * MOST_REPEATED:g} % of a file's rows at most"
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
