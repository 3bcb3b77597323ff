"""How long choosing and training may take. Knows nothing about what is tried."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from time import monotonic

from taxel.training.choose.cores import AT_ONCE

TRYING = 0.75
"""Share of the time in which candidates are tried, until it is seen how long training takes what
was chosen. Source: our choice, docs/decisions/0039."""
LEAST_TRYING = 0.5
"""Share of a choice's time that is left for candidates however long training takes. Source: our
choice, 0039."""
OVERRUN = 0.5
"""Share of what a try has taken by which it may outlast its choice's time: to break it off loses
all of that. Source: our choice, 0039."""


@dataclass(slots=True)
class Budget:
    """Seconds from now on, shared evenly among several choices, each with its training.

    Training what an earlier choice found says how long it will take after the choices to come: that
    is set aside for each of them, so that no choice has less time than another.

    Args:
        seconds: All of it.
        shares: Into how many equal parts it is divided, one a choice.
        clock: Monotonic seconds.
        at_once: Candidates at work at a time.
    """

    seconds: float
    shares: int = 1
    clock: Callable[[], float] = monotonic
    at_once: int = AT_ONCE
    _start: float = 0.0
    _done: int = 0
    _share_start: float = 0.0
    _share_end: float = 0.0
    _trained: list[float] = field(default_factory=list)
    _took: dict[object, float] = field(default_factory=dict)

    def __post_init__(self) -> None:
        self._start = self.clock()

    def begin(self) -> None:
        """Begin a share: what earlier ones left over is divided among those to come."""
        now = self.clock()
        left = max(0.0, self._start + self.seconds - now)
        choices = max(1, self.shares - self._done)
        trainings = max(1, self.shares - len(self._trained))
        each = (1.0 - TRYING) * self.seconds / max(1, self.shares)
        if self._trained:
            each = sum(self._trained) / len(self._trained)
        self._share_start = now
        self._share_end = now + max(left - each * trainings, LEAST_TRYING * left) / choices
        self._done += 1

    @contextmanager
    def training(self) -> Iterator[None]:
        """Note how long training takes what was chosen."""
        started = self.clock()
        yield
        self._trained.append(self.clock() - started)

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

    def starts(self, what: object) -> bool:
        """Return whether a try may begin: one that was made in an earlier choice, whether it would
        end in time or outlast it by little.

        Args:
            what: Names the try, the same in each choice.
        """
        return self.lasts(self._took.get(what, 0.0))

    def lasts(self, seconds: float) -> bool:
        """Return whether what is known to take so long would end in time or outlast it by little.

        It has hardly begun: unlike in `goes_on`, breaking it off loses next to nothing.
        """
        return self.allows(seconds / (1.0 + OVERRUN))

    def goes_on(self, spent: float, left: float) -> bool:
        """Return whether a try that has taken `spent` seconds may take about `left` more."""
        return self.allows(left - OVERRUN * spent)

    def took(self, what: object, seconds: float) -> None:
        """Note how long a whole try took."""
        self._took[what] = seconds
