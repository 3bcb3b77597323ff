"""The one kind of console: it prints text as text, and obeys nothing that stands in it.

Rich reads markup (`[red]`), smileys (`:cup:`) and numbers into strings, and hands escape
sequences on to the terminal. None of that happens here: our own colours are `Text` and styles,
and what a terminal would obey is shown as its escape (docs/decisions/0034). Knows nothing
about what is printed.
"""

from __future__ import annotations

import math
import sys
from collections.abc import Iterable
from time import monotonic
from typing import Any

from rich.console import Console, ConsoleOptions, RenderableType
from rich.progress import (
    BarColumn,
    MofNCompleteColumn,
    Progress,
    TaskID,
    TextColumn,
    TimeElapsedColumn,
)
from rich.segment import Segment
from rich.text import Text

from taxel.plain_text import without_controls

PLAIN_WIDTH = 110
"""Columns where the output is no terminal: a file or a pipe has no width of its own."""


LINE_S = 20.0
"""Seconds between lines of progress where there is no terminal. Source: our choice,
docs/decisions/0031: seldom enough for a log, often enough to see that work goes on."""


class PlainConsole(Console):
    """A console that prints all strings as they are, with what cannot be seen made visible.

    Rich has no setting for the second half, so this is the one place that overrides it: all that
    is drawn passes `render`, and only the positions and colours that Rich itself makes pass as
    commands to the terminal.

    Args:
        options: As of `rich.console.Console`, such as stderr and width.
    """

    def __init__(self, **options: Any) -> None:
        super().__init__(markup=False, emoji=False, highlight=False, **options)

    def render(
        self, renderable: RenderableType, options: ConsoleOptions | None = None
    ) -> Iterable[Segment]:
        """Yield what is drawn; characters that a terminal would obey are shown instead."""
        for segment in super().render(renderable, options):
            if segment.control or segment.text.isprintable():
                yield segment
            else:
                yield Segment(without_controls(segment.text), segment.style)

    def render_str(self, text: str, **options: Any) -> Text:
        """Return a string as a text, so that what is measured is what will be drawn."""
        return super().render_str(without_controls(text), **options)


def output_console() -> PlainConsole:
    """Return a console on the standard output."""
    return PlainConsole(width=None if sys.stdout.isatty() else PLAIN_WIDTH)


def error_console() -> PlainConsole:
    """Return a console on the error stream, for notes beside JSON and for progress."""
    return PlainConsole(stderr=True)


class LineProgress(Progress):
    """A progress bar that prints a line now and then where its console is no terminal.

    The first comes after `LINE_S`, so that quick work prints none.
    """

    _began_s = _printed_s = -math.inf

    def start(self) -> None:
        """Begin to show progress, or to count the time to the first line."""
        self._began_s = self._printed_s = monotonic()
        super().start()

    def update(self, task_id: TaskID, *args: Any, **changes: Any) -> None:
        """Note what changed; as of `rich.progress.Progress`."""
        super().update(task_id, *args, **changes)
        now_s = monotonic()
        with self._lock:
            if self.console.is_terminal or now_s - self._printed_s < LINE_S:
                return
            self._printed_s = now_s
            task = self._tasks[task_id]
            of = f" · {task.completed:g} of {task.total:g}" if task.total else ""
            took = f"{now_s - self._began_s:.0f} s"
        self.console.print(Text(f"{took} · {task.description}{of}"), soft_wrap=True)


def progress_on(console: Console) -> Progress:
    """Return a progress bar; a line now and then where the console is no terminal."""
    return LineProgress(
        TextColumn("{task.description}", markup=False),
        BarColumn(),
        MofNCompleteColumn(),
        TimeElapsedColumn(),
        console=console,
        transient=True,
        disable=not console.is_terminal,
    )
