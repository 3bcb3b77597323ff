"""A station that watches a still grasp: waited for, and measured in spells beside each other.

Knows nothing about the faults that are brought about in it.

Background of our choices: docs/decisions/0019.
"""

from __future__ import annotations

from collections.abc import Callable
from time import monotonic, sleep

from taxel.decisions.stability import Stability
from taxel.live.station.station import TICK_S, Station

STILL = "sim://cup-pour?kind=still&force_n=50&duration_s=600"
"""A grasp in which nothing happens."""
_READY_S = 30.0
"""How long a monitor may take to come back, seconds."""


def is_calm(station: Station) -> bool:
    """True where the monitor says STABLE, whatever an interlock that has stopped shows."""
    return station.guard.decision.state is Stability.STABLE


def until(station: Station, holds: Callable[[], bool]) -> float:
    """Supervise until something holds; return when, monotonic seconds.

    Raises:
        TimeoutError: It never does.
    """
    limit_s = monotonic() + _READY_S
    while True:
        now_s = monotonic()
        station.tick(now_s)
        if holds():
            return monotonic()
        if now_s > limit_s:
            raise TimeoutError(f"not within {_READY_S:g} s; shown: {station.guard.shown}")
        sleep(TICK_S)


def paired_ratios(spells: list[float]) -> tuple[list[float], list[float]]:
    """Return stopped over running of neighbours, and of neighbours that are alike the ratio.

    Args:
        spells: One figure a spell: running, stopped, stopped, running, and again, so that
            neither a drift nor an order favours either side.
    """
    pairs = list(zip(spells[0::2], spells[1::2], strict=True))
    over = [b / a if number % 2 == 0 else a / b for number, (a, b) in enumerate(pairs)]
    alike = [b / a for a, b in zip(spells[1:-1:2], spells[2::2], strict=True)]
    return over, alike
