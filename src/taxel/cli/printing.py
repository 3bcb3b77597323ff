"""How verbs print: one console, JSON, and progress on long work.

Progress goes to the error stream, so that `--json` on the output stays clean. All text from
files, devices and people passes here, or the console of `taxel.views.console`: no other module
writes to the output (tests/test_plain_text.py).
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

from rich.progress import Progress
from rich.style import Style
from rich.text import Text

from taxel.plain_text import finite, json_text, shell_words, visible_line, without_controls
from taxel.views.console import error_console, output_console, progress_on

console = output_console()


def command(*words: object) -> str:
    """Return a command line to be pasted into a shell: words with blanks are quoted."""
    return shell_words(*words)


def say(*parts: object, style: str | Style = "") -> None:
    """Print one line, whatever it quotes; it is never broken, so that it can be copied."""
    console.print(Text(_line(parts), style), soft_wrap=True)


def say_aside(*parts: object) -> None:
    """Print one line on the error stream."""
    print(_line(parts), file=sys.stderr)


def ask(question: str) -> None:
    """Print a question on the error stream; the answer is typed behind it."""
    print(without_controls(question), end="", file=sys.stderr, flush=True)


def print_json(data: Any, indent: int | None = 1) -> None:
    """Print data as JSON; numbers that are not finite become null.

    Args:
        data: What `json.dumps` takes.
        indent: Spaces a level; None prints one line.
    """
    sys.stdout.write(json_text(finite(data), indent) + "\n")


def progress() -> Progress:
    """Return a progress bar on the error stream; a line now and then where that is no terminal."""
    return progress_on(error_console())


@contextmanager
def counted(what: str, total: int | None = None) -> Iterator[Callable[[int, int], None]]:
    """Show a progress bar over work that calls what is given with steps done and in all."""
    with progress() as bar:
        task = bar.add_task(what, total=total)
        yield lambda done, of: bar.update(task, completed=done, total=of)


def _line(parts: tuple[object, ...]) -> str:
    return visible_line(" ".join(map(str, parts)))
