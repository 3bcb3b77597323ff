"""Rows of an import table that stand for many trials each, and what each of these trials is.

Knows nothing about how files are read (stacks/, trial_lines.py, trial_runs.py), or how recordings
are written.

Background of our choices: docs/decisions/0011.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from taxel.errors import BadTable
from taxel.foreign.array_files import ARRAY_ENDINGS, NAMED_ENDINGS
from taxel.foreign.sheets import file_behind
from taxel.foreign.wav_file import WAV_ENDING
from taxel.plain_text import number_of, visible
from taxel.recordings.imports.class_names import named_classes, remark_on
from taxel.recordings.imports.lying_texts import lies
from taxel.recordings.imports.row_labels import columns_by_row
from taxel.recordings.imports.stacks.members import STAR
from taxel.recordings.imports.stacks.trials import ArrayTrials, StackWords
from taxel.recordings.imports.table_files import NO_FILE, file_of
from taxel.recordings.imports.trial_lines import LineTrials
from taxel.recordings.imports.trial_runs import TextTrials
from taxel.recordings.imports.trial_sets import (
    FROM,
    Reference,
    Trial,
    TrialSet,
    name_above,
    safe_names,
    values_beside,
)
from taxel.recordings.imports.value_tables.table_columns import npy_shape
from taxel.recordings.imports.value_tables.table_form import is_text

STAR_CELL = "star:"
"""What a cell begins with that takes a part of the trials' own names."""


@dataclass(frozen=True, slots=True)
class OneOfMany:
    """One of the trials that a row of an import table stands for."""

    trial: Trial
    name: str
    """What sets it apart from the row's other trials, fit for a file's name."""
    values: Mapping[str, str]
    """Column of the import table → the trial's own value."""


@dataclass(frozen=True, slots=True)
class _Row:
    """A row of an import table, and where the files that its cells name are looked for."""

    named: Mapping[str, str]
    """Column → the row's cell."""
    data_dir: Path
    where: str
    """Table and line, for messages."""
    outside: bool
    """Whether files may lie outside of that folder."""

    def path_of(self, ref: Reference) -> Path:
        """Return the file that a cell names."""
        return file_of(ref.file, self.data_dir, self.where, outside=self.outside)

    def read_beside(self, ref: Reference) -> list[str]:
        """Return the values that a cell names in another file than the trials' own."""
        return values_beside(self.path_of(ref), ref.name)


def holds_many(file: Path, named: Mapping[str, str]) -> bool:
    """Return whether a row stands for many trials: by its file's ending, shape, or its cells.

    Args:
        file: The row's file.
        named: Column → the row's cell.

    Raises:
        BadTable: A .npy file has no head.
    """
    if named.get("layout", "") not in ("", "csv"):
        return False
    ending = file.name.lower()
    if ending.endswith(WAV_ENDING) or lies(file, named.get("axes", "")):
        return False
    if ending.endswith(NAMED_ENDINGS) or named.get("trials") or named.get("axes"):
        return True
    if not ending.endswith(".npy") or not file.is_file():
        return False
    refers = any(_may_refer(name) and Reference.of(cell) for name, cell in named.items())
    return refers or len(npy_shape(file)) > 2


def trials_of(
    file: Path,
    named: Mapping[str, str],
    data_dir: Path,
    where: str,
    *,
    outside: bool,
    labelled: bool = False,
) -> tuple[TrialSet, list[OneOfMany]]:
    """Return the trials of a row, each with its own values of the columns that begin with `from:`.

    Args:
        file: The row's file.
        named: Column → the row's cell.
        data_dir: What files are relative to.
        where: Table and line, for messages.
        outside: Also files that lie outside of that folder.
        labelled: Whether a label stands in the file's name.

    Raises:
        BadTable: The file is not there, or is not what the row says.
    """
    if not file_behind(file).is_file():
        raise BadTable("a file to import", f"{file}, which is not there", NO_FILE)
    row = _Row(named, data_dir, where, outside)
    references = {name: ref for name, cell in named.items()
                  if _may_refer(name) and (ref := Reference.of(cell))}  # fmt: skip
    beside = {name: row.read_beside(ref) for name, ref in references.items() if ref.file}
    own = list(dict.fromkeys(ref.name for ref in references.values() if not ref.file))
    labelled = labelled or any(
        cell and name.startswith("label:") and not cell.lower().startswith((FROM, STAR_CELL))
        for name, cell in named.items()
    )
    counts = [len(texts) for texts in beside.values()]
    source = _opened(file, named, own, counts, where, labelled=labelled)
    try:
        values = {
            name: beside.get(name) or source.texts(ref.name) for name, ref in references.items()
        }
        for name, ref in references.items():
            if ref.classes is not None:
                values[name] = _class_names(source, row, name, ref, values[name])
        arrays = any(
            len(values[name]) > 1 and STAR not in ref.name for name, ref in references.items()
        )
        if arrays and isinstance(source, ArrayTrials) and source.order:
            source.doubts.append(source.order)
        source.doubts.extend(_names_as_values(source, named, where))
        values |= _from_stars(source, named, where)
        count = len(source.keys)
        for name, texts in values.items():
            if len(texts) not in (1, count):
                raise _wrong_count(row, name, references.get(name), len(texts), count)
        _cut(source, values.pop("length", None), named, where)
    finally:
        source.close()
    names = safe_names(source.keys)
    return source, [
        OneOfMany(Trial(source, index), names[index],
                  {name: texts[index if len(texts) > 1 else 0] for name, texts in values.items()})
        for index in range(count)
    ]  # fmt: skip


def _class_names(
    source: TrialSet, row: _Row, name: str, ref: Reference, numbers: list[str]
) -> list[str]:
    """Return the names of the classes that a column numbers, as in from:objects[y].

    Args:
        source: The trials; a remark on how the numbers were read is added to its doubts.
        row: The row.
        name: The column.
        ref: Its cell, with `classes`.
        numbers: Each trial's number of a class.

    Raises:
        BadTable: There are no such names, or they do not fit the numbers.
    """
    assert ref.classes is not None
    cell, where = row.named[name], row.where
    _check_line_1(ref.classes, cell, where)
    if ref.classes.file:
        classes = row.read_beside(ref.classes)
    else:
        classes = _own_classes(source, ref.classes.name, cell, where)
    found = named_classes(numbers, classes, ref.first, cell, where)
    source.doubts.append(remark_on(numbers, classes, ref.first, cell))
    return found


def _wrong_count(row: _Row, name: str, ref: Reference | None, found: int, trials: int) -> BadTable:
    """Return the refusal of a column that names a wrong number of values.

    Args:
        row: The row.
        name: The column.
        ref: Its cell, where it names values of the trials or of another file.
        found: How many values there are.
        trials: How many trials there are.
    """
    got = f"{found} by {visible(row.named[name])} in {row.where}"
    mend = "name another array, or correct the column 'axes'"
    if ref and ref.file and found + 1 == trials:
        above = name_above(row.path_of(ref), ref.name, found)
        if above is not None:
            line_1 = f"line 1 of the file, {above[:80]!r}"
            got += f", where {line_1}, is taken for the column's name"
            mend = f"if it is the first trial's value, write a name above it; or {mend}"
    return BadTable(f"a value for each of {number_of(trials, 'trial')}", got, mend)


def refuse_words_of_many(named: Mapping[str, str], where: str) -> None:
    """Refuse what only rows of many trials may say in a row of one.

    Raises:
        BadTable: Such a cell is filled in.
    """
    for name, cell in named.items():
        refers = _may_refer(name) and cell.lower().startswith((FROM, STAR_CELL))
        if cell and (refers or name in ("trials", "axes", "length")):
            raise BadTable(
                f"the column '{name}' without {cell!r} for a file of one trial",
                f"it in {where}",
                "write a value itself, or leave it empty; in a text with many trials, name the "
                "column that tells them apart in the column 'trials'",
            )


def _names_as_values(source: TrialSet, named: Mapping[str, str], where: str) -> list[str]:
    """Return a line on each cell that may have been meant as the name of an array or a file."""
    return [
        f"{where}: {visible(cell)} in the column {visible(name)} is taken as the value of all "
        f"trials; write from:{visible(cell)} for each trial's own"
        for name, cell in named.items()
        if cell
        and _may_refer(name)
        and not cell.lower().startswith((FROM, STAR_CELL))
        and (cell in source.names or (cell.lower().endswith(ARRAY_ENDINGS) or is_text(cell)))
        and name != "length"
    ]


def _from_stars(source: TrialSet, named: Mapping[str, str], where: str) -> dict[str, list[str]]:
    """Return what stands for a * of the trials' names, where a cell asks for it: star:1."""
    found = {}
    for name, cell in named.items():
        if not cell.lower().startswith(STAR_CELL) or not _may_refer(name):
            continue
        number = cell[len(STAR_CELL) :].strip()
        held = source.stars if isinstance(source, ArrayTrials) else ()
        count = len(held[0]) if held else 0
        if not (number.isdecimal() and len(number) < 4 and 1 <= int(number) <= count):
            raise BadTable(
                f"{STAR_CELL}1 to {STAR_CELL}{count}" if count else "a * in the column 'trials'",
                f"{cell[:80]!r} in {where}",
                "correct it; star:1 is what stands for the first * in the column 'trials'",
            )
        found[name] = [stars[int(number) - 1] for stars in held]
        if not all(found[name]):
            raise BadTable("a value for each trial", f"nothing by {cell!r} in {where}",
                           "choose another pattern in the column 'trials'")  # fmt: skip
    return found


def _check_line_1(classes: Reference, cell: str, where: str) -> None:
    """Refuse a text of class names whose line 1 may be a name or the column's name."""
    if is_text(classes.file) and not classes.name:
        raise BadTable(
            f"the column of the classes' names, as in {classes.file}:object",
            f"{cell[:80]!r} in {where}",
            "write the column's name into line 1 of the file, and behind the file's name",
        )


def _own_classes(source: TrialSet, name: str, cell: str, where: str) -> list[str]:
    """Return the names of classes that an array of the trials' own file holds."""
    if isinstance(source, ArrayTrials):
        return source.texts(name)
    raise BadTable(
        "names of classes in another file than a text's own", f"{cell[:80]!r} in {where}",
        "write a table with a line for each class, as in from:classes.csv:object[label]",
    )  # fmt: skip


def _may_refer(name: str) -> bool:
    return name == "length" or name.startswith(("label:", "group:"))


def _opened(
    file: Path,
    named: Mapping[str, str],
    own: Sequence[str],
    counts: Sequence[int],
    where: str,
    *,
    labelled: bool,
) -> TrialSet:
    trials, channels = named.get("trials", ""), named.get("channels", "")
    time = named.get("time", "")
    if is_text(file.name):
        by_row = list(columns_by_row(named, where).values())
        if named.get("axes"):
            _refuse_rows(by_row, where)
            return LineTrials(file, named, own, where)
        return TextTrials(file, named, own, where, by_row)
    words = StackWords(trials=trials, axes=named.get("axes", ""), channels=channels, time=time,
                       one_label=labelled)  # fmt: skip
    return ArrayTrials(file, words, own, counts, where, named["file"])


def _refuse_rows(by_row: Sequence[str], where: str) -> None:
    """Refuse a label in each row where each row is a trial."""
    if by_row:
        raise BadTable("from:COLUMN for a text with a trial in each line",
                       f"rows:{visible(by_row[0])} in {where}", "write it so")  # fmt: skip


def _cut(
    source: TrialSet, lengths: Sequence[str] | None, named: Mapping[str, str], where: str
) -> None:
    """Take only so many rows of each trial as the column `length` says, if it says so."""
    if lengths is None:
        if named.get("length"):
            raise BadTable(
                "from:NAME in the column 'length'", f"{named['length']!r} in {where}",
                "name the array that holds each trial's number of rows",
            )  # fmt: skip
        return
    if not isinstance(source, ArrayTrials):
        raise BadTable("'length' for a file of arrays", f"a text in {where}", "leave it empty")
    rows = [int(text) if text.isdecimal() and len(text) < 10 else 0 for text in lengths]
    count = len(source.keys)
    source.cut_to(rows if len(rows) == count else rows * count)
