"""One grasp of the TENG hand: open, approach, close until contact, hold, release, pause.

A state machine that takes the time and what the board says, and answers with what the fingers
are to do now. The board itself stops a motor at the contact current (protocol/SPEC.md); here is
found out which fingers it stopped, since a hand that closed on nothing is no grasp. While it
holds, the fingers press again and again: a TENG pad senses touch only while it changes.
Knows nothing about ports, sources or plans.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from enum import StrEnum

from taxel.errors import BadInput
from taxel.wire.messages import State


class Phase(StrEnum):
    """Where a grasp stands."""

    OPENING = "opening"
    APPROACHING = "approaching"
    HOLDING = "holding"
    LIFTING = "lifting"
    """The fingers open a little before they press again."""
    PRESSING = "pressing"
    RELEASING = "releasing"
    PAUSING = "pausing"
    DONE = "done"


@dataclass(frozen=True, slots=True, kw_only=True)
class CycleConfig:
    """How a grasp goes. Source: our choice, docs/decisions/0043."""

    fingers: int = 0b1111
    """Which fingers: bit 0 the first."""
    closed_permille: int = 1000
    """How far they close where nothing stops them, per mille."""
    contact_ma: int = 700
    """The current at which the board stops a motor, milliamperes; decision 20."""
    stroke_s: float = 5.0
    """From open to closed, seconds: HAND_STROKE_MS of the firmware."""
    hold_s: float = 0.4
    """How long the fingers rest on the object after each press, seconds."""
    presses: int = 5
    """Presses of one grasp, the first included; as the simulator's 4 to 8."""
    lift_s: float = 0.15
    """How long the fingers open between two presses, seconds."""
    pause_s: float = 0.5
    """Open hand after a grasp, seconds."""
    settle_s: float = 0.25
    """After an order the board's state counts only so much later, unless it has said that it
    moves, seconds."""
    lasts_s: float = 0.4
    """Each order runs out after this long unless it is repeated, seconds."""

    def __post_init__(self) -> None:
        for name in ("stroke_s", "hold_s", "lift_s", "pause_s", "lasts_s"):
            time_s = getattr(self, name)
            if not 0 < time_s <= 60:
                raise BadInput(
                    f"{name} of a grasp above 0 and up to 60 s", f"{time_s:g}", "choose another"
                )
        if not (1 <= self.fingers <= 0b1111 and 0 < self.closed_permille <= 1000):
            raise BadInput(
                "fingers 1 to 15 and a way of 1 to 1000 per mille",
                f"{self.fingers} and {self.closed_permille}", "mend them",
            )  # fmt: skip
        if not 1 <= self.contact_ma <= 0x7FFF or not 1 <= self.presses <= 100:
            raise BadInput(
                "a contact current of 1 to 32767 mA and 1 to 100 presses",
                f"{self.contact_ma} mA and {self.presses}", "mend them",
            )  # fmt: skip


@dataclass(frozen=True, slots=True)
class Closing:
    """What the fingers are to do: the arguments of `HandController.grip`."""

    fingers: int
    closed_permille: int
    contact_ma: int
    lasts_s: float


@dataclass(slots=True)
class GraspCycle:
    """The state machine."""

    config: CycleConfig = field(default_factory=CycleConfig)
    phase: Phase = Phase.OPENING
    touched: dict[int, float] = field(default_factory=dict)
    """Finger → when its motor was off by contact in the approach, seconds."""
    started_s: float = math.nan
    """When the approach began, seconds."""
    ended_s: float = math.nan
    """When the fingers were open again, seconds."""
    _since_s: float = math.nan
    _moved: bool = False
    _presses: int = 0
    _running: set[int] = field(default_factory=set)

    @property
    def done(self) -> bool:
        """True when the grasp is over."""
        return self.phase is Phase.DONE

    def step(self, now_s: float, state: State | None, currents_ma: Sequence[int]) -> Closing | None:
        """Return what the fingers are to do now; None where they are to rest.

        Args:
            now_s: This moment, seconds.
            state: What the board said last.
            currents_ma: The newest current of each motor, milliamperes.
        """
        if math.isnan(self._since_s):
            self._since_s = now_s
        self._moved |= state is State.MOVING
        if self.phase is Phase.APPROACHING:
            self._look_for_contact(now_s, currents_ma)
        after = self._next(now_s, state)
        if self.phase is Phase.APPROACHING and after is not None:
            self._look_for_contact(now_s, [0] * len(currents_ma))  # the board says that all are off
        if after is not None:
            self._enter(after, now_s)
        return self._order()

    def _look_for_contact(self, now_s: float, currents_ma: Sequence[int]) -> None:
        """Take note of motors that ran and are off before their way was over."""
        running = {finger for finger, ma in enumerate(currents_ma) if ma > 0}
        whole_s = 0.95 * self.config.stroke_s * self.config.closed_permille / 1000
        for finger in self._running - running:
            if now_s - self.started_s < whole_s:
                self.touched.setdefault(finger, now_s)
        self._running |= running

    def _next(self, now_s: float, state: State | None) -> Phase | None:
        passed_s = now_s - self._since_s
        config = self.config
        still = state is State.ARMED and (self._moved or passed_s >= config.settle_s)
        match self.phase:
            case Phase.OPENING if still:
                return Phase.APPROACHING
            case Phase.APPROACHING | Phase.PRESSING if still:
                return Phase.HOLDING
            case Phase.HOLDING if passed_s >= config.hold_s:
                self._presses += 1
                ends = self._presses >= config.presses or not self.touched
                return Phase.RELEASING if ends else Phase.LIFTING
            case Phase.LIFTING if passed_s >= config.lift_s:
                return Phase.PRESSING
            case Phase.RELEASING if still:
                self.ended_s = now_s
                return Phase.PAUSING
            case Phase.PAUSING if passed_s >= config.pause_s:
                return Phase.DONE
        return None

    def _enter(self, phase: Phase, now_s: float) -> None:
        self.phase, self._since_s, self._moved = phase, now_s, False
        if phase is Phase.APPROACHING:
            self.started_s = now_s

    def _order(self) -> Closing | None:
        config = self.config
        if self.phase in (Phase.APPROACHING, Phase.PRESSING):
            to = config.closed_permille
        elif self.phase in (Phase.OPENING, Phase.LIFTING, Phase.RELEASING):
            to = 0
        else:
            return None
        return Closing(config.fingers, to, config.contact_ma, config.lasts_s)
