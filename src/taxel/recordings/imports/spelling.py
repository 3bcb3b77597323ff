"""Names: one spelling, their order by the numbers in them, and a word on those that look alike,
or like no value.

Knows nothing about files, recordings or tables.
"""

from __future__ import annotations

import re
import unicodedata
from collections import Counter, defaultdict
from collections.abc import Collection, Iterable, Mapping

_UNKNOWN = frozenset(("nan", "na", "n/a", "#n/a", "<na>", "null"))
"""What numpy, pandas, R and SQL write for an unknown value, in small letters; "none" is also what
people write where nothing is touched. Source: our choice, docs/decisions/0011."""
_NUMBER = re.compile(r"([+-]?)([0-9]{1,40})(?:\.([0-9]{0,40}))?")


def composed(text: str) -> str:
    """Return a text with composed letters (NFC): "é" is one letter, however it was typed."""
    return unicodedata.normalize("NFC", text)


def column_name(text: str, plain: Collection[str]) -> str:
    """Return a column's name as a table's reader knows it: "File" is file, "Label:Hue" label:Hue.

    Args:
        text: As it stands in the first line.
        plain: The reader's own columns, in small letters; other names stay as they are.
    """
    name = text.strip()
    kind, colon, own = name.partition(":")
    if colon and kind.strip().lower() in ("label", "group", "camera"):
        return f"{kind.strip().lower()}:{own.strip()}"
    return name.lower() if name.lower() in plain else name


def prefixed(named: Mapping[str, str], prefix: str) -> dict[str, str]:
    """Return a row's cells of the columns label:NAME, or group:NAME: NAME → composed cell."""
    return {
        name.removeprefix(prefix): composed(cell)
        for name, cell in named.items()
        if name.startswith(prefix)
    }


def look_alikes(what: str, sets: Iterable[Mapping[str, str]]) -> list[str]:
    """Return a line for each lot of values that differ in case or blanks only, or in zeros.

    Args:
        what: What the values are: "label" or "group".
        sets: Labels, or groups, of everything there is: name → value.
    """
    lots: dict[tuple[str, str], set[str]] = defaultdict(set)
    numbers: dict[tuple[str, str], set[str]] = defaultdict(set)
    for group in sets:
        for name, value in group.items():
            spelt = composed(value)
            lots[composed(name), "".join(spelt.casefold().split())].add(spelt)
            if number := _plain_number(spelt):
                numbers[composed(name), number].add(spelt)
    return [
        f"{what} {name}: {', '.join(map(repr, sorted(values)))} differ in {how} only; "
        f"they count as {len(values)}"
        for how, own in (("case or blanks", lots), ("how a number is written", numbers))
        for (name, _), values in sorted(own.items())
        if len(values) > 1
    ]


def unknown_words(what: str, sets: Iterable[Mapping[str, str]]) -> list[str]:
    """Return a line for each label, or group, with words that mean elsewhere that it is unknown.

    Args:
        what: As for `look_alikes`.
        sets: Likewise.
    """
    found: dict[str, Counter[str]] = defaultdict(Counter)
    for group in sets:
        for name, value in group.items():
            if value.casefold() in _UNKNOWN:
                found[composed(name)][value] += 1
    mend = "leave the cell empty, or the trial out" if what == "label" else "leave those trials out"
    return [
        f"{what} {name}: {', '.join(f'{word!r} ({words[word]} ×)' for word in sorted(words))}: "
        f"taken as any other value; where it means that the {what} is unknown, {mend}"
        for name, words in sorted(found.items())
    ]


def _plain_number(text: str) -> str:
    """Return a number without needless zeros, so that 1, 01 and 1.0 are alike; else nothing."""
    found = _NUMBER.fullmatch(text.strip())
    if found is None:
        return ""
    sign, whole, fraction = found.groups()
    left, right = whole.lstrip("0") or "0", (fraction or "").rstrip("0")
    return f"{'-' * (sign == '-' and (left, right) != ('0', ''))}{left}.{right}"


def by_numbers(name: str) -> list[tuple[int, str]]:
    """Return a name's key in an order in which trial_10 follows trial_9."""
    return [
        (int(part), "") if part.isdecimal() and len(part) < 20 else (-1, part)
        for part in re.split(r"(\d+)", name)
    ]
