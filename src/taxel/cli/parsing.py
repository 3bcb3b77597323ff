"""Words as typed → a verb with its options; what does not fit is said in one plain line.

Tyro reads a dataclass; its own refusals are boxes of several lines, which may quote any word.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from contextlib import redirect_stderr
from io import BytesIO, TextIOWrapper
from typing import TypeVar

from taxel.errors import TaxelError
from taxel.plain_text import visible_line, without_controls

V = TypeVar("V")

_RULE = re.compile("─{3}")
_MISSING = re.compile(r" {5}\S")
_MEANT = re.compile(r"Perhaps you meant:\s+(--\S+)")


class BadOption(TaxelError, ValueError):
    """Words that a verb's options cannot be read from."""


def parse(kind: type[V], door: str, words: Sequence[str]) -> V:
    """Return a verb with its options; print its help and end where that is asked for.

    Args:
        kind: The verb's dataclass.
        door: Verb, and kind where it has kinds, as they are typed.
        words: What was typed behind them.

    Raises:
        BadOption: They do not fit.
    """
    import tyro

    said = TextIOWrapper(BytesIO(), encoding="utf-8", errors="backslashreplace")
    try:
        with redirect_stderr(said):
            return tyro.cli(kind, prog=f"taxel {door}", args=list(words))
    except SystemExit as ended:
        if not ended.code:
            raise
        said.seek(0)
        raise BadOption(refusal(without_controls(said.read()), door)) from None


def refusal(box: str, door: str) -> str:
    """Return what a box of tyro's says, as one line.

    Args:
        box: Several lines within a frame; a rule stands between its parts.
        door: Verb, and kind where it has kinds.
    """
    lines = [line.strip("│").rstrip() for line in box.splitlines() if line[:1] == "│"]
    ends = [at for at, line in enumerate(lines) if _RULE.search(line)] or [len(lines)]
    told = lines[: ends[0]]
    if told and told[0].strip().startswith("Missing from"):
        needed = ", ".join(line.strip() for line in told if _MISSING.match(line))
        return f"needed {needed}; got none; run: taxel {door} --help."
    upto = next((at for at, line in enumerate(told) if not line.strip()), len(told))
    said = visible_line(" ".join(" ".join(told[:upto]).split()).rstrip("."))
    meant = _MEANT.search("\n".join(lines))
    perhaps = f"; perhaps {meant[1]} was meant" if meant else ""
    return f"{said}{perhaps}; run: taxel {door} --help."
