"""Turn tables of values into recordings, by a table that says what each file is.

FORMAT.md describes the import table's columns. All files are read and
written before the output folder appears: it is complete or not there. Knows
nothing about particular data sets (known.py).
"""

from __future__ import annotations

import os
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from taxel.errors import BadTable
from taxel.plain_text import number_of, visible
from taxel.recordings.imports import tables
from taxel.recordings.imports.earlier import IMPORTED, import_folder
from taxel.recordings.imports.intervals import (
    Interval,
    marks_of,
    read_intervals,
    stem_of,
    write_marked,
)
from taxel.recordings.imports.layouts import find_layout
from taxel.recordings.imports.notes import (
    FileFacts,
    coarse_of,
    doubtful_names,
    gaps_of,
    lying_of,
)
from taxel.recordings.imports.row_labels import marks_by_row, remarks_on_rows
from taxel.recordings.imports.rows import ImportRow, read_rows
from taxel.recordings.imports.spelling import composed
from taxel.recordings.imports.table_columns import text_cells
from taxel.recordings.imports.tables import Missing, Table
from taxel.recordings.imports.trial_runs import TextTrials
from taxel.recordings.imports.trial_sets import Padding
from taxel.recordings.manifest import Manifest
from taxel.recordings.writer import Recorder
from taxel.signals import Mark, Samples, SensorInfo


@dataclass(frozen=True, slots=True, kw_only=True)
class ImportOptions:
    """How strictly files are read."""

    missing: Missing = "refuse"
    """Empty cells, NaN and infinity: refuse the file, or keep them flagged as not finite."""
    allow_code: bool = False
    """Run layouts of the form module.py:function."""
    allow_outside: bool = False
    """Take files that lie outside the data folder; see table_files.py."""
    overwrite: bool = False
    """Replace an existing output folder that holds nothing else than what is written again, and
    recordings of earlier imports."""


def import_table(
    manifest_csv: Path | str,
    output_dir: Path | str,
    *,
    data_dir: Path | None = None,
    intervals: Path | None = None,
    options: ImportOptions = ImportOptions(),
    progress: Callable[[int, int], None] | None = None,
    on_file: Callable[[FileFacts], None] | None = None,
) -> list[Path]:
    """Write one recording for each row of an import table.

    Args:
        manifest_csv: The import table.
        output_dir: Folder to be made.
        data_dir: What the column `file` is relative to; the table's own folder by default.
        intervals: A table of labelled intervals, which become marks (intervals.py).
        options: How strictly files are read.
        progress: Called with files done and files in all.
        on_file: Called with what was found in each file; `import_notes.notes_of` says it.

    Raises:
        BadTable: A table or any file is not as it should be; then nothing is written.
        RecordingFailed: The disk refused.
    """
    manifest_csv, output_dir = Path(manifest_csv), Path(output_dir)
    rows = read_rows(manifest_csv, data_dir or manifest_csv.parent, outside=options.allow_outside)
    return import_rows(
        rows, output_dir, code_dir=manifest_csv.parent, intervals=intervals_of(rows, intervals),
        options=options, progress=progress, on_file=on_file,
    )  # fmt: skip


def import_rows(
    rows: Sequence[ImportRow],
    output_dir: Path,
    *,
    code_dir: Path = Path(),
    intervals: Mapping[str, Sequence[Interval]] | None = None,
    options: ImportOptions = ImportOptions(),
    progress: Callable[[int, int], None] | None = None,
    on_file: Callable[[FileFacts], None] | None = None,
) -> list[Path]:
    """Write one recording for each row; see `import_table` and `intervals_of`."""
    names = _output_names(rows)
    files = [f"{name}.mcap" for name in names]
    with (
        _closing(rows),
        import_folder(output_dir, files, overwrite=options.overwrite) as made,
    ):
        following = (*rows[1:], None)
        for done, (row, name, file, after) in enumerate(
            zip(rows, names, files, following, strict=True), 1
        ):
            own = (intervals or {}).get(name, ())
            facts = _import_file(row, own, made / file, code_dir, options)
            if row.trial and not (after and after.trial and after.trial.source is row.trial.source):
                row.trial.source.close()  # not all of 1,000 files are open at once
            if on_file is not None:
                on_file(facts)
            if progress is not None:
                progress(done, len(rows))
    return [output_dir / file for file in files]


@contextmanager
def _closing(rows: Sequence[ImportRow]) -> Iterator[None]:
    """Close the files of many trials at the end, whatever happens."""
    try:
        yield
    finally:
        for source in {
            id(row.trial.source): row.trial.source for row in rows if row.trial
        }.values():
            source.close()


def intervals_of(rows: Sequence[ImportRow], table: Path | None) -> dict[str, list[Interval]]:
    """Return the intervals of each row's recording, by its name; none without a table.

    Raises:
        BadTable: The table is not as it should be, or a file has neither an interval nor a
            label of its own.
    """
    if table is None:
        return {}
    names = _output_names(rows)
    found = read_intervals(table, names)
    for row, name in zip(rows, names, strict=True):
        if name not in found and not row.labels:
            raise BadTable("an interval or a label for each file", f"none for {row.file}",
                           f"add lines to {table}, or leave the file out")  # fmt: skip
    return found


def _output_names(rows: Sequence[ImportRow]) -> list[str]:
    """Return the recordings' names, without ending: with their folders where files share a name."""
    stems = [row.name or stem_of(row.file.name) for row in rows]
    often = Counter(stems)
    if len(often) == len(stems):
        return stems
    paths = [Path(os.path.abspath(row.file)) for row in rows]
    top = os.path.commonpath([path.parent for path in paths])
    names: dict[str, Path] = {}
    for path, stem in zip(paths, stems, strict=True):
        folders = path.parent.relative_to(top).parts if often[stem] > 1 else ()
        name = "-".join((*folders, stem))
        if name in names:
            raise _one_name(names[name], path)
        names[name] = path
    _refuse_twice([pair for pair in zip(paths, stems, strict=True) if often[pair[1]] > 1])
    return list(names)


def _refuse_twice(paths: Sequence[tuple[Path, str]]) -> None:
    """Refuse a file, or a trial of one, that two paths lead to, be it by a link.

    Args:
        paths: Each with the name of its recording, which tells a file's trials apart.
    """
    found: dict[tuple[Path, str], Path] = {}
    for path, stem in paths:
        before = found.setdefault((path.resolve(), stem), path)
        if before is not path:
            raise _one_name(before, path)


def _one_name(first: Path, second: Path) -> BadTable:
    if first.resolve() == second.resolve():
        return BadTable(
            "each file in one row", f"{first} in two", "remove a row, or mark parts of the file "
            "as trials with --intervals",
        )  # fmt: skip
    return BadTable("files whose names differ", f"{first} and {second}", "rename one of them")


def _import_file(
    row: ImportRow,
    intervals: Sequence[Interval],
    path: Path,
    code_dir: Path,
    options: ImportOptions,
) -> FileFacts:
    if not row.file.is_file():
        raise BadTable("a file to import", f"{row.file}, which is not there", "check the path")
    padding = Padding()
    if row.trial is not None:
        table, padding = row.trial.source.table(row.trial.index, options.missing)
    else:
        table = _read(row, code_dir, options)
    samples = Samples.from_values(table.values, table.time_s, row.full_scale)
    steps = np.diff(table.time_s)
    info = SensorInfo(
        name=row.sensor,
        channels=table.names,
        units=table.units,
        rate_hz=round(float(1.0 / np.median(steps)), 6) if len(steps) else _stated_rate(row),
        full_scale=row.full_scale,
        details={"imported_from": row.file.name, "layout": row.layout} | dict(row.details),
    )
    marks = _marks(row, intervals, samples, info)
    labels, groups = _composed(row.labels), _composed(row.groups)
    recorder = Recorder(path, Manifest(sensor=info, labels=labels, groups=groups))
    try:
        write_marked(recorder, samples, marks)
        recorder.close(IMPORTED)
    except BaseException:
        recorder.discard()
        raise
    gaps, longest_gap_s, longest_from_s = gaps_of(table.time_s)
    source = row.trial.source if row.trial else None
    return FileFacts(
        file=f"{row.file.name}[{row.details['trial']}]" if row.trial else row.file.name,
        of_line=(*row.remarks, *remarks_on_rows(row.by_row)),
        remarks=tuple(source.remarks) if source else (),
        doubts=(*row.doubts, *(source.doubts if source else ()), *_doubtful(row, table)),
        coarse=coarse_of(table.values, table.names),
        lying=lying_of(*table.values.shape)
        if _by_star(row) and row.trial is None and row.file.name.lower().endswith(".npy")
        else "",
        padding=padding.cut,
        zeros=padding.zeros,
        number_header=table.number_header,
        decimal_comma=table.decimal_comma,
        one_more=table.one_more,
        passed_over=table.passed_over,
        rate_hz=info.rate_hz,
        time=row.time if row.layout == "csv" and not row.time.strip().startswith("rate:") else "",
        gaps=gaps,
        longest_gap_s=longest_gap_s,
        longest_from_s=longest_from_s,
    )


def _marks(
    row: ImportRow, intervals: Sequence[Interval], samples: Samples, info: SensorInfo
) -> list[Mark]:
    """Return a recording's marks: of a table of intervals, or of labels that stand in its rows."""
    if not row.by_row:
        return marks_of(intervals, samples.fitted_s, info.rate_hz)
    if intervals:
        raise BadTable(
            "labels from rows or from intervals", f"both for {row.file}",
            "leave one of them out",
        )  # fmt: skip
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
    marks = marks_by_row(dict(zip(row.by_row, cells, strict=True)), samples.fitted_s)
    if not marks and not row.labels:
        raise BadTable(
            "a label in some row", f"none in the column {columns[0]!r} of {row.file}",
            "fill it in, or leave the file out",
        )  # fmt: skip
    return marks


def _doubtful(row: ImportRow, table: Table) -> list[str]:
    """Return a line on names that speak against channels, where * took all columns."""
    called = visible(row.called or row.file.name)
    return doubtful_names(called, table.names) if _by_star(row) else []


def _by_star(row: ImportRow) -> bool:
    return row.layout == "csv" and row.channels.strip().startswith(tables.ALL)


def _stated_rate(row: ImportRow) -> float:
    """Return the rate that a row of the table states, hertz; 0 where a column holds times."""
    if not row.time.strip().startswith("rate:"):
        return 0.0
    return tables.parse_time(row.time, f"the row of {row.file.name}").rate_hz or 0.0


def _composed(pairs: Mapping[str, str]) -> dict[str, str]:
    return {composed(name): composed(value) for name, value in pairs.items()}


def _read(row: ImportRow, code_dir: Path, options: ImportOptions) -> Table:
    where = f"the row of {row.file.name}"
    if row.layout == "csv":
        return tables.read_table(
            row.file,
            tables.parse_columns(row.channels, where),
            tables.parse_time(row.time, where),
            options.missing,
            but=row.by_row.values(),
        )
    reader = find_layout(row.layout, code_dir, options.allow_code)
    try:
        values, time_s, names, units = reader(row.file)
        table = Table(
            values=np.asarray(values, np.float64),
            time_s=np.asarray(time_s, np.float64),
            names=tuple(names),
            units=tuple(units),
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
    tables.check_values(row.file, table.values, table.names, options.missing)
    tables.check_time(row.file, table.time_s)
    return _select(table, row, where) if row.channels else table


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


def _select(table: Table, row: ImportRow, where: str) -> Table:
    columns = tables.parse_columns(row.channels, where)
    unknown = [column.name for column in columns if column.name not in table.names]
    if unknown:
        raise BadTable(
            f"channels out of {', '.join(table.names)}", f"{unknown[0]!r} in {where}", "correct it"
        )
    places = [table.names.index(column.name) for column in columns]
    return Table(
        values=table.values[:, places],
        time_s=table.time_s,
        names=tuple(column.name for column in columns),
        units=tuple(column.unit for column in columns),
    )
