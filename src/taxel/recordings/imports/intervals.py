"""Labelled intervals of long recordings: a table of them, as marks on the scans' clock.

FORMAT.md describes the table; MNE's annotations (.txt) and Audacity's label
tracks are such tables. A scan belongs to one interval at most: an interval
holds the scans from its start up to, not at, its end. Knows nothing about
what is learned from a mark.
"""

from __future__ import annotations

import re
from collections import defaultdict
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from taxel.errors import BadTable
from taxel.foreign.array_files import ARRAY_ENDINGS
from taxel.foreign.sheets import without_sheet
from taxel.foreign.wav_file import WAV_ENDING
from taxel.plain_text import figures
from taxel.recordings.imports.own_groups import refuse_own_groups
from taxel.recordings.imports.spelling import column_name, composed, prefixed
from taxel.recordings.imports.value_tables.table_columns import mend_number, read_cells
from taxel.recordings.imports.value_tables.table_form import TEXT_ENDINGS, is_number
from taxel.recordings.writer import Recorder
from taxel.signals import Mark, Samples

SUFFIXES = (*TEXT_ENDINGS, *ARRAY_ENDINGS, WAV_ENDING, ".mcap")
"""Endings of a file's name that are no part of its recording's, in capitals or not."""
COLUMNS = ("file", "start_s", "end_s", "duration_s")
"""Columns beside label:NAME and group:NAME."""
OTHER_NAMES = {
    "recording": "file",
    "onset": "start_s",
    "duration": "duration_s",
    "description": "label:description",
}
"""What taxel audit's folds and MNE's annotations call the same columns."""
UNNAMED_COLUMNS = ["start_s", "end_s", "label:label"]
"""Columns of a table whose first line is no header: Audacity's label track."""
_SLACK_S = 1e-6
"""How far a time may be off by its rounding: a double of seconds since 1970 keeps 0.2 µs."""
_LATE = 0.5
"""How far an end may lie behind the recording's, in scans: tables round. Source: our choice,
docs/decisions/0011."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Interval:
    """One line of the table."""

    start_s: float
    """First moment, seconds from the recording's first scan."""
    end_s: float
    """First moment that no longer belongs to it, the same."""
    labels: Mapping[str, str] = field(default_factory=dict)
    groups: Mapping[str, str] = field(default_factory=dict)
    where: str = "an interval"
    """Table and line, for messages."""


def stem_of(file: str) -> str:
    """Return the name of a file's recording: without folders and without its ending."""
    name = Path(file).name
    if (plain := without_sheet(name)) != name:  # touch.xlsx[Day 1] is touch-Day-1
        sheet = re.sub(r"[^\w.+-]+", "-", name[len(plain) + 1 : -1])
        return f"{stem_of(plain)}-{sheet}"
    for suffix in SUFFIXES:
        if name.lower().endswith(suffix):
            name = name[: -len(suffix)]
    return name


def read_intervals(table: Path, recordings: Sequence[str]) -> dict[str, list[Interval]]:
    """Return each recording's intervals, in the order of time; recordings without are left out.

    Args:
        table: The table.
        recordings: Names of the recordings there are, without ending. A table without the
            column file is of the only one.

    Raises:
        BadTable: A column is unknown, missing or a group that taxel fills in itself, a line is
            not complete, its file is unknown, it ends before it starts, or two intervals of a
            file overlap.
    """
    header, lines = _lines(table)
    _check_header(table, header)
    if not lines:
        raise BadTable("at least one interval", f"none in {table}", "add a line for each")
    if "file" not in header and len(recordings) != 1:
        raise BadTable(
            f"a column 'file', as there are {len(recordings)} recordings",
            f"{', '.join(header)} in {table}", "add it, or name one recording",
        )  # fmt: skip
    known = {composed(name): name for name in recordings}
    by_recording: dict[str, list[Interval]] = defaultdict(list)
    for number, cells in lines:
        where = f"{table}, line {number}"
        if len(cells) != len(header):
            raise BadTable(f"{len(header)} cells", f"{len(cells)} in {where}", "mend the line")
        named = dict(zip(header, cells, strict=True))
        name = _recording_of(named.get("file", recordings[0]), known)
        if name is None:
            raise BadTable(f"a file among {_some(recordings)}", f"{named['file']!r} in {where}",
                           "correct the line, or add the file")  # fmt: skip
        by_recording[name].append(_interval(named, where))
    for own in by_recording.values():
        own.sort(key=lambda interval: interval.start_s)
        for before, after in pairwise(own):
            if after.start_s < before.end_s - _SLACK_S:
                start, end = figures(after.start_s, before.end_s)
                raise BadTable(
                    "intervals that do not overlap",
                    f"{start} s in {after.where}, before the {end} s at "
                    f"which that of {before.where} ends", "mend one of them",
                )  # fmt: skip
    return dict(by_recording)


def marks_of(
    intervals: Sequence[Interval], time_s: NDArray[np.float64], rate_hz: float
) -> list[Mark]:
    """Return intervals as marks on a recording's own clock, from first to last scan of each.

    Args:
        intervals: Of one recording, in the order of time.
        time_s: Fitted time of its scans, shape (n,), seconds, increasing.
        rate_hz: Its scans a second, hertz; the last scan lasts one step. An end up to half a step
            behind it is its end, rounded.

    Raises:
        BadTable: An interval lies outside the recording, or between two scans.
    """
    since_s = time_s - time_s[:1]
    step_s = 1.0 / rate_hz if rate_hz > 0 else 0.0
    lasts_s = float(since_s[-1]) + step_s if len(time_s) else 0.0
    latest_s = lasts_s + max(_SLACK_S, _LATE * step_s)
    marks = []
    for interval in intervals:
        if interval.start_s < -_SLACK_S or interval.end_s > latest_s:
            lasts, start, end = figures(lasts_s, interval.start_s, interval.end_s)
            raise BadTable(
                f"an interval within 0 and {lasts} s, the recording's length",
                f"{start} to {end} s in {interval.where}",
                "count seconds from the recording's first scan",
            )
        ends = np.array([interval.start_s, interval.end_s]) - _SLACK_S
        first, stop = np.searchsorted(since_s, ends).tolist()
        if first == stop:
            start, end = figures(interval.start_s, interval.end_s)
            raise BadTable("an interval with a scan in it",
                           f"none from {start} to {end} s in {interval.where}",
                           "make it longer, or remove it")  # fmt: skip
        marks.append(
            Mark(
                start_s=float(time_s[first]), end_s=float(time_s[stop - 1]),
                labels=dict(interval.labels), groups=dict(interval.groups),
            )
        )  # fmt: skip
    return marks


def write_marked(recorder: Recorder, samples: Samples, marks: Sequence[Mark]) -> None:
    """Write scans, and each mark behind its own, so that a replay knows it in time.

    Args:
        recorder: Of the new recording; stays open.
        samples: All of its scans.
        marks: In the order of time.
    """
    written = 0
    for mark in marks:
        end = int(np.searchsorted(samples.fitted_s, mark.end_s, side="right"))
        recorder.write(samples[written:end])
        recorder.mark(mark)
        recorder.flush()
        written = end
    recorder.write(samples[written:])


def _lines(table: Path) -> tuple[list[str], list[tuple[int, list[str]]]]:
    """Return the header in taxel's own words, and the lines below it with their numbers."""
    lines = [
        (number, [cell.strip() for cell in cells])
        for number, cells in enumerate(read_cells(table), 1)
        if any(cell.strip() for cell in cells) and cells[0] != "\\"  # Audacity: of a spectrum
    ]
    header: list[str] = []
    while lines and lines[0][1][0].startswith("#"):  # MNE: the last remark is the header
        _, (first, *others) = lines.pop(0)
        header = [first.removeprefix("#").strip(), *others]
    if lines and not header:
        header = UNNAMED_COLUMNS if is_number(lines[0][1][0]) else lines.pop(0)[1]
    names = [column_name(name, (*COLUMNS, *OTHER_NAMES)) for name in header]
    return [composed(OTHER_NAMES.get(name, name)) for name in names], lines


def _check_header(table: Path, header: Sequence[str]) -> None:
    odd = [n for n in header if n not in COLUMNS and not n.startswith(("label:", "group:"))]
    lengths = {"end_s", "duration_s"} & set(header)
    if odd or "start_s" not in header or len(lengths) != 1 or len(set(header)) < len(header):
        raise BadTable(
            "the columns file, start_s, end_s or duration_s, label:NAME and group:NAME, each once",
            f"{', '.join(map(repr, odd)) or ', '.join(header) or 'none'} in {table}",
            "mend its first line",
        )  # fmt: skip
    refuse_own_groups(header, str(table))


def _recording_of(file: str, known: Mapping[str, str]) -> str | None:
    """Return the recording of a file, by its name with as many of its folders as match.

    Args:
        file: As the table writes it, with folders and ending or without.
        known: Composed names of the recordings → as they are spelt. Imported files that share a
            name have that of their folders before it: day1-trial0.
    """
    parts = [*Path(file).parent.parts, stem_of(file)]
    names = (composed("-".join(parts[first:])) for first in range(len(parts)))
    return next((known[name] for name in names if name in known), None)


def _interval(named: Mapping[str, str], where: str) -> Interval:
    for name, cell in named.items():
        if not cell:
            raise BadTable(f"something in the column {name!r}", f"nothing in {where}", "fill it in")
    start_s = _seconds(named["start_s"], where)
    if "end_s" in named:
        end_s = _seconds(named["end_s"], where)
    else:
        end_s = start_s + _seconds(named["duration_s"], where)
    if end_s <= start_s:
        start, end = figures(start_s, end_s)
        raise BadTable("an end after the start", f"{start} to {end} s in {where}",
                       "mend the line, or remove it")  # fmt: skip
    return Interval(
        start_s=start_s, end_s=end_s, where=where,
        labels=prefixed(named, "label:"), groups=prefixed(named, "group:"),
    )  # fmt: skip


def _seconds(cell: str, where: str) -> float:
    if not is_number(cell) or not np.isfinite(float(cell)):
        raise BadTable("seconds as a number", f"{cell!r} in {where}", mend_number(cell))
    return float(cell)


def _some(names: Sequence[str]) -> str:
    return ", ".join(names[:6]) + (f" and {len(names) - 6} more" if len(names) > 6 else "")
