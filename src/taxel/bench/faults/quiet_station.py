"""A station that watches a still grasp: waited for, and measured in spells beside each other.

Knows nothing about the faults that are brought about in it.

Background of our choices: docs/decisions/0019.
"""

from __future__ import annotations

import signal
from collections.abc import Callable
from time import monotonic, sleep

import numpy as np

from taxel.bench.rows import Row, row
from taxel.decisions.stability import Stability
from taxel.live.station.station import TICK_S, Station

STILL = "sim://cup-pour?kind=still&force_n=50&duration_s=600"
"""A grasp in which nothing happens."""
_SPELLS = (False, True, True, False)
"""Whether a process is stopped, spell by spell."""
_PAIRS, _SPELL_S = 4, 1.0
"""How often those follow each other, and how long each is measured, seconds. Our choice."""
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


def spells_ms(station: Station, send: Callable[[signal.Signals], None]) -> list[float]:
    """Stop a process in every other spell; return each spell's median time to the alarm, ms.

    Args:
        station: Supervised meanwhile.
        send: Sends a signal to the process.
    """
    spells = []
    for stopped in _SPELLS * _PAIRS:
        send(signal.SIGSTOP if stopped else signal.SIGCONT)
        station.run(_SPELL_S / 5)
        station.latencies.clear()
        station.run(_SPELL_S)
        spells.append(float(np.median(station.latencies.whole_ms())))
    return spells


def spells_row(name: str, spells: list[float]) -> Row:
    """Return the row of the ratio of stopped to running, of what `spells_ms` has measured."""
    over, alike = paired_ratios(spells)
    return row(
        name, float(np.median(over)), "ratio", "<=", 1.1,
        f"median of {len(over)} neighbouring spells of {_SPELL_S:g} s, {min(over):.2f} to "
        f"{max(over):.2f}; two alike, next to each other: {np.median(alike):.2f}, "
        f"{min(alike):.2f} to {max(alike):.2f}; {np.median(spells):.1f} ms",
    )  # fmt: skip


def lost_frames(station: Station) -> int:
    """Return how many frames its sources, monitor or recorder have lost, once it is closed."""
    ledger = station.ledger()
    recorded = station.recording["ledger"]["cameras"]
    lost = sum(camera["lost_frames"] for camera in recorded.values())
    return int(lost + ledger["recorder"]["dropped"] + ledger["monitor"]["dropped"])


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
