"""When a recogniser's input cannot be used for longer than a pause within a contact.

Knows nothing about screens or processes.

Background of our choices: docs/decisions/0010.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

from taxel.decisions.recognition import Decision, FaultWatch


@dataclass(frozen=True, slots=True)
class Outage:
    """A time in which no window could be used."""

    start_s: float
    """First row of its first window, fitted clock, seconds."""
    reason: str
    """Why that window could not be used."""
    end_s: float | None = None
    """First row of the next window that could be used, seconds; None while it lasts."""

    def words(self) -> str:
        """In a few words, for a person."""
        if self.end_s is None:
            return f"no usable values: {self.reason}; the answer is UNKNOWN"
        return f"usable values again, after {self.end_s - self.start_s:.1f} s"


class OutageWatch:
    """Follows decisions, and reports where an outage begins and ends.

    It begins when the contact is over for it, as `GraspVote` has it.

    Args:
        gap_s: Longest pause within a contact, seconds.
    """

    def __init__(self, gap_s: float) -> None:
        self._faults = FaultWatch(gap_s)
        self._now: Outage | None = None

    def look(self, decision: Decision) -> Outage | None:
        """Take in one decision; return the outage that it shows to have begun, or to be over."""
        over, now, first = self._faults.look(decision), self._now, self._faults.first
        if decision.usable:
            self._now = None
            return None if now is None else replace(now, end_s=decision.start_s)
        if not over or now is not None or first is None:
            return None
        self._now = Outage(first.start_s, first.reason)
        return self._now
