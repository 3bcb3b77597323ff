r"""Foreign text made fit to be shown: labels, names, metadata, and messages that quote them.

Text from a file, a device or a network may hold a terminal's escape sequences, marks that turn
the direction of writing, line breaks, or nothing that can be seen. It is accepted as it is,
kept as it is, and shown literally: every such character as its escape, `\x1b`, `\u202e`.
Two texts that differ look different (docs/decisions/0034). Knows nothing about consoles,
pages or files.
"""

from __future__ import annotations

import hashlib
import html
import json
import math
import shlex
from collections.abc import Iterable, Sequence
from typing import Any

MOST_NAME = 200
"""Characters of a name that are shown in full. Source: our choice; two lines of a terminal."""
MOST_LINE = 4000
"""Characters of a message, such as an error that quotes several names. Our choice."""
MOST_HTML = 20_000
"""Characters of one piece of a page, such as a paragraph. Our choice."""
_MOST_DECIMALS, _MOST_PLAIN = 17, 1e12
"""Of a figure, and from where on it is written as 1e+12. A double has 17 digits at most."""
_DIGEST = 8
"""Hexadecimal digits by which shortened texts differ: 32 bits."""
_IRREGULAR = {"epoch": "epochs", "axis": "axes"}
_PLAIN = {"cut_from": "file"}
"""A group's name that is no noun → what its values are: what pieces were cut from."""


def visible(value: object) -> str:
    r"""Return a name as one line of characters that can all be seen.

    What Python calls not printable (controls, format and direction marks, surrogates, unusual
    spaces) becomes `\x1b`, `\u202e` or `\U000e0041`. Backslashes are doubled where they could
    be taken for such an escape, so that two names are shown alike only if they are equal. A name
    of more than 200 characters keeps its head, and ends in its length and a digest.
    """
    text = str(value)
    if len(text) <= MOST_NAME:
        return _escaped(text)
    return _escaped(text[: MOST_NAME // 2]) + _end(text)


def visible_names(values: Iterable[object]) -> str:
    """Return names as a list between commas; those that hold a comma stand in quotes."""
    shown = map(visible, values)
    return ", ".join(f'"{name}"' if "," in name else name for name in shown)


def visible_line(value: object, most: int = MOST_LINE) -> str:
    """Return a message that quotes foreign text as one line of characters that can be seen.

    Unlike `visible` it leaves backslashes alone: names in it may have been made visible already,
    and stay as they are.

    Args:
        value: Any value; its `str` is shown.
        most: Characters that are shown; of a longer message the head and a digest.
    """
    text = str(value)
    if len(text) > most:
        text = text[:most] + _end(text)
    return without_controls(text).replace("\n", "\\x0a")


def noun_of(key: str) -> str:
    """Return the noun for a value of a group: its name, or what its values are."""
    return _PLAIN.get(key, key)


def several(key: str) -> str:
    """Return a noun, such as a group's name, for several: "session" → "sessions"."""
    key = noun_of(key)
    if key.endswith("y") and key[-2:-1] not in "aeiou":
        return f"{key[:-1]}ies"
    for single, plural in _IRREGULAR.items():
        if key.endswith(single):
            return key.removesuffix(single) + plural
    return f"{key}es" if key.endswith(("s", "x", "ch", "sh")) else f"{key}s"


def number_of(count: int, noun: str, form: str = "") -> str:
    """Return a number and its noun: "1 window", "2 windows".

    Args:
        count: How many.
        noun: What is counted, in the singular: "window", "labelled object".
        form: The number's format, such as "," for 1,234.
    """
    return f"{count:{form}} {noun_of(noun) if count == 1 else several(noun)}"


def without_controls(text: str) -> str:
    """Return text of several lines without a character that a terminal would obey.

    A safety net for what has been laid out already: line breaks stay, and it may be applied
    twice. `visible` keeps two names apart.
    """
    if text.isprintable():
        return text
    return "".join(c if c.isprintable() or c == "\n" else _escape(c) for c in text)


def html_text(value: object) -> str:
    """Return a value as text of an HTML or SVG page or of a quoted attribute."""
    return html.escape(visible_line(value, MOST_HTML))


def json_text(data: Any, indent: int | None = None) -> str:
    """Return data as JSON that a terminal can show: letters as they are, the rest escaped.

    What a reader gets back is equal to the data; half a surrogate pair stays one.

    Raises:
        ValueError: A number is not finite.
    """
    text = json.dumps(data, indent=indent, ensure_ascii=False, allow_nan=False)
    if text.isprintable():
        return text
    return "".join(c if c.isprintable() or c == "\n" else json.dumps(c)[1:-1] if c != "\x7f"
                   else "\\u007f" for c in text)  # fmt: skip


def finite(data: Any) -> Any:
    """Return data for `json_text`: each number that is not finite is None."""
    if isinstance(data, float):
        return data if math.isfinite(data) else None
    if isinstance(data, dict):
        return {key: finite(value) for key, value in data.items()}
    if isinstance(data, list | tuple):
        return [finite(value) for value in data]
    return data


def figures(*numbers: float) -> list[str]:
    """Return numbers for a message that compares them: to the sixth decimal, or to as many more
    that numbers which differ look different.
    """
    each = ([_decimals(number, most) for number in numbers] for most in range(6, _MOST_DECIMALS))
    differ = len(set(numbers))
    return next((own for own in each if len(set(own)) == differ), list(map(repr, numbers)))


def _decimals(number: float, most: int) -> str:
    if not abs(number) < _MOST_PLAIN:
        return f"{number:g}"
    return f"{number:.{most}f}".rstrip("0").rstrip(".")


def shell_words(*words: object) -> str:
    """Return a command line to be pasted into a shell, on one line that can be seen."""
    return " ".join(map(_shell_word, map(str, words)))


def short_names(names: Sequence[str], most: int, end: str = "…") -> list[str]:
    """Return names shown in few characters, still different where the names are.

    Args:
        names: Such as classes; equal names stay equal.
        most: Characters that each should have, at least 2; numbers are added where the
            beginnings are alike.
        end: What a name that was cut ends in, at most one character.
    """
    shown = {name: visible(name) for name in names}
    cut = {name: text if len(text) <= most else text[: most - len(end)] + end
           for name, text in shown.items()}  # fmt: skip
    found: dict[str, str] = {}
    for number, name in enumerate(cut, 1):
        alike = [other for other in cut if cut[other] == cut[name]]
        tail = f"…{number}"
        found[name] = cut[name] if len(alike) == 1 else (
            shown[name][: max(1, most - len(tail))] + tail)  # fmt: skip
    if len(set(found.values())) < len(found):  # one is called what another was cut to
        found = {name: f"…{number}" for number, name in enumerate(cut, 1)}
    return [found[name] for name in names]


def _end(text: str) -> str:
    digest = hashlib.sha256(text.encode("utf-8", "surrogatepass")).hexdigest()[:_DIGEST]
    return f"… ({len(text):,} characters, {digest})"


def _escaped(text: str) -> str:
    if text.isprintable() and "\\" not in text:
        return text
    parts: list[str] = []
    slashes = 0
    for c in text:
        if c == "\\":
            slashes += 1
            continue
        seen = c.isprintable()
        # An escape stands behind an odd number of backslashes, plain text behind an even one.
        parts.append("\\" * (2 * slashes if not seen or c in "xuU" else slashes))
        parts.append(c if seen else _escape(c))
        slashes = 0
    # What follows this text is not known, and may look like the rest of an escape.
    return "".join(parts) + "\\" * slashes


def _escape(c: str) -> str:
    code = ord(c)
    if code <= 0xFF:
        return f"\\x{code:02x}"
    return f"\\u{code:04x}" if code <= 0xFFFF else f"\\U{code:08x}"


def _shell_word(word: str) -> str:
    if word.isprintable():
        return shlex.quote(word)
    # Bytes of a file's name that are no UTF-8 come as surrogates, and go back as those bytes.
    raw = word.encode("utf-8", "surrogateescape")
    each = (chr(b) if 0x20 <= b < 0x7F and b not in b"'\\" else f"\\x{b:02x}" for b in raw)
    return f"$'{''.join(each)}'"
