"""A part of an import table: at most so many recordings of each value of its columns.

Knows nothing about files.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Collection, Sequence
from dataclasses import replace
from typing import TypeVar

from taxel.errors import BadInput
from taxel.plain_text import number_of, visible
from taxel.recordings.imports.rows import ImportRow
from taxel.recordings.imports.video_rows import VideoRow

PART = "part_of_table"
"""Detail of a recording's sensor or cameras: what was left out beside it, and by which rule."""
Row = TypeVar("Row", ImportRow, VideoRow)


def spread(rows: Sequence[Row], most: int, columns: Sequence[str] = ()) -> tuple[list[Row], str]:
    """Return some of the rows, evenly spread over their order, and a line on those left out.

    The same rows give the same part, and each of it keeps the line as a detail. A file of many
    trials that cannot be read stays, for the note on it.

    Args:
        rows: Of an import table.
        most: How many recordings of each value at most, 1 or more.
        columns: label:NAME or group:NAME; with several, each combination of their values counts.
            All labels unless given; without any, all rows together.

    Returns:
        The rows, and the line; empty where none is left out.

    Raises:
        BadInput: There is no such column, or nothing would be left.
    """
    if most < 1:
        raise BadInput("--at-most 1 or more", str(most), "give a larger number")
    each = [_values(row) for row in rows]
    known = list(dict.fromkeys(name for own in each for name in own))
    if unknown := [name for name in columns if name not in known]:
        raise BadInput(f"columns of the table for --of: {', '.join(known) or 'there is none'}",
                       unknown[0], "name one of those, or leave --of out")  # fmt: skip
    named = list(columns) or [name for name in known if name.startswith("label:")]
    keys = [tuple(own.get(name) for name in named) for own in each]
    kept = _kept(keys, most, {at for at, row in enumerate(rows) if getattr(row, "fault", None)})
    left = len(rows) - len(kept)
    if not left:
        return list(rows), ""
    of = f" of each {' and '.join(map(visible, named))}" if named else ""
    was = "was" if left == 1 else "were"
    line = (
        f"{left} of {number_of(len(rows), 'recording')} {was} left out: at most {most}{of}, evenly "
        "spread over the order of the table"
    )
    return [replace(rows[at], details={**rows[at].details, PART: line}) for at in kept], line


def _values(row: ImportRow | VideoRow) -> dict[str, str]:
    """Return a row's labels and groups by their columns, but for the file's own name."""
    groups = {f"group:{name}": value for name, value in row.groups.items() if name != "file"}
    return {f"label:{name}": value for name, value in row.labels.items()} | groups


def _kept(keys: Sequence[object], most: int, always: Collection[int]) -> list[int]:
    """Return the places of what is kept, ascending."""
    often = Counter(key for at, key in enumerate(keys) if at not in always)
    seen = Counter[object]()
    kept = []
    for at, key in enumerate(keys):
        place, count = seen[key], often[key]
        if at in always:
            kept.append(at)
            continue
        seen[key] += 1
        # The first of each of `most` equal stretches.
        if count <= most or place * most % count < most:
            kept.append(at)
    return kept
