"""WAV files as tables of values: a file is a trial, its channels are numbered from 1.

The rate is that of the file's head. Knows nothing about recordings.

Background of our choices: docs/decisions/0033.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np

from taxel.errors import BadFile, BadTable
from taxel.foreign.wav_file import WavHead, read_wav, read_wav_head
from taxel.recordings.imports.value_tables.places import as_number
from taxel.recordings.imports.value_tables.row_times import LARGEST_RATE_HZ
from taxel.recordings.imports.value_tables.table_columns import MOST_VALUES
from taxel.recordings.imports.value_tables.tables import (
    ALL,
    MOST_CHANNELS,
    Column,
    Missing,
    Table,
    check_values,
    parse_columns,
    parse_time,
)

FULL_SCALE = "FS"
"""Unit of channels that the import table does not name: shares of full scale."""


def wav_reader(path: Path, channels: str, time: str, where: str) -> Callable[[Missing], Table]:
    """Return what reads a WAV file; a BadTable that it raises is the file's fault.

    Args:
        path: The file.
        channels: Such as "1[m/s2] 2[m/s2]" or "*[Pa]"; empty for all, in shares of full scale.
        time: Empty, or the rate that the file's head must have, as in "rate:44100Hz".
        where: The import table's row, for messages.

    Raises:
        BadTable: The row names channels or times that a WAV file cannot have.
    """
    columns = parse_columns(channels or f"{ALL}[{FULL_SCALE}]", where)
    rate_hz = None
    if time:
        stated = parse_time(time, where)
        if stated.column is not None:
            raise BadTable(f"an empty column 'time' for a WAV file, in {where}", repr(time[:80]),
                           "leave it empty: the file's head holds the rate")  # fmt: skip
        rate_hz = stated.rate_hz
    return lambda missing: _read(path, columns, rate_hz, missing)


def _read(
    path: Path, columns: tuple[Column, ...], rate_hz: float | None, missing: Missing
) -> Table:
    try:
        head = read_wav_head(path)
        _check_rate(path, head, rate_hz)
        columns = _columns(path, head, columns)
        head, values = read_wav(path, [as_number(column.name) - 1 for column in columns],
                                MOST_VALUES)  # fmt: skip
    except BadFile as error:
        raise BadTable(error.needed, f"{error.got} in {path}", error.mend) from error
    except OSError as error:
        raise BadTable("a file that can be read", f"{path}: {error.strerror or error}",
                       "check the path") from error  # fmt: skip
    names = tuple(column.name for column in columns)
    check_values(path, values, names, missing, place="value {row} of channel {name}")
    return Table(values=values, time_s=np.arange(len(values)) / head.rate_hz, names=names,
                 units=tuple(column.unit for column in columns), rails=head.rails,
                 dtype=np.dtype(f"f{head.bits // 8}" if head.is_float else np.float64))  # fmt: skip


def _check_rate(path: Path, head: WavHead, stated_hz: float | None) -> None:
    if head.rate_hz > LARGEST_RATE_HZ:
        raise BadTable(f"at most {LARGEST_RATE_HZ:,.0f} scans a second",
                       f"{head.rate_hz:,} in {path}", "write the file again")  # fmt: skip
    if stated_hz is not None and stated_hz != head.rate_hz:
        raise BadTable(
            f"the rate of the file's head, {head.rate_hz} Hz", f"{stated_hz:g} Hz for {path}",
            "leave the column 'time' empty; if the head is wrong, write the file again",
        )  # fmt: skip


def _columns(path: Path, head: WavHead, columns: tuple[Column, ...]) -> tuple[Column, ...]:
    """Return the wanted channels, all of them where the row says so."""
    if [column.name for column in columns] == [ALL]:
        if head.channels > MOST_CHANNELS:
            raise BadTable(f"at most {MOST_CHANNELS:,} channels in {path}", f"{head.channels:,}",
                           "name the channels")  # fmt: skip
        return tuple(Column(name=str(number), unit=columns[0].unit)
                     for number in range(1, head.channels + 1))  # fmt: skip
    for column in columns:
        if not 1 <= as_number(column.name) <= head.channels:
            raise BadTable(
                f"channels by their numbers, 1 to {head.channels}: no names are in {path}",
                repr(column.name[:80]), "write channels as 1[N] 2[N] in the import table",
            )  # fmt: skip
    return columns
