r"""Patterns of file names with labels in them, as {label:object}_{group:force}_trial*.csv.

A part in braces is named like the column of the import table that it fills in. `*` stands for
anything, also nothing, and `?` for one character. A part takes as little of the name as it can,
from the left, at least one character, and never a slash. {digits} stands for a whole number, and
{group:take:digits} reads one: these may stand right beside another part, as in bottle12.csv. Knows
nothing about which files there are (matched_files.py).

Background of our choices: docs/decisions/0011.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import lru_cache
from itertools import pairwise
from pathlib import Path

from taxel.errors import BadTable
from taxel.recordings.imports.own_groups import not_own_group, refuse_own_groups
from taxel.recordings.imports.spelling import column_name, composed

ANY = "*"
"""A part that says nothing."""
HIDDEN = "."
"""What the names of hidden files begin with, such as the ._cup.csv that macOS leaves on sticks."""
DIGITS = "digits"
"""In braces a whole number that says nothing; behind a column's name, that its part is one."""
_TOKENS = re.compile(r"(\{[^{}]*\})|(\*)|([{}])|([^{}*]+)")
_KINDS = ("label:", "group:")
_NUMBER = "(?<![0-9])([0-9]+)(?![0-9])"
_DIGITS = tuple("0123456789")


@dataclass(frozen=True, slots=True)
class NamePattern:
    """What the name of one folder or file must be like."""

    texts: tuple[str, ...]
    """What stands before, between and behind the parts, one more than these; ? is any character."""
    parts: tuple[str, ...]
    """Column of each part, as label:object; * for one that says nothing."""
    numbers: tuple[bool, ...]
    """Whether each part is a whole number."""

    def read(self, name: str) -> dict[str, str] | None:
        """Return column → its value in a name; None if the name does not match.

        Args:
            name: Of a file or folder, with composed letters (NFC).
        """
        if name.startswith(HIDDEN) and not self.texts[0].startswith(HIDDEN):
            return None
        found = _expression(self.texts, self.parts, self.numbers).fullmatch(name)
        return None if found is None else self._named(found.groups())

    def read_from_right(self, name: str) -> dict[str, str]:
        """Return the other reading of a name that matches: the same where there is only one."""
        texts = tuple(text[::-1] for text in reversed(self.texts))
        found = _expression(texts, self.parts[::-1], self.numbers[::-1]).fullmatch(name[::-1])
        assert found is not None, "what matches from the left matches from the right"
        return self._named([value[::-1] for value in reversed(found.groups())])

    def _named(self, values: Sequence[str]) -> dict[str, str]:
        pairs = zip(self.parts, values, strict=True)
        return {part: composed(value) for part, value in pairs if part != ANY}


@dataclass(frozen=True, slots=True)
class FilePattern:
    """What the path of a file must be like, folder by folder."""

    steps: tuple[str | NamePattern, ...]
    """A name as it is, or a pattern, for each folder and, last, the file."""

    @property
    def columns(self) -> list[str]:
        """Columns of the import table that its parts fill in."""
        patterns = [step for step in self.steps if isinstance(step, NamePattern)]
        return [part for step in patterns for part in step.parts if part != ANY]


def pattern_of(cell: str, where: str) -> FilePattern | None:
    """Return the pattern that a cell of the column `file` holds; None if it is a plain name.

    Args:
        cell: The cell.
        where: Table and line, for messages.

    Raises:
        BadTable: A brace has no other, a part names no label or group, one that taxel fills in
            itself, or stands there twice, or two parts follow one another without anything
            between.
    """
    if not any(sign in cell for sign in "{}*?"):
        return None
    pattern = FilePattern(tuple(_step(name, where) for name in Path(cell).parts))
    columns = pattern.columns
    refuse_own_groups(columns, where)
    again = next((name for name in columns if columns.count(name) > 1), None)
    if again is not None:
        raise BadTable("each part once", f"{{{again}}} twice in {where}", "write * for one of them")
    return pattern


def _step(name: str, where: str) -> str | NamePattern:
    if not any(sign in name for sign in "{}*?"):
        return name
    texts, parts, numbers = [""], [], []
    for token in _tokens(name):
        if token == ANY or token.startswith("{"):
            column, number = (ANY, False) if token == ANY else _column(token, where)
            parts.append(column)
            numbers.append(number)
            texts.append("")
        elif token == "}":
            raise _no_part(token, where)
        else:
            texts[-1] += composed(token)
    shown = [_shown(part, number=number) for part, number in zip(parts, numbers, strict=True)]
    pairs = zip(pairwise(shown), pairwise(numbers), texts[1:-1], strict=True)
    for (first, second), kinds, text in pairs:
        apart = text.strip("?") or (not text and len(set(kinds)) == 2)
        if not apart:
            folders = first == second == ANY
            raise BadTable(
                "something of the name between two parts, as in {label:object}_{group:session}",
                f"{first}{text}{second} in {where}",
                "write */ for each folder" if folders else "write what stands between them, make "
                "one part of both, or say which of them is a number, as {group:take:digits}",
            )  # fmt: skip
    for place, number in enumerate(numbers):
        before, after = texts[place], texts[place + 1]
        if number and (before[-1:] in _DIGITS or after[:1] in _DIGITS):
            raise BadTable(
                "a whole number, with no digit of it outside the braces",
                f"{before}{shown[place]}{after} in {where}", "leave those digits out",
            )  # fmt: skip
    return NamePattern(tuple(texts), tuple(parts), tuple(numbers))


def _tokens(name: str) -> Iterator[str]:
    return (match[0] for match in _TOKENS.finditer(name))


def _column(token: str, where: str) -> tuple[str, bool]:
    """Return the column that a part in braces names, as the table's header would spell it, and
    whether it is a number; `ANY` for one that says nothing.
    """
    own = token[1:-1].strip()
    if own.casefold() == DIGITS:
        return ANY, True
    before, _, last = own.rpartition(":")
    number = ":" in before and last.strip().casefold() == DIGITS
    name = column_name(before if number else own, ())
    kind, colon, rest = name.partition(":")
    if token == "{" or f"{kind}{colon}" not in _KINDS or not rest:
        raise _no_part(token, where)
    return name, number


def _no_part(token: str, where: str) -> BadTable:
    own = token.strip("{}").strip()[:40]
    number = own.casefold().endswith(f":{DIGITS}")
    own = own[: -len(DIGITS) - 1] if number else own
    own = not_own_group(own.rpartition(":")[2].strip() or "object")
    named = own + (f":{DIGITS}" if number else "")
    return BadTable(
        "a file that is there, or a pattern whose parts are {label:NAME}, {group:NAME}, {digits}, "
        "* and ?",
        f"{token[:80]!r} in the column 'file' in {where}",
        f"write it as {{label:{named}}} or {{group:{named}}}",
    )


def _shown(part: str, *, number: bool) -> str:
    if part == ANY:
        return f"{{{DIGITS}}}" if number else ANY
    return f"{{{part}:{DIGITS}}}" if number else f"{{{part}}}"


@lru_cache
def _expression(
    texts: tuple[str, ...], parts: tuple[str, ...], numbers: tuple[bool, ...]
) -> re.Pattern[str]:
    """Return the regular expression of a pattern.

    Each part ends where the text behind it first comes, for good (an atomic group): this gives
    the same as trying all ways from the shortest on, in a time that no name can make long. A part
    before a number ends where the text, the number and what follows it first come.
    """
    made, last, begun = _plain(texts[0]), len(parts) - 1, ""
    for place, (part, number, text) in enumerate(zip(parts, numbers, texts[1:], strict=True)):
        begun += _NUMBER if number else "(.*?)" if part == ANY else "(.+?)"
        begun += _plain(text)
        if place < last and numbers[place + 1]:
            continue
        made += begun if place == last else f"(?>{begun})"
        begun = ""
    return re.compile(made, re.DOTALL)


def _plain(text: str) -> str:
    return ".".join(map(re.escape, text.split("?")))
