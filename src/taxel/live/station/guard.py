"""What the supervisor makes of decisions and signs of life: the state shown, alarms, orders.

Runs on times passed in, without processes, so that each rule can be tested. Knows nothing
about rings, pages or drivers.

Background of our choices: docs/decisions/0030.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from typing import Any

from taxel.actions.alarm import AlarmLatch, Level
from taxel.actions.grip_policy import GripPolicy
from taxel.actions.interlock import Interlock, InterlockState, Order
from taxel.decisions.reasons import REASONS, in_words
from taxel.decisions.stability import Stability, StabilityDecision
from taxel.gel.slip_signal import Slip

STOP = "STOP"
"""Shown when the monitor itself is not to be trusted, or the interlock has stopped."""
NO_GRASP = "NONE"
"""Shown where nothing watches a grasp."""
_LEAST_N = 0.1
"""A policy begins above nothing, newtons. Source: our choice."""
_FAULT = "the monitor is silent"
STALL = "supervisor"
"""Kind of the alarm that the supervisor itself stood still."""
_LEVELS = {Stability.WARNING: 1, Stability.UNSTABLE: 2}
_WORST = (
    Stability.STABLE, Stability.NO_GRASP, Stability.UNKNOWN, Stability.WARNING, Stability.UNSTABLE,
)  # fmt: skip


@dataclass(frozen=True, slots=True, kw_only=True)
class GuardConfig:
    """Times. Source: our choice, docs/decisions/0019 and 0030."""

    silent_s: float = 0.06
    """A monitor that gave no sign of life for longer is stopped or hangs, seconds: with the
    supervisor's tick it keeps the limit of 70 ms."""


@dataclass(slots=True)
class _Monitor:
    """One grasp monitor as last heard."""

    decision: StabilityDecision
    decided_s: float
    """When that was decided, by the monitor's own word, monotonic seconds."""
    beat_s: float
    patience_s: float = 0.0
    dead: bool = False
    """Its process has ended."""


class Guard:
    """Joins all grasp monitors into one state, the alarms and the interlock's orders.

    Args:
        interlock: Before the actuator.
        config: Times.
        policy: From decisions to the force asked for, a twin for each monitor; the interlock's
            largest without one.
    """

    def __init__(
        self,
        interlock: Interlock,
        config: GuardConfig | None = None,
        policy: GripPolicy | None = None,
    ) -> None:
        self.interlock = interlock
        self._policy = policy
        self._policies: dict[str, GripPolicy] = {}
        self.alarms = AlarmLatch()
        self._config = config or GuardConfig()
        self._monitors: dict[str, _Monitor] = {}
        self._weighed_last: dict[str, StabilityDecision] = {}
        self._levels: dict[str, int] = {}
        """Process of monitors, which watches one grasp → how bad that grasp was since it was calm:
        0, 1 warned, 2 unstable."""
        self._begun: set[str] = set()
        """Those whose next grasp was announced, while all that was heard may be of the one
        before."""
        self._shown = (NO_GRASP, "", 0.0)
        self._doubt = ""
        self._decision = StabilityDecision(
            Stability.UNKNOWN, REASONS["no input"].say(), math.nan, math.nan
        )
        self._set_n = interlock.force_n
        self._stalled = False
        self._looked_s = -math.inf
        self._asleep_s: float | None = None

    def expect(self, name: str, now_s: float) -> None:
        """Watch a monitor from now on, also one that follows a dead one."""
        reason = REASONS["no input"].say()
        nothing = StabilityDecision(Stability.UNKNOWN, reason, now_s, math.nan)
        self._monitors[name] = _Monitor(nothing, now_s, now_s)

    def new_grasp(self, who: str = "") -> None:
        """Begin another grasp, at the force that is set now, with alarms of its own.

        Args:
            who: The monitor of that grasp; empty for every grasp.
        """
        self.alarms.new_grasp()
        self._begun.update(map(_process, (who,) if who else self._monitors))
        self.begin_raises()

    def begin_raises(self) -> None:
        """Let this grasp's raises begin at the force that is set now."""
        self._begin_at(self.interlock.force_n)

    def decide(self, name: str, note: dict[str, Any]) -> None:
        """Take in a monitor's newest note.

        Its `decided_s` is the decision's own time, monotonic seconds: a decision without one is
        none, and does not keep the monitor's word alive.
        """
        monitor = self._monitors[name]
        decided_s = note.get("decided_s")
        if not isinstance(decided_s, int | float) or not monitor.decided_s <= decided_s < math.inf:
            return
        p, since_s = note.get("p"), note.get("since_s")
        reason = str(note.get("reason", ""))
        try:
            state = Stability[note["state"]]
        except KeyError:
            state, reason = Stability.UNKNOWN, REASONS["no word"].say()
        monitor.decided_s = float(decided_s)
        monitor.decision = StabilityDecision(
            state,
            reason,
            math.nan if since_s is None else float(since_s),
            math.nan if p is None else float(p),
            _slip_of(note),
            note.get("is_score") is True,
        )

    def beat(self, name: str, beat_s: float, patience_s: float = 0.0) -> None:
        """Take in when a monitor last gave a sign of life, and what patience it asks for.

        Args:
            name: The monitor.
            beat_s: Monotonic seconds.
            patience_s: Of its present step, seconds.
        """
        monitor = self._monitors[name]
        if beat_s >= monitor.beat_s:
            monitor.beat_s, monitor.patience_s = beat_s, patience_s

    def died(self, name: str) -> None:
        """Hear that a monitor's process has ended."""
        self._monitors[name].dead = True

    def trouble(self, kind: str, text: str, now_s: float, *, danger: bool = True) -> None:
        """Raise an alarm that is not about the grasp, such as a full disk."""
        self.alarms.set(kind, Level.DANGER if danger else Level.WARNING, text, now_s)

    def over(self, kind: str, now_s: float) -> None:
        """Say that such trouble is over; its alarm waits for a person."""
        self.alarms.clear(kind, now_s)

    def wake(self, now_s: float) -> str:
        """Look whether the supervisor itself stood still; call it first in each turn.

        Returns:
            What happened, in words; empty where nothing did.
        """
        if now_s == self._looked_s:
            return ""
        self._looked_s = now_s
        if self._stalled:
            self._stalled = False
            self.alarms.clear(STALL, now_s)
        gap_s = self.interlock.wake(now_s)
        if not gap_s:
            return ""
        self._stalled = True
        text = f"the supervisor stood still for {gap_s:.2f} s: nobody watched the grasp"
        self.alarms.set(STALL, Level.DANGER, text, now_s)
        return text

    def slept(self, asleep_s: float, now_s: float) -> str:
        """Look whether the machine slept since the last look: its clock stood still, no tick is
        missing, and nobody watched the grasp. Call it in each turn, after `wake`.

        Args:
            asleep_s: How long it has slept since its start, seconds.
            now_s: This moment, monotonic seconds.

        Returns:
            What happened, in words; empty where nothing did.
        """
        before_s = asleep_s if self._asleep_s is None else self._asleep_s
        self._asleep_s = max(before_s, asleep_s)
        if not asleep_s - before_s > self.interlock.config.stall_s:
            return ""
        self._stalled = True
        text = f"the machine slept for {asleep_s - before_s:.1f} s: nobody watched the grasp"
        self.alarms.set(STALL, Level.DANGER, text, now_s)
        self.interlock.fault(text, now_s)
        self.interlock.fault_gone(text)
        return text

    def tick(self, now_s: float) -> Order:
        """Weigh what was heard; return what the actuator is to do now."""
        self.wake(now_s)
        silent = self._silent(now_s)
        if self._monitors:
            every, decided_s = self._weighed(silent, now_s)
            self._weighed_last = every
            decision = self._decision = replace(_worst_of(every.values()), slip=self.slip)
            if self._worsens(every):
                self.alarms.renew_grasp()
            self.alarms.watch(decision, armed=self.interlock.armed, now_s=now_s)
            force_n = self._asked_n(every, now_s)
            self.interlock.decision(decision.state.name, decided_s, force_n)
            self._alarm_of_silence(silent, now_s)
            if not silent:
                self.interlock.beat(now_s)
        else:
            self.interlock.beat(now_s)
        order = self.interlock.tick(now_s)
        self._show(silent, now_s)
        return order

    @property
    def shown(self) -> tuple[str, str, float]:
        """The state in one word, why, and since when (monotonic seconds)."""
        return self._shown

    @property
    def decision(self) -> StabilityDecision:
        """All monitors' decisions as one, as of the last tick."""
        return self._decision

    def state_of(self, names: Iterable[str]) -> Stability:
        """Return the worst state of some monitors, as of the last tick."""
        return _worst_of([self._weighed_last[name] for name in names]).state

    @property
    def probability(self) -> float:
        """The largest probability of instability that a monitor gave; NaN without any."""
        return self._largest(is_score=False)

    @property
    def score(self) -> float:
        """The largest score of a monitor that gives no probability; NaN without any."""
        return self._largest(is_score=True)

    @property
    def slip(self) -> Slip | None:
        """The largest slip that a monitor gave; None where none follows it."""
        found = [m.decision.slip for m in self._monitors.values() if m.decision.slip is not None]
        return max(found, key=lambda slip: (slip.seen, slip.distance_mm), default=None)

    def _largest(self, *, is_score: bool) -> float:
        decisions = [monitor.decision for monitor in self._monitors.values()]
        found = [d.probability for d in decisions if d.is_score is is_score]
        return max((p for p in found if math.isfinite(p)), default=math.nan)

    def _asked_n(self, every: Mapping[str, StabilityDecision], now_s: float) -> float | None:
        """Return the largest force that any monitor's policy asks for.

        Each follows its own monitor's slip, and all begin at the force that is set.
        """
        set_n = self.interlock.force_n
        lowered, self._set_n = set_n < self._set_n, set_n
        if self._policy is None:
            return None
        if not self.interlock.armed or lowered:
            # Lowered: the robot's own program took over with less, and raises begin there.
            self._begin_at(set_n)
        if not self.interlock.armed:
            return None
        asked_n = set_n
        for name, decision in every.items():
            policy = self._policies.setdefault(name, self._policy.twin())
            policy.force_n = max(policy.force_n, set_n)
            asked_n = max(asked_n, policy.push(decision, now_s))
        return asked_n

    def _begin_at(self, force_n: float) -> None:
        if self._policy is not None:
            for policy in (self._policy, *self._policies.values()):
                policy.reset(max(force_n, _LEAST_N))

    def _silent(self, now_s: float) -> str:
        for name, monitor in self._monitors.items():
            who = in_words(name)
            if monitor.dead:
                return REASONS["monitor ended"].say(who=who)
            limit_s = max(self._config.silent_s, monitor.patience_s)
            silent_s = now_s - monitor.beat_s
            if not silent_s <= limit_s:
                return REASONS["monitor silent"].say(who=who, silent_s=silent_s)
            if self._overdue(monitor, now_s, monitor.patience_s):
                return REASONS["monitor mute"].say(who=who)
        return ""

    def _overdue(self, monitor: _Monitor, now_s: float, patience_s: float = 0.0) -> bool:
        """True where a monitor's last decision is too old, or from too far ahead, to act on."""
        config = self.interlock.config
        age_s = now_s - monitor.decided_s
        return not -config.stall_s <= age_s <= config.decision_s + patience_s

    def _weighed(self, silent: str, now_s: float) -> tuple[dict[str, StabilityDecision], float]:
        """Return what counts of each monitor, and when the oldest of it was decided.

        For a monitor in a long step that it announced, and where any is silent, the guard itself
        says UNKNOWN, now.
        """
        every, oldest_s = {}, now_s
        for name, monitor in self._monitors.items():
            doubt = silent
            if not silent and self._overdue(monitor, now_s):
                doubt = REASONS["long step"].say(who=in_words(name))
            if doubt:
                every[name] = StabilityDecision(Stability.UNKNOWN, doubt, now_s, math.nan)
            else:
                every[name] = monitor.decision
                oldest_s = min(oldest_s, monitor.decided_s)
        return every, oldest_s

    def _worsens(self, every: Mapping[str, StabilityDecision]) -> bool:
        """Return whether any of the grasps begins to alarm, or gets worse.

        Joined with another grasp that alarms already, it would not be seen to.
        """
        grasps: dict[str, list[StabilityDecision]] = {}
        for who, decision in every.items():
            grasps.setdefault(_process(who), []).append(decision)
        worsens = False
        for name, decisions in grasps.items():
            state, before = _worst_of(decisions).state, self._levels.get(name, 0)
            level = _LEVELS.get(state, 0)
            if state in (Stability.STABLE, Stability.NO_GRASP) or (
                name in self._begun and not level
            ):
                self._begun.discard(name)
                self._levels[name] = 0
            else:  # silence is no evidence of calm
                self._levels[name] = max(before, level)
            worsens = worsens or self._levels[name] > before
        return worsens

    def _alarm_of_silence(self, silent: str, now_s: float) -> None:
        if silent and not self._doubt:
            self.alarms.set("monitor", Level.DANGER, silent, now_s, input=True)
            self.interlock.fault(_FAULT, now_s)
        elif self._doubt and not silent:
            self.alarms.clear("monitor", now_s)
            self.interlock.fault_gone(_FAULT)
        self._doubt = silent

    def _show(self, silent: str, now_s: float) -> None:
        if not self._monitors:
            word, reason = NO_GRASP, ""
        elif silent:
            word, reason = STOP, silent
        elif self.interlock.state is InterlockState.STOPPED:
            word, reason = STOP, self.interlock.reason
        else:
            decision = self._decision
            shown, reason = self.alarms.shown(decision.state), decision.reason
            word = shown.word
            if shown is not decision.state:
                reason = REASONS["alarm"].say()
        since_s = self._shown[2] if word == self._shown[0] else now_s
        self._shown = (word, reason, since_s)


def _process(who: str) -> str:
    """Return the name of a monitor's process, which watches one grasp."""
    return who.partition("/")[0]


def _worst_of(decisions: Iterable[StabilityDecision]) -> StabilityDecision:
    return max(decisions, key=lambda decision: _WORST.index(decision.state))


def _slip_of(note: dict[str, Any]) -> Slip | None:
    """Return the slip in a monitor's note; None where it has none that can be read."""
    try:
        return Slip.from_dict(note["slip"])
    except (KeyError, TypeError, ValueError):
        return None
