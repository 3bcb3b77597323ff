"""Single movements of the TENG hand: to a place, closed until contact, or open.

Knows nothing about grasps as a whole, sources or screens.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from taxel.actions.grasp_cycle import Closing
from taxel.actions.hand_driver import TICK_S, HandDriver, HandStopped
from taxel.wire.messages import State

_SETTLE_S = 0.25
"""After an order the board's state counts only so much later, unless it has moved, seconds."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Moved:
    """The outcome of a movement."""

    ended: str
    """there: every finger is where it was sent or on something; time: it took too long;
    stopped: a person asked for the end."""
    seconds: float
    currents: list[tuple[float, tuple[int, ...]]]
    """(monotonic seconds, mA of each motor), oldest first."""

    @property
    def largest_ma(self) -> tuple[int, ...]:
        """Each motor's largest current, milliamperes."""
        columns = zip(*(row for _, row in self.currents), strict=True)
        return tuple(max(abs(ma) for ma in column) for column in columns)


def move_fingers(
    driver: HandDriver,
    wanted: Closing,
    longest_s: float,
    stopped: Callable[[], bool] = lambda: False,
) -> Moved:
    """Move fingers and wait until they rest, then let go of the order.

    Args:
        driver: The hand, armed.
        wanted: Where to, and up to which current.
        longest_s: How long to wait, seconds.
        stopped: True once a person asks for the end.

    Raises:
        HandStopped: The hand was stopped in between; it holds the currents until then.
    """
    clock, moved, ended = driver.clock, False, "time"
    currents: list[tuple[float, tuple[int, ...]]] = []
    began_s = clock.now_s()
    while (passed_s := clock.now_s() - began_s) < longest_s:
        state = driver.actuator.hand.status().state
        moved |= state is State.MOVING
        if stopped():
            ended = "stopped"
            break
        if state is State.ARMED and (moved or passed_s > _SETTLE_S):
            ended = "there"
            break
        try:
            driver.tick(wanted)
        except HandStopped as error:
            error.currents = [*currents, *driver.actuator.readings]
            raise
        currents += driver.actuator.readings
        clock.sleep(TICK_S)
    return Moved(ended=ended, seconds=clock.now_s() - began_s, currents=currents)


def watch(driver: HandDriver, seconds: float) -> list[tuple[float, tuple[int, ...]]]:
    """Listen to the hand without moving it; return the currents that came, seconds and mA."""
    until_s = driver.clock.now_s() + seconds
    hand = driver.actuator.hand
    currents: list[tuple[float, tuple[int, ...]]] = []
    while driver.clock.now_s() < until_s:
        hand.refresh()
        currents += hand.take_currents()
        driver.clock.sleep(TICK_S)
    return currents
