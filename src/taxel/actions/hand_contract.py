"""What a TENG hand's motors can be asked for, and what is known of them.

One contract for the controller behind a port and for the simulated hand. Knows nothing about
ports, threads or physics.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Protocol

from taxel.errors import BadInput
from taxel.wire import messages as wire

_LONGEST_MS = 0xFFFF
"""What 16 bits of a grip order hold, milliseconds. Source: protocol/SPEC.md."""


@dataclass(frozen=True, slots=True, kw_only=True)
class HandStatus:
    """What is known of the hand."""

    state: wire.State | None = None
    """What the board said last; None before its first heartbeat."""
    currents_ma: tuple[int, ...] = ()
    """The newest current of each motor, milliamperes."""
    current_s: float = -math.inf
    """When they came, monotonic seconds."""
    boot_id: int | None = None
    """The board's present boot."""
    fault: str = ""
    """What is wrong, in words; empty where all is well."""
    heard_s: float = -math.inf
    """When the board was last heard, monotonic seconds."""

    @property
    def ok(self) -> bool:
        """True where the board is heard and nothing is wrong."""
        return not self.fault

    @property
    def armed(self) -> bool:
        """True where the board says that it may move."""
        return self.state in (wire.State.ARMED, wire.State.MOVING)


class Hand(Protocol):
    """A hand whose motors close until contact."""

    def connect(self) -> None:
        """Open it; waits for its first answer.

        Raises:
            BadInput: It is not there, or has no motors.
        """
        ...

    def refresh(self) -> None:
        """Say that the owner lives; call it every tick. Without it the hand stops."""
        ...

    def arm(self) -> None:
        """Ask for motion to be allowed, on behalf of a person; `status().armed` says when."""
        ...

    def grip(
        self, fingers: int, closed_permille: int, contact_ma: int, lasts_s: float = 0.2
    ) -> None:
        """Move fingers until contact, unless this runs out; call it again to refresh it.

        Args:
            fingers: Bit 0 the first finger.
            closed_permille: How far, 0 open … 1000 closed, per mille.
            contact_ma: The current at which the board stops a motor, milliamperes.
            lasts_s: The board ends the motion after this long, seconds.

        Raises:
            BadInput: A number does not fit its place on the wire.
        """
        ...

    def stop(self) -> None:
        """Motors off and no longer armed."""
        ...

    def status(self) -> HandStatus:
        """Return what is known, at once."""
        ...

    def take_currents(self) -> list[tuple[float, tuple[int, ...]]]:
        """Return (monotonic seconds, mA of each motor) of each reading since the last call."""
        ...

    def close(self) -> None:
        """Stop the hand and let go of it."""
        ...


def checked_grip(fingers: int, closed_permille: int, contact_ma: int, lasts_s: float) -> int:
    """Return how long a grip lasts, milliseconds; the arguments are those of `Hand.grip`.

    Raises:
        BadInput: A number does not fit its place on the wire.
    """
    lasts_ms = round(lasts_s * 1000) if math.isfinite(lasts_s) else 0
    if not (
        1 <= fingers <= 0xFFFF
        and 0 <= closed_permille <= 1000
        and 1 <= contact_ma <= 0x7FFF
        and 1 <= lasts_ms <= _LONGEST_MS
    ):
        raise BadInput(
            "fingers 1 to 65535, 0 to 1000 per mille, 1 to 32767 mA, 0.001 to 65 s",
            f"{fingers}, {closed_permille} per mille, {contact_ma} mA, {lasts_s} s",
            "mend the call",
        )
    return lasts_ms
