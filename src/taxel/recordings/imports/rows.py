"""What each line of an import table stands for: files, or each of a file's trials.

FORMAT.md describes the columns. Knows nothing about how recordings are written (importing.py).
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

from taxel.errors import BadTable
from taxel.foreign.hdf5_trial import many_hdf5
from taxel.plain_text import number_of, visible
from taxel.recordings.imports.header import PLAIN_COLUMNS, PREFIXES, check_header, table_cells
from taxel.recordings.imports.intervals import stem_of
from taxel.recordings.imports.left_out import naming_option
from taxel.recordings.imports.lying_texts import lies
from taxel.recordings.imports.many_trials import holds_many, refuse_words_of_many, trials_of
from taxel.recordings.imports.matched_files import TableLine, one_line_a_file
from taxel.recordings.imports.pieces import Pieces, parse_pieces
from taxel.recordings.imports.row_labels import ROWS, columns_by_row
from taxel.recordings.imports.spelling import column_name
from taxel.recordings.imports.table_files import file_of
from taxel.recordings.imports.trial_sets import Trial
from taxel.recordings.imports.value_tables.missing_marks import parse_marks
from taxel.recordings.imports.value_tables.table_columns import by_column
from taxel.recordings.imports.value_tables.table_form import is_number, is_text
from taxel.recordings.imports.value_tables.tables import LARGEST_VALUE


@dataclass(frozen=True, slots=True, kw_only=True)
class ImportRow:
    """What one file is."""

    file: Path
    labels: Mapping[str, str] = field(default_factory=dict)
    groups: Mapping[str, str] = field(default_factory=dict)
    by_row: Mapping[str, str] = field(default_factory=dict)
    """Label → column of the text that holds it in each row (row_labels.py)."""
    channels: str = ""
    """Such as "Data0[count] Data1[count] 7[deg]"; may be empty where the layout names them."""
    time: str = ""
    """Such as "Timestamp[ms]" or "rate:100Hz"; empty where the layout gives times."""
    layout: str = "csv"
    sensor: str = "array"
    """Short name of the sensor, the topic in the recording."""
    full_scale: float | None = None
    """Value from which a channel counts as saturated, in the channels' unit."""
    missing: tuple[str, ...] = ()
    """Numbers that mark missing values, as the table writes them."""
    pieces: Pieces | None = None
    """Length of the pieces that each recording is cut into; None where it stays whole."""
    details: Mapping[str, str] = field(default_factory=dict)
    """Kept with the sensor in the manifest."""
    lying: bool = False
    """Whether each line of the text is a channel (lying_texts.py)."""
    trial: Trial | None = None
    """Which of the file's trials it is; None where the file is one."""
    called: str = ""
    """The file as the table names it, for notes; its name where there is no table."""
    name: str = ""
    """Of the recording, without ending; the file's own by default."""
    remarks: tuple[str, ...] = ()
    """How the names of a line's files were read, the same for all of them."""
    doubts: tuple[str, ...] = ()
    """What a person should check of these names."""
    line: str = ""
    """Table and line that name it; empty where there is no table."""
    fault: BadTable | None = None
    """Why no trial can be read from a file that holds many."""


@many_hdf5()
def read_rows(
    manifest_csv: Path, data_dir: Path, *, outside: bool = False, skip_unreadable: bool = False
) -> list[ImportRow]:
    """Return the rows of an import table.

    Args:
        manifest_csv: The import table.
        data_dir: What the column `file` is relative to.
        outside: Also files that lie outside of that folder.
        skip_unreadable: Give a row with its `fault` where a file of many trials cannot be read.

    Raises:
        BadTable: A column is unknown or missing, a row is not complete, its file lies outside or
            cannot be read, or no file matches its pattern.
    """
    lines = table_cells(manifest_csv)
    header = [column_name(name, PLAIN_COLUMNS) for name in lines[0]]
    check_header(manifest_csv, header)
    if len(lines) < 2:
        raise BadTable("a row for each file", f"none in {manifest_csv}", "add rows")
    written = [
        TableLine(
            where=f"{manifest_csv}, line {number}",
            cells=_cells(manifest_csv, number, header, cells),
        )
        for number, cells in enumerate(lines[1:], start=2)
        if any(cell.strip() for cell in cells)
    ]
    table_lines = _noted(
        one_line_a_file(written, manifest_csv, data_dir, outside=outside, lost=skip_unreadable),
        manifest_csv,
    )
    _refuse_half_a_group(table_lines)
    often = Counter(line.cells["file"] for line in table_lines)

    def rows_at(place: int) -> list[ImportRow]:
        line = table_lines[place]
        return _rows(line, data_dir, outside, alone=often[line.cells["file"]] == 1)

    rows: list[ImportRow] = []
    for place, line in enumerate(table_lines):
        own = rows_at(place)
        if own[0].fault is not None and not skip_unreadable:
            raise naming_option(own[0].fault, [line.where for line in table_lines], place,
                                lambda other: rows_at(other)[0].fault is None)  # fmt: skip
        rows += [_with_name(row, line) for row in own]
    return rows


def _cells(path: Path, number: int, header: Sequence[str], cells: Sequence[str]) -> dict[str, str]:
    """Return a row's cells by their columns, those that must be there filled in."""
    where = f"{path}, line {number}"
    units = sum(cell.rstrip().endswith("]") for cell in cells)
    if len(cells) > len(header) and units > 2 - any("rate:" in cell for cell in cells):
        raise BadTable(
            number_of(len(header), "cell"), f"{len(cells)} in {where}",
            "put blanks, not commas, between the channels of a line",
        )  # fmt: skip
    named = by_column(header, cells, where)
    if not named["file"]:
        raise _nothing_in("file", where)
    return named


def _nothing_in(column: str, where: str) -> BadTable:
    return BadTable(f"something in the column {column!r}", f"nothing in {where}", "fill it in")


def _noted(lines: Sequence[TableLine], table: Path) -> list[TableLine]:
    """Return the lines, those without a value of a label with a note of how many there are.

    Raises:
        BadTable: A label has no value in any line.
    """
    made = list(lines)
    columns = [name for line in lines for name in (*line.cells, *line.values)]
    for column in dict.fromkeys(name for name in columns if name.startswith("label:")):
        empty = [n for n, line in enumerate(lines)
                 if not (line.cells.get(column) or line.values.get(column))]  # fmt: skip
        if len(empty) == len(lines):
            raise _nothing_in(column, f"any line of {table}")
        if not empty:
            continue
        have = "has" if len(empty) == 1 else "have"
        note = (
            f"{len(empty)} of {number_of(len(lines), 'file')} {have} no {visible(column)}, "
            f"the first is "
            f"{visible(lines[empty[0]].cells['file'])}: left out where it is to be predicted"
        )
        for n in empty:
            made[n] = replace(made[n], doubts=(*made[n].doubts, note))
    return made


def _refuse_half_a_group(lines: Sequence[TableLine]) -> None:
    """Refuse a group that some lines have and others leave empty; an empty column is none.

    Raises:
        BadTable: A split by that group would not know where the files of such a line belong.
    """
    for column in dict.fromkeys(name for line in lines for name in line.cells):
        empty = [line for line in lines if not (line.cells[column] or line.values.get(column))]
        if not column.startswith("group:") or len(empty) in (0, len(lines)):
            continue
        raise BadTable(
            f"something in the column {column!r}",
            f"nothing in {empty[0].where}, where other lines have it: a split could not tell which "
            "side such files belong to",
            "fill it in, each file that belongs with no other with a value of its own; or empty "
            "the column",
        )


def _rows(line: TableLine, data_dir: Path, outside: bool, *, alone: bool) -> list[ImportRow]:
    """Return what one line of the table stands for: a file, or each trial of it; or its fault."""
    named, where = line.cells, line.where
    file = file_of(named["file"], data_dir, where, outside=outside)
    try:
        many = trials_of(
            file, named, data_dir, where, outside=outside,
            labelled=any(name.startswith("label:") for name in line.values),
        ) if holds_many(file, named) else None  # fmt: skip
    except BadTable as error:
        return [ImportRow(file=file, called=named["file"], fault=error)]
    if many is None:
        lying = lies(file, named.get("axes", ""))
        refuse_words_of_many({**named, "axes": ""} if lying else named, where)
        return [_row(file, named, where)]
    source, trials = many
    array = re.sub(r"[^A-Za-z0-9_]+", "-", source.what.replace("*", "")).strip("-")
    stem = stem_of(file.name) + (f"-{array}" if array and not alone else "")
    place = f"{named['file']}:{source.what}" if source.what else named["file"]
    import_rows = []
    for part in trials:
        key, own = source.keys[part.trial.index], {**named, **part.values}
        only = alone and len(trials) == 1
        import_rows.append(
            replace(
                _row(file, own, where),
                trial=part.trial,
                name=stem if only else f"{stem}-{part.name}",
                groups=_groups(own, named["file"] if only else f"{place}[{key}]"),
                details={"trial": key, "trials": source.what},
            )
        )
    return import_rows


def _with_name(row: ImportRow, line: TableLine) -> ImportRow:
    """Return a row with what its file's name says: literally, whatever it begins with."""
    read = {kind: {name.removeprefix(kind): value for name, value in line.values.items()
                   if name.startswith(kind)} for kind in PREFIXES}  # fmt: skip
    return replace(
        row,
        labels={**row.labels, **read["label:"]},
        groups={**row.groups, **read["group:"]},
        remarks=line.remarks,
        doubts=line.doubts,
        line=line.where,
    )


def _row(file: Path, named: Mapping[str, str], where: str) -> ImportRow:
    by_row = columns_by_row(named, where)
    layout = named.get("layout", "") or "csv"
    lying = lies(file, named.get("axes", ""))
    if by_row and (layout != "csv" or lying or not is_text(file.name)):
        raise BadTable(f"a text for {ROWS}COLUMN, a scan in each line", f"{file.name} in {where}",
                       "write a table of intervals, and import with --intervals")  # fmt: skip
    labels = {n.removeprefix("label:"): c for n, c in named.items() if n.startswith("label:")}
    return ImportRow(
        file=file,
        called=named["file"],
        labels={name: cell for name, cell in labels.items() if cell and name not in by_row},
        by_row=by_row,
        groups=_groups(named, named["file"]),
        channels=named.get("channels", ""),
        time=named.get("time", ""),
        layout=layout,
        lying=lying,
        sensor=named.get("sensor", "") or "array",
        full_scale=_full_scale(named.get("full_scale", ""), where),
        missing=parse_marks(named.get("missing", ""), where),
        pieces=parse_pieces(named.get("pieces", ""), where),
    )


def _groups(named: Mapping[str, str], file: str) -> dict[str, str]:
    own = {n.removeprefix("group:"): c for n, c in named.items() if c and n.startswith("group:")}
    return {"file": file} | own


def _full_scale(text: str, where: str) -> float | None:
    if text and not (is_number(text) and abs(float(text)) <= LARGEST_VALUE):
        raise BadTable("a number in 'full_scale'", f"{text[:80]!r} in {where}", "mend it")
    return float(text) if text else None
