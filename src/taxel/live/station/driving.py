"""The actuators of a station: read, given the guard's orders, begun anew at a new grasp.

Knows nothing about processes or models.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from taxel.actions.actuators import (
    Actuator,
    CountsMessages,
    FollowsGrasps,
    TakesAnswers,
    hear_all,
)
from taxel.actions.interlock import Order, OrderKind
from taxel.live.station.acting import SimulatedGrip
from taxel.live.station.guard import Guard


class Driving:
    """All actuators under one guard.

    Args:
        guard: Orders, and receives what is wrong with them.
        least_n: The force at which a grasp begins, newtons.
        happened: Called with a moment and words for a person.
    """

    def __init__(
        self,
        guard: Guard,
        least_n: float,
        happened: Callable[[float, str], None] = lambda *_: None,
    ) -> None:
        self._guard, self._happened = guard, happened
        self._least_n = least_n
        self._actuators: list[Actuator] = []
        self._outputs: list[CountsMessages] = []
        self._losing: set[str] = set()
        """Names of outputs of which it was said that messages are lost."""
        self._faults: dict[str, str] = {}
        self._releasing = False

    def add(self, actuator: Actuator) -> None:
        """Give each tick's order to one more actuator, which is connected."""
        self._actuators.append(actuator)
        if isinstance(actuator, CountsMessages):
            self._outputs.append(actuator)

    def new_grasp(self, who: str = "") -> None:
        """Hear that a new grasp begins: said to all, and by itself it lowers nothing.

        Only the simulated gripper is known to begin each cup with its least force; orders to it
        do so as well, once the new grasp is calm. Another cup's grasp says nothing of its own.

        Args:
            who: The monitor of that grasp; empty for every grasp.
        """
        self._guard.new_grasp(who)
        for actuator in self._actuators:
            if isinstance(actuator, SimulatedGrip):
                if not actuator.begins(who):
                    continue
                self._releasing = True
            if isinstance(actuator, FollowsGrasps):
                actuator.new_grasp()

    def tick(self, now_s: float) -> None:
        """Read all actuators, weigh, and give them their orders: once.

        `Guard.wake` comes before it.
        """
        faults = hear_all(self._guard.interlock, self._actuators, now_s)
        order = self._guard.tick(now_s)
        self._release(order)
        for actuator in self._actuators:
            actuator.apply(self._guard.decision, order, now_s)
        self._weigh(faults, now_s)
        self._report_losses(now_s)

    def recognised(self, answer: dict[str, Any]) -> None:
        """Hand on what a recogniser has just answered, to those that take it."""
        for actuator in self._actuators:
            if isinstance(actuator, TakesAnswers):
                actuator.recognised(answer)

    def counts(self) -> dict[str, dict[str, int]]:
        """Return how many messages each output has sent and lost."""
        return {output.name: output.counts() for output in self._outputs}

    def snapshot(self) -> dict[str, Any] | None:
        """Return how the gripper does, as the page's link gives it; None without any."""
        if not self._actuators:
            return None
        interlock = self._guard.interlock
        return {
            "interlock": str(interlock.state), "armed": interlock.armed,
            "commanded_n": interlock.force_n, "force_n": None, "motion": "",
            "note": next(iter(self._faults.values()), interlock.reason),
            **self._actuators[0].snapshot(),
        }  # fmt: skip

    def _report_losses(self, now_s: float) -> None:
        """Report of each output, once, that messages are lost."""
        for output in self._outputs:
            if output.name not in self._losing and output.counts()["lost"]:
                self._losing.add(output.name)
                text = f"{output.name}: a message was lost; the summary at the end counts them"
                self._happened(now_s, text)

    def _release(self, order: Order) -> None:
        """Let the interlock's force begin anew; never once this grasp was raised or stopped."""
        if order.kind in (OrderKind.GRIP, OrderKind.STOP):
            self._releasing = False
        elif self._releasing and self._guard.interlock.release(self._least_n):
            self._releasing = False
            self._guard.begin_raises()

    def _weigh(self, faults: dict[str, str], now_s: float) -> None:
        for name in self._faults.keys() - faults.keys():
            self._guard.over(name, now_s)
        for name, fault in faults.items():
            if self._faults.get(name) != fault:
                self._guard.trouble(name, f"{name}: {fault}", now_s)
                if name not in self._faults:  # its words may hold how long it has lasted
                    self._happened(now_s, f"{name}: {fault}")
        self._faults = faults
