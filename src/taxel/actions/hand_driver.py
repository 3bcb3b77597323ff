"""Move the TENG hand behind the interlock: every tick it is heard, judged and only then moved.

The program that moves the fingers is the decision maker here: it beats by ticking, and says STABLE,
since no model judges. What the interlock stops stays stopped until a person arms again. Knows
nothing about plans, sources or files.

Background of our choices: docs/decisions/0043.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

from taxel.actions.actuators import HandActuator, hear_all
from taxel.actions.grasp_cycle import Closing
from taxel.actions.interlock import Interlock, InterlockConfig, InterlockState
from taxel.clock import Clock
from taxel.decisions.stability import Stability, StabilityDecision
from taxel.errors import BadInput

TICK_S = 0.01
"""Between two ticks, seconds. Source: docs/decisions/0016."""
_ARM_S = 2.0
"""How long arming may take, seconds. Source: our choice."""


def hand_limits(contact_ma: int) -> InterlockConfig:
    """Return the interlock's limits behind a board that stops motors at a contact current.

    A half more for 0.1 s is a board that does not stop; 2,600 mA is the board's own over-current.
    Source: our choice, docs/decisions/0043.

    Args:
        contact_ma: What each grip names, milliamperes.
    """
    return InterlockConfig(
        min_n=0.0, max_n=1.0, contact_ma=1.5 * contact_ma, contact_s=0.1, over_ma=2600.0
    )


class HandStopped(BadInput):
    """The interlock or the board has stopped the hand."""

    currents: Sequence[tuple[float, tuple[int, ...]]] = ()
    """Of a single movement, until the stop: monotonic seconds and mA of each motor."""

    def __init__(self, reason: str) -> None:
        super().__init__(
            "a hand that may move", f"a stop: {reason}", "mend the cause and run it again"
        )


@dataclass(slots=True)
class HandDriver:
    """The loop's body for one hand."""

    actuator: HandActuator
    clock: Clock
    limits: InterlockConfig
    interlock: Interlock = field(init=False)

    def __post_init__(self) -> None:
        self.interlock = Interlock(self.limits)

    def arm(self) -> None:
        """Arm board and interlock, on behalf of a person; waits until both are.

        Raises:
            HandStopped: One of them refuses.
        """
        until_s = self.clock.now_s() + _ARM_S
        causes: tuple[str, ...] = ()
        asked = False
        while (now_s := self.clock.now_s()) < until_s:
            self._listen(now_s)
            status = self.actuator.hand.status()
            if status.armed:
                causes = self.interlock.arm(now_s)
                if not causes:
                    return
            elif not asked or status.fault:
                self.actuator.hand.arm()
                asked = True
            self.clock.sleep(TICK_S)
        status = self.actuator.hand.status()
        raise HandStopped(", ".join(causes) or status.fault or "the board does not arm")

    def tick(self, wanted: Closing | None) -> None:
        """Read the hand's state, let the interlock judge it, and move the fingers if allowed.

        Args:
            wanted: What the fingers are to do; None lets them rest.

        Raises:
            HandStopped: The interlock has stopped the hand, or the board has.
        """
        now_s = self.clock.now_s()
        order = self._listen(now_s)
        if self.interlock.state is InterlockState.STOPPED:
            raise HandStopped(self.interlock.reason)
        status = self.actuator.hand.status()
        if not status.armed:
            raise HandStopped(status.fault or f"the board is {status.state}")
        if wanted is not None and order:
            self.actuator.hand.grip(
                wanted.fingers, wanted.closed_permille, wanted.contact_ma, wanted.lasts_s
            )

    def _listen(self, now_s: float) -> bool:
        """Return whether the interlock lets the fingers move."""
        lock = self.interlock
        lock.wake(now_s)
        lock.beat(now_s)
        lock.decision(Stability.STABLE.name, now_s)
        hear_all(lock, [self.actuator], now_s)
        decision = StabilityDecision(Stability.STABLE, "", now_s, 0.0)
        self.actuator.apply(decision, lock.tick(now_s), now_s)
        return lock.armed
