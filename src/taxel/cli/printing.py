"""How verbs print: one console, JSON, and progress on long work.

Progress goes to the error stream, so that `--json` on the output stays clean.
"""

from __future__ import annotations

import json
import math
import shlex
import sys
from typing import Any

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn

_PLAIN_WIDTH = 110
"""Columns where the output is no terminal: a file or a pipe has no width of its own."""

console = Console(highlight=False, width=None if sys.stdout.isatty() else _PLAIN_WIDTH)


def command(*words: object) -> str:
    """Return a command line to be pasted into a shell: words with blanks are quoted."""
    return shlex.join(map(str, words))


def print_json(data: Any) -> None:
    """Print data as JSON; numbers that are not finite become null."""
    json.dump(_finite(data), sys.stdout, indent=1, ensure_ascii=False)
    sys.stdout.write("\n")


def progress() -> Progress:
    """Return a progress bar on the error stream; silent where that is no terminal."""
    errors = Console(stderr=True)
    return Progress(
        TextColumn("{task.description}"),
        BarColumn(),
        MofNCompleteColumn(),
        TimeElapsedColumn(),
        console=errors,
        transient=True,
        disable=not errors.is_terminal,
    )


def _finite(data: Any) -> Any:
    if isinstance(data, float):
        return data if math.isfinite(data) else None
    if isinstance(data, dict):
        return {key: _finite(value) for key, value in data.items()}
    if isinstance(data, list | tuple):
        return [_finite(value) for value in data]
    return data
