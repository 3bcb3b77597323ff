"""The gripper of a simulated cup as an actuator of the station: it lives in the source's process.

Knows nothing about decisions or processes.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

from taxel.actions.actuators import Health
from taxel.actions.gripper import ForceRange
from taxel.actions.interlock import Interlock, Order, OrderKind
from taxel.decisions.stability import StabilityDecision


class SimulatedGrip:
    """Sends a raised force to the simulated cup's gripper, once each and never a lower one.

    Args:
        send: Sends a force, newtons, to the process that simulates the cup.
        force: What that gripper can do.
    """

    def __init__(self, send: Callable[[float], None], force: ForceRange) -> None:
        self.name = "the simulated cup's gripper"
        self.force: ForceRange | None = force
        self._send = send
        self._sent_n = math.nan

    def connect(self) -> None:
        """It is there as long as its source is."""

    def hear(self, interlock: Interlock, now_s: float) -> Health:
        return Health("", now_s)

    def tell(self, decision: StabilityDecision, order: Order, now_s: float) -> None:
        higher = not order.force_n <= self._sent_n  # also where nothing was sent yet
        if order.kind is OrderKind.GRIP and order.valid(now_s) and higher:
            self._sent_n = order.force_n
            self._send(order.force_n)

    def new_grasp(self) -> None:
        """The simulated gripper begins anew by itself: the next raise is to be sent whole."""
        self._sent_n = math.nan

    def told(self) -> dict[str, Any]:
        force_n = self._sent_n if math.isfinite(self._sent_n) else None
        return {"motion": "simulated", "force_n": force_n}

    def close(self) -> None:
        """Nothing to let go of."""
