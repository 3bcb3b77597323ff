"""Pieces of equal length, each a trial, that long recordings are cut into: the column `pieces`.

Each piece knows what it was cut from, so that a split can keep the pieces of a whole together.
Knows nothing about files.

Background of our choices: docs/decisions/0011.
"""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from taxel.errors import BadTable
from taxel.plain_text import visible
from taxel.recordings.imports.own_groups import CUT_FROM, PIECE
from taxel.recordings.imports.trial_sets import MOST_TRIALS
from taxel.signals import Mark

_SLACK_S = 1e-6
"""How far a time may be off by its rounding: a double of seconds since 1970 keeps 0.2 µs."""
_UNITS_S = {"s": 1.0, "ms": 1e-3}


@dataclass(frozen=True, slots=True, kw_only=True)
class Pieces:
    """How long each piece is: in rows, or in seconds."""

    rows: int = 0
    """Rows; 0 where seconds count."""
    seconds: float = 0.0

    def __str__(self) -> str:
        return f"{self.rows} rows" if self.rows else f"{self.seconds:g} s"


def parse_pieces(text: str, where: str) -> Pieces | None:
    """Return what a cell such as "1s", "500ms" or "100rows" says; None where it is empty.

    Raises:
        BadTable: It says no length above zero.
    """
    if not text.strip():
        return None
    match = re.fullmatch(r"\s*([0-9]{1,9}(?:\.[0-9]{1,9})?)\s*(s|ms|rows?)\s*", text)
    number, unit = (float(match[1]), match[2]) if match else (0.0, "")
    if unit in _UNITS_S and number > 0:
        return Pieces(seconds=number * _UNITS_S[unit])
    if unit.startswith("row") and number >= 1 and number.is_integer():
        return Pieces(rows=int(number))
    raise BadTable("a length such as 1s, 500ms or 100rows in the column 'pieces'",
                   f"{text[:80]!r} in {where}", "correct it, or leave it empty")  # fmt: skip


def cut(
    wholes: Sequence[Mark], time_s: NDArray[np.float64], length: Pieces, file: str
) -> tuple[tuple[Mark, ...], int, int]:
    """Return the pieces of a recording as marks, how many rows are in none, and how many wholes
    give none, as they are shorter.

    What is left at the end of a whole, shorter than a piece, is in none.

    Args:
        wholes: Labelled stretches of the recording; none where it is one whole.
        time_s: Fitted time of its scans, shape (n,), seconds, increasing, n at least 1.
        length: Of each piece. A scan lasts until the next, the last as long as the median one.
        file: The recording's group `file`, which names the wholes.

    Raises:
        BadTable: No whole is as long as a piece, or there are too many pieces.
    """
    step_s = float(np.median(np.diff(time_s))) if len(time_s) > 1 else 0.0
    marks: list[Mark] = []
    left = short = 0
    for number, whole in enumerate(wholes or [None], start=1):
        first, stop = 0, len(time_s)
        if whole is not None:
            first, stop = np.searchsorted(time_s, [whole.start_s, whole.end_s]).tolist()
            stop += stop < len(time_s) and time_s[stop] <= whole.end_s
        edges = _edges(time_s[first:stop], step_s, length, file) + first
        labels = dict(whole.labels) if whole else {}
        groups = {**(whole.groups if whole else {}),
                  CUT_FROM: file if whole is None else f"{file}#{number}"}  # fmt: skip
        marks += [
            Mark(start_s=float(time_s[start]), end_s=float(time_s[end - 1]), labels=labels,
                 groups={**groups, PIECE: str(place)})
            for place, (start, end) in enumerate(pairwise(edges.tolist()), start=1)
            if start < end  # not where nothing was measured
        ]  # fmt: skip
        left += stop - int(edges[-1])
        short += len(edges) == 1
    if not marks:
        what = "stretch" if wholes else "recording"
        longest = len(time_s) if length.rows else time_s[-1] - time_s[0] + step_s
        got = f"{longest} rows" if length.rows else f"{longest:.6g} s"
        raise BadTable(f"a {what} of at least {length} for one piece",
                       f"{'none' if wholes else got} in {visible(file)}",
                       "write a shorter length in the column 'pieces'")  # fmt: skip
    return tuple(marks), left, short


def _edges(
    time_s: NDArray[np.float64], step_s: float, length: Pieces, file: str
) -> NDArray[np.int64]:
    """Return where each piece begins and the last one ends, as rows of a whole, from 0."""
    if length.rows:
        count = len(time_s) // length.rows
        _refuse_many(count, file)
        return np.arange(count + 1) * length.rows
    slack_s = min(_SLACK_S, step_s / 4) if step_s else _SLACK_S
    lasts_s = float(time_s[-1] - time_s[0]) + step_s if len(time_s) else 0.0
    count = math.floor((lasts_s + slack_s) / length.seconds)
    _refuse_many(count, file)
    ends_s = time_s[:1] + np.arange(count + 1) * length.seconds
    return np.searchsorted(time_s, ends_s - slack_s).astype(np.int64)


def _refuse_many(count: int, file: str) -> None:
    if count > MOST_TRIALS:
        raise BadTable(
            f"at most {MOST_TRIALS:,} pieces of a whole", f"{count:,} in {visible(file)}",
            "write a greater length in the column 'pieces'",
        )  # fmt: skip
