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
from dataclasses import dataclass, replace
from itertools import groupby
from pathlib import Path

import numpy as np

from taxel.errors import BadTable
from taxel.foreign.hdf5_trial import many_hdf5
from taxel.foreign.sheets import chosen_of, is_sheet
from taxel.plain_text import visible
from taxel.recordings.imports.earlier import IMPORTED, import_folder
from taxel.recordings.imports.intervals import (
    Interval,
    marks_of,
    read_intervals,
    stem_of,
    write_marked,
)
from taxel.recordings.imports.left_out import naming_option, refuse_whole_lots
from taxel.recordings.imports.notes import (
    FileFacts,
    coarse_of,
    doubtful_names,
    gaps_of,
    lying_of,
)
from taxel.recordings.imports.reading import Content, in_pieces, reader_of
from taxel.recordings.imports.row_labels import remarks_on_rows
from taxel.recordings.imports.rows import ImportRow, read_rows
from taxel.recordings.imports.spelling import composed, unknown_words
from taxel.recordings.imports.value_tables import tables
from taxel.recordings.imports.value_tables.row_times import BadTimes, OnBadTime
from taxel.recordings.imports.value_tables.table_form import is_text, is_whole
from taxel.recordings.imports.value_tables.tables import Missing, Table
from taxel.recordings.manifest import Manifest
from taxel.recordings.writer import Recorder
from taxel.signals import Mark, SensorInfo


@dataclass(frozen=True, slots=True, kw_only=True)
class ImportOptions:
    """How strictly files are read."""

    missing: Missing = "refuse"
    """Empty cells, NaN and infinity: refuse the file, or keep them flagged as not finite."""
    repeated_times: OnBadTime = "refuse"
    """Rows that repeat the time of the row above: refuse the file, or leave such rows out, if they
    are few."""
    garbled_times: OnBadTime = "refuse"
    """Rows whose time lies far outside those of both neighbours: likewise."""
    allow_code: bool = False
    """Run layouts of the form module.py:function."""
    allow_outside: bool = False
    """Take files that lie outside the data folder; see table_files.py."""
    skip_unreadable: bool = False
    """Leave out files that cannot be read as the table says, where others can be; left_out.py."""
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
        on_file: Called with what was found in each file, or why it was left out;
            `notes.notes_of` says it.

    Raises:
        BadTable: A table or any file is not as it should be; then nothing is written.
        RecordingFailed: The disk refused.
    """
    manifest_csv, output_dir = Path(manifest_csv), Path(output_dir)
    rows = read_rows(
        manifest_csv, data_dir or manifest_csv.parent,
        outside=options.allow_outside, skip_unreadable=options.skip_unreadable,
    )  # fmt: skip
    return import_rows(
        rows, output_dir, code_dir=manifest_csv.parent, intervals=intervals_of(rows, intervals),
        options=options, progress=progress, on_file=on_file,
    )  # fmt: skip


@many_hdf5()
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
    parts, faults, done = _parts(rows, intervals or {}), dict[int, BadTable](), 0
    lines = [part[0].row.line for part in parts]
    # With files left out, no name is sure to be written again, and what has it must not go.
    names = () if options.skip_unreadable else [job.file for part in parts for job in part]
    on_file, progress = on_file or (lambda _: None), progress or (lambda done, of: None)
    with _closing(rows), import_folder(output_dir, names, overwrite=options.overwrite) as made:
        for place, part in enumerate(parts):
            facts: list[FileFacts] = []
            for found in _import_part(part, made, code_dir, options):
                if isinstance(found, BadTable):
                    faults[place] = found
                    continue
                facts.append(found)
                progress(done + len(facts), len(rows))
            done += len(part)
            if place in faults:
                if not options.skip_unreadable:
                    raise naming_option(faults[place], lines, place, lambda other: isinstance(
                        _content(parts[other][0], code_dir, options), Content))  # fmt: skip
                facts = [_left_out(part[0].row, faults[place])]
                progress(done, len(rows))
            for own in facts:
                on_file(own)
        refuse_whole_lots(lines, faults)
    return [output_dir / job.file
            for place, part in enumerate(parts) if place not in faults for job in part]  # fmt: skip


@dataclass(frozen=True, slots=True)
class _Job:
    """A recording to be written."""

    row: ImportRow
    file: str
    """The recording's name; none where it is known that the row's file cannot be read."""
    intervals: Sequence[Interval]


def _parts(
    rows: Sequence[ImportRow], intervals: Mapping[str, Sequence[Interval]]
) -> list[list[_Job]]:
    """Return what is to be written, in a list for each file."""
    jobs = [_Job(row, f"{row.name}.mcap", intervals.get(row.name, ())) for row in with_names(rows)]
    each = groupby(jobs, key=lambda job: id(job.row.trial.source if job.row.trial else job))
    return [list(part) for _, part in each]


def _import_part(
    part: Sequence[_Job], made: Path, code_dir: Path, options: ImportOptions
) -> Iterator[FileFacts | BadTable]:
    """Write a file's recordings, yielding what a person should know of each.

    Where one of them cannot be read, the reason comes last, and none of them is there.
    """
    for number, job in enumerate(part):
        content = _content(job, code_dir, options)
        if isinstance(content, BadTable):
            for earlier in part[:number]:
                (made / earlier.file).unlink()
            yield content
            break
        yield _import_file(job, content, made / job.file)
    if (trial := part[0].row.trial) is not None:
        trial.source.close()  # not all of 1,000 files are open at once


def _content(job: _Job, code_dir: Path, options: ImportOptions) -> Content | BadTable:
    """Return what a row's file or trial holds, in pieces if so, or why it cannot be read.

    Raises:
        BadTable: The row itself is not as it should be.
    """
    row = job.row
    if row.fault is not None:
        return row.fault
    bad_times = BadTimes(repeated=options.repeated_times, garbled=options.garbled_times)
    read = reader_of(row, options.missing, bad_times, code_dir, allow_code=options.allow_code)
    try:
        content = read()
        return content if job.intervals else in_pieces(row, content, content.marks)
    except BadTable as error:
        return error


def _left_out(row: ImportRow, fault: BadTable) -> FileFacts:
    return FileFacts(
        file=row.called or row.file.name, left_out=f"needed {fault.needed}; got {fault.got}"
    )


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
    rows = [row for row in rows if row.fault is None]
    names = _output_names(rows)
    found = read_intervals(table, names)
    for row, name in zip(rows, names, strict=True):
        if name not in found and not row.labels:
            raise BadTable("an interval or a label for each file", f"none for {row.file}",
                           f"add lines to {table}, or leave the file out")  # fmt: skip
    return found


def with_names(rows: Sequence[ImportRow]) -> list[ImportRow]:
    """Return the rows with their recordings' names, which stay where some rows are left out."""
    names = iter(_output_names([row for row in rows if row.fault is None]))
    return [row if row.fault else replace(row, name=next(names)) for row in rows]


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


def _import_file(job: _Job, content: Content, path: Path) -> FileFacts:
    """Write what a row's file or trial holds; return what a person should know of it."""
    row = job.row
    if row.by_row and job.intervals:
        raise BadTable(
            "labels from rows or from intervals", f"both for {row.file}",
            "leave one of them out",
        )  # fmt: skip
    table, samples = content.table, content.samples
    steps = np.diff(table.time_s)
    info = SensorInfo(
        name=row.sensor,
        channels=table.names,
        units=table.units,
        rate_hz=round(float(1.0 / np.median(steps)), 6) if len(steps) else _stated_rate(row),
        full_scale=row.full_scale,
        details={"imported_from": row.file.name, "layout": row.layout} | dict(row.details),
    )
    if job.intervals:
        content = in_pieces(row, content, marks_of(job.intervals, samples.fitted_s, info.rate_hz))
    labels, groups = _composed(row.labels), _composed(row.groups)
    recorder = Recorder(path, Manifest(sensor=info, labels=labels, groups=groups))
    try:
        write_marked(recorder, samples, content.marks)
        recorder.close(IMPORTED)
    except BaseException:
        recorder.discard()
        raise
    gaps, longest_gap_s, longest_from_s = gaps_of(table.time_s)
    source = row.trial.source if row.trial else None
    return FileFacts(
        file=f"{row.file.name}[{row.details['trial']}]" if row.trial else row.file.name,
        of_line=(*row.remarks, *remarks_on_rows(row.by_row)),
        remarks=tuple(source.remarks) if source else table.remarks,
        doubts=(
            *row.doubts,
            *(source.doubts if source else ()),
            *_doubtful(row, table),
            *_no_labels(row, content.marks),
        ),
        coarse=coarse_of(table.values, table.names),
        lying=lying_of(*table.values.shape) if _by_star(row) and _may_lie(row, table) else "",
        marked=content.marked,
        values=table.values.size,
        padding=content.padding.cut,
        zeros=content.padding.zeros,
        number_header=table.number_header,
        decimal_comma=table.decimal_comma,
        one_more=table.one_more,
        passed_over=table.passed_over,
        other_units=table.other_units,
        scans=len(samples),
        repeated=len(table.dropped.repeated),
        garbled=len(table.dropped.garbled),
        rate_hz=info.rate_hz,
        time=row.time if row.layout == "csv" and not row.time.strip().startswith("rate:") else "",
        gaps=gaps,
        longest_gap_s=longest_gap_s,
        longest_from_s=longest_from_s,
        pieces=len(content.marks) if row.pieces else 0,
        in_no_piece=content.in_no_piece,
        short=content.short,
    )


def _doubtful(row: ImportRow, table: Table) -> list[str]:
    """Return a line on names that speak against channels, where * took all columns, one on which
    sheet was read where none is named, and those of the table itself.
    """
    called = visible(row.called or row.file.name)
    doubts = doubtful_names(called, table.names) if _by_star(row) else []
    if row.layout == "csv" and is_sheet(row.file) and (chosen := chosen_of(row.file)):
        doubts.append(f"{called}: the sheet {visible(chosen)} was read; to read another one, write "
                      f"{called}[SHEET]")  # fmt: skip
    return [*doubts, *(f"{called}: {doubt}" for doubt in table.doubts)]


def _may_lie(row: ImportRow, table: Table) -> bool:
    """Return whether nothing but its shape says what a file's lines are: no names, no axes."""
    name = row.file.name
    bare = is_text(name) and all(map(is_whole, table.names)) and not row.lying
    return row.trial is None and (name.lower().endswith(".npy") or bare)


def _by_star(row: ImportRow) -> bool:
    return row.layout == "csv" and row.channels.strip().startswith(tables.ALL)


def _stated_rate(row: ImportRow) -> float:
    """Return the rate that a row of the table states, hertz; 0 where a column holds times."""
    if not row.time.strip().startswith("rate:"):
        return 0.0
    return tables.parse_time(row.time, f"the row of {row.file.name}").rate_hz or 0.0


def _composed(pairs: Mapping[str, str]) -> dict[str, str]:
    return {composed(name): composed(value) for name, value in pairs.items()}


def _no_labels(row: ImportRow, marks: Sequence[Mark]) -> list[str]:
    """Return a line on labels that stand in rows, and may mean that there is none."""
    words = unknown_words("label", (mark.labels for mark in marks)) if row.by_row else []
    return [f"{visible(row.called or row.file.name)}: {line}" for line in words]
