"""One face for everything that can obey an order: grippers, the hand, arms, plain outputs.

The loop of a tick:

    interlock.wake(now_s)
    for each word of the decision maker: interlock.beat, interlock.decision with its own time
    hear_all(interlock, actuators, now_s)
    order = interlock.tick(now_s)
    for actuator in actuators: actuator.apply(decision, order, now_s)

Nothing here waits or decides. Knows nothing about addresses, pages or models.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Protocol, runtime_checkable

from taxel.actions.arm import Arm
from taxel.actions.gripper import ForceRange, Gripper, obey
from taxel.actions.hand_contract import Hand
from taxel.actions.hand_raise import CurrentRaise, Raising
from taxel.actions.interlock import Interlock, Order, OrderKind
from taxel.actions.plain_output import CallbackOutput, Disarm, UdpOutput
from taxel.decisions.stability import Stability, StabilityDecision


@dataclass(frozen=True, slots=True)
class Health:
    """How an actuator is."""

    fault: str
    """What is wrong, in words; empty where all is well."""
    read_s: float
    """When this was known, monotonic seconds."""


class Actuator(Protocol):
    """Something that obeys orders."""

    name: str
    """What it is, for a person."""
    force: ForceRange | None
    """Its range of force; None where it has none. The interlock's limits come from it."""

    def connect(self) -> None:
        """Open it; waits for its first answer.

        Raises:
            BadInput: It is not there, or not what it should be.
        """
        ...

    def hear(self, interlock: Interlock, now_s: float) -> Health:
        """Report currents, where there are any, to the interlock; return the actuator's health."""
        ...

    def apply(self, decision: StabilityDecision, order: Order, now_s: float) -> None:
        """Hand on what is decided and ordered now."""
        ...

    def snapshot(self) -> dict[str, Any]:
        """Return what a person wants to see, as JSON values: `motion`, `force_n` if any."""
        ...

    def close(self) -> None:
        """Let go of it."""
        ...


@runtime_checkable
class FollowsGrasps(Protocol):
    """An actuator that does something of its own when a person says that a new grasp begins."""

    def new_grasp(self) -> None:
        """Note that another grasp begins; no force is lowered by it."""
        ...


@runtime_checkable
class TakesAnswers(Protocol):
    """An actuator that wants to know what is in the hand, such as another robot's program."""

    def recognised(self, answer: Mapping[str, Any]) -> None:
        """Take in a recogniser's newest answer, with fields as in `answer_output`."""
        ...


@runtime_checkable
class CountsMessages(Protocol):
    """An actuator whose messages may be lost on their way, such as datagrams."""

    name: str

    def counts(self) -> dict[str, int]:
        """Return how many messages were "sent", and at least how many "lost", some of those too."""
        ...


def hear_all(interlock: Interlock, actuators: Sequence[Actuator], now_s: float) -> dict[str, str]:
    """Report the actuators' health to the interlock, the worst and the oldest counting.

    Where something of a known force is driven, that alone says where raises begin: what another
    robot says of its own grip must not make a step of this one's.

    Args:
        interlock: Hears of the device as of the oldest reading.
        actuators: All that obey; none is well, and never gets old.
        now_s: This moment, monotonic seconds.

    Returns:
        Name → what is wrong, for those where something is.
    """
    outputs = [actuator for actuator in actuators if isinstance(actuator, OutputActuator)]
    grips = any(actuator.force is not None for actuator in actuators if actuator not in outputs)
    for output in outputs:
        output.alone = not grips
    found = [(actuator.name, actuator.hear(interlock, now_s)) for actuator in actuators]
    faults = {name: health.fault for name, health in found if health.fault}
    read_s = min((health.read_s for _, health in found), default=now_s)
    interlock.device(not faults, min(read_s, now_s))
    return faults


class GripperActuator:
    """A gripper: raises, holds, stops.

    The interlock receives the force that is set, so that a raise begins there: down only where
    `Interlock.release` allows it, up always.
    """

    def __init__(self, name: str, gripper: Gripper, force: ForceRange) -> None:
        self.name = name
        self.gripper = gripper
        self.force: ForceRange | None = force
        self._range = force

    def connect(self) -> None:
        self.gripper.connect()

    def hear(self, interlock: Interlock, now_s: float) -> Health:
        status = self.gripper.status()
        if math.isfinite(status.force_pct):
            interlock.release(self._range.newtons(status.force_pct))
        return Health(status.fault or ("" if status.ok else "not initialised"), status.read_s)

    def apply(self, decision: StabilityDecision, order: Order, now_s: float) -> None:
        obey(self.gripper, order, self._range, now_s)

    def close(self) -> None:
        self.gripper.close()

    def snapshot(self) -> dict[str, Any]:
        status = self.gripper.status()
        pct = status.force_pct
        force_n = self._range.newtons(pct) if math.isfinite(pct) else None
        return {"force_n": force_n, "motion": status.fault or status.motion.value}


class HandActuator:
    """The TENG hand's motors: stops, and raises where that was asked for.

    Args:
        name: For a person.
        hand: Its motors.
        raises: How a GRIP order raises the contact current; None leaves such orders alone, as no
            calibration from motor current to force exists for this hand.
    """

    def __init__(self, name: str, hand: Hand, raises: CurrentRaise | None = None) -> None:
        self.name = name
        self.hand = hand
        self.force: ForceRange | None = None
        self.readings: list[tuple[float, tuple[int, ...]]] = []
        """Of the last `hear`: (monotonic seconds, mA of each motor)."""
        self._raising = None if raises is None else Raising(raises)

    def connect(self) -> None:
        self.hand.connect()

    def hear(self, interlock: Interlock, now_s: float) -> Health:
        self.hand.refresh()
        self.readings = self.hand.take_currents()
        for read_s, currents_ma in self.readings:
            largest_ma = max((abs(ma) for ma in currents_ma), default=0)
            interlock.contact_current(largest_ma, min(read_s, now_s))
        status = self.hand.status()
        return Health(status.fault, status.heard_s)

    def apply(self, decision: StabilityDecision, order: Order, now_s: float) -> None:
        # HOLD sends nothing: its motors hold without current, and a grip runs out by itself.
        if not order.valid(now_s):
            return
        if order.kind is OrderKind.STOP:
            self.hand.stop()
        elif order.kind is OrderKind.GRIP and self._raising is not None:
            self._raising.obey(self.hand, now_s)

    def close(self) -> None:
        self.hand.close()

    def snapshot(self) -> dict[str, Any]:
        status = self.hand.status()
        state = "unknown" if status.state is None else status.state.name.lower()
        return {"motion": status.fault or state, "currents_ma": list(status.currents_ma)}


class ArmActuator:
    """An arm: holds on a warning, lowers once when the grasp is unstable, stops.

    Args:
        name: For a person.
        arm: Is neither powered nor enabled from here.
        lower_mm: How far it lowers what is held, millimetres; 0 never lowers.
    """

    def __init__(self, name: str, arm: Arm, lower_mm: float = 0.0) -> None:
        self.name = name
        self.arm = arm
        self.force: ForceRange | None = None
        self._lower_mm = lower_mm
        self._lowered = False
        self._leaving = False
        """True once a new grasp was announced and all that was heard may be of the one before."""
        self._alarms = 0
        self._stopped = False

    def connect(self) -> None:
        self.arm.connect()

    def hear(self, interlock: Interlock, now_s: float) -> Health:
        status = self.arm.status()
        return Health(status.fault or ("" if status.ok else "not ready"), status.read_s)

    def new_grasp(self) -> None:
        """Note that another grasp begins: what alarms in it is a new alarm."""
        self._leaving = True

    def apply(self, decision: StabilityDecision, order: Order, now_s: float) -> None:
        if self._leaving and not decision.alarm:
            self._leaving = self._lowered = False
        if not order.valid(now_s):
            return
        if order.kind is OrderKind.STOP:
            if not self._stopped or self.arm.status().moving:
                self.arm.stop()
            self._stopped = True
            return
        self._stopped = False
        if order.kind is OrderKind.GRIP and decision.state is Stability.UNSTABLE:
            self._lower(order)
        elif order.kind is OrderKind.GRIP and not self._lowered:
            self.arm.hold(order.expires_s)
        elif order.kind is OrderKind.HOLD and decision.state is Stability.STABLE:
            self._lowered = False

    def _lower(self, order: Order) -> None:
        """Lower once an alarm: it is over when the grasp is stable again, or another one.

        Asked again each tick, since each order lives a short time; sent once.
        """
        if self._lower_mm > 0:
            self._alarms += not self._lowered
            self._lowered = True
            self.arm.lower(self._lower_mm, expires_s=order.expires_s, number=self._alarms)

    def close(self) -> None:
        self.arm.close()

    def snapshot(self) -> dict[str, Any]:
        status = self.arm.status()
        height_mm = status.height_mm if math.isfinite(status.height_mm) else None
        words = status.fault or ("moving" if status.moving else "still")
        return {"motion": words, "height_mm": height_mm}


class OutputActuator:
    """A plain output: whatever listens may disarm, or say with what force it grips."""

    def __init__(
        self, name: str, output: UdpOutput | CallbackOutput, force: ForceRange | None = None
    ) -> None:
        self.name = name
        self.output = output
        self.force = force
        self.alone = True
        """No gripper is driven beside it: then raises begin at the force that it is said to set."""

    def connect(self) -> None:
        """Nothing to wait for."""

    def hear(self, interlock: Interlock, now_s: float) -> Health:
        for word in self.output.heard():
            if isinstance(word, Disarm):
                interlock.disarm(now_s, f"the robot's program ({self.name})")
            elif self.alone and interlock.release(word.force_n):
                self.output.grips_with(max(word.force_n, interlock.force_n))
        return Health("", math.inf)

    def new_grasp(self) -> None:
        """Say from now on that another grasp has begun."""
        self.output.new_grasp()

    def recognised(self, answer: Mapping[str, Any]) -> None:
        self.output.recognised(answer)

    def apply(self, decision: StabilityDecision, order: Order, now_s: float) -> None:
        self.output.send(decision, order, now_s)

    def close(self) -> None:
        self.output.close()

    def counts(self) -> dict[str, int]:
        return {"sent": self.output.sent, "lost": self.output.lost}

    def snapshot(self) -> dict[str, Any]:
        return {"motion": f"{self.output.sent} sent, {self.output.lost} lost"}
