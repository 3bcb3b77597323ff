"""Files that hold many trials, as rows of an import table see them, and `from:` cells.

A row of the table may stand for many trials: those of a stacked array, of arrays that are called
alike, of cells, or of a long text with a column that numbers them. A cell `from:NAME` then says
that each trial has its own value, from the array (or column) NAME of the same file;
`from:FILE:NAME` takes it from another file. `from:CLASSES[NAME]` takes it for the number of a
class, and CLASSES for the names of these. Knows nothing about recordings.

Background of our choices: docs/decisions/0011.
"""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Protocol

import numpy as np

from taxel.errors import BadFile, BadTable
from taxel.foreign.array_files import ARRAY_ENDINGS, open_arrays
from taxel.foreign.held_arrays import (
    LONGEST_TEXT,
    ArrayFile,
    Cells,
    Held,
    Numbers,
    Texts,
    sides_of,
    table_of,
)
from taxel.foreign.sheets import file_behind
from taxel.plain_text import visible
from taxel.recordings.imports.value_tables.places import some_names
from taxel.recordings.imports.value_tables.row_times import BadTimes
from taxel.recordings.imports.value_tables.table_columns import (
    LARGEST_LIST,
    list_separator,
    read_cells,
    table_lines,
)
from taxel.recordings.imports.value_tables.table_form import TEXT_ENDINGS, is_number
from taxel.recordings.imports.value_tables.tables import Missing, Table

FROM = "from:"
"""What a cell begins with that names where each trial's own value stands."""
AND = "+"
"""Between the names of a text's columns that say together which trial a row belongs to."""
MOST_TRIALS = 100_000
"""Of one row, each of which becomes a file. Source: our choice."""
_KEPT = 4
_MOST_NUMBERS = 64 * MOST_TRIALS
"""In an array of labels, which may be one-hot."""


@dataclass(frozen=True, slots=True)
class Padding:
    """What filled a trial up to the length of its array."""

    cut: int = 0
    """Rows of NaN at its end, which were cut."""
    zeros: int = 0
    """Rows of zeros at its end, which may be padding or values, and were kept."""


class TrialSet(Protocol):
    """The trials of one row."""

    @property
    def keys(self) -> Sequence[str]:
        """What each trial is called within the file: its number from 1, or its own name."""

    @property
    def what(self) -> str:
        """The array or column that holds them, as the table names it; may be empty."""

    @property
    def remarks(self) -> Sequence[str]:
        """What a person should know of how the file was read."""

    @property
    def names(self) -> Sequence[str]:
        """All arrays, or columns, of the file."""

    @property
    def doubts(self) -> list[str]:
        """What a person should check: it may have been meant in another way."""

    def texts(self, name: str) -> list[str]:
        """Return each trial's own value, as text.

        Raises:
            BadTable: There is no such array or column, or it has another number of values.
        """

    def table(self, index: int, missing: Missing, bad_times: BadTimes) -> tuple[Table, Padding]:
        """Return one trial's values, and what padding they had.

        Args:
            index: Of the trial, from 0.
            missing: What happens to values that are not finite.
            bad_times: What happens to rows whose times are garbled or repeat.

        Raises:
            BadTable: Its values or times are not as they should be.
        """

    def close(self) -> None:
        """Close the file; it is opened again where needed."""


@dataclass(frozen=True, slots=True)
class Trial:
    """One of them."""

    source: TrialSet
    index: int
    """From 0."""


@dataclass(frozen=True, slots=True)
class Reference:
    """What a `from:` cell names."""

    file: str
    """Another file, relative to the data folder; empty for the row's own."""
    name: str
    classes: Reference | None = None
    """Names of the classes that the values are numbers of; None where these are values."""
    first: int = 0
    """The number of the first class."""

    @staticmethod
    def of(cell: str) -> Reference | None:
        """Return what a cell names; None if it is a value of its own."""
        if not cell.lower().startswith(FROM):
            return None
        name = cell[len(FROM) :].strip()
        if match := re.fullmatch(r"(.+)\[([^\[\]]+?)\s*(-\s*1)?\s*\]", name):
            return replace(
                _place(match[2].strip()),
                classes=_place(match[1].strip()),
                first=int(bool(match[3])),
            )
        return _place(name)


def _place(name: str) -> Reference:
    """Return what FILE:NAME, FILE or NAME means."""
    endings = "|".join(map(re.escape, (*TEXT_ENDINGS, *ARRAY_ENDINGS)))
    sheet = r"(?:(?<=\.xlsx)\[[^\[\]]+\])?"
    match = re.fullmatch(rf"(.+?(?:{endings}){sheet})(?::(.*))?", name, re.IGNORECASE)
    return Reference("", name) if match is None else Reference(match[1], (match[2] or "").strip())


@dataclass(frozen=True, slots=True)
class OpenedFile:
    """A file of arrays that is opened where needed."""

    path: Path
    kept: list[ArrayFile]
    """The open one, or none."""
    last: dict[str, Held]
    """Arrays that were asked for last, such as that of the trials and that of their times."""

    @staticmethod
    def at(path: Path) -> OpenedFile:
        """Name a file; nothing is opened yet."""
        return OpenedFile(path, [], {})

    def get(self, name: str) -> Held:
        """Return an array of the file.

        Raises:
            BadTable: There is none of that name, or it cannot be read.
        """
        try:
            if name not in self.last:
                held = self.opened().get(name)
                if len(self.last) >= _KEPT:
                    self.last.clear()
                self.last[name] = held
            return self.last[name]
        except KeyError as error:
            ending, more = self.path.suffix.lower(), ""
            if ending == ".npy":
                more = f", as in from:{name}.npy for an array of another file"
            elif ending in (".h5", ".hdf5"):
                more = "; attributes are not listed: write GROUP@NAME, as in from:trial_*@object"
            raise BadTable(
                "the name of an array", f"{name!r}, where {self.path} holds "
                f"{table_of(self.opened())}", f"correct the table{more}",
            ) from error  # fmt: skip
        except BadFile as error:
            raise self._refused(error) from error

    def opened(self) -> ArrayFile:
        """Return the open file.

        Raises:
            BadTable: It cannot be read.
        """
        if not self.kept:
            try:
                self.kept.append(open_arrays(self.path))
            except BadFile as error:
                raise self._refused(error) from error
            except OSError as error:
                raise BadTable(
                    "a file that can be read", f"{self.path}: {error.strerror or error}",
                    "check the path",
                ) from error  # fmt: skip
        return self.kept[0]

    def close(self) -> None:
        """Close it."""
        self.last.clear()
        while self.kept:
            self.kept.pop().close()

    def _refused(self, error: BadFile) -> BadTable:
        got = error.got if str(self.path) in error.got else f"{self.path}: {error.got}"
        return BadTable(error.needed, got, error.mend)


def values_beside(path: Path, name: str) -> list[str]:
    """Return the values of another file than the trials': an array, or a column of a table.

    Args:
        path: The file.
        name: Of the array or column; empty where there is only one.

    Raises:
        BadTable: There is no such thing in it.
    """
    if not file_behind(path).is_file():
        raise BadTable("a file of values", f"{path}, which is not there", "check the path")
    if not path.name.lower().endswith(ARRAY_ENDINGS):
        return _column_of(path, name)
    file = OpenedFile.at(path)
    try:
        names = file.opened().names()
        only = names[0] if not name and len(names) == 1 else name
        return label_texts(file.get(only), f"{only or 'the array'} in {path}")[0]
    finally:
        file.close()


def name_above(path: Path, name: str, found: int) -> str | None:
    """Return what `values_beside` took for the name above a list of values; None if nothing.

    Args:
        path: The file.
        name: The column that was asked for; of no list where there is one.
        found: How many values it gave.
    """
    if name or path.name.lower().endswith(ARRAY_ENDINGS):
        return None
    lines = [cells for cells in read_cells(path) if any(cell.strip() for cell in cells)]
    return lines[0][0].strip() if len(lines) == found + 1 else None


def _column_of(path: Path, name: str) -> list[str]:
    header, *lines = read_cells(path) or [[]]
    names = [cell.strip() for cell in header]
    if not name and len(names) > 1:
        raise _split_header(path, names)
    if names.count(name) != 1 and (name or len(names) != 1):
        raise BadTable(
            f"one column {name!r} in {path}", ", ".join(map(visible, names[:12])), "correct it"
        )
    place = names.index(name) if name else 0
    lines = [cells for cells in lines if any(cell.strip() for cell in cells)]
    first = 2
    if not name and (is_number(names[0]) or any(cells[0].strip() == names[0] for cells in lines)):
        lines, first = [header, *lines], 1  # a list of values without a name above it
    for number, cells in enumerate(lines, start=first):
        if len(cells) != len(names) or not cells[place].strip():
            raise BadTable(
                f"something in the column {name!r}", f"nothing in {path}, line {number}",
                "fill it in",
            )  # fmt: skip
    return [cells[place].strip() for cells in lines]


def _split_header(path: Path, names: Sequence[str]) -> BadTable:
    """Return the error of a list of values whose line 1 has several cells."""
    signs = {",": "commas", ";": "semicolons", "\t": "tabs"}
    sign = signs[list_separator(path, table_lines(path, LARGEST_LIST))]
    return BadTable(
        f"one column in {path}, or the name of one behind the file's",
        f"{len(names)}, for its line 1 was split at its {sign}: {some_names(names)}",
        f"name the column, as in {FROM}{path.name}:NAME; or, if line 1 is one name, write it in "
        "double quotes",
    )  # fmt: skip


def label_texts(held: Held, what: str) -> tuple[list[str], bool]:
    """Return an array's values as texts, and whether it was one-hot.

    Whole numbers are written without a point, so that MATLAB's 3.0 is the class 3. One-hot rows
    give the number of their column, from 0.

    Raises:
        BadTable: It has several values for each trial, some without a value, or too many trials.
    """
    if isinstance(held, Texts):
        return _filled(list(held.values), what), False
    if isinstance(held, Cells):
        return _filled([_only(item, what) for item in held.items], what), False
    shape = tuple(side for side in held.shape if side != 1)
    if (rows := shape[0] if shape else 1) > MOST_TRIALS:  # before any are read, also of no columns
        raise BadTable(f"values of at most {MOST_TRIALS:,} trials", f"{rows:,} in {what}",
                       "name another array, or cut the file into several")  # fmt: skip
    few = 0 < math.prod(shape) <= _MOST_NUMBERS
    if not few or len(shape) > 2 or held.dtype.kind not in "biuf":
        raise _one_each(what, str(held))
    try:
        array = held.whole().reshape(shape)
    except BadFile as error:
        raise BadTable(error.needed, f"{what}: {error.got}", error.mend) from error
    if array.ndim < 2:
        return _filled([_number_text(value, what) for value in array.ravel()], what), False
    if not (np.isin(array, (0, 1)).all() and (array.sum(axis=1) == 1).all()):
        raise _one_each(what, sides_of(shape))
    return [str(column) for column in array.argmax(axis=1).tolist()], True


def _one_each(what: str, got: str) -> BadTable:
    return BadTable(
        "one value for each trial, or a one-hot row", f"{what}: {got}",
        "name another array, or write one value for each trial",
    )  # fmt: skip


def _only(item: Numbers | Texts, what: str) -> str:
    if isinstance(item, Texts) and len(item.values) == 1:
        return item.values[0]
    if isinstance(item, Numbers) and math.prod(item.shape) == 1:
        return _number_text(item.whole().ravel()[0], what)
    raise _one_each(what, f"a cell of {item}")


def _number_text(value: np.generic, what: str) -> str:
    number = value.item()
    if isinstance(number, bool):
        return str(number).lower()
    if isinstance(number, float):
        if math.isnan(number):
            return ""  # refused with the trial's number
        if not math.isfinite(number):
            raise BadTable("a value for each trial", f"{number} in {what}", "fill it in")
        return str(int(number)) if number.is_integer() and abs(number) < 1e15 else str(value)
    return str(number)


def _filled(texts: list[str], what: str) -> list[str]:
    for number, text in enumerate(texts, start=1):
        if not text.strip() or len(text) > LONGEST_TEXT:
            raise BadTable(
                "a value for each trial", f"nothing for trial {number} in {what}",
                "fill it in, or take that trial out of the file",
            )  # fmt: skip
    return texts


def safe_names(keys: Sequence[str]) -> list[str]:
    """Return what a recording of each trial may be called: its key, or its number, from 1."""
    plain = re.compile(r"[A-Za-z0-9][A-Za-z0-9_.+-]{0,79}")
    folded = {key.lower() for key in keys}
    digits = len(str(len(keys)))
    if len(folded) < len(keys) or not all(map(plain.fullmatch, keys)):
        return [f"{number:0{digits}d}" for number in range(1, len(keys) + 1)]
    if all(key.isdecimal() for key in keys):
        longest = max(map(len, keys))
        filled = [key.zfill(longest) for key in keys]
        return filled if len(set(filled)) == len(keys) else list(keys)  # 1 and 01 are two trials
    return list(keys)
