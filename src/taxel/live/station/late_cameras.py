"""The alarm that cameras deliver late, of all grasp monitors together.

Each monitor speaks of the cameras of its own source only: that one's are in time says nothing of
another's. Knows nothing about rings.
"""

from __future__ import annotations

from collections.abc import Mapping
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
        words = [
            f"{name} is {1000 * s:.0f} ms late"
            for found in self._late.values()
            for name, s in found.items()
        ]
        if words:
            text = ", ".join(dict.fromkeys(words))  # two monitors of one source say the same
            self._guard.trouble(_KIND, text, now_s, danger=False)
        else:
            self._guard.over(_KIND, now_s)
