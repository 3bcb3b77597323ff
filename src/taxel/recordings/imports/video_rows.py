"""What each camera trial is, read from an import table: its videos, labels and groups.

FORMAT.md describes the table. Knows nothing about pixels.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path, PurePath

from taxel.errors import BadTable
from taxel.recordings.imports.spelling import column_name, composed, prefixed
from taxel.recordings.imports.table_files import file_of
from taxel.recordings.imports.value_tables.table_columns import by_column, read_cells

_CAMERA_COLUMNS = ("left", "right")
_CAMERA = "camera:"
SPLIT = "split"
"""Column, and group, that says on which side a trial stands."""
_LONGEST_NAME = 150
"""Characters of a file and its folders that a recording is called by."""
_PLAIN = (*_CAMERA_COLUMNS, SPLIT, "rate", "mm_per_px")
TEST = "test"
"""Value of it whose trials are only tested on."""
SIDES = ("train", "validation", TEST)
"""What the column `split` may hold."""
CAMERA_FILE = "a video, an image or a folder of images for each camera"
"""What a camera's cell names, in messages."""
_EACH_ROW = "write a row for each trial: in tables of videos no cell stands for several files"


@dataclass(frozen=True, slots=True, kw_only=True)
class VideoRow:
    """One row of an import table of camera trials: the files of one recording."""

    name: str
    """Of the recording, without ending."""
    files: Mapping[str, Path]
    """Camera's name → its video, its folder of images, or its one image."""
    labels: Mapping[str, str] = field(default_factory=dict)
    groups: Mapping[str, str] = field(default_factory=dict)
    rate_hz: float | None = None
    """Frames a second; None takes what the files say."""
    mm_per_px: float | None = None
    details: Mapping[str, str] = field(default_factory=dict)
    """Kept with each camera in the manifest."""


def read_video_rows(table: Path, data_dir: Path, *, outside: bool = False) -> list[VideoRow]:
    """Return the rows of an import table: a trial a row, a column a camera.

    Args:
        table: A CSV with the columns camera:NAME (or left and right), label:NAME and group:NAME;
            split, `rate` (hertz) and `mm_per_px` are further ones, where wanted.
        data_dir: What the videos' paths are relative to.
        outside: Also videos that lie outside of that folder.

    Raises:
        BadTable: The table cannot be read, a column is missing or unknown, or a video is not there
            or lies outside.
    """
    lines = read_cells(table)
    columns = [column_name(name, _PLAIN) for name in lines[0]] if lines else []
    _check_columns(table, columns)
    rows = [
        _row(table, number, columns, cells, data_dir, outside)
        for number, cells in enumerate(lines[1:], start=2)
        if any(cell.strip() for cell in cells)
    ]
    if not rows:
        raise BadTable("at least one row", f"none in {table}", "add one a recording")
    return _named(rows, data_dir)


def _named(rows: Sequence[VideoRow], data_dir: Path) -> list[VideoRow]:
    """Return the rows, called by their first camera's files, and by folders where those repeat."""
    files = [next(iter(row.files.values())) for row in rows]
    inside = [file.is_relative_to(data_dir) for file in files]
    names = names_apart(
        [
            file.relative_to(data_dir) if own else file
            for file, own in zip(files, inside, strict=True)
        ]
    )
    return [
        replace(row, name=f"{row.name}-{composed(name)[-_LONGEST_NAME:]}")
        for row, name in zip(rows, names, strict=True)
    ]


def names_apart(paths: Sequence[PurePath]) -> list[str]:
    """Return what files are called: without ending, and with the folders that tell them apart.

    As few folders as do, nearest first, and none that all of them share; a file's own name is left
    out where it is that of all, as of `camera_0.avi` in a folder of each trial.

    Args:
        paths: Of the files, such as `mug/try_1/camera_0.avi`.
    """
    often = Counter(path.stem for path in paths)
    apart = [(*_folders(path), path.stem) for path in paths]
    several = [parts for parts in apart if often[parts[-1]] > 1]
    if not several:
        return [path.stem for path in paths]
    counts = range(2, max(map(len, several)) + 1)
    most = len(set(several))
    count = next((n for n in counts if len({parts[-n:] for parts in several}) == most), 1)
    levels = [n for n in range(count, 1, -1) if len({parts[-n:][:1] for parts in several}) > 1]
    levels += [1] if len(often) > 1 or not levels else []
    names = []
    for path, parts in zip(paths, apart, strict=True):
        found = [parts[-n] for n in levels if n <= len(parts)] if often[path.stem] > 1 else []
        names.append("-".join(found) or path.stem)
    return names


def _folders(path: PurePath) -> tuple[str, ...]:
    return tuple(part for part in path.parent.parts if part not in ("..", path.anchor))


def names_videos(columns: Sequence[str]) -> bool:
    """Return whether a table with these columns is one of camera trials."""
    return any(_is_camera(column_name(name, _PLAIN)) for name in columns)


def _is_camera(column: str) -> bool:
    return column in _CAMERA_COLUMNS or column.startswith(_CAMERA)


def _check_columns(table: Path, columns: Sequence[str]) -> None:
    prefixes = (_CAMERA, "label:", "group:")
    odd = [c for c in columns if c not in _PLAIN and not c.startswith(prefixes)]
    odd += [c for c in columns if c in prefixes]
    alone = "right" in columns and "left" not in columns
    if odd or alone or not names_videos(columns):
        raise BadTable(
            "the columns left, right (or camera:NAME), label:NAME, group:NAME, split, rate, "
            "mm_per_px",
            f"{', '.join(map(repr, odd)) or 'no column left or camera:NAME'} in {table}",
            "mend the table's first line",
        )
    cameras = [column.removeprefix(_CAMERA) for column in columns if _is_camera(column)]
    if len(set(columns)) < len(columns) or len(set(cameras)) < len(cameras):
        raise BadTable(
            "each column once", f"{', '.join(columns)} in {table}", "mend the table's first line"
        )


def no_file(path: Path, where: str = "") -> BadTable:
    """Return what is said of a camera's file that is not there.

    Args:
        path: The file.
        where: Behind it in the message: the line that names it.
    """
    mend = "check the path" + (", which is relative to the table" if where else "")
    if any(sign in path.name for sign in "{*"):
        mend = _EACH_ROW
    elif Path(str(path).replace("\\", "/")).exists():
        mend = "write / where the path has \\"
    return BadTable(CAMERA_FILE, f"no file {path}{where}", mend)


def _row(
    table: Path,
    number: int,
    columns: Sequence[str],
    cells: Sequence[str],
    data_dir: Path,
    outside: bool,
) -> VideoRow:
    where = f"{table}, line {number}"
    line = by_column(columns, cells, where)
    cameras = {name.removeprefix(_CAMERA): line[name] for name in columns if _is_camera(name)}
    if not all(cameras.values()):
        raise BadTable(
            CAMERA_FILE, f"an empty cell in {where}",
            "name it, or leave the column out for all",
        )  # fmt: skip
    empty = [name for name, cell in line.items() if ":" in name and not cell]
    if empty:
        pattern = any(sign in cell for cell in cameras.values() for sign in "{*")
        mend = _EACH_ROW if pattern else "fill it in"
        raise BadTable(f"something in the column {empty[0]!r}", f"nothing in {where}", mend)
    files = {
        name: _file_of(cell, data_dir, where, outside=outside) for name, cell in cameras.items()
    }
    first = next(iter(cameras))
    row = VideoRow(
        name=f"{number - 1:04d}",
        files=files,
        labels=prefixed(line, "label:"),
        groups={"file": cameras[first], **prefixed(line, "group:"), **_side(line, where)},
        rate_hz=_number(line.get("rate", ""), "rate", where),
        mm_per_px=_number(line.get("mm_per_px", ""), "mm_per_px", where),
    )
    for path in files.values():
        if not path.exists():
            raise no_file(path, f" ({where})")
    return row


def _file_of(cell: str, data_dir: Path, where: str, *, outside: bool) -> Path:
    """Return the file that a cell names, as its name is spelt on the disk; see `file_of`."""
    path = file_of(cell, data_dir, where, outside=outside)
    spelt = _as_spelt(path)
    if spelt == path:
        return path
    inside = spelt.is_relative_to(data_dir)
    named = str(spelt.relative_to(data_dir) if inside else spelt)
    return file_of(named, data_dir, where, outside=outside)


def _as_spelt(path: Path) -> Path:
    """Return a path as it is there: composed and decomposed letters (NFC, NFD) are the same."""
    if path.exists() or path.parent == path:
        return path
    folder = _as_spelt(path.parent)
    inside = folder.iterdir() if folder.is_dir() else ()
    found = [file for file in inside if composed(file.name) == composed(path.name)]
    return found[0] if len(found) == 1 else path


def _side(line: Mapping[str, str], where: str) -> dict[str, str]:
    if SPLIT not in line:
        return {}
    if line[SPLIT] not in SIDES:
        raise BadTable(f"{', '.join(SIDES)} in the column split",
                       f"{line[SPLIT]!r} in {where}", "write one of them")  # fmt: skip
    return {SPLIT: line[SPLIT]}


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
