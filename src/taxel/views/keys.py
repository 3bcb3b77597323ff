"""Single keys in a terminal, asked for without waiting.

Knows nothing about what is shown. Where the input is no terminal, or the
system has no POSIX terminals, no key is ever pressed and Ctrl-C remains.
"""

from __future__ import annotations

import os
import re
import select
import sys
import time
from typing import Any, Self, TextIO

_SEQUENCE = re.compile(r"\x1b(\[\[[ -~]|\[[0-9;]+\$|\[[0-?]*[ -/]*[@-Z\\-~]|O[0-9;]*[A-Za-z])")
"""What a terminal sends for a key that is no letter: ESC [ D for the arrow to the left, ESC O P or,
without windows, ESC [ [ A for F1. Source: ECMA-48, 5.4; xterm's sequences; console_codes(4).
"""
_BEGUN = re.compile(r"\x1b(\[\[?|\[[0-?]*[ -/]*|O[0-9;]*)?\Z")
_REST_S = 1.0
"""How long the rest of a sequence may take; then it is lost. Our choice, docs/decisions/0046."""


class Keys:
    """Reads single keys while its `with` block lasts, then gives the terminal back.

    Args:
        stream: The input, a terminal or not.
    """

    def __init__(self, stream: TextIO = sys.stdin) -> None:
        self._stream = stream
        self._before: list[Any] | None = None
        self._begun = ""
        """The beginning of a key's sequence whose rest has not come yet."""
        self._begun_s = 0.0

    def __enter__(self) -> Self:
        if not self._stream.isatty():
            return self
        try:
            import termios
            import tty
        except ImportError:
            return self
        self._before = termios.tcgetattr(self._stream)
        tty.setcbreak(self._stream)
        return self

    def __exit__(self, *_: object) -> None:
        if self._before is not None:
            import termios

            termios.tcsetattr(self._stream, termios.TCSADRAIN, self._before)

    def typed(self) -> str:
        """Return what was typed since the last question, in small letters; q, too, where the
        terminal went away.
        """
        found = ""
        if self._before is None:
            return found
        while select.select([self._stream], [], [], 0)[0]:
            keys = os.read(self._stream.fileno(), 64)
            if not keys:
                return found + "q"
            text, now_s = keys.decode("ascii", "ignore"), time.monotonic()
            if not text.startswith("\x1b") and now_s - self._begun_s <= _REST_S:
                text = self._begun + text
            text = _SEQUENCE.sub("", text)
            begun = _BEGUN.search(text)
            self._begun, self._begun_s = "" if begun is None else begun[0], now_s
            found += text.removesuffix(self._begun).replace("\x1b", "").lower()
        return found

    def forget(self) -> bool:
        """Throw away what was typed until now; return True where q was among it.

        A question comes first, then its answer: a key typed earlier was meant for something else.
        """
        return self.quit

    @property
    def quit(self) -> bool:
        """True when q was typed since the last question, or the terminal went away."""
        return "q" in self.typed()
