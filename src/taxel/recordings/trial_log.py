"""A log of grasps beside a recording: when the alarm came, what the person did, what came of it.

`pour.mcap` has `pour.trials.csv`, a line a grasp, written when the grasp is over. Times are on
the recording's clock, host monotonic seconds; what is not known is empty. Knows nothing about
alarms, keys or pages.

Background of our choices: docs/decisions/0046.
"""

from __future__ import annotations

import csv
import io
import math
import re
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import asdict, dataclass, fields
from pathlib import Path
from typing import Any

from taxel.errors import BadTable
from taxel.foreign.files import MIB
from taxel.foreign.text_rows import rows_of

REACTIONS = ("pour stopped", "put down", "grip changed")
"""What a person may do about an alarm."""
OUTCOMES = ("held", "slipped", "dropped")
"""What may come of a grasp."""
LEVELS = ("", "warning", "danger")
_WORDS = {"alarm": LEVELS, "reaction": ("", *REACTIONS), "outcome": ("", *OUTCOMES),
          "outcome_by": ("", "person", "source")}  # fmt: skip
_MOST = 100_000
"""Lines of a log that are read. Source: our choice."""


@dataclass(frozen=True, slots=True, kw_only=True)
class GraspTrial:
    """A line of the log: one grasp, its alarm, the person's reaction and the outcome."""

    number: int
    """From 1 in a session, of these cameras."""
    began_s: float
    ended_s: float
    alarm: str = ""
    """The worst level, one of `LEVELS`; empty where none came."""
    alarm_s: float | None = None
    """When the first alarm of this grasp came."""
    advice: str = ""
    """What the page told the person to do at the alarm."""
    acknowledged_s: float | None = None
    """When a person acknowledged it."""
    reaction: str = ""
    """What the person did first, one of `REACTIONS`."""
    reaction_s: float | None = None
    """When."""
    outcome: str = ""
    """One of `OUTCOMES`."""
    outcome_by: str = ""
    """Who says so: "person", or "source" (a simulator's truth, a replay's label)."""
    cameras: str = ""
    """Names of the cameras that watched it, as the recording names them; empty: not known."""

    @property
    def reaction_time_s(self) -> float | None:
        """From the alarm to what the person did, seconds; below 0 where that came first."""
        if self.alarm_s is None or self.reaction_s is None:
            return None
        return self.reaction_s - self.alarm_s


COLUMNS = tuple(field.name for field in fields(GraspTrial))
_FORMER = {"told": "advice"}
"""Columns of logs written before → their name today."""
_CELLS = (len(COLUMNS), len(COLUMNS) - 1)
"""Of a line today, and of one written before, which ends without `cameras`."""


def log_of(recording: Path) -> Path:
    """Return where the log of a recording is."""
    return recording.with_name(f"{recording.stem}.trials.csv")


def append_trial(path: Path, trial: GraspTrial) -> None:
    """Add a line to a log; the first one brings the names of the columns.

    Raises:
        OSError: The disk refused; the log is as it was.
    """
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    with path.open("ab", buffering=0) as file:
        before = file.tell()
        if not before:
            writer.writerow(COLUMNS)
        writer.writerow([_cell(value) for value in asdict(trial).values()])
        left = text.getvalue().encode()
        try:
            while left:
                left = left[file.write(left) :]
        except OSError:
            with suppress(OSError):  # half a line would make the whole log another table
                file.truncate(before)
            raise


def read_trial_log(path: Path) -> list[GraspTrial]:
    """Return the grasps of a log.

    Raises:
        BadTable: It is another table, or a cell cannot be used.
        BadFile: It is no text, or too large.
        OSError: It is not there.
    """
    rows = rows_of(path, 16 * MIB)
    columns = tuple(_FORMER.get(name, name) for name in rows[0][1]) if rows else ()
    if columns not in [COLUMNS[:count] for count in _CELLS]:
        raise BadTable(
            "a log of trials as taxel live writes it beside a recording, NAME.trials.csv",
            f"another table in {path}", "name that file",
        )  # fmt: skip
    if len(rows) > _MOST:
        raise BadTable(f"at most {_MOST} lines", f"{len(rows)} in {path}", "split the file")
    return [_trial(cells, f"line {number} of {path}") for number, cells in rows[1:]]


def trial_of(values: Mapping[str, Any]) -> GraspTrial:
    """Return a trial that was sent from another process as plain values.

    Raises:
        TypeError: There are others than a trial's.
    """
    return GraspTrial(**values)


def _cell(value: object) -> str:
    if isinstance(value, float):
        return f"{value:.3f}"
    return "" if value is None else str(value)


def _trial(cells: list[str], where: str) -> GraspTrial:
    if len(cells) not in _CELLS:
        raise BadTable(f"{len(COLUMNS)} cells", f"{len(cells)} in {where}", "mend the line")
    found: dict[str, Any] = dict(zip(COLUMNS, cells, strict=False))
    for name, words in _WORDS.items():
        if found[name] not in words:
            allowed = ", ".join(word or "nothing" for word in words)
            raise BadTable(f"{name} as one of {allowed}", f"{found[name]!r} in {where}", "mend it")
    for name in ("began_s", "ended_s", "alarm_s", "acknowledged_s", "reaction_s"):
        found[name] = _seconds(found[name], name, where)
    is_number = re.fullmatch(r"[0-9]{1,9}", found["number"])
    if not is_number or found["began_s"] is None or found["ended_s"] is None:
        raise BadTable(
            "a number, began_s and ended_s",
            f"{[cell[:40] for cell in cells[:3]]} in {where}",
            "mend the line",
        )
    return GraspTrial(**found | {"number": int(found["number"])})


def _seconds(text: str, name: str, where: str) -> float | None:
    if not text:
        return None
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise BadTable(f"{name} in seconds", f"{text!r} in {where}", "mend the line")
    return value
