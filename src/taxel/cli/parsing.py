"""Words as typed → a verb with its options; what does not fit is said in one plain line.

Tyro reads a dataclass; its own refusals are boxes of several lines, which may quote any word.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from contextlib import redirect_stderr
from io import BytesIO, TextIOWrapper
from typing import TypeVar, get_type_hints

from taxel.errors import TaxelError
from taxel.plain_text import visible_line, without_controls

V = TypeVar("V")

_RULE = re.compile(r"[\s│]*[─-]{3,}[\s│]*")
_MEANT = re.compile(r"Perhaps you meant:\s+(--\S+)")
_FORMS = (
    (
        r"invalid choice (?P<got>'.*') for argument '(?P<option>[^']+)'. "
        r"Expected one of \((?P<of>.*)\)",
        "one of {of} for {option}",
    ),
    (
        r"Error parsing (?P<option>\S+): invalid literal for int.* (?P<got>'.*')",
        "a whole number, in the range that its help gives, for {option}",
    ),
    (
        r"Error parsing (?P<option>\S+): could not convert string.* (?P<got>'.*')",
        "a number, in the range that its help gives, for {option}",
    ),
    (
        r"Error parsing (?P<option>\S+): Could not parse arguments \[(?P<got>.*)\] into tuple type "
        r"tuple\[float.*",
        "numbers, in the range that its help gives, for {option}",
    ),
    (
        r"Error parsing (?P<option>\S+): Could not find valid parse for arguments: \[(?P<got>.*)\]",
        "values as its help gives them for {option}, with files and folders before that option",
    ),
    (r"Unrecognized options: (?P<got>.*)", "options that this verb has"),
)
"""What tyro says → what was needed."""


class BadOption(TaxelError, ValueError):
    """Words that a verb's options cannot be read from."""


def parse(kind: type[V], command: str, words: Sequence[str]) -> V:
    """Return a verb with its options; print its help and end where that is asked for.

    Args:
        kind: The verb's dataclass.
        command: Verb, and kind where it has kinds, as they are typed.
        words: What was typed behind them.

    Raises:
        BadOption: They do not fit.
    """
    import tyro

    from taxel.cli.options.page_address import PageAddress, with_addresses
    from taxel.cli.options.types import plain_types

    if "--page" in words and get_type_hints(kind, include_extras=True).get("page") == PageAddress:
        words = with_addresses(words)
    output = TextIOWrapper(BytesIO(), encoding="utf-8", errors="backslashreplace")
    try:
        with redirect_stderr(output), plain_types():
            return tyro.cli(kind, prog=f"taxel {command}", args=list(words))
    except SystemExit as ended:
        if not ended.code:
            raise
        output.seek(0)
        raise BadOption(refusal(without_controls(output.read()), command)) from None


def refusal(box: str, command: str) -> str:
    """Return what a box of tyro's says, as one line.

    Args:
        box: A title, and parts with rules between, in a frame where the terminal can draw it.
        command: Verb, and kind where it has kinds.
    """
    parts = _parts(box)
    first = next(iter(parts), [])
    if first and first[0].strip().startswith("Missing from"):
        return f"needed {_missing(first)}; got none; run: taxel {command} --help."
    upto = next((at for at, line in enumerate(first) if not line.strip()), len(first))
    message = visible_line(" ".join(" ".join(first[:upto]).split()).rstrip("."))
    meant = _MEANT.search("\n".join(line for part in parts for line in part))
    perhaps = f"perhaps {meant[1]} was meant; " if meant else ""
    for pattern, needed in _FORMS:
        if found := re.search(pattern, message):
            known = {name: text.replace("'", "") for name, text in found.groupdict().items()}
            return (
                f"needed {needed.format(**known)}; got {known['got']}; {perhaps}"
                f"run: taxel {command} --help."
            )
    return f"needed words that this verb takes; got others: {message}; run: taxel {command} --help."


def _parts(box: str) -> list[list[str]]:
    """Return the lines between rules, without frame and title."""
    parts: list[list[str]] = [[]]
    for line in box.splitlines():
        if line[:1] in ("╭", "╰"):
            continue
        if _RULE.fullmatch(line):
            parts.append([])
        else:
            parts[-1].append(line.strip("│").rstrip())
    return parts if box.lstrip().startswith("╭") else parts[1:]


def _missing(lines: list[str]) -> str:
    """Return what is missing: options and choices by name, the rest with its help's beginning.

    Names stand four columns further than their heading, and their help further than they.
    """
    margin = len(lines[0]) - len(lines[0].lstrip()) + 4
    found: list[tuple[str, list[str]]] = []
    for line in lines[1:]:
        if len(line) - len(line.lstrip()) == margin:
            found.append((line.strip(), []))
        elif found:
            found[-1][1].append(line.strip())
    return " and ".join(
        name if name.startswith(("--", "{")) else f"{name} ({_beginning(' '.join(words))})"
        for name, words in found
    )


def _beginning(words: str) -> str:
    """Return what a help says first, up to a full stop, semicolon or colon."""
    first = re.split(r"[.;:] | \(required\)|\.?$", words, maxsplit=1)[0]
    return re.sub(r"^(A|An|The) ", lambda article: article[0].lower(), first)
