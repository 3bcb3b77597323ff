"""A station driven by hand until something holds, and an actuator that is well."""

from __future__ import annotations

from collections.abc import Callable
from time import monotonic, sleep

from taxel.actions.actuators import Health
from taxel.actions.gripper import ForceRange
from taxel.actions.interlock import Interlock, Order
from taxel.decisions.stability import StabilityDecision
from taxel.live.station.station import Station

WAIT_S = 40.0
"""Longest wait on a busy machine; what is waited for usually comes within a second."""


class Idle:
    """An actuator that is well and does nothing."""

    def __init__(self) -> None:
        self.name = "idle"
        self.force: ForceRange | None = None

    def connect(self) -> None:
        pass

    def hear(self, interlock: Interlock, now_s: float) -> Health:
        return Health("", now_s)

    def apply(self, decision: StabilityDecision, order: Order, now_s: float) -> None:
        pass

    def snapshot(self) -> dict[str, object]:
        return {"motion": ""}

    def close(self) -> None:
        pass


def until(station: Station, holds: Callable[[], bool]) -> None:
    limit_s = monotonic() + WAIT_S
    while not holds():
        assert monotonic() < limit_s, f"shown: {station.guard.shown}"
        station.tick(monotonic())
        sleep(0.001)
