"""The interlock between a decision and whatever grips: when to raise, hold and stop.

One class for the gripper and for the TENG hand. It only ever raises or holds the grip;
opening and lowering are left to the robot's own program (`release`).

    from       when                                                       to        order
    DISARMED   arm, and no cause persists                                 READY     HOLD
    DISARMED   anything else                                              DISARMED  NONE
    READY      WARNING or UNSTABLE                                        RAISED    GRIP
    READY      UNKNOWN                                                    HOLDING   HOLD
    RAISED     STABLE                                                     READY     HOLD
    RAISED     UNKNOWN                                                    HOLDING   HOLD
    HOLDING    STABLE                                                     READY     HOLD
    HOLDING    WARNING or UNSTABLE                                        RAISED    GRIP
    any three  a cause (below)                                            STOPPED   STOP
    any three  disarm                                                     DISARMED  NONE
    STOPPED    arm, and no cause persists                                 READY     HOLD
    STOPPED    anything else, disarm too                                  STOPPED   STOP

HOLD keeps the force last ordered and moves nothing; STOP ends all motion where it stands and
keeps the force. Causes: no `beat` for `watchdog_s`; decisions that came and have not for
`decision_s`, whatever beats; no tick for `stall_s`: whoever calls this stood still; a fault; a
device that is not well or has not been heard of for `device_s`; over-current; contact current
for `contact_s` (hand); no current reading for `current_s` (where one is expected); a clock that
is not finite or steps back. Before the first decision it is UNKNOWN. NaN is never good news: as
a decision it is UNKNOWN, as a current it is over-current.

Every order carries the moment at which it expires; whoever sends one looks at a clock of its
own. Called from one thread; nothing blocks. Knows nothing about buses, percent, alarms or
models. Source of limits: our choice, docs/decisions/0016 and 0030.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import StrEnum

from taxel.errors import BadInput

_AHEAD_S = 0.005
"""A word stamped this far ahead of the tick still counts, seconds: its thread read the clock
after the tick did. Source: our choice."""
_AWAKE_S = 0.5
"""Arming is refused this long after a stall, seconds: a key that was pressed during it must not
undo the stop. Source: our choice, docs/decisions/0030."""
_EXACT_S = 1e-9
"""Times of equal distance may differ by this from rounding, seconds."""


class InterlockState(StrEnum):
    """Where the interlock stands."""

    DISARMED = "disarmed"
    READY = "ready"
    RAISED = "raised"
    HOLDING = "holding"
    STOPPED = "stopped"


class OrderKind(StrEnum):
    """What an order asks of the actuator."""

    NONE = "none"
    GRIP = "grip"
    HOLD = "hold"
    STOP = "stop"


_ARMED = (InterlockState.READY, InterlockState.RAISED, InterlockState.HOLDING)


@dataclass(frozen=True, slots=True)
class Order:
    """What the actuator is to do now."""

    kind: OrderKind
    """What to do."""
    force_n: float
    """With GRIP: the force, newtons. With HOLD and STOP: the force that is kept. NaN with NONE."""
    reason: str
    """Why, in words."""
    expires_s: float
    """From this moment on, monotonic seconds, the order is void."""

    def valid(self, now_s: float) -> bool:
        """True while the order may still be obeyed."""
        return now_s < self.expires_s


@dataclass(frozen=True, slots=True, kw_only=True)
class InterlockConfig:
    """Limits and times. Source: our choice, docs/decisions/0016."""

    min_n: float
    """The least force ever ordered and the force assumed at the start, newtons."""
    max_n: float
    """The largest force ever ordered, newtons."""
    slew_n_s: float = 200.0
    """The force rises by at most this much a second, newtons per second."""
    expires_s: float = 0.1
    """An order is void after this long unless refreshed, seconds."""
    watchdog_s: float = 0.08
    """STOPPED when the decision maker was last heard longer ago, seconds; with a tick every
    10 ms it keeps the limit of 100 ms for a process that was killed or hangs."""
    decision_s: float = 0.3
    """STOPPED when the newest decision was taken longer ago, seconds, whatever beats."""
    stall_s: float = 0.08
    """STOPPED when the tick before was longer ago, seconds: nobody has watched meanwhile."""
    step_s: float = 0.02
    """The most that one tick counts for the slew, seconds: a late tick never makes a larger
    step of force than this."""
    device_s: float = 0.5
    """STOPPED when the actuator was last heard longer ago, seconds."""
    contact_ma: float | None = None
    """A motor current that means contact, milliamperes; None where contact does not stop."""
    contact_s: float = 0.02
    """It must last this long, seconds."""
    over_ma: float | None = None
    """A motor current that stops at once, milliamperes; None where none is measured."""
    current_s: float = 0.2
    """STOPPED when a current was last read longer ago, seconds; only with one of the above."""

    def __post_init__(self) -> None:
        if not 0 <= self.min_n <= self.max_n < math.inf:
            raise BadInput(
                "forces 0 ≤ min_n ≤ max_n", f"{self.min_n} N and {self.max_n} N", "order them"
            )
        named = {
            "slew_n_s": self.slew_n_s,
            "expires_s": self.expires_s,
            "watchdog_s": self.watchdog_s,
            "decision_s": self.decision_s,
            "stall_s": self.stall_s,
            "step_s": self.step_s,
            "device_s": self.device_s,
            "contact_ma": 1.0 if self.contact_ma is None else self.contact_ma,
            "over_ma": 1.0 if self.over_ma is None else self.over_ma,
            "current_s": self.current_s,
        }
        for name, value in named.items():
            if not 0 < value < math.inf:
                raise BadInput(f"{name} above 0", f"{value}", "choose another")
        if not 0 <= self.contact_s < math.inf:
            raise BadInput("contact_s of at least 0 s", f"{self.contact_s} s", "choose another")


class Interlock:
    """The state machine drawn above."""

    def __init__(self, config: InterlockConfig) -> None:
        self._config = config
        self._state = InterlockState.DISARMED
        self._reason = "not armed"
        self.disarms = 0
        """How often it was disarmed."""
        self._now_s = -math.inf
        self._woke_s = -math.inf
        self._held_n = config.min_n
        self._decision = "UNKNOWN"
        self._decided_s = -math.inf
        self._target_n = config.max_n
        self._beat_s = -math.inf
        self._device_ok = False
        self._device_s = -math.inf
        self._faults: dict[str, float] = {}
        self._current_s = -math.inf
        self._over = False
        self._contact_since_s: float | None = None
        self._contact = False

    @property
    def config(self) -> InterlockConfig:
        """Limits and times."""
        return self._config

    @property
    def state(self) -> InterlockState:
        """Where it stands."""
        return self._state

    @property
    def armed(self) -> bool:
        """True in READY, RAISED and HOLDING."""
        return self._state in _ARMED

    @property
    def reason(self) -> str:
        """Why it stands there, in words; in STOPPED the first cause."""
        return self._reason

    @property
    def force_n(self) -> float:
        """The force last ordered, newtons."""
        return self._held_n

    def decision(self, state_name: str, decided_s: float, force_n: float | None = None) -> None:
        """Take in the newest decision.

        Args:
            state_name: STABLE, WARNING, UNSTABLE or UNKNOWN; any other word is UNKNOWN.
            decided_s: When it was taken, monotonic seconds: the decision's own time, not that
                of the call, or `decision_s` never finds that decisions have stopped. One
                without a finite time is UNKNOWN, and does not count as one that came.
            force_n: The force that a policy asks for in WARNING or UNSTABLE, newtons, kept
                within the limits; the largest force where it is None or NaN.
        """
        known = state_name in ("STABLE", "WARNING", "UNSTABLE") and math.isfinite(decided_s)
        self._decision = state_name if known else "UNKNOWN"
        self._decided_s = decided_s if math.isfinite(decided_s) else self._decided_s
        config = self._config
        asked = config.max_n if force_n is None or math.isnan(force_n) else force_n
        self._target_n = min(max(asked, config.min_n), config.max_n)

    def beat(self, now_s: float) -> None:
        """Hear from the decision maker: it lives. Times that are not finite are not heard."""
        if math.isfinite(now_s):
            self._beat_s = now_s

    def device(self, ok: bool, now_s: float) -> None:
        """Hear of the actuator: whether it answers and is well."""
        self._device_ok = ok
        self._device_s = now_s if math.isfinite(now_s) else -math.inf
        if not ok:
            self._stop("the actuator is not well")

    def contact_current(self, ma: float, now_s: float) -> None:
        """Hear a motor's current, milliamperes; NaN counts as over-current."""
        config = self._config
        self._current_s = now_s if math.isfinite(now_s) else -math.inf
        size = abs(ma)
        self._over = not size < (math.inf if config.over_ma is None else config.over_ma)
        if self._over:
            self._stop(f"over-current: {size:.0f} mA")
        if config.contact_ma is None:
            return
        if size < config.contact_ma:
            self._contact_since_s, self._contact = None, False
            return
        if self._contact_since_s is None:
            self._contact_since_s = now_s
        if not now_s - self._contact_since_s < config.contact_s - _EXACT_S:
            self._contact = True
            self._stop(f"contact: {size:.0f} mA for {config.contact_s:g} s")

    def fault(self, reason: str, now_s: float) -> None:
        """Hear of a fault; it persists until `fault_gone` names it."""
        self._faults.setdefault(reason, now_s)
        self._stop(reason)

    def fault_gone(self, reason: str) -> None:
        """Hear that a fault is over. STOPPED stays until a person arms again."""
        self._faults.pop(reason, None)

    def release(self, force_n: float) -> bool:
        """Take over the force that the robot's own program grips with; return whether it may.

        The only way down. Refused (False) in WARNING, UNSTABLE, UNKNOWN and STOPPED, where it
        would lower the force, and for a force that is not finite.

        Args:
            force_n: Newtons, kept within the limits.
        """
        if not math.isfinite(force_n):
            return False
        force_n = min(max(force_n, self._config.min_n), self._config.max_n)
        calm = self._state is InterlockState.DISARMED or (
            self._state is InterlockState.READY and self._decision == "STABLE"
        )
        if force_n < self._held_n and not calm:
            return False
        if self._state is InterlockState.STOPPED:
            return False
        self._held_n = force_n
        return True

    def arm(self, now_s: float) -> tuple[str, ...]:
        """Arm, on behalf of a person; return the causes that forbid it, none where it is armed.

        Args:
            now_s: This moment, monotonic seconds.
        """
        causes = self._causes(now_s)
        if causes or self.armed:
            return causes
        self._now_s = now_s
        self._state, self._reason = InterlockState.READY, "armed"
        return ()

    def disarm(self, now_s: float, by: str = "") -> None:
        """Act no more; STOPPED stays STOPPED.

        Where it is not armed this is counted too, once: whoever waits to arm must not do so then.

        Args:
            now_s: This moment, monotonic seconds.
            by: On whose behalf, in words.
        """
        reason = f"disarmed by {by}" if by else "not armed"
        if self._state is InterlockState.STOPPED or (not self.armed and reason == self._reason):
            return
        self._state, self._reason = InterlockState.DISARMED, reason
        self.disarms += 1

    def wake(self, now_s: float) -> float:
        """Look whether ticks stood still; stop where they did while armed.

        `tick` does so itself. Call it first where others are heard before the tick, so that
        the stall and not what it did to them is reported as the cause.

        Args:
            now_s: This moment, monotonic seconds.

        Returns:
            Seconds since the tick before where that is longer than `stall_s`, else 0.
        """
        gap_s = now_s - self._now_s
        if not self._config.stall_s + _EXACT_S < gap_s < math.inf:
            return 0.0
        if self._state is not InterlockState.DISARMED:
            self._woke_s = now_s
            self._stop(f"the program stood still for {gap_s:.2f} s")
        return gap_s

    def tick(self, now_s: float) -> Order:
        """Return what the actuator is to do now.

        Args:
            now_s: This moment, monotonic seconds.
        """
        self.wake(now_s)
        passed_s = now_s - self._now_s if self._now_s > -math.inf else 0.0
        if self.armed:
            causes = self._causes(now_s)
            if causes:
                self._stop(causes[0])
        if self.armed:
            self._follow(now_s, passed_s)
        if math.isfinite(now_s):
            self._now_s = now_s
        return self._order(now_s)

    def _follow(self, now_s: float, passed_s: float) -> None:
        """Go to the state that the newest decision asks for, and raise the force in RAISED."""
        config, decision = self._config, self._decision
        if decision == "STABLE":
            self._state, self._reason = InterlockState.READY, "the grasp is stable"
        elif decision == "UNKNOWN":
            self._state, self._reason = InterlockState.HOLDING, "the state of the grasp is unknown"
        else:
            self._state, self._reason = InterlockState.RAISED, f"the grasp is {decision}"
            step_n = config.slew_n_s * min(max(0.0, passed_s), config.step_s)
            self._held_n = max(self._held_n, min(self._target_n, self._held_n + step_n))

    def _order(self, now_s: float) -> Order:
        # An order without a usable time is never valid: its expiry lies in the past.
        expires_s = now_s + self._config.expires_s if math.isfinite(now_s) else -math.inf
        if self._state is InterlockState.DISARMED:
            return Order(OrderKind.NONE, math.nan, self._reason, expires_s)
        if self._state is InterlockState.STOPPED:
            # Stopping needs no clock: a STOP stays valid whatever the clock says.
            return Order(OrderKind.STOP, self._held_n, self._reason, math.inf)
        kind = OrderKind.GRIP if self._state is InterlockState.RAISED else OrderKind.HOLD
        return Order(kind, self._held_n, self._reason, expires_s)

    def _causes(self, now_s: float) -> tuple[str, ...]:
        """Return what stops at this moment, the most important first."""
        config = self._config
        if not math.isfinite(now_s) or now_s < self._now_s:
            return ("the clock cannot be used",)
        causes = list(self._faults)
        if self._over:
            causes.append("over-current")
        if self._contact:
            causes.append("contact")
        if not self._device_ok:
            causes.append("the actuator is not well")
        elif not self._fresh(self._device_s, now_s, config.device_s):
            causes.append(f"nothing from the actuator for {config.device_s:g} s")
        measured = config.contact_ma is not None or config.over_ma is not None
        if measured and not self._fresh(self._current_s, now_s, config.current_s):
            causes.append(f"no current reading for {config.current_s:g} s")
        if not self._fresh(self._beat_s, now_s, config.watchdog_s):
            causes.append(f"no word from the decision maker for {config.watchdog_s:g} s")
        elif self._decided_s > -math.inf and not self._fresh(
            self._decided_s, now_s, config.decision_s
        ):
            causes.append(f"no decision for {config.decision_s:g} s")
        if 0 <= now_s - self._woke_s < _AWAKE_S:
            causes.append(f"ticks stood still less than {_AWAKE_S:g} s ago")
        return tuple(causes)

    @staticmethod
    def _fresh(then_s: float, now_s: float, limit_s: float) -> bool:
        return -_AHEAD_S <= now_s - then_s <= limit_s + _EXACT_S

    def _stop(self, reason: str) -> None:
        """Trip, where armed; the first cause stays as the reason."""
        if self.armed:
            self._state, self._reason = InterlockState.STOPPED, reason
