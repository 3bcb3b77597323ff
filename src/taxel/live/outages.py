"""When a recogniser's input cannot be used for longer than a pause within a contact.

Knows nothing about screens or processes.

Background of our choices: docs/decisions/0010.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

from taxel.decisions.recognition import Decision


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

    Args:
        gap_s: Longest pause within a contact, seconds: what is shorter is no outage.
    """

    def __init__(self, gap_s: float) -> None:
        self._gap_s = gap_s
        self._now: Outage | None = None
        self._reported = False

    def look(self, decision: Decision) -> Outage | None:
        """Take in one decision; return the outage that it shows to have begun, or to be over."""
        now = self._now
        if decision.usable:
            self._now = None
            over = now is not None and self._reported
            self._reported = False
            return replace(now, end_s=decision.start_s) if over and now is not None else None
        if now is None:
            now = self._now = Outage(decision.start_s, decision.reason)
        if self._reported or not decision.end_s - now.start_s > self._gap_s:
            return None
        self._reported = True
        return now
