"""Trials out of a file of arrays (NumPy, MATLAB, HDF5): from a stack, from cells, from many arrays.

A stack is one array of many trials. Otherwise each cell, or each array whose name fits a pattern
such as trials/*/force, is one trial. No more than a block of trials is in memory. Rows of NaN at a
trial's end are padding, and are cut. Knows nothing about recordings.

Background of our choices: docs/decisions/0011.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from taxel.errors import BadFile, BadTable
from taxel.foreign.files import MIB
from taxel.foreign.held_arrays import Cells, Numbers, bytes_of, sides_of
from taxel.plain_text import number_of, visible
from taxel.recordings.imports.stacks.axes import (
    ROWS,
    TRIALS,
    Axes,
    check_axes,
    find_axes,
    parse_axes,
)
from taxel.recordings.imports.stacks.channels import channel_counts, take_channels
from taxel.recordings.imports.stacks.members import STAR, members_of, numbers_of, only_array
from taxel.recordings.imports.trial_sets import (
    FROM,
    MOST_TRIALS,
    OpenedFile,
    Padding,
    label_texts,
)
from taxel.recordings.imports.value_tables.row_times import BadTimes, check_time
from taxel.recordings.imports.value_tables.table_columns import MOST_VALUES
from taxel.recordings.imports.value_tables.tables import (
    MOST_CHANNELS,
    TIME_UNITS_S,
    Column,
    Missing,
    Table,
    check_values,
    parse_columns,
    parse_time,
    refuse_stamps,
)

_BLOCK_BYTES = 64 * MIB
"""Of trials that are read at once."""


@dataclass(frozen=True, slots=True, kw_only=True)
class StackWords:
    """What a row of the import table says of a file of arrays."""

    trials: str = ""
    """The array, or a pattern with * of several; empty for the only one that may be it."""
    axes: str = ""
    """What its axes are, as in "trials rows channels"; empty where one reading only is possible."""
    channels: str = ""
    time: str = ""
    one_label: bool = False
    """Whether the file has a label of its own, written out or in its name."""


class ArrayTrials:
    """The trials of a file of arrays.

    Args:
        path: The file.
        words: What the table says of it.
        labels: Names of this file's arrays that hold a value for each trial.
        counts: How many values such arrays of other files hold.
        where: Table and line, for messages.
        called: The file as the table names it, for remarks: two files of one name, in two folders,
            are two.

    Raises:
        BadTable: There is no such array, or it is not certain what its axes are.
    """

    def __init__(
        self,
        path: Path,
        words: StackWords,
        labels: Sequence[str],
        counts: Sequence[int],
        where: str,
        called: str,
    ) -> None:
        self._path, self._file, self._where = path, OpenedFile.at(path), where
        self._called_file = visible(called)
        self._remarks: list[str] = []
        self.doubts: list[str] = []
        self._block: tuple[int, NDArray[Any]] | None = None
        self._lengths: list[int] | None = None
        try:
            self.what = words.trials or only_array(self._file)
            self._members = members_of(self._file, self.what)
            first = self._members[0]
            self._single = len(self._members) > 1 or first.cell is not None or bool(first.stars)
            self._shapes = [numbers_of(self._file, member).shape for member in self._members]
            self._read_words(words, labels, counts)
        except BaseException:
            self.close()
            raise

    def _read_words(self, words: StackWords, labels: Sequence[str], counts: Sequence[int]) -> None:
        columns = parse_columns(words.channels, self._where)
        self._time = parse_time(words.time, self._where)
        if self._time.column is not None:
            refuse_stamps(self._time.column, self._where)
        named = "" if self._time.column is None else self._time.column.name
        self._time_array = named[len(FROM) :].strip() if named.lower().startswith(FROM) else ""
        in_channel = "" if self._time_array else named
        if in_channel and in_channel in self.names and not in_channel.isdecimal():
            raise BadTable(
                "a channel that holds time, or from: and the name of an array of times",
                f"{in_channel!r} in {self._where}, which is the name of an array",
                f"write from:{words.time.strip()}",
            )
        self._axes = self._find_axes(words, columns, bool(in_channel), labels, counts)
        self._places, self._columns, self._time_place = take_channels(
            columns, self._axes.names(self._shapes[0]), in_channel, self._where
        )
        self.keys = self._called()
        self._remarks.insert(0, self._in_words())

    @property
    def remarks(self) -> Sequence[str]:
        """How the array was read, and which labels were one-hot."""
        return self._remarks

    @property
    def names(self) -> Sequence[str]:
        """All arrays of the file."""
        return self._file.opened().names()

    @property
    def stars(self) -> list[tuple[str, ...]]:
        """What stands for each * in each trial's name; empty where the trials have no pattern."""
        return [member.stars for member in self._members] if self._members[0].stars else []

    @property
    def order(self) -> str:
        """A remark on the order of trials, where numbers in their names give another than the file.

        Labels in an array of their own may have been written in the file's order.
        """
        names = list(dict.fromkeys(member.name for member in self._members))
        taken = set(names)
        listed = [name for name in self.names if name in taken]
        at = next((n for n, pair in enumerate(zip(names, listed, strict=False))
                   if pair[0] != pair[1]), None)  # fmt: skip
        if at is None:
            return ""
        return (
            f"{visible(self.what)} in {self._called_file}: the trials are in the order of the "
            f"numbers in their names, {visible(names[at])} before {visible(listed[at])}, but the "
            f"file lists {visible(listed[at])} first; if the labels were written in that order, "
            "they are wrong: check a few of them"
        )

    @property
    def _may_pad(self) -> bool:
        """Whether trials had to be filled up: those of a stack, without a column of lengths."""
        return self._axes.trials is not None and self._lengths is None

    @property
    def _name(self) -> str:
        return visible(self.what) or "the array"

    def texts(self, name: str) -> list[str]:
        """Return each trial's own value of an array; or its only one.

        Raises:
            BadTable: There is no such array, or it has another number of values.
        """
        if STAR not in name:
            what = f"{visible(name) or 'the array'} in {self._path}"
            found, one_hot = label_texts(self._file.get(name), what)
            remark = f"{what} is one-hot: its classes are called by their columns, from 0"
            if one_hot and remark not in self._remarks:
                self._remarks.append(remark)
            return found
        found = []
        for member in self._members:
            filled = member.fill(name, self.what)
            values = self._file.get(filled)
            texts, _ = label_texts(values, f"{visible(filled)} in {self._path}")
            if len(texts) != 1:
                raise BadTable("one value for each trial", f"{len(texts)} in {visible(filled)} of "
                               f"{self._path}", "name another array")  # fmt: skip
            found += texts
        return found

    def cut_to(self, lengths: Sequence[int]) -> None:
        """Take only so many rows of each trial; what follows is padding.

        Raises:
            BadTable: There are more than a trial has.
        """
        for index, length in enumerate(lengths):
            rows = self._axes.size(self._shape_of(index), ROWS)
            if not 1 <= length <= rows:
                raise BadTable(
                    f"a length of 1 to {rows} rows", f"{length} for trial "
                    f"{visible(self.keys[index])} in {self._where}", "correct the column 'length'",
                )  # fmt: skip
        self._lengths = list(lengths)

    def table(self, index: int, missing: Missing, bad_times: BadTimes) -> tuple[Table, Padding]:
        """Return one trial's values, and what padding they had.

        Raises:
            BadTable: Its values or times are not as they should be.
        """
        where = f"{self._path}, trial {visible(self.keys[index])}"
        cells = self._trial(index)
        if self._lengths is not None:
            cells = cells[: self._lengths[index]]
        with np.errstate(invalid="ignore"):  # a NaN may be one that signals
            values = np.asarray(cells[:, self._places], np.float64)
            rows = len(values) if missing == "keep" else self._without_nan(cells)
        padding = Padding(len(values) - rows, _zeros_at_end(values) if self._may_pad else 0)
        values = values[:rows]
        if not rows:
            raise BadTable(
                "rows of numbers", f"none in {where}",
                "give it some, or keep NaN as invalid with --missing keep",
            )  # fmt: skip
        names = tuple(column.name for column in self._columns)
        check_values(where, values, names, missing)
        time_s = self._time_s(index, cells, rows)
        dropped = check_time(where, time_s, bad_times)
        units = tuple(column.unit for column in self._columns)
        table = Table(values=values, time_s=time_s, names=names, units=units,
                      dtype=cells.dtype)  # fmt: skip
        return table.without(dropped), padding

    def close(self) -> None:
        """Close the file; it is opened again where needed."""
        self._block = None
        self._file.close()

    def _without_nan(self, cells: NDArray[Any]) -> int:
        """Return how many rows there are up to the last one that is not all NaN.

        Also channels that are not wanted count: where one goes on, others end by a fault.
        """
        values = cells if self._time_place is None else np.delete(cells, self._time_place, axis=1)
        held = np.flatnonzero(~np.isnan(values).all(axis=1))
        return int(held[-1]) + 1 if len(held) else 0

    def _find_axes(
        self,
        words: StackWords,
        columns: Sequence[Column],
        with_time: bool,
        labels: Sequence[str],
        counts: Sequence[int],
    ) -> Axes:
        what = f"{self._name} in {self._path}"
        empty = [number for number, shape in enumerate(self._shapes, 1) if 0 in shape]
        if self._single and empty and len(self._shapes) > 1:
            raise BadTable("numbers in each trial", f"none in trial {empty[0]} of {what}",
                           "remove it, with its labels, or fill it in")  # fmt: skip
        if words.axes:
            axes = parse_axes(words.axes, self._where)
            for shape in self._shapes:
                check_axes(axes, shape, what)
            if self._single and axes.trials is not None:
                raise BadTable(
                    f"the axes of a single trial, as {what} holds one in each array",
                    f"'{axes}' in {self._where}", "leave out the word trials",
                )  # fmt: skip
        else:
            own = [] if self._single else [len(self.texts(name)) for name in labels]
            trials = next((count for count in (*own, *counts) if count > 1), None)
            many = not self._single and (trials is not None or len(self._shapes[0]) > 2)
            axes = find_axes(self._shapes, what, many=many, trials=trials,
                             channels=channel_counts(columns, with_time),
                             one_label=words.one_label)  # fmt: skip
        self._check_sizes(axes, what)
        return axes

    def _check_sizes(self, axes: Axes, what: str) -> None:
        channels = {axes.channels(shape) for shape in self._shapes}
        if len(channels) > 1 or not 1 <= max(channels) <= MOST_CHANNELS:
            raise BadTable(
                f"equally many channels in all trials of {what}, {MOST_CHANNELS:,} at most",
                f"{min(channels)} to {max(channels)}" if len(channels) > 1 else f"{channels.pop()}",
                "correct the column 'axes'",
            )
        for shape in self._shapes:
            trials, rows = axes.size(shape, TRIALS), axes.size(shape, ROWS)
            if not 1 <= trials <= MOST_TRIALS:
                raise BadTable(f"between 1 and {MOST_TRIALS:,} trials in {what}", f"{trials:,}",
                               "split the file, or correct the column 'axes'")  # fmt: skip
            if rows * axes.channels(shape) > MOST_VALUES:
                raise BadTable(f"at most {MOST_VALUES:,} values in a trial of {what}",
                               f"{rows:,} rows", "correct the column 'axes'")  # fmt: skip

    def _called(self) -> list[str]:
        first = self._members[0]
        if self._axes.trials is not None:
            return [str(n) for n in range(1, self._axes.size(self._shapes[0], TRIALS) + 1)]
        if not first.stars:
            return [str(number) for number in range(1, len(self._members) + 1)]
        cells = ("" if member.cell is None else f"-{member.cell + 1}" for member in self._members)
        return ["-".join(member.stars) + cell
                for member, cell in zip(self._members, cells, strict=True)]  # fmt: skip

    def _in_words(self) -> str:
        shape, name = self._shapes[0], f"{self._name} in {self._called_file}"
        size = self._axes.in_words(shape)
        if self._axes.trials is not None:
            return f"{name}, {sides_of(shape)}, was read as '{self._axes}': {size}"
        number = len(self._members)
        if number == 1:
            return f"{name} was read as 1 trial of '{self._axes}': {size}"
        return f"{name} was read as {number} trials of '{self._axes}', the first of {size}"

    def _shape_of(self, index: int) -> tuple[int, ...]:
        return self._shapes[0 if self._axes.trials is not None else index]

    def _trial(self, index: int) -> NDArray[Any]:
        """Return a trial's values, shape (rows, the array's channels), in the file's own type."""
        axis = self._axes.trials
        try:
            if axis is None:
                return self._axes.table(numbers_of(self._file, self._members[index]).whole())
            start, block = self._block_with(axis, index)
        except BadFile as error:
            raise BadTable(error.needed, f"{self._path}: {error.got}", error.mend) from error
        places = [slice(None)] * block.ndim
        places[axis] = slice(index - start, index - start + 1)
        return self._axes.table(block[tuple(places)])

    def _block_with(self, axis: int, index: int) -> tuple[int, NDArray[Any]]:
        """Return the block of trials that holds one, and the number of its first."""
        if self._block is None or not 0 <= index - self._block[0] < self._block[1].shape[axis]:
            numbers = numbers_of(self._file, self._members[0])
            count = numbers.shape[axis]
            each = max(1, bytes_of(numbers.shape, numbers.dtype) // count)
            step = max(1, _BLOCK_BYTES // each)
            start = index // step * step
            block = numbers.part(axis, start, min(count, start + step))
            self._block = (start, np.ascontiguousarray(block))
        return self._block

    def _time_s(self, index: int, cells: NDArray[Any], rows: int) -> NDArray[np.float64]:
        if self._time.column is None:
            return np.arange(rows) / (self._time.rate_hz or 1.0)
        unit_s = TIME_UNITS_S[self._time.column.unit]
        if self._time_place is not None:
            return np.asarray(cells[:rows, self._time_place], np.float64) * unit_s
        return self._times_of(index)[:rows] * unit_s

    def _times_of(self, index: int) -> NDArray[np.float64]:
        """Return a trial's times out of an array of their own: one for all, one each, or a cell."""
        name = self._time_array
        if STAR in name:
            name = self._members[index].fill(name, self.what)
        held = self._file.get(name)
        if isinstance(held, Cells) and len(held.items) == len(self.keys):
            held = held.items[index]
        shape, rows = self._shape_of(index), self._axes.size(self._shape_of(index), ROWS)
        words = [word for word in self._axes.words if word in (TRIALS, ROWS)]
        own = tuple(self._axes.size(shape, word) for word in words)
        try:
            if isinstance(held, Numbers) and held.dtype.kind in "biuf":
                sides = tuple(side for side in held.shape if side != 1)
                if sides == (rows,) or (rows == 1 and not sides):
                    return np.asarray(held.whole(), np.float64).ravel()
                if len(words) == 2 and held.shape == own:
                    part = held.part(words.index(TRIALS), index, index + 1)
                    return np.asarray(part, np.float64).ravel()
        except BadFile as error:
            raise BadTable(error.needed, f"{self._path}: {error.got}", error.mend) from error
        raise BadTable(
            f"a time for each of {number_of(rows, 'row')}, or for each row of each trial",
            f"{held} in {visible(name)} of {self._path}", "correct the column 'time'",
        )  # fmt: skip


def _zeros_at_end(values: NDArray[np.float64]) -> int:
    held = np.flatnonzero(values.any(axis=1))  # NaN is no zero
    return len(values) - 1 - int(held[-1]) if len(held) else 0
