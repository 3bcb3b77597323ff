"""The alarm that cameras deliver late, of all grasp monitors together.

Each monitor speaks of the cameras of its own source only: that one's are in time says nothing of
another's. Knows nothing about rings.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping
from typing import Any

from taxel.live.station.guard import Guard

_KIND = "late camera"


class LateCameras:
    """Which cameras are late, as each monitor said last.

    Args:
        guard: Receives the alarm.
    """

    def __init__(self, guard: Guard) -> None:
        self._guard = guard
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
        else:
            self._guard.over(_KIND, now_s)
