"""Read what a row of an import table stands for: a file, or a trial of one.

What the row itself says wrongly is refused before its file is opened, so that faults of the table
and of a file can be told apart. Knows nothing about how recordings are written.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from taxel.errors import BadTable
from taxel.foreign.sheets import file_behind
from taxel.foreign.wav_file import WAV_ENDING
from taxel.plain_text import number_of
from taxel.recordings.imports.lying_texts import HINT, may_lie, read_lying
from taxel.recordings.imports.pieces import cut
from taxel.recordings.imports.row_labels import marks_by_row
from taxel.recordings.imports.rows import ImportRow
from taxel.recordings.imports.scan_blocks import lines_in_scan, read_blocks
from taxel.recordings.imports.table_files import NO_FILE
from taxel.recordings.imports.trial_runs import TextTrials
from taxel.recordings.imports.trial_sets import Padding
from taxel.recordings.imports.value_tables import tables
from taxel.recordings.imports.value_tables.layouts import LayoutReader, find_layout
from taxel.recordings.imports.value_tables.missing_marks import without_marked
from taxel.recordings.imports.value_tables.row_times import BadTimes, check_time
from taxel.recordings.imports.value_tables.table_columns import text_cells
from taxel.recordings.imports.value_tables.table_form import is_text
from taxel.recordings.imports.value_tables.tables import Column, Missing, Table, TimeColumn
from taxel.recordings.imports.value_tables.wav_tables import wav_reader
from taxel.signals import Mark, Samples, Validity


@dataclass(frozen=True, slots=True, kw_only=True)
class Content:
    """What a row's file, or a trial of it, holds."""

    table: Table
    samples: Samples
    """The table's values, as scans."""
    marks: tuple[Mark, ...]
    """Of labels that stand in its rows; or pieces."""
    padding: Padding
    marked: Mapping[str, int] = field(default_factory=dict)
    """Mark of missing values → how many there were; they are NaN in the table."""
    in_no_piece: int = 0
    """Rows behind the last whole piece."""
    short: int = 0
    """Stretches that are shorter than a piece."""


def reader_of(
    row: ImportRow, missing: Missing, bad_times: BadTimes, code_dir: Path, *, allow_code: bool
) -> Callable[[], Content]:
    """Return what reads a row's file; a BadTable that it raises is the file's fault.

    Args:
        row: The row.
        missing: What happens to values that are not finite.
        bad_times: What happens to rows whose times are garbled or repeat.
        code_dir: What the module of a layout is relative to.
        allow_code: Whether modules may be run.

    Raises:
        BadTable: The row names channels, times or a layout that cannot be.
    """
    read = _table_reader(row, missing, bad_times, code_dir, allow_code=allow_code)

    def content() -> Content:
        if not file_behind(row.file).is_file():
            raise BadTable("a file to import", f"{row.file}, which is not there", NO_FILE)
        table, padding = read()
        values, marked = without_marked(table.values, row.missing, table.dtype)
        table = replace(table, values=values)
        samples = Samples.from_values(table.values, table.time_s, row.full_scale)
        if row.full_scale is not None and table.rails is not None:
            samples = replace(samples, validity=samples.validity | _clipped(table, table.rails))
        marks = tuple(_marks(row, samples, table.dropped.rows)) if row.by_row else ()
        return Content(table=table, samples=samples, marks=marks, padding=padding, marked=marked)

    return content


def _clipped(table: Table, rails: tuple[float, float]) -> NDArray[np.uint8]:
    """Return the flags of values at either end of what a file's numbers can hold."""
    ends = (table.values <= rails[0]) | (table.values >= rails[1])
    return np.where(ends, Validity.SATURATED, 0).astype(np.uint8)


def in_pieces(row: ImportRow, content: Content, wholes: Sequence[Mark]) -> Content:
    """Return a row's content with its wholes as marks, cut into pieces where the row says so.

    Args:
        row: The row.
        content: Of its file or trial.
        wholes: Stretches of it; none where it is one whole.

    Raises:
        BadTable: No whole is long enough for a piece.
    """
    if row.pieces is None:
        return replace(content, marks=tuple(wholes))
    file = row.groups.get("file", row.file.name)
    marks, left, short = cut(wholes, content.samples.fitted_s, row.pieces, file)
    return replace(content, marks=marks, in_no_piece=left, short=short)


def _table_reader(
    row: ImportRow, missing: Missing, bad_times: BadTimes, code_dir: Path, *, allow_code: bool
) -> Callable[[], tuple[Table, Padding]]:
    if row.trial is not None:
        return partial(row.trial.source.table, row.trial.index, missing, bad_times)
    where = f"the row of {row.file.name}"
    if row.layout != "csv":
        reader = find_layout(row.layout, code_dir, allow_code)
        chosen = tables.parse_columns(row.channels, where) if row.channels else ()
        return lambda: (_by_layout(row, reader, chosen, missing, bad_times), Padding())
    if row.file.name.lower().endswith(WAV_ENDING):
        read_wav = wav_reader(row.file, row.channels, row.time, where)
        return lambda: (read_wav(missing), Padding())
    columns, time = tables.parse_columns(row.channels, where), tables.parse_time(row.time, where)
    if row.lying:
        return lambda: (read_lying(row.file, columns, time, missing, bad_times), Padding())
    return lambda: (_text_or_array(row, columns, time, missing, bad_times), Padding())


def _text_or_array(
    row: ImportRow,
    columns: Sequence[Column],
    time: TimeColumn,
    missing: Missing,
    bad_times: BadTimes,
) -> Table:
    """Return the table of a text or a .npy file; of a text that may lie on its side the refusal
    says how to say so.
    """
    but = row.by_row.values()
    if not but and (lines := lines_in_scan(row.file, columns, time)):
        return read_blocks(row.file, columns, time, missing, lines)
    try:
        return tables.read_table(row.file, columns, time, missing, bad_times=bad_times, but=but)
    except BadTable as error:
        if not (is_text(row.file.name) and may_lie(row.file)):
            raise
        raise BadTable(error.needed, error.got, f"{error.mend}; {HINT}") from error


def _marks(row: ImportRow, samples: Samples, left_out: list[int]) -> list[Mark]:
    """Return the marks of labels that stand in a file's rows.

    Args:
        row: What the file is.
        samples: Its scans.
        left_out: Rows, from 0, of which there is no scan.

    Raises:
        BadTable: No row has one.
    """
    columns = list(row.by_row.values())
    if row.trial is None:
        where = f"the row of {row.file.name}"
        others = tables.names_of(tables.parse_columns(row.channels, where),
                                 tables.parse_time(row.time, where))  # fmt: skip
        rows = list(text_cells(row.file, columns, others)[1])
        cells = [[own[place] for own in rows] for place in range(len(columns))]
    else:
        assert isinstance(row.trial.source, TextTrials)
        source, index = row.trial.source, row.trial.index
        cells = [source.by_row(index, column) for column in columns]
    if left_out:
        cells = [np.delete(np.array(own, object), left_out).tolist() for own in cells]
    marks = marks_by_row(dict(zip(row.by_row, cells, strict=True)), samples.fitted_s)
    if not marks and not row.labels:
        raise BadTable(
            "a label in some row", f"none in the column {columns[0]!r} of {row.file}",
            "fill it in, or leave the file out",
        )  # fmt: skip
    return marks


def _by_layout(
    row: ImportRow,
    reader: LayoutReader,
    columns: Sequence[Column],
    missing: Missing,
    bad_times: BadTimes,
) -> Table:
    try:
        values, time_s, names, units = reader(row.file)
        held = np.asarray(values)
        table = Table(
            values=held.astype(np.float64),
            time_s=np.asarray(time_s, np.float64),
            names=tuple(names),
            units=tuple(units),
            dtype=held.dtype,
        )
    except BadTable:
        raise
    except Exception as error:  # a layout of the user's own may raise anything
        raise BadTable(
            f"a file in the layout {row.layout}",
            f"{row.file}: {type(error).__name__}: {error}",
            "mend the file or the layout",
        ) from error
    _check_shapes(row, table)
    tables.check_values(row.file, table.values, table.names, missing)
    table = table.without(check_time(row.file, table.time_s, bad_times))
    return _select(table, columns, f"the row of {row.file.name}") if columns else table


def _check_shapes(row: ImportRow, table: Table) -> None:
    rows = table.values.shape[0] if table.values.ndim else 0
    wanted = (rows, len(table.names))
    if (
        table.values.shape != wanted
        or table.time_s.shape != (rows,)
        or len(table.units) != len(table.names)
    ):
        raise BadTable(
            "values (n, channels), time_s (n,), one name and one unit a channel",
            f"{table.values.shape}, {table.time_s.shape}, {number_of(len(table.names), 'name')}, "
            f"{number_of(len(table.units), 'unit')} for {row.file}",
            f"mend the layout {row.layout}",
        )


def _select(table: Table, columns: Sequence[Column], where: str) -> Table:
    unknown = [column.name for column in columns if column.name not in table.names]
    if unknown:
        raise BadTable(
            f"channels out of {', '.join(table.names)}", f"{unknown[0]!r} in {where}", "correct it"
        )
    places = [table.names.index(column.name) for column in columns]
    return replace(
        table,
        values=table.values[:, places],
        names=tuple(column.name for column in columns),
        units=tuple(column.unit for column in columns),
    )
