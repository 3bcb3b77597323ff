"""A station in a program of its own, to be stopped and killed from outside.

Lines on standard output, each one JSON value: first its processes, {name: number}; then, for each
round, "raising" once it is armed and raises, and what it ordered until a line came on standard
input: [[seconds, order, newtons], …]. Knows nothing about goals.
"""

from __future__ import annotations

import json
import select
import sys
from time import monotonic
from typing import Any

from taxel.actions.actuators import Health
from taxel.actions.gripper import ForceRange
from taxel.actions.interlock import Interlock, InterlockConfig, InterlockState, Order, OrderKind
from taxel.bench.faults.quiet_station import STILL, is_calm, until
from taxel.bundles.shipped import CUP_POUR, shipped_bundle
from taxel.decisions.stability import StabilityDecision
from taxel.live.station.station import Station
from taxel.live.station.wiring import StationConfig

LIMITS = InterlockConfig(min_n=15.0, max_n=50.0, slew_n_s=20.0)
"""A slow slew: the raise of 35 N takes 1.75 s, so that a stop from outside falls into it."""
_CALM_P, _SLIPPING_P = 0.02, 0.97


class OrderLog:
    """An actuator that writes down each order at the moment at which it would obey it."""

    def __init__(self) -> None:
        self.name = "log"
        self.force: ForceRange | None = None
        self.orders: list[tuple[float, str, float]] = []
        """Monotonic seconds, what, newtons; an expired order is obeyed by nobody."""

    def connect(self) -> None:
        """Nothing to open."""

    def hear(self, interlock: Interlock, now_s: float) -> Health:
        return Health("", now_s)

    def apply(self, decision: StabilityDecision, order: Order, now_s: float) -> None:
        now_s = monotonic()
        if order.kind is not OrderKind.NONE and order.valid(now_s):
            self.orders.append((now_s, str(order.kind), order.force_n))

    def snapshot(self) -> dict[str, Any]:
        return {"motion": "", "force_n": None}

    def close(self) -> None:
        """Nothing to let go of."""


def supervise() -> None:
    """Run rounds until standard input ends."""
    config = StationConfig(
        sources=(STILL,), bundles=(shipped_bundle(CUP_POUR),), interlock=LIMITS, drill=True
    )
    with Station(config) as station:
        log = OrderLog()
        station.drive(log)
        _say({name: process.pid for name, process in station.workers().items()})
        station.run(0.0)
        interlock = station.guard.interlock
        while True:
            while not _raising(interlock):  # again where a busy machine stopped it meanwhile
                station.order("monitor", {"do": "give", "p": _CALM_P})
                until(station, lambda: is_calm(station) and not station.arm())
                interlock.release(LIMITS.min_n)
                station.acknowledge()
                station.order("monitor", {"do": "give", "p": _SLIPPING_P})
                until(station, lambda: _raising(interlock) or not interlock.armed)
            log.orders.clear()
            _say("raising")
            until(station, _asked)
            if not sys.stdin.readline():
                return
            _say(log.orders)


def _raising(interlock: Interlock) -> bool:
    return interlock.state is InterlockState.RAISED and interlock.force_n > LIMITS.min_n + 1.0


def _asked() -> bool:
    """True where a line waits, or the input has ended."""
    return bool(select.select([sys.stdin], [], [], 0)[0])


def _say(value: object) -> None:
    sys.stdout.write(json.dumps(value) + "\n")
    sys.stdout.flush()


if __name__ == "__main__":
    supervise()
