"""What obeys the interlock's orders in a station: a gripper, the simulated cup's, an output.

Each returns at once. Knows nothing about decisions or processes.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Any, Protocol

from taxel.actions.gripper import ForceRange, Gripper, hear, obey
from taxel.actions.interlock import Interlock, Order, OrderKind


class Actuator(Protocol):
    """Something that grips, or is told."""

    def hear(self, interlock: Interlock, now_s: float) -> None:
        """Tell the interlock how it is, before its tick."""
        ...

    def obey(self, order: Order, now_s: float) -> None:
        """Carry out an order, without waiting."""
        ...

    def told(self) -> dict[str, Any]:
        """Return what a person wants to see: force_n and motion."""
        ...


class GripperActs:
    """A connected gripper.

    Args:
        gripper: The gripper.
        force: Newtons to percent.
    """

    def __init__(self, gripper: Gripper, force: ForceRange) -> None:
        self._gripper = gripper
        self._force = force

    def hear(self, interlock: Interlock, now_s: float) -> None:
        hear(interlock, self._gripper, now_s)

    def obey(self, order: Order, now_s: float) -> None:
        obey(self._gripper, order, self._force, now_s)

    def told(self) -> dict[str, Any]:
        status = self._gripper.status()
        pct = status.force_pct
        force_n = self._force.newtons(pct) if math.isfinite(pct) else None
        return {"force_n": force_n, "motion": status.fault or str(status.motion)}


class SimulatedGrip:
    """The gripper of a simulated cup: it lives in the source's process.

    Args:
        send: Sends a force, newtons, to that process.
    """

    def __init__(self, send: Callable[[float], None]) -> None:
        self._send = send
        self._sent_n = math.nan

    def hear(self, interlock: Interlock, now_s: float) -> None:
        interlock.device(True, now_s)

    def obey(self, order: Order, now_s: float) -> None:
        if order.kind is OrderKind.GRIP and order.valid(now_s) and order.force_n != self._sent_n:
            self._sent_n = order.force_n
            self._send(order.force_n)

    def told(self) -> dict[str, Any]:
        force_n = self._sent_n if math.isfinite(self._sent_n) else None
        return {"force_n": force_n, "motion": "simulated"}


class Several:
    """Several actuators that get the same orders; one that is not well stops all.

    Args:
        actuators: In the order in which they are told; the first is shown.
    """

    def __init__(self, actuators: Sequence[Actuator]) -> None:
        self._actuators = tuple(actuators)

    def hear(self, interlock: Interlock, now_s: float) -> None:
        for one in self._actuators:
            one.hear(interlock, now_s)

    def obey(self, order: Order, now_s: float) -> None:
        for one in self._actuators:
            one.obey(order, now_s)

    def told(self) -> dict[str, Any]:
        return self._actuators[0].told() if self._actuators else {}
