"""Lines of an import table whose file is a pattern: a line for each file that matches.

Every match is held to what a table may name (table_files.py). Knows nothing about what the files
hold.

Background of our choices: docs/decisions/0011.
"""

from __future__ import annotations

import os
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

from taxel.errors import BadTable
from taxel.plain_text import visible
from taxel.recordings.name_patterns import HIDDEN, FilePattern, NamePattern, pattern_of
from taxel.recordings.spelling import by_numbers, composed
from taxel.recordings.table_files import file_of
from taxel.recordings.trial_sets import MOST_TRIALS

MOST_LOOKED_AT = 1_000_000
"""Names of files and folders that one pattern is held against. Source: our choice,
docs/decisions/0011."""


@dataclass(frozen=True, slots=True, kw_only=True)
class TableLine:
    """One line of an import table, or what it says of one of the files that match it."""

    where: str
    """Table and line, for messages."""
    cells: Mapping[str, str]
    """Column → cell; `file` is a plain name, relative to the data folder."""
    values: Mapping[str, str] = field(default_factory=dict)
    """Column label:NAME or group:NAME → what stands for it in the file's name."""
    remarks: tuple[str, ...] = ()
    """How the names were read, the same for all files of a line."""
    doubts: tuple[str, ...] = ()
    """What a person should check of them."""


@dataclass(frozen=True, slots=True)
class _Found:
    """A file or folder, with what its path says so far."""

    path: str
    """As a table would name it."""
    values: Mapping[str, str] | None
    """None where it only lies beside those that match."""
    others: Mapping[str, str]
    """The same, each name read from the right."""


def one_line_a_file(
    lines: Sequence[TableLine], table: Path, data_dir: Path, *, outside: bool = False
) -> list[TableLine]:
    """Return the lines with each pattern replaced by the files that match, by name and number.

    Args:
        lines: Of the table; a file that is there counts as a plain name whatever it is called.
        table: The table itself, which no pattern matches.
        data_dir: What files are relative to.
        outside: Also files that lie outside of that folder.

    Raises:
        BadTable: A pattern is none, matches no file or too many, or a file outside of the folder;
            a column is filled in by the line and by the name; or two lines have one file.
    """
    made: list[TableLine] = []
    beside: list[str] = []
    for line in lines:
        own = _pattern(line, data_dir, outside)
        if own is None:
            made.append(line)
            continue
        found = _files(own, data_dir, line.where, outside, table)
        matches = [file for file in found if file.values is not None]
        others = [file.path for file in found if file.values is None]
        if not matches:
            raise _no_match(line, data_dir, others)
        made += _lines(line, matches)
        endings = {_ending(file.path) for file in matches}
        beside += [path for path in others if _ending(path) in endings]
    _refuse_twice(made, data_dir)
    doubts = _left_out(beside, made, table, data_dir)
    return [replace(line, doubts=(*line.doubts, *doubts)) if line.remarks else line
            for line in made]  # fmt: skip


def _pattern(line: TableLine, data_dir: Path, outside: bool) -> FilePattern | None:
    cell = line.cells["file"]
    if file_of(cell, data_dir, line.where, outside=outside).exists():
        return None
    pattern = pattern_of(cell, line.where)
    for column in pattern.columns if pattern else ():
        if line.cells.get(column):
            raise BadTable(
                f"a value of {column!r} from the file's name or from its column",
                f"both in {line.where}",
                f"leave the cell empty, or write * in place of {{{column}}}",
            )
    return pattern


def _lines(line: TableLine, matches: Sequence[_Found]) -> list[TableLine]:
    """Return a line for each file that matches, with notes on how the names were read."""
    first = matches[0]
    twofold = [file for file in matches if file.values != file.others]
    count = f"{len(matches)} {'file matches' if len(matches) == 1 else 'files match'}"
    remark = f"{line.where}: {count}, the first is {visible(first.path)}{_said(first.values)}"
    doubts = [
        f"{line.where}: {len(twofold)} of {len(matches)} names can be read in two ways; the first, "
        f"{visible(file.path)}, was taken as{_said(file.values, '')}, not{_said(file.others, '')}; "
        "write more of the name into the pattern, or rename the files"
        for file in twofold[:1]
    ]
    return [
        replace(line, cells={**line.cells, "file": file.path}, values=file.values or {},
                remarks=(remark,), doubts=tuple(doubts))
        for file in matches
    ]  # fmt: skip


def _said(values: Mapping[str, str] | None, before: str = ", with") -> str:
    pairs = [f"{name.partition(':')[2]}={value}" for name, value in (values or {}).items()]
    return f"{before} {', '.join(map(visible, pairs))}" if pairs else ""


def _refuse_twice(lines: Sequence[TableLine], data_dir: Path) -> None:
    """Refuse a file that two lines have, one of them by a pattern; a stack's parts are others."""
    if not any(line.remarks for line in lines):
        return
    known: dict[tuple[Path, str], TableLine] = {}
    for line in lines:
        path = (data_dir / line.cells["file"]).resolve()
        before = known.setdefault((path, line.cells.get("trials", "")), line)
        if before is not line and (before.remarks or line.remarks):
            raise BadTable(
                "each file in one line of the table",
                f"{line.cells['file']!r} by {before.where} and by {line.where}",
                "write more of the names into the patterns, or remove a line",
            )


def _left_out(
    beside: Sequence[str], lines: Sequence[TableLine], table: Path, data_dir: Path
) -> list[str]:
    """Return a line on files that lie where others match, and that no line has."""
    taken = {(data_dir / line.cells["file"]).resolve() for line in lines}
    left = [path for path in dict.fromkeys(beside) if (data_dir / path).resolve() not in taken]
    if not left:
        return []
    first = min(left, key=_order)
    return [
        f"{table}: {len(left)} {'file' if len(left) == 1 else 'files'} beside those that match "
        f"{'is' if len(left) == 1 else 'are'} in no line, and not imported; the first is "
        f"{visible(first)}"
    ]


def _no_match(line: TableLine, data_dir: Path, others: Sequence[str]) -> BadTable:
    count = f" of {len(others)} there, such as {others[0]!r}," if others else ""
    return BadTable(
        f"a file that matches {line.cells['file']!r} in the folder {data_dir}",
        f"none{count} by {line.where}",
        "correct the pattern, or name the files' folder with --data",
    )


def _files(
    pattern: FilePattern, data_dir: Path, where: str, outside: bool, table: Path
) -> list[_Found]:
    """Return the files that match and those beside, in the order of names and numbers."""
    level, looked_at = [_Found("", {}, {})], 0
    for number, step in enumerate(pattern.steps, start=1):
        fits = os.path.isdir if number < len(pattern.steps) else os.path.isfile
        below = []
        for found in _steps(level, step, data_dir):
            looked_at += 1
            if looked_at > MOST_LOOKED_AT:
                raise BadTable(f"at most {MOST_LOOKED_AT:,} names to hold a pattern against",
                               f"more by {where}", "write more of the names")  # fmt: skip
            path = data_dir / found.path
            if not fits(path) or _is_table(path, table):
                continue
            if found.values is not None and (step == ".." or os.path.islink(path)):
                file_of(found.path, data_dir, where, outside=outside)  # before a look into it
            below.append(found)
        level = below
    _check_matches([found.path for found in level if found.values is not None], data_dir, where,
                   outside)  # fmt: skip
    return sorted(level, key=lambda found: _order(found.path))


def _check_matches(matches: Sequence[str], data_dir: Path, where: str, outside: bool) -> None:
    """Refuse files that a table may not name, or that no recording could name."""
    if len(matches) > MOST_TRIALS:
        raise BadTable(f"at most {MOST_TRIALS:,} files that match a pattern",
                       f"{len(matches):,} by {where}", "write several lines")  # fmt: skip
    for path in matches:
        file_of(path, data_dir, where, outside=outside)
        if any("\ud800" <= sign <= "\udfff" for sign in path):
            raise BadTable("file names in UTF-8", f"{path!r} by {where}", "rename the file")


def _is_table(path: Path, table: Path) -> bool:
    return path.name == table.name and path.resolve() == table.resolve()


def _steps(level: Sequence[_Found], step: str | NamePattern, data_dir: Path) -> Iterator[_Found]:
    """Yield what one more name leads to; folders that do not match are looked into as well."""
    for found in level:
        if isinstance(step, str):
            yield replace(found, path=Path(found.path, step).as_posix())
            continue
        for name in _names(data_dir / found.path):
            path, spelt = Path(found.path, name).as_posix(), composed(name)
            own = None if found.values is None else step.read(spelt)
            if own is not None and found.values is not None:
                yield _Found(path, {**found.values, **own},
                             {**found.others, **step.read_from_right(spelt)})  # fmt: skip
            elif not (name.startswith(HIDDEN) or os.path.islink(data_dir / path)):
                yield _Found(path, None, {})


def _names(folder: Path) -> list[str]:
    """Return the names in a folder; none where it is no folder, or may not be looked into."""
    try:
        return sorted(os.listdir(folder))
    except OSError:
        return []


def _order(path: str) -> tuple[list[tuple[int, str]], str]:
    return by_numbers(path), path


def _ending(path: str) -> str:
    return Path(path).suffix.lower()
