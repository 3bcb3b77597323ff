"""Trials out of one long text: rows that follow one another and have the same trial in a column.

Knows nothing about recordings.

Background of our choices: docs/decisions/0011.
"""

from __future__ import annotations

from array import array
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import groupby
from pathlib import Path

import numpy as np

from taxel.errors import BadTable
from taxel.plain_text import visible
from taxel.recordings.imports.trial_sets import AND, MOST_TRIALS, Padding
from taxel.recordings.imports.value_tables.restarts import RESTARTS, begins_anew
from taxel.recordings.imports.value_tables.row_times import BadTimes, check_time
from taxel.recordings.imports.value_tables.stray_times import strays_of
from taxel.recordings.imports.value_tables.table_columns import parted_cells, text_cells, text_names
from taxel.recordings.imports.value_tables.table_form import header_names, is_number
from taxel.recordings.imports.value_tables.tables import (
    ALL,
    Missing,
    Table,
    check_values,
    names_of,
    parse_columns,
    parse_time,
    read_table,
)
from taxel.recordings.imports.value_tables.time_stamps import stamp_s

EMPTY_ROWS = "empty rows"
"""In the column `trials`: rows without anything in their cells, or blank lines, part trials."""


@dataclass(frozen=True, slots=True)
class _Run:
    """The rows of one trial."""

    key: tuple[str, ...]
    values: tuple[str, ...]
    start: int
    stop: int


class TextTrials:
    """The trials of a long text.

    Args:
        path: The text.
        named: The table's cells. `trials`: the column that says which trial a row belongs to, or
            several: subject+trial; where no column is called so, restarts stands for where time
            begins anew, and empty rows for where such rows, or blank lines, part trials.
            `channels` and `time`. `file`, for remarks: two files of one name, in two folders, are
            two.
        names: Columns that `from:` cells name, whose value is the same in all rows of a trial.
        where: Table and line, for messages.
        by_row: Columns whose value may be another in each row.

    Raises:
        BadTable: The text is not as it should be, or the rows of a trial are not together.
    """

    def __init__(
        self,
        path: Path,
        named: Mapping[str, str],
        names: Sequence[str],
        where: str,
        by_row: Sequence[str] = (),
    ) -> None:
        trials = named.get("trials", "")
        self._path, self.what, self._called = path, trials, visible(named["file"])
        self._time = parse_time(named.get("time", ""), where)
        timed = [self._time.column.name] if self._time.column is not None else []
        columns = parse_columns(named.get("channels", ""), where)
        parts = [name.strip() for name in trials.split(AND)]
        others = {*names_of(columns, self._time), *parts} - {RESTARTS, EMPTY_ROWS}
        header = text_names(path, [*names, *by_row, *timed], others)
        self.names = header
        keys = [trials] if trials in header else parts
        self._parted = keys == [EMPTY_ROWS] and EMPTY_ROWS not in header
        self._names = list(names)
        anew = RESTARTS in keys and RESTARTS not in header
        asked = [self._time_name(where) if anew and name == RESTARTS else name for name in keys]
        asked = [] if self._parted else asked
        self._all = [column.name for column in columns] == [ALL]
        self._described = header_names([*asked, *names, *by_row], header)
        self._columns = columns
        cells_of_rows = parted_cells if self._parted else text_cells
        first_line, rows = cells_of_rows(path, [*asked, *names, *by_row], others)
        self._strays: list[range] | None = [] if anew else None
        if self._strays is not None:
            rows = _numbered(path, rows, keys, first_line, self._strays)
        self._first_line = first_line
        self._by_row = {column: place for place, column in enumerate(by_row)}
        self._cells: list[list[str]] = []
        described = self._apart(rows, len(keys) + len(names))
        self._runs = list(_runs(path, described, len(keys), names, first_line))
        self.keys = ["-".join(run.key) for run in self._runs]
        count = len(self._runs)
        self.remarks = [
            f"{self._called} was read as {count} {'trial' if count == 1 else 'trials'} by "
            + (
                "its empty rows"
                if self._parted
                else self._where_anew(keys)
                if anew
                else f"its column {visible(trials)}"
            )
        ]
        self.doubts: list[str] = []
        self._whole: Table | None = None

    def _time_name(self, where: str) -> str:
        if self._time.column is None:
            raise BadTable(
                f"a column of time for {RESTARTS} in the column 'trials'", f"a rate in {where}",
                "name the column whose times begin anew in the column 'time'",
            )  # fmt: skip
        return self._time.column.name

    def _where_anew(self, keys: Sequence[str]) -> str:
        assert self._time.column is not None
        others = AND.join(visible(name) for name in keys if name != RESTARTS)
        before = f"its column {others}, and by " if others else ""
        return f"{before}where the times in {visible(self._time.column.name)} begin anew"

    def texts(self, name: str) -> list[str]:
        """Return each trial's value of a column.

        Raises:
            KeyError: It was not named before.
        """
        place = self._names.index(name)
        return [run.values[place] for run in self._runs]

    def by_row(self, index: int, column: str) -> list[str]:
        """Return a column's value in each row of a trial.

        Raises:
            KeyError: It was not named before.
        """
        place, run = self._by_row[column], self._runs[index]
        return [cells[place] for cells in self._cells[run.start : run.stop]]

    def _apart(self, rows: Iterable[list[str]], count: int) -> Iterator[list[str]]:
        """Yield what describes a row's trial, and keep what may change within it."""
        for cells in rows:
            if self._by_row:
                self._cells.append(cells[count:])
            yield cells[:count]

    def table(self, index: int, missing: Missing, bad_times: BadTimes) -> tuple[Table, Padding]:
        """Return one trial's values; a text has no padding.

        Raises:
            BadTable: Its values or times are not as they should be.
        """
        if self._whole is None:
            self._whole = read_table(self._path, self._columns, self._time, missing,
                                     trials="parted" if self._parted else "many",
                                     but=self._described)  # fmt: skip
            if self._all and (steady := self._steady(self._whole)):
                self.doubts.append(steady)
        run, whole = self._runs[index], self._whole
        if self._parted:
            check_values(self._path, whole.values[run.start : run.stop], whole.names, missing,
                         self._first_line + run.start)  # fmt: skip
        table = Table(
            values=whole.values[run.start : run.stop], time_s=whole.time_s[run.start : run.stop],
            names=whole.names, units=whole.units, decimal_comma=whole.decimal_comma,
            one_more=whole.one_more, passed_over=whole.passed_over, other_units=whole.other_units,
        )  # fmt: skip
        if self._time.column is None:  # by the rate, from 0 in each trial
            return replace(table, time_s=whole.time_s[: run.stop - run.start]), Padding()
        where = f"{self._path}, trial {visible(self.keys[index])}"
        dropped = check_time(where, table.time_s, bad_times, self._first_line + run.start,
                             text=True, strays=self._strays_of(run))  # fmt: skip
        return table.without(dropped), Padding()

    def _strays_of(self, run: _Run) -> list[range] | None:
        """Return a trial's rows with a garbled time, from 0; None if they were not looked for."""
        if self._strays is None:
            return None
        return [range(lot.start - run.start, lot.stop - run.start)
                for lot in self._strays if run.start <= lot.start < run.stop]  # fmt: skip

    def _steady(self, whole: Table) -> str:
        """Return a remark on columns that * took for channels, but that may describe the trial."""
        values = whole.values
        # A dead channel is the same everywhere, but for the empty rows between trials.
        odd = ((values != values[0]) & ~np.isnan(values)).any(axis=0)
        for run in self._runs:
            odd &= (values[run.start : run.stop] == values[run.start]).all(axis=0)
        names = [visible(name) for name, is_odd in zip(whole.names, odd, strict=True) if is_odd]
        longest = max(run.stop - run.start for run in self._runs)
        if not names or longest < 2:
            return ""
        more = f" and {len(names) - 8} more" if len(names) > 8 else ""
        has, each = ("has", "it") if len(names) == 1 else ("have", "each of them")
        return (
            f"{self._called}: {', '.join(names[:8])}{more} {has} one value in each trial, and * "
            f"made a channel of {each}; if this is a label or a group, say from:{names[0]} in such "
            "a column, or name the channels"
        )

    def close(self) -> None:
        """Forget the values; they are read again where needed."""
        self._whole = None


def _numbered(
    path: Path, rows: Iterable[list[str]], keys: Sequence[str], first_line: int, strays: list[range]
) -> Iterator[list[str]]:
    """Yield rows with a number in the place of their time: how often it has begun, from 1.

    Numbers begin with 1 where another of the keys changes. Rows with a garbled time belong to the
    trial of the row above: to cut there would make two trials of one.

    Args:
        path: For messages.
        rows: The keys' cells of each row, and others behind them.
        keys: Columns that say which trial a row belongs to, `restarts` in the place of time.
        first_line: Number of the line that holds the first row.
        strays: Is given the rows, from 0, whose times are garbled.

    Raises:
        BadTable: A time is no number, or goes back without beginning anew.
    """
    place, first = keys.index(RESTARTS), 0
    timed = _timed(path, rows, place, first_line)
    for _, part in groupby(timed, key=lambda row: row[1][: len(keys)]):
        times, held = array("d"), list[list[str]]()
        for now, cells in part:
            times.append(now)
            held.append(held[-1] if held and held[-1] == cells else cells)  # takes less memory
        lots = strays_of(np.array(times))
        strays += [range(first + lot.start, first + lot.stop) for lot in lots]
        counts = _begun(path, times, lots, first_line + first)
        for count, cells in zip(counts, held, strict=True):
            yield [*cells[:place], str(count), *cells[place + 1 :]]
        first += len(times)


def _timed(
    path: Path, rows: Iterable[list[str]], place: int, first_line: int
) -> Iterator[tuple[float, list[str]]]:
    """Yield the time that stands at a place of each row, and the row's cells without it."""
    for line, cells in enumerate(rows, start=first_line):
        text = cells[place].replace(",", ".")
        now = float(text) if is_number(text) else stamp_s(cells[place])
        if now is None:
            raise BadTable("a time in every row", f"{cells[place][:80]!r} in {path}, line {line}",
                           "mend the file")  # fmt: skip
        cells[place] = ""
        yield now, cells


def _begun(
    path: Path, times: array[float], strays: Sequence[range], first_line: int
) -> Iterator[int]:
    """Yield for each row how often time has begun, from 1; garbled times are not looked at."""
    garbled = {row for lot in strays for row in lot}
    count = 1
    start = before = next(now for row, now in enumerate(times) if row not in garbled)
    for row, now in enumerate(times):
        if row not in garbled:
            if begins_anew(now, before, start):
                count, start = count + 1, now
            elif now < before:
                raise BadTable(
                    "times that increase, or begin anew near where they began",
                    f"{now:.6g} after {before:.6g} in {path}, line {row + first_line}",
                    "sort the rows of each trial, or name a column that numbers the trials in the "
                    "column 'trials'",
                )
            before = now
        yield count


def _runs(
    path: Path, rows: Iterable[list[str]], keys: int, names: Sequence[str], first_line: int
) -> Iterator[_Run]:
    """Yield each trial's rows; `names` are the columns behind the keys, the same in a trial."""
    seen_keys: set[tuple[str, ...]] = set()
    key: tuple[str, ...] = ()
    values: list[str] = []
    start, row = 0, -1
    for row, cells in enumerate(rows):
        if not cells:  # an empty row between trials
            if key:
                yield _Run(key, tuple(values), start, row)
            key = ()
        elif tuple(cells[:keys]) != key:
            if key:
                yield _Run(key, tuple(values), start, row)
            key, values, start = tuple(cells[:keys]), cells[keys:], row
            if key in seen_keys or len(seen_keys) >= MOST_TRIALS or not all(key):
                raise _no_run(path, key, key in seen_keys, first_line + row)
            if not all(values):
                raise BadTable("a value for each trial", f"nothing in {path}, line "
                               f"{first_line + row}", "fill it in")  # fmt: skip
            seen_keys.add(key)
        elif cells[keys:] != values:
            odd = next(n for n, value in enumerate(values) if cells[keys + n] != value)
            raise BadTable(
                f"one value a trial in the column {names[odd]!r}",
                f"{values[odd]!r}, then {cells[keys + odd]!r} in trial {visible('-'.join(key))} "
                f"of {path}, line {first_line + row}",
                "name all columns that tell trials apart in the column 'trials', as in "
                "subject+trial; a label that changes within a trial is written "
                f"rows:{visible(names[odd])}",
            )
    if row < 0:
        raise BadTable("rows of numbers", f"none in {path}", "leave the file out")
    yield _Run(key, tuple(values), start, row + 1)


def _no_run(path: Path, own: tuple[str, ...], again: bool, line: int) -> BadTable:
    if not all(own):
        return BadTable("a trial in every row", f"none in {path}, line {line}", "fill it in")
    if not again:
        return BadTable(f"at most {MOST_TRIALS:,} trials in a file", "more", "split the file")
    return BadTable(
        "the rows of each trial together",
        f"trial {visible('-'.join(own))} once more in {path}, line {line}",
        "sort the rows by trial; or, if trials of several people or sessions are called alike, "
        "name all columns that tell them apart in the column 'trials', as in subject+trial",
    )
