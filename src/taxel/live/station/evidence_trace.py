"""What the grasp monitors go by, as the one line that the page draws: the largest of all.

A station may watch several grasps. Their probabilities or scores come by several ways, each in its
own order; drawn as they come they would be one line that jumps between them, or one of them would
hide the other. Knows nothing about rings or pages.

Background of our choices: docs/decisions/0018.
"""

from __future__ import annotations

import math
from collections import deque

LONGEST_HZ = 60
"""Points a second that are kept. Source: `taxel.views.page.link.StationLink.traces`."""
_NEAR_S = 0.6 / LONGEST_HZ
"""A point of another monitor that is no later than this after the last one waits for the next
one, seconds. Source: our choice; frames of 60 Hz are further apart, and jitter."""
_FRESH_S = 0.5
"""What a monitor said longer ago counts no more, seconds. Our choice, as for images."""
_TINY_S = 1e-6


class EvidenceTrace:
    """The points of the last seconds.

    Args:
        kept_s: How many seconds.
    """

    def __init__(self, kept_s: float) -> None:
        self.points: deque[tuple[float, float]] = deque(maxlen=round(kept_s * LONGEST_HZ))
        """(seconds, probability or score; NaN is a gap), oldest first."""
        self._newest: dict[str, tuple[float, float]] = {}
        self._waiting = math.nan

    def add(self, who: str, time_s: float, p: float) -> None:
        """Take in what a monitor said of the frames of a moment.

        Args:
            who: The monitor.
            time_s: When the frames were taken, seconds.
            p: Its probability or score; NaN where it gave none.
        """
        self._newest[who] = (time_s, p)
        if len(self._newest) == 1:
            self.points.append((time_s, p))
            return
        if self.points and time_s - self.points[-1][0] < _NEAR_S:
            self._waiting = _larger(self._waiting, p)
            return
        found, self._waiting = self._waiting, math.nan
        for newest_s, newest_p in self._newest.values():
            if time_s - newest_s <= _FRESH_S:
                found = _larger(found, newest_p)
        self.points.append((time_s, found))

    def lack(self) -> None:
        """Break the line: what came since its last point was not read."""
        if self.points:
            self.points.append((self.points[-1][0] + _TINY_S, math.nan))


def _larger(first: float, second: float) -> float:
    """Return the larger of two numbers; of a number and NaN the number."""
    return second if math.isnan(first) or second > first else first
