"""What a gripper can be asked for, newtons to percent, and how an order reaches it.

A gripper never opens or lowers its force by what stands here: `grip` closes with a force, `hold`
keeps it, `stop` ends motion. No method but `connect` and `close` waits for the device.
Knows nothing about decisions, buses or models.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import StrEnum
from typing import Protocol

from taxel.actions.interlock import Interlock, Order, OrderKind
from taxel.errors import BadInput


class Motion(StrEnum):
    """What the fingers do."""

    MOVING = "moving"
    REACHED = "reached"
    """At the place they were sent to, nothing between them."""
    CAUGHT = "caught"
    """An object is between them."""
    DROPPED = "dropped"
    """An object was between them and is there no longer."""


@dataclass(frozen=True, slots=True, kw_only=True)
class GripperStatus:
    """What is known of a gripper; what was read last, where it does not answer now."""

    initialised: bool = False
    """True once it knows its end stops."""
    motion: Motion = Motion.MOVING
    """What the fingers do."""
    position_permille: float = math.nan
    """Where the fingers are: 0 closed … 1000 open, per mille of the stroke; NaN unknown."""
    force_pct: float = math.nan
    """The force set, percent of the largest; NaN unknown."""
    fault: str = ""
    """What is wrong, in words; empty where all is well."""
    read_s: float = -math.inf
    """When this was read, monotonic seconds."""

    @property
    def ok(self) -> bool:
        """True where it is initialised and nothing is wrong."""
        return self.initialised and not self.fault


@dataclass(frozen=True, slots=True, kw_only=True)
class Latency:
    """How long commands took from the call to the device's answer."""

    commands: int = 0
    """Commands answered."""
    last_s: float = math.nan
    """The newest, seconds."""
    p50_s: float = math.nan
    """The median of the last thousand, seconds."""
    worst_s: float = math.nan
    """The longest of the run, seconds."""


class Gripper(Protocol):
    """A gripper with two fingers."""

    def connect(self) -> None:
        """Open the device; waits for its first answer, a few seconds at most.

        Raises:
            BadInput: There is no such device, or it does not answer as it should.
        """
        ...

    def grip(self, force_pct: float, expires_s: float = math.inf) -> None:
        """Close with a force, unless the moment `expires_s` passes before it can be sent.

        Args:
            force_pct: Percent of the largest force, kept within what the gripper takes.
            expires_s: Monotonic seconds.
        """
        ...

    def hold(self) -> None:
        """Keep the force last asked for; asks for nothing new."""
        ...

    def stop(self) -> None:
        """End all motion where the fingers are; what is held stays held."""
        ...

    def status(self) -> GripperStatus:
        """Return what is known, at once."""
        ...

    def close(self) -> None:
        """Let go of the device, not of the object: the fingers stay as they are."""
        ...


@dataclass(frozen=True, slots=True, kw_only=True)
class ForceRange:
    """From newtons to percent, on a straight line between two ends.

    Makers state the ends of the range and not the line between: measure it where it matters.
    """

    max_n: float
    """Force at 100 %, newtons: 50 for a PGE-50-26 (its data sheet)."""
    min_pct: float = 20.0
    """The smallest setting, percent. Source: register 0x0101 of the PGE takes 20 to 100."""
    min_n: float | None = None
    """Force at the smallest setting, newtons: 15 for a PGE-50-26 (its data sheet). None: in
    proportion, `max_n` times `min_pct` / 100."""

    def __post_init__(self) -> None:
        if not (0 < self.max_n < math.inf and 0 <= self.min_pct < 100):
            raise BadInput(
                "a largest force above 0 N and a smallest setting of 0 to 99 %",
                f"{self.max_n} N and {self.min_pct} %",
                "see the gripper's data sheet",
            )
        if not 0 <= self.least_n < self.max_n:
            raise BadInput(
                f"a smallest force of 0 N to less than {self.max_n:g} N",
                f"{self.least_n} N",
                "see the gripper's data sheet",
            )

    @property
    def least_n(self) -> float:
        """Force at the smallest setting, newtons."""
        return self.max_n * self.min_pct / 100 if self.min_n is None else self.min_n

    def pct(self, force_n: float) -> float:
        """Return the setting for a force, `min_pct` … 100 percent; NaN for NaN."""
        if math.isnan(force_n):
            return math.nan
        share = (force_n - self.least_n) / (self.max_n - self.least_n)
        return self.min_pct + (100 - self.min_pct) * min(max(share, 0.0), 1.0)

    def newtons(self, force_pct: float) -> float:
        """Return the force of a setting, newtons."""
        share = (force_pct - self.min_pct) / (100 - self.min_pct)
        return self.least_n + (self.max_n - self.least_n) * min(max(share, 0.0), 1.0)


def obey(gripper: Gripper, order: Order, force: ForceRange, now_s: float) -> None:
    """Hand an order of the interlock to a gripper; an expired one does nothing.

    A GRIP with less than the force that is set already does nothing either: whoever set more
    did so on purpose.

    Args:
        gripper: A connected gripper.
        order: What `Interlock.tick` returned.
        force: The gripper's range.
        now_s: This moment, monotonic seconds.
    """
    if not order.valid(now_s):
        return
    if order.kind is OrderKind.GRIP:
        pct = force.pct(order.force_n)
        if not pct < gripper.status().force_pct:
            gripper.grip(pct, order.expires_s)
    elif order.kind is OrderKind.HOLD:
        gripper.hold()
    elif order.kind is OrderKind.STOP:
        gripper.stop()


def hear(interlock: Interlock, gripper: Gripper, now_s: float) -> GripperStatus:
    """Tell the interlock how a gripper that acts alone is; return the gripper's status.

    Args:
        interlock: Is told whether the gripper is well, as of when that was read.
        gripper: A connected gripper. With other actuators beside it use `actuators.hear_all`.
        now_s: This moment, monotonic seconds.
    """
    status = gripper.status()
    interlock.device(status.ok, min(status.read_s, now_s))
    return status
