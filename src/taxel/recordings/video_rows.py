"""What each pair of videos is, read from an import table.

FORMAT.md describes the table. Knows nothing about pixels.
"""

from __future__ import annotations

import csv
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

from taxel.errors import BadTable

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


def read_video_rows(table: Path, data_dir: Path) -> list[VideoRow]:
    """Return the rows of an import table whose columns are left, right, label:… and group:….

    Args:
        table: A CSV; `rate` (hertz) and `mm_per_px` are further columns, where wanted.
        data_dir: What the videos' paths are relative to.

    Raises:
        BadTable: The table cannot be read, or a column is missing or unknown.
    """
    try:
        with table.open(newline="") as file:
            reader = csv.DictReader(file)
            columns = [name.strip() for name in reader.fieldnames or []]
            lines = [
                {k.strip(): (v or "").strip() for k, v in line.items() if k} for line in reader
            ]
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        raise BadTable("an import table (CSV)", f"{table}: {error}", "check the path") from error
    known = (*_CAMERA_COLUMNS, "rate", "mm_per_px")
    odd = [c for c in columns if c not in known and not c.startswith(("label:", "group:"))]
    if odd or "left" not in columns:
        raise BadTable(
            "the columns left, right, label:NAME, group:NAME, rate, mm_per_px",
            f"{', '.join(odd) or 'no column left'} in {table}",
            "mend the table's first line",
        )
    rows = []
    for number, line in enumerate(lines, start=2):
        files = {name: data_dir / line[name] for name in _CAMERA_COLUMNS if line.get(name)}
        if len(files) < sum(name in columns for name in _CAMERA_COLUMNS):
            raise BadTable("a video for each camera", f"an empty cell in {table}, line {number}",
                           "name the video, or leave the column out for all")  # fmt: skip
        rows.append(
            VideoRow(
                name=f"{number - 1:04d}-{files['left'].stem}",
                files=files,
                labels=_prefixed(line, "label:"),
                groups={"file": line["left"], **_prefixed(line, "group:")},
                rate_hz=_number(line.get("rate", ""), "rate", table, number),
                mm_per_px=_number(line.get("mm_per_px", ""), "mm_per_px", table, number),
            )
        )
    if not rows:
        raise BadTable("at least one row", f"none in {table}", "add one a recording")
    return rows


def _prefixed(line: Mapping[str, str], prefix: str) -> dict[str, str]:
    return {key.removeprefix(prefix): value for key, value in line.items()
            if key.startswith(prefix) and value}  # fmt: skip


def _number(text: str, column: str, table: Path, line: int) -> float | None:
    if not text:
        return None
    try:
        value = float(text)
    except ValueError:
        value = 0.0
    if not 0 < value < float("inf"):
        raise BadTable(f"a number above 0 in column {column}", f"{text!r} in {table}, line {line}",
                       "mend it")  # fmt: skip
    return value
