"""How far long work is: a bar on a terminal, and a line now and then where there is none.

Knows nothing about the work.
"""

from __future__ import annotations

from collections.abc import Callable
from time import monotonic

from rich.progress import Progress, TaskID

from taxel.cli.printing import say_aside

EVERY_S = 15.0
"""Time between two lines where no terminal shows a bar, seconds. Source: our choice,
docs/decisions/0041."""


class LongWork:
    """Passes of one long work, each with a name and a clock of its own.

    Args:
        bar: Shown on a terminal, and silent elsewhere.
        clock: Seconds; the host's unless given.
    """

    def __init__(self, bar: Progress, clock: Callable[[], float] = monotonic) -> None:
        self._bar, self._clock = bar, clock
        self._task: TaskID | None = None
        self._name = ""
        self._said_s = clock()

    def at(self, name: str, done: int, of: int) -> None:
        """Say how far a pass is; another name than before begins another pass."""
        self._begin(name, of)
        if self._task is not None:
            self._bar.update(self._task, completed=done, total=of)
        self._say(f"{name}: {done} of {of}")

    def step(self, name: str, line: str) -> None:
        """Say what a pass of unknown length is at."""
        self._begin(name, None)
        if self._task is not None:
            self._bar.update(self._task, description=line)
        self._say(line)

    def _begin(self, name: str, of: int | None) -> None:
        if name == self._name:
            return
        if self._task is not None:
            self._bar.remove_task(self._task)
        self._task, self._name = self._bar.add_task(name, total=of), name

    def _say(self, line: str) -> None:
        if self._bar.disable and self._clock() - self._said_s >= EVERY_S:
            self._said_s = self._clock()
            say_aside(f"taxel: {line}")
