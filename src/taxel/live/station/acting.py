"""The gripper of a simulated cup as an actuator of the station: it lives in the source's process.

Knows nothing about decisions or processes.

Background of our choices: docs/decisions/0019.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Collection
from typing import Any

from taxel.actions.actuators import Health
from taxel.actions.gripper import ForceRange
from taxel.actions.interlock import Interlock, Order, OrderKind
from taxel.clock import Clock, SystemClock
from taxel.decisions.stability import StabilityDecision

_AGAIN_S = 0.05
"""A force that was sent is sent again after so long while it is ordered, seconds: each order
expires, and one that came too late was not obeyed. Source: our choice, half an order's life."""


class SimulatedGrip:
    """Sends a raised force to the simulated cup's gripper, never a lower one.

    Args:
        send: Sends a force, newtons, and the moment from which on it must not be obeyed,
            monotonic seconds, to the process that simulates the cup.
        force: What that gripper can do.
        clock: Looked at before anything is sent: an order may be older than its tick.
        watchers: Names of the monitors of that cup; None where all are.
    """

    def __init__(
        self,
        send: Callable[[float, float], None],
        force: ForceRange,
        clock: Clock | None = None,
        watchers: Collection[str] | None = None,
    ) -> None:
        self.name = "the simulated cup's gripper"
        self.force: ForceRange | None = force
        self._send = send
        self._clock = clock or SystemClock()
        self._watchers = watchers
        self._sent_n = math.nan
        self._sent_s = -math.inf

    def connect(self) -> None:
        """Do nothing: the simulated gripper is there as long as its source is."""

    def hear(self, interlock: Interlock, now_s: float) -> Health:
        return Health("", now_s)

    def apply(self, decision: StabilityDecision, order: Order, now_s: float) -> None:
        now_s = max(now_s, self._clock.now_s())
        if order.kind is not OrderKind.GRIP or not order.valid(now_s):
            return
        higher = not order.force_n <= self._sent_n  # also where nothing was sent yet
        same = order.force_n == self._sent_n and now_s - self._sent_s >= _AGAIN_S
        if higher or same:
            self._sent_n, self._sent_s = order.force_n, now_s
            self._send(order.force_n, order.expires_s)

    def begins(self, who: str) -> bool:
        """Return whether a new grasp that a monitor reports is one of this cup.

        Args:
            who: The monitor; empty where every grasp begins anew.
        """
        return not who or self._watchers is None or who in self._watchers

    def new_grasp(self) -> None:
        """The simulated gripper begins anew by itself: the next raise is to be sent whole."""
        self._sent_n = math.nan

    def snapshot(self) -> dict[str, Any]:
        force_n = self._sent_n if math.isfinite(self._sent_n) else None
        return {"motion": "simulated", "force_n": force_n}

    def close(self) -> None:
        """Nothing to let go of."""
