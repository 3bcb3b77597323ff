"""Passes of one long work on one progress bar, each with a name and a clock of its own.

Where no terminal shows the bar, it prints a line now and then (`taxel.views.console`). Knows
nothing about the work.
"""

from __future__ import annotations

from rich.progress import Progress, TaskID


class LongWork:
    """The pass that long work is in.

    Args:
        bar: Shows it.
    """

    def __init__(self, bar: Progress) -> None:
        self._bar = bar
        self._task: TaskID | None = None
        self._name = ""

    def at(self, name: str, done: int, of: int) -> None:
        """Say how far a pass is; another name than before begins another pass."""
        self._bar.update(self._begun(name), completed=done, total=of)

    def step(self, name: str, line: str) -> None:
        """Say what a pass of unknown length is at."""
        self._bar.update(self._begun(name), description=line)

    def _begun(self, name: str) -> TaskID:
        """Return a pass's task, begun where the one before has another name."""
        if self._task is None or name != self._name:
            if self._task is not None:
                self._bar.remove_task(self._task)
            self._task, self._name = self._bar.add_task(name, total=None), name
        return self._task
