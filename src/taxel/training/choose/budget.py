"""How long choosing may take. Knows nothing about what is tried."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from time import monotonic


@dataclass(slots=True)
class Budget:
    """Seconds from now on, shared among several choices.

    Args:
        seconds: All of it.
        shares: Into how many equal parts it is divided, one a choice.
        clock: Monotonic seconds.
        at_once: Candidates at work at a time: issue 16 gives two cores.
    """

    seconds: float
    shares: int = 1
    clock: Callable[[], float] = monotonic
    at_once: int = 2
    _start: float = 0.0
    _done: int = 0
    _share_start: float = 0.0
    _share_end: float = 0.0

    def __post_init__(self) -> None:
        self._start = self.clock()

    def begin(self) -> None:
        """Begin a share: what earlier ones left over is divided among those to come."""
        left = self._start + self.seconds - self.clock()
        self._share_start = self.clock()
        self._share_end = self._share_start + max(0.0, left) / max(1, self.shares - self._done)
        self._done += 1

    def add(self, seconds: float) -> None:
        """Give back time that was spent on something else."""
        self._start += seconds
        self._share_start += seconds
        self._share_end += seconds

    def spent(self) -> float:
        """Return how much of the share has passed, 0…1 and above; 1 of a share without time."""
        whole = self._share_end - self._share_start
        return (self.clock() - self._share_start) / whole if whole > 0.0 else 1.0

    def allows(self, seconds: float) -> bool:
        """Return whether something that takes so long still fits into the share."""
        return self.clock() + seconds <= self._share_end
