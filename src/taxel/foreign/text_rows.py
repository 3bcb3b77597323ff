"""Read the rows of a small table of texts (CSV), such as rules, a plan or a log.

Tables of values are read elsewhere (`recordings/imports/value_tables/`). Knows nothing about what
the columns mean.
"""

from __future__ import annotations

import csv
from pathlib import Path

from taxel.errors import BadTable
from taxel.foreign.text_lines import lines_of


def rows_of(path: Path, most: int) -> list[tuple[int, list[str]]]:
    """Return a table's rows, each with the number of its last line; empty lines and remarks, which
    begin with #, are left out.

    Args:
        path: The file.
        most: Bytes that it may have, unpacked.

    Raises:
        BadTable: A cell is longer than CSV's readers take.
        BadFile: It is no text, or too large.
        OSError: It is not there, or may not be read.
    """
    lines = (
        line if line.strip() and not line.startswith("#") else "\n" for line in lines_of(path, most)
    )
    reader = csv.reader(lines)
    try:
        return [(reader.line_num, cells) for cells in reader if cells]
    except csv.Error as error:
        raise BadTable("a table (CSV)", f"{path}: {error}", "save it again as CSV") from error
