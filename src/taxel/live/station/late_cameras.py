"""The alarm that cameras deliver late, of all grasp monitors together.

Each monitor speaks of the cameras of its own source only: that one's are in time says nothing of
another's. Knows nothing about rings.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping
from typing import Any

from taxel.live.station.guard import Guard

_KIND = "late camera"


class LateCameras:
    """Which cameras are late, as each monitor said last.

    Args:
        guard: Receives the alarm.
        happened: Called with a moment and words for a person, where a camera begins to be late: a
            terminal shows no other alarms than those that are said.
    """

    def __init__(
        self, guard: Guard, happened: Callable[[float, str], None] = lambda *_: None
    ) -> None:
        self._guard, self._happened = guard, happened
        self._was: frozenset[str] = frozenset()
        self._late: dict[str, dict[str, float]] = {}

    def hear(self, note: Mapping[str, Any], now_s: float) -> None:
        """Take in a monitor's note: what is late, or frames without anything late."""
        late: dict[str, float] = note.get("late") or {}
        if not late and "time_s" not in note:
            return
        self._late[note["who"]] = late
        self._weigh(now_s)

    def forget(self, given_up: Collection[str], now_s: float) -> None:
        """Forget what monitors said that will say nothing any more.

        Args:
            given_up: Their names.
            now_s: This moment, monotonic seconds.
        """
        gone = self._late.keys() & given_up
        for who in gone:
            del self._late[who]
        if gone:
            self._weigh(now_s)

    def _weigh(self, now_s: float) -> None:
        most: dict[str, float] = {}
        for found in self._late.values():
            for name, s in found.items():  # two monitors of one source may differ a little
                most[name] = max(s, most.get(name, s))
        if most:
            text = ", ".join(f"{name} is {1000 * s:.0f} ms late" for name, s in most.items())
            self._guard.trouble(_KIND, text, now_s, danger=False)
            if not self._was.issuperset(most):
                self._happened(now_s, text)
        else:
            self._guard.over(_KIND, now_s)
        self._was = frozenset(most)
