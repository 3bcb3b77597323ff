"""What each pair of videos is, read from an import table.

FORMAT.md describes the table. Knows nothing about pixels.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from taxel.errors import BadTable
from taxel.recordings.spelling import composed
from taxel.recordings.table_columns import read_cells
from taxel.recordings.table_files import file_of

_CAMERA_COLUMNS = ("left", "right")


@dataclass(frozen=True, slots=True, kw_only=True)
class VideoRow:
    """What one recording is made of."""

    name: str
    """Of the recording, without ending."""
    files: Mapping[str, Path]
    """Camera's name → its video."""
    labels: Mapping[str, str] = field(default_factory=dict)
    groups: Mapping[str, str] = field(default_factory=dict)
    rate_hz: float | None = None
    """Frames a second; None takes what the files say."""
    mm_per_px: float | None = None


def read_video_rows(table: Path, data_dir: Path, *, outside: bool = False) -> list[VideoRow]:
    """Return the rows of an import table whose columns are left, right, label:… and group:….

    Args:
        table: A CSV; `rate` (hertz) and `mm_per_px` are further columns, where wanted.
        data_dir: What the videos' paths are relative to.
        outside: Also videos that lie outside of that folder.

    Raises:
        BadTable: The table cannot be read, a column is missing or unknown, or a video lies
            outside.
    """
    lines = read_cells(table)
    columns = [name.strip() for name in lines[0]] if lines else []
    _check_columns(table, columns)
    rows = [
        _row(table, number, columns, cells, data_dir, outside)
        for number, cells in enumerate(lines[1:], start=2)
        if cells
    ]
    if not rows:
        raise BadTable("at least one row", f"none in {table}", "add one a recording")
    return rows


def _check_columns(table: Path, columns: Sequence[str]) -> None:
    known = (*_CAMERA_COLUMNS, "rate", "mm_per_px")
    odd = [c for c in columns if c not in known and not c.startswith(("label:", "group:"))]
    odd += [c for c in columns if c in ("label:", "group:")]
    if odd or "left" not in columns:
        raise BadTable(
            "the columns left, right, label:NAME, group:NAME, rate, mm_per_px",
            f"{', '.join(map(repr, odd)) or 'no column left'} in {table}",
            "mend the table's first line",
        )
    if len(set(columns)) < len(columns):
        raise BadTable(
            "each column once", f"{', '.join(columns)} in {table}", "mend the table's first line"
        )


def _row(
    table: Path,
    number: int,
    columns: Sequence[str],
    cells: Sequence[str],
    data_dir: Path,
    outside: bool,
) -> VideoRow:
    where = f"{table}, line {number}"
    if len(cells) != len(columns):
        raise BadTable(f"{len(columns)} cells", f"{len(cells)} in {where}", "mend the line")
    line = {name: cell.strip() for name, cell in zip(columns, cells, strict=True)}
    if any(not line[name] for name in _CAMERA_COLUMNS if name in line):
        raise BadTable(
            "a video for each camera", f"an empty cell in {where}",
            "name the video, or leave the column out for all",
        )  # fmt: skip
    empty = [name for name, cell in line.items() if ":" in name and not cell]
    if empty:
        raise BadTable(f"something in the column {empty[0]!r}", f"nothing in {where}", "fill it in")
    files = {
        name: file_of(line[name], data_dir, where, outside=outside)
        for name in _CAMERA_COLUMNS
        if name in line
    }
    return VideoRow(
        name=f"{number - 1:04d}-{files['left'].stem}",
        files=files,
        labels=_prefixed(line, "label:"),
        groups={"file": line["left"], **_prefixed(line, "group:")},
        rate_hz=_number(line.get("rate", ""), "rate", where),
        mm_per_px=_number(line.get("mm_per_px", ""), "mm_per_px", where),
    )


def _prefixed(line: Mapping[str, str], prefix: str) -> dict[str, str]:
    return {
        key.removeprefix(prefix): composed(cell)
        for key, cell in line.items()
        if key.startswith(prefix)
    }


def _number(text: str, column: str, where: str) -> float | None:
    if not text:
        return None
    try:
        value = float(text)
    except ValueError:
        value = 0.0
    if not 0 < value < float("inf"):
        raise BadTable(f"a number above 0 in column {column}", f"{text!r} in {where}", "mend it")
    return value
