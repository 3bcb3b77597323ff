"""Notice when a run's answers turn worse, and since which grasp.

Watches how little of the right answer's probability the run gave to each grasp. Knows nothing
about networks, files or clocks.

Source: adaptive windowing (Bifet and Gavaldà, SDM 2007), as river has it.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from taxel.errors import MissingExtra

FALSE_ALARM = 0.05
"""ADWIN's delta. Its usual 0.002 is for thousands of values; grasps are counted in tens.
Source: our choice, docs/decisions/0028."""


@dataclass(frozen=True, slots=True)
class Drift:
    """The answers have turned worse."""

    grasp: int
    """Number of the first grasp after the turn, from 0, among those watched."""
    before: float
    """Mean doubt before it, 0…1."""
    after: float
    """Mean doubt since, 0…1."""


class DriftWatch:
    """Watches doubts, grasp by grasp.

    Raises:
        MissingExtra: river is not installed.
    """

    def __init__(self, false_alarm: float = FALSE_ALARM) -> None:
        try:
            from river.drift import ADWIN
        except ModuleNotFoundError as error:
            raise MissingExtra("river", "adapt", "noticing drift") from error
        self._adwin: Any = ADWIN(delta=false_alarm, clock=1)  # type: ignore[no-untyped-call]
        self._doubts: list[float] = []
        self._start = 0

    def add(self, doubt: float) -> Drift | None:
        """Take in one grasp's doubt, 0…1 (one minus the right class's mean probability).

        Returns:
            A drift where the doubts have just been found larger than before, or None; doubts
            that fell are no drift to mend.
        """
        self._doubts.append(doubt)
        self._adwin.update(doubt)
        if not self._adwin.drift_detected:
            return None
        turn = self._start + _turn(self._doubts[self._start :])
        before, after = self._doubts[self._start : turn], self._doubts[turn:]
        self._start = turn
        was, now = sum(before) / len(before), sum(after) / len(after)
        return Drift(turn, was, now) if now > was else None


def _turn(doubts: list[float]) -> int:
    """Return where two constant levels fit best: the first index of the second.

    ADWIN says that there is a turn; what it keeps of its window begins before it.
    """
    n, total, first = len(doubts), sum(doubts), 0.0
    best, gain = 1, -1.0
    for k in range(1, n):
        first += doubts[k - 1]
        apart = first / k - (total - first) / (n - k)
        if k * (n - k) * apart**2 > gain:
            best, gain = k, k * (n - k) * apart**2
    return best
