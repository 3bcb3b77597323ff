"""What a gripper can be asked for, newtons to percent, and how an order reaches it.

A gripper never opens or lowers its force by what stands here: `grip` closes with a force, `hold`
keeps it, `stop` ends motion. No method but `connect` and `close` waits for the device.
Knows nothing about decisions, buses or models.
"""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass
from enum import StrEnum
from typing import Protocol

import numpy as np

from taxel.actions.interlock import Order, OrderKind
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
    """From newtons to percent: in proportion to the largest force, or by a measured table.

    In proportion is how the grasp paper states its four grips: 15, 25, 40 and 50 N are 30, 50,
    80 and 100 % (section 3.2). Makers do not promise that line: measure it where it matters.
    """

    max_n: float
    """Force at 100 %, newtons: 50 for a PGE-50-26 (its data sheet and the paper)."""
    min_pct: float = 20.0
    """The smallest setting, percent. Source: register 0x0101 of the PGE takes 20 to 100."""
    table: tuple[tuple[float, float], ...] = ()
    """Measured (percent, newtons), rising in both, from `min_pct` to 100; straight lines between.
    Empty: in proportion."""

    def __post_init__(self) -> None:
        if not (0 < self.max_n < math.inf and 0 <= self.min_pct < 100):
            raise BadInput(
                "a largest force above 0 N and a smallest setting of 0 to 99 %",
                f"{self.max_n} N and {self.min_pct} %",
                "see the gripper's data sheet",
            )
        rising = all(
            before[0] < after[0] and before[1] < after[1]
            for before, after in itertools.pairwise(self.table)
        )
        ends = [pair[0] for pair in self.table[:: max(1, len(self.table) - 1)]]
        values = [value for pair in self.table for value in pair]
        if self.table and not (
            rising and ends == [self.min_pct, 100.0] and all(0 <= v < math.inf for v in values)
        ):
            raise BadInput(
                f"a table of force that rises, from {self.min_pct:g} % to 100 %",
                ", ".join(f"{pct:g} % is {force_n:g} N" for pct, force_n in self.table),
                "measure both ends and write percent:newtons pairs, smallest first",
            )
        if self.table and self.table[-1][1] != self.max_n:
            raise BadInput(
                f"the largest force, {self.max_n:g} N, at 100 % of the table",
                f"{self.table[-1][1]:g} N",
                "give max_force_n as measured",
            )

    @property
    def least_n(self) -> float:
        """Force at the smallest setting, newtons."""
        return self._line[0][1]

    @property
    def _line(self) -> tuple[tuple[float, float], ...]:
        """(percent, newtons) between which force is a straight line."""
        least = (self.min_pct, self.max_n * self.min_pct / 100)
        return self.table or (least, (100.0, self.max_n))

    def pct(self, force_n: float) -> float:
        """Return the setting for a force, `min_pct` … 100 percent; NaN for NaN."""
        percents, forces = zip(*self._line, strict=True)
        return float(np.interp(force_n, forces, percents))

    def newtons(self, force_pct: float) -> float:
        """Return the force of a setting, newtons."""
        percents, forces = zip(*self._line, strict=True)
        return float(np.interp(force_pct, percents, forces))


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
