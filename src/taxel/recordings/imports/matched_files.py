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
from taxel.foreign.sheets import file_behind, without_sheet
from taxel.plain_text import number_of, visible
from taxel.recordings.imports.name_patterns import HIDDEN, FilePattern, NamePattern, pattern_of
from taxel.recordings.imports.spelling import by_numbers, composed
from taxel.recordings.imports.table_files import file_of
from taxel.recordings.imports.trial_sets import MOST_TRIALS

MOST_LOOKED_AT = 1_000_000
"""Names of files and folders that one pattern is held against, those in folders that match.
Source: our choice, docs/decisions/0011."""
_LOST = "a link that leads nowhere,"
MOST_BESIDE = 100_000
"""Names that do not match and are looked at for a note on what is left out. Source: our choice,
docs/decisions/0011."""


@dataclass(frozen=True, slots=True, kw_only=True)
class TableLine:
    """One line of an import table, for one of the files that its pattern matches."""

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

    @property
    def matches(self) -> bool:
        """Whether all names of its path match."""
        return self.values is not None


@dataclass(frozen=True, slots=True, kw_only=True)
class _Search:
    """The folder that a pattern is looked up in, and whether it may lead outside."""

    data_dir: Path
    where: str
    """Table and line, for messages."""
    outside: bool
    table: Path
    lost: bool
    """Whether links that lead nowhere match as well."""


def one_line_a_file(
    lines: Sequence[TableLine],
    table: Path,
    data_dir: Path,
    *,
    outside: bool = False,
    lost: bool = False,
) -> list[TableLine]:
    """Return the lines with each pattern replaced by the files that match, by name and number.

    Args:
        lines: Of the table; a file that is there counts as a plain name whatever it is called.
        table: The table itself, which no pattern matches.
        data_dir: What files are relative to.
        outside: Also files that lie outside of that folder.
        lost: Also links that lead nowhere, which cannot be read.

    Raises:
        BadTable: A pattern is none, matches no file or too many, a file outside of the folder, or
            what cannot be read; a column is filled in by the line and by the name; or two lines
            have one file.
    """
    expanded: list[TableLine] = []
    beside: list[str] = []
    least = ""
    for line in lines:
        own = _pattern(line, data_dir, outside)
        if own is None:
            expanded.append(line)
            continue
        search = _Search(data_dir=data_dir, where=line.where, outside=outside, table=table,
                         lost=lost)  # fmt: skip
        found, whole = _files(own, search)
        least = least if whole else "at least "
        matches = [file for file in found if file.matches]
        others = [file.path for file in found if not file.matches]
        if not matches:
            raise _no_match(line, data_dir, others, "" if whole else "at least ")
        expanded += _lines(line, matches)
        endings = {_ending(file.path) for file in matches}
        beside += [path for path in others if _ending(path) in endings]
    _refuse_twice(expanded, data_dir)
    doubts = _left_out(beside, expanded, table, data_dir, least)
    return [replace(line, doubts=(*line.doubts, *doubts)) if line.remarks else line
            for line in expanded]  # fmt: skip


def _pattern(line: TableLine, data_dir: Path, outside: bool) -> FilePattern | None:
    cell = line.cells["file"]
    if file_behind(file_of(cell, data_dir, line.where, outside=outside)).exists():
        return None
    pattern = pattern_of(without_sheet(cell), line.where)
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
    sheet = line.cells["file"].removeprefix(without_sheet(line.cells["file"]))
    twofold = [file for file in matches if file.values != file.others]
    count = f"{len(matches)} {'file matches' if len(matches) == 1 else 'files match'}"
    remark = (
        f"{line.where}: {count}, the first is {visible(first.path)}{_shown_values(first.values)}"
    )
    doubts = [
        f"{line.where}: {len(twofold)} of {number_of(len(matches), 'name')} can be read in "
        "two ways; the first, "
        f"{visible(file.path)}, was taken as{_shown_values(file.values, '')}, not"
        f"{_shown_values(file.others, '')}; write more of the name into the pattern, or "
        "rename the files"
        for file in twofold[:1]
    ]
    return [
        replace(line, cells={**line.cells, "file": file.path + sheet}, values=file.values or {},
                remarks=(remark,), doubts=tuple(doubts))
        for file in matches
    ]  # fmt: skip


def _shown_values(values: Mapping[str, str] | None, before: str = ", with") -> str:
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
    beside: Sequence[str], lines: Sequence[TableLine], table: Path, data_dir: Path, least: str
) -> list[str]:
    """Return a line on files that lie where others match, and that no line has.

    `least` stands before their number where not all of them were looked at.
    """
    taken = {file_behind(data_dir / line.cells["file"]).resolve() for line in lines}
    left = [path for path in dict.fromkeys(beside) if (data_dir / path).resolve() not in taken]
    if not left:
        return []
    first = min(left, key=_order)
    return [
        f"{table}: {least}{len(left)} {'file' if len(left) == 1 else 'files'} beside those that "
        f"match {'is' if len(left) == 1 else 'are'} in no line, and not imported; the first is "
        f"{visible(first)}"
    ]


def _no_match(line: TableLine, data_dir: Path, others: Sequence[str], least: str) -> BadTable:
    count = f" of {least}{len(others)} there, such as {others[0]!r}," if others else ""
    return BadTable(
        f"a file that matches {line.cells['file']!r} in the folder {data_dir}",
        f"none{count} by {line.where}",
        "correct the pattern, or name the files' folder with --data",
    )


def _files(pattern: FilePattern, search: _Search) -> tuple[list[_Found], bool]:
    """Return the files that match and those beside, by name and number, and if these are all."""
    level, looked_at, beside = [_Found("", {}, {})], 0, 0
    for number, step in enumerate(pattern.steps, start=1):
        below = []
        for folder in level:
            if not folder.matches and beside > MOST_BESIDE:
                continue
            for found in _steps(folder, step, search):
                looked_at += folder.matches
                beside += not found.matches
                if looked_at > MOST_LOOKED_AT:
                    raise BadTable(f"at most {MOST_LOOKED_AT:,} names to hold a pattern against",
                                   f"more by {search.where}", "write more of the folders' names, "
                                   "or keep other files elsewhere")  # fmt: skip
                if not found.matches and beside > MOST_BESIDE:
                    continue
                if _leads_on(found, step, number == len(pattern.steps), search):
                    below.append(found)
        level = below
    _check_matches([found.path for found in level if found.matches], search)
    return sorted(level, key=lambda found: _order(found.path)), beside <= MOST_BESIDE


def _leads_on(found: _Found, step: str | NamePattern, last: bool, search: _Search) -> bool:
    """Return whether a name is the folder, or at last the file, that a pattern wants.

    Raises:
        BadTable: It matches, and lies outside or cannot be read.
    """
    path = search.data_dir / found.path
    fits = os.path.isfile(path) if last else os.path.isdir(path)
    if fits and _is_table(path, search.table):
        return False
    if not found.matches:
        return fits
    why_not = "" if fits else _why_not(path, last)
    if (fits or why_not) and (step == ".." or os.path.islink(path)):
        file_of(found.path, search.data_dir, search.where, outside=search.outside)
    if why_not and not (last and search.lost and why_not == _LOST):
        raise _unreadable(found.path, why_not, search)
    return fits or bool(why_not)


def _why_not(path: Path, last: bool) -> str:
    """Return why nothing is known of a file or folder; empty if it is known, or is not there.

    Where a folder is wanted, a link to nothing whose name ends as a file's does was none.
    """
    try:
        os.stat(path)
    except (FileNotFoundError, NotADirectoryError):
        lost = os.path.islink(path) and (last or not path.suffix)
        return _LOST if lost else ""
    except OSError as error:
        return f"which cannot be read ({error.strerror}),"
    return ""


def _unreadable(path: str, why: str, search: _Search) -> BadTable:
    mend = "allow reading it" if why.startswith("which") else (
        "bring what it leads to (as git annex get does), remove it"
    )  # fmt: skip
    return BadTable("a match that can be read", f"{path!r}, {why} by {search.where}",
                    f"{mend}, or write more of the names")  # fmt: skip


def _check_matches(matches: Sequence[str], search: _Search) -> None:
    """Refuse files that a table may not name, or that no recording could name."""
    where = search.where
    if len(matches) > MOST_TRIALS:
        raise BadTable(f"at most {MOST_TRIALS:,} files that match a pattern",
                       f"{len(matches):,} by {where}", "write several lines")  # fmt: skip
    for path in matches:
        file_of(path, search.data_dir, where, outside=search.outside)
        if any("\ud800" <= sign <= "\udfff" for sign in path):
            raise BadTable("file names in UTF-8", f"{path!r} by {where}", "rename the file")


def _is_table(path: Path, table: Path) -> bool:
    return path.name == table.name and path.resolve() == table.resolve()


def _steps(folder: _Found, step: str | NamePattern, search: _Search) -> Iterator[_Found]:
    """Yield what one more name leads to; folders that do not match are looked into as well.

    Of what does not match, nothing behind a link or `..` is: it may lie anywhere.
    """
    for name, read in _names(folder, step, search):
        path = Path(folder.path, name).as_posix()
        if read is not None and folder.values is not None:
            own, other = read
            yield _Found(path, {**folder.values, **own}, {**folder.others, **other})
        elif not (name == ".." or os.path.islink(search.data_dir / path)):
            yield _Found(path, None, {})


def _names(
    folder: _Found, step: str | NamePattern, search: _Search
) -> Iterator[tuple[str, tuple[dict[str, str], dict[str, str]] | None]]:
    """Yield the names in a folder that may lead on, with both readings of those that match."""
    if isinstance(step, str):
        yield from ((name, ({}, {})) for name in _spelt(folder, step, search))
        return
    for name in _listed(folder, search):
        spelt = composed(name)
        own = step.read(spelt) if folder.matches else None
        if own is not None:
            yield name, (own, step.read_from_right(spelt))
        elif not name.startswith(HIDDEN):
            yield name, None


def _spelt(folder: _Found, step: str, search: _Search) -> list[str]:
    """Return a name as it is there: composed and decomposed letters (NFC, NFD) are the same."""
    if step.isascii() or os.path.lexists(search.data_dir / folder.path / step):
        return [step]
    return [name for name in _listed(folder, search) if composed(name) == composed(step)]


def _listed(folder: _Found, search: _Search) -> list[str]:
    """Return the names in a folder; none where it is none.

    Raises:
        BadTable: It matches, and may not be listed.
    """
    path = search.data_dir / folder.path
    try:
        return sorted(os.listdir(path))
    except (FileNotFoundError, NotADirectoryError):
        return []
    except OSError as error:
        if not folder.matches:
            return []
        why = f"which cannot be read ({error.strerror}),"
        raise _unreadable(folder.path or str(path), why, search) from error


def _order(path: str) -> tuple[list[tuple[int, str]], str]:
    return by_numbers(path), path


def _ending(path: str) -> str:
    return Path(path).suffix.lower()
