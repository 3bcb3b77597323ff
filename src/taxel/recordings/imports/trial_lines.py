"""Trials out of a text that has one in each line: a scan, or several scans side by side.

Knows nothing about recordings.

Background of our choices: docs/decisions/0011.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from taxel.errors import BadTable
from taxel.plain_text import number_of, visible
from taxel.recordings.imports.trial_sets import MOST_TRIALS, Padding
from taxel.recordings.imports.value_tables.row_times import BadTimes
from taxel.recordings.imports.value_tables.table_columns import text_cells, text_names
from taxel.recordings.imports.value_tables.table_form import column_places, header_names, is_whole
from taxel.recordings.imports.value_tables.tables import (
    ALL,
    Column,
    Missing,
    Table,
    names_of,
    parse_columns,
    parse_time,
    read_table,
)

_ENOUGH_LINES = 3
"""From which on a column can be seen to count them. Source: our choice, docs/decisions/0011."""
_MOST_SCANS = 100_000
"""In a line. Source: our choice, docs/decisions/0011."""


@dataclass(frozen=True, slots=True)
class _Axes:
    """How a line's columns are a trial."""

    scans: int
    """How many scans stand in a line."""
    channels_last: bool
    """Whether the channels of one scan stand side by side, else the scans of one channel."""


def _axes_of(text: str, where: str) -> _Axes:
    """Return what the column `axes` says: trials channels, or how many rows each line holds.

    Raises:
        BadTable: It is neither.
    """
    match text.lower().split():
        case ["trials", "channels"]:
            return _Axes(1, True)
        case ["trials", rows, "channels"] if scans := _scans(rows):
            return _Axes(scans, True)
        case ["trials", "channels", rows] if scans := _scans(rows):
            return _Axes(scans, False)
    raise BadTable(
        "axes of a text: 'trials channels' for one scan in a line; for four, 'trials rows:4 "
        "channels' where the channels of one scan stand side by side, 'trials channels rows:4' "
        "where the scans of one channel do; 'channels rows' for one trial whose lines are channels",
        f"{text[:80]!r} in {where}",
        "correct it, or leave it empty for a text with a scan in each line",
    )


def _scans(word: str) -> int:
    """Return the number in a word such as rows:4; 0 where it is none."""
    found = re.fullmatch(r"rows:([0-9]{1,6})", word)
    return int(found[1]) if found and int(found[1]) <= _MOST_SCANS else 0


class LineTrials:
    """The trials of a text, one in each line.

    Args:
        path: The text.
        named: The table's cells. `axes`: trials channels, trials rows:N channels or trials channels
            rows:N. `channels` and `time`, which is a rate. `file`, for remarks.
        names: Columns that `from:` cells name.
        where: Table and line, for messages.

    Raises:
        BadTable: The text, or what the table says of it, is not as it should be.
    """

    def __init__(
        self, path: Path, named: Mapping[str, str], names: Sequence[str], where: str
    ) -> None:
        self._path, self.what, self._called = path, "", visible(named["file"])
        self._axes = _axes_of(named.get("axes", ""), where)
        if not named.get("time", "").startswith("rate:"):
            raise BadTable("a rate, as in rate:100Hz, for a text with a trial in each line",
                           f"{named.get('time', '')[:80]!r} in {where}", "write it")  # fmt: skip
        self._time = parse_time(named["time"], where)
        if named.get("trials"):
            raise BadTable(
                "an empty column 'trials' where axes say that each line is a trial",
                f"{named['trials'][:80]!r} in {where}", "leave one of them empty",
            )  # fmt: skip
        self._names, self._columns = list(names), parse_columns(named.get("channels", ""), where)
        others = names_of(self._columns, self._time)
        self.names = text_names(path, names, others)
        self._all = [column.name for column in self._columns] == [ALL]
        self._first_line, rows = text_cells(path, self._names, others)
        self._cells = [cells[: len(names)] for cells in rows]
        count = len(self._cells)
        if not count:
            raise BadTable("rows of numbers", f"none in {path}", "leave the file out")
        if count > MOST_TRIALS:
            raise BadTable(f"at most {MOST_TRIALS:,} trials in a file", "more", "split the file")
        digits = len(str(count))
        self.keys = [str(number).zfill(digits) for number in range(1, count + 1)]
        scans = self._axes.scans
        each = "one scan" if scans == 1 else f"{scans} scans"
        self.remarks = [
            f"{self._called} was read as {count} {'trial' if count == 1 else 'trials'}, "
            f"one in each line, of {each}"
        ]
        self.doubts: list[str] = []
        self._whole: Table | None = None

    def texts(self, name: str) -> list[str]:
        """Return each trial's value of a column.

        Raises:
            BadTable: A cell is empty.
        """
        place = self._names.index(name)
        found = [cells[place] for cells in self._cells]
        if not all(found):
            line = self._first_line + found.index("")
            raise BadTable("a value for each trial", f"nothing in {self._path}, line {line}",
                           "fill it in")  # fmt: skip
        return found

    def table(self, index: int, missing: Missing, bad_times: BadTimes) -> tuple[Table, Padding]:
        """Return one trial's values; a text has no padding, and times by a rate are never bad.

        Raises:
            BadTable: Its values are not as they should be, or are no whole scans.
        """
        if self._whole is None:
            self._whole = self._read(missing)
        scans, width = self._axes.scans, len(self._whole.names)
        values = self._whole.values[index].reshape(
            (scans, width) if self._axes.channels_last else (width, scans)
        )
        own = values if self._axes.channels_last else values.T
        time_s = np.arange(scans) / (self._time.rate_hz or 1.0)
        return replace(self._whole, values=np.ascontiguousarray(own), time_s=time_s), Padding()

    def _read(self, missing: Missing) -> Table:
        """Return all lines, with the names and units of the channels of one scan."""
        found = read_table(self._path, self._wanted(), self._time, missing, trials="many",
                           but=header_names(self._names, self.names))  # fmt: skip
        scans, count = self._axes.scans, len(found.names)
        if scans == 1:
            if self._all and (odd := self._numbers_of_lines(found)):
                self.doubts.append(odd)
            return found
        if count % scans:
            raise BadTable(
                f"columns for {number_of(scans, 'scan')} in each line of {self._path}",
                number_of(count, "column"),
                "name the channels' columns only, or correct the number of rows in 'axes'",
            )  # fmt: skip
        width = count // scans
        units = np.array(found.units).reshape((scans, width) if self._axes.channels_last else
                                              (width, scans))  # fmt: skip
        units = units if self._axes.channels_last else units.T
        if (units != units[0]).any():
            raise BadTable("the same units in all scans of a line", "others",
                           "correct the column 'channels', or 'axes'")  # fmt: skip
        return replace(found, names=tuple(f"c{number}" for number in range(1, width + 1)),
                       units=tuple(units[0].tolist()))  # fmt: skip

    def _wanted(self) -> Sequence[Column]:
        """Return the columns; where * means all those of several scans, which often have the names
        of a scan again and again, by their numbers.
        """
        if not self._all or self._axes.scans == 1 or any(map(is_whole, self.names)):
            return self._columns
        described = column_places(self._names, self.names)
        return [Column(name=str(place + 1), unit=self._columns[0].unit)
                for place in range(len(self.names)) if place not in described]  # fmt: skip

    def _numbers_of_lines(self, found: Table) -> str:
        """Return a remark on columns that * took for channels, but that may count the lines."""
        steps = np.diff(found.values, axis=0)
        if len(steps) < _ENOUGH_LINES - 1:
            return ""
        places = np.flatnonzero((steps == 1).all(axis=0)).tolist()
        if not places:
            return ""
        name = visible(found.names[places[0]]) or str(places[0] + 1)
        return (
            f"{self._called}: the column {name} counts the lines, and * made a channel of it; if "
            f"this is no touch, say from:{name} in a column group:NAME, or name the channels"
        )

    def close(self) -> None:
        """Forget the values; they are read again where needed."""
        self._whole = None
