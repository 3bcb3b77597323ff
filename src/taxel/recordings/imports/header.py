"""The first line of an import table, and what is none: a file of data, an empty file.

Knows nothing about what the rows say.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from taxel.errors import BadFile, BadTable, MissingExtra
from taxel.foreign.array_files import ARRAY_ENDINGS, open_arrays
from taxel.foreign.held_arrays import table_of
from taxel.foreign.sheets import is_sheet, sheet_names
from taxel.foreign.wav_file import WAV_ENDING, read_wav_head
from taxel.plain_text import number_of, visible
from taxel.recordings.footage_files import IMAGES, NAME_THEM, VIDEOS, is_footage
from taxel.recordings.imports.own_groups import refuse_own_groups
from taxel.recordings.imports.value_tables.table_columns import read_cells

PLAIN_COLUMNS = (
    "file", "trials", "axes", "length", "pieces", "channels", "time", "layout", "sensor",
    "full_scale", "missing",
)  # fmt: skip
"""Columns of an import table beside label:NAME and group:NAME."""
PREFIXES = ("label:", "group:")
_EXAMPLES = {"label": "label:object", "group": "group:session"}
_NO_TABLES = (".npy", ".npz", ".mat", ".mcap", ".xls", ".xlsx", ".parquet", ".h5", ".hdf5",
              WAV_ENDING)  # fmt: skip
"""Endings of files that people pass in the table's place; none is text."""
_A_TABLE = "an import table: a CSV with a column 'file' and a line for each file of data"
_WRITE_ONE = "write a table with a line for it (taxel import --help says the columns)"


def table_cells(path: Path) -> list[list[str]]:
    """Return the cells of an import table, line by line; there is at least one line.

    Raises:
        BadTable: It is empty, cannot be read, or its ending is that of data.
    """
    if path.is_dir():
        if is_footage(path) and not list(path.glob("*.csv")):
            raise BadTable(_A_TABLE, f"the folder {path}", f"for videos or images, {NAME_THEM}")
        raise BadTable(
            _A_TABLE, f"the folder {path}", "write a table that names its files; one line is "
            "enough where names or folders are alike: {label:object}_*.csv, {label:object}/*.csv",
        )  # fmt: skip
    if path.name.lower().endswith((*IMAGES, *VIDEOS)) and path.is_file():
        raise BadTable(_A_TABLE, f"{path}, one video or image", NAME_THEM)
    if path.name.lower().endswith(_NO_TABLES) and path.is_file():
        holds, mend = _holds(path)
        raise BadTable(_A_TABLE, f"{path}, which {holds}", mend)
    lines = read_cells(path)
    if not any(cell.strip() for cells in lines for cell in cells):
        raise BadTable(_A_TABLE, f"the empty file {path}", "write its lines")
    return lines


def _holds(path: Path) -> tuple[str, str]:
    """Return what is known of a file that is no table, and what to do: of arrays, their names and
    shapes, or why they cannot be read.
    """
    if not (path.name.lower().endswith((*ARRAY_ENDINGS, WAV_ENDING)) or is_sheet(path)):
        return "is not one", _WRITE_ONE
    try:
        return f"is a {_in_words(path)}", _WRITE_ONE
    except BadFile as error:
        return f"is not one, and cannot be read either: needed {error.needed}; got {error.got}", (
            f"{error.mend}; then {_WRITE_ONE}"
        )
    except MissingExtra as error:
        return f"is not one, and needs the package {error.package} to be read", (
            f"pip install 'taxel[{error.extra}]'; then {_WRITE_ONE}"
        )
    except OSError as error:
        return f"is not one, and cannot be read either: {error.strerror}", _WRITE_ONE


def _in_words(path: Path) -> str:
    """Return which sheets a workbook holds, how many values a WAV file, or which arrays another."""
    if path.name.lower().endswith(WAV_ENDING):
        return f"WAV file: {read_wav_head(path)}"
    if is_sheet(path):
        names = sheet_names(path)
        some = ", ".join(visible(name) for name in names[:6]) + (" …" if names[6:] else "")
        return f"workbook with {number_of(len(names), 'sheet')}: {some}"
    file = open_arrays(path)
    try:
        return f"file of arrays: {table_of(file)}"
    finally:
        file.close()


def check_header(path: Path, header: Sequence[str]) -> None:
    """Refuse columns that an import table does not have.

    Args:
        path: The table, for messages.
        header: Its first line, each name as `spelling.column_name` spells it.

    Raises:
        BadTable: A column is unknown, is there twice, or is a group that taxel fills in itself; or
            `file` is missing.
    """
    if not any(header):
        raise BadTable(_A_TABLE, f"an empty line 1 in {path}", "write the columns' names there")
    odd = [name for name in header if name not in PLAIN_COLUMNS and not name.startswith(PREFIXES)]
    if odd and "file" not in header and not any(name.startswith(PREFIXES) for name in header):
        raise BadTable(
            _A_TABLE, f"the columns {', '.join(map(_quoted, header[:6]))} in {path}, line 1",
            f"call the one with the files 'file'; if it is itself a file of data, {_WRITE_ONE}",
        )  # fmt: skip
    if odd:
        name = odd[0][:80]
        raise BadTable(
            f"the columns {', '.join(PLAIN_COLUMNS)}, label:NAME and group:NAME",
            f"{_quoted(odd[0])} in {path}, line 1",
            "write scans a second in the column time, as rate:100Hz"
            if name.split(":")[0] == "rate"
            else f"write behind it what it is, as in {_EXAMPLES[name]}"
            if name in _EXAMPLES
            else f"call it label:{name} or group:{name} if it is one of them, or remove it",
        )
    if "file" not in header or len(set(header)) < len(header):
        raise BadTable(
            "a column 'file', and each column once", f"{', '.join(header)} in {path}", "mend line 1"
        )
    refuse_own_groups(header, f"{path}, line 1")


def _quoted(name: str) -> str:
    return repr(name[:80])
