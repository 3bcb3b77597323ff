"""Alarms for a person: each stays until a person has acknowledged it.

    condition      not acknowledged           acknowledged
    on             "on"                       "acknowledged, still on" (silent, visible)
    gone           "gone, not acknowledged"   leaves the list

An acknowledged alarm whose condition goes and comes back is a new alarm. So is one whose
level rises. Input that is lost while the guard is armed is an alarm of its own, and while an
input alarm's condition holds, `shown` never gives STABLE. The first moments of a grasp, in which
a monitor learns what it looks like at rest, are UNKNOWN without an alarm.

Each grasp has an alarm of its own. What nobody acknowledged of grasps that are over stands beside
it as one line, which counts them: a list of all would hide the one that slips now.

Knows nothing about sound, pages, grippers or where a decision comes from. Not for several
threads at once.
"""

from __future__ import annotations

import math
from collections.abc import Collection
from dataclasses import asdict, dataclass, replace
from enum import StrEnum
from typing import Any

from taxel.decisions.reasons import kind_of
from taxel.decisions.stability import Stability, StabilityDecision

GRASP = "grasp"
"""Kind of the alarm that the grasp slips: WARNING gives a warning, UNSTABLE danger."""
EARLIER = "earlier grasps"
"""Kind of the one alarm that stands for those of grasps that are over and nobody acknowledged."""
INPUT = "input"
"""Kind of the alarm that nothing can be said about the grasp while the guard is armed."""

BEGINNING = ("settling", "window", "evidence")
"""Reasons for UNKNOWN with which each grasp begins."""
BEGINNING_S = 3.0
"""For so long they are no alarm, seconds: a grasp's take 0.6. Source: our choice,
docs/decisions/0031."""


class Level(StrEnum):
    """How bad an alarm is."""

    WARNING = "warning"
    DANGER = "danger"


_WAS = {Level.WARNING: "began to slip", Level.DANGER: "was unstable"}
_RANK = {Level.WARNING: 0, Level.DANGER: 1}


@dataclass(frozen=True, slots=True, kw_only=True)
class Alarm:
    """One alarm as a person sees it."""

    number: int
    """Grows by one with each alarm raised in this run."""
    key: int
    """What it means now, as a person sees it: another number, of this run alone, once it is raised,
    comes on again, gets worse, is about one more grasp or counts one more."""
    kind: str
    """What it is about; at most one alarm a kind."""
    level: Level
    """The worst level since it was raised."""
    text: str
    """Newest words on it."""
    since_s: float
    """When it was raised, seconds."""
    on: bool
    """True while its condition holds."""
    gone_s: float | None = None
    """When its condition last went, seconds; None while it holds."""
    acknowledged_s: float | None = None
    """When a person acknowledged it, seconds."""
    count: int = 1
    """Alarms that it stands for: of `EARLIER`, one a grasp."""
    input: bool = False
    """True for an alarm about lost input: while it is on, nothing may be called stable."""

    @property
    def acknowledged(self) -> bool:
        """True once a person has acknowledged it."""
        return self.acknowledged_s is not None

    @property
    def state(self) -> str:
        """Return its state in words."""
        if self.acknowledged:
            return "acknowledged, still on"
        return "on" if self.on else "gone, not acknowledged"


@dataclass(frozen=True, slots=True, kw_only=True)
class AlarmCounts:
    """What has happened since the start of the run."""

    raised: int = 0
    """Alarms raised; an alarm that comes back or gets worse after acknowledgement counts again."""
    acknowledged: int = 0
    """Alarms acknowledged by a person."""
    waiting: int = 0
    """Alarms that nobody has acknowledged."""
    on: int = 0
    """Alarms in the list whose condition holds."""


class AlarmLatch:
    """The list of alarms."""

    def __init__(self) -> None:
        self._alarms: dict[str, Alarm] = {}
        self._raised = 0
        self._keys = 0
        self._acknowledged = 0
        self._latest_s = 0.0
        self._begun_s: float | None = None
        """When the present beginning of a grasp was first seen, seconds."""
        self._leaving = False
        """True once a new grasp was announced and all that was heard may be of the one before."""

    def set(self, kind: str, level: Level, text: str, now_s: float, input: bool = False) -> Alarm:
        """Say that a condition holds; return its alarm.

        Args:
            kind: What it is about.
            level: How bad it is now.
            text: Words for a person, one line.
            now_s: This moment, monotonic seconds; the last one known where it is not finite,
                since an alarm must not be lost to a broken clock.
            input: True where it means that the input is lost.
        """
        now = self._moment(now_s)
        old = self._alarms.get(kind)
        worse = old is not None and _RANK[level] > _RANK[old.level]
        if old is None or (old.acknowledged and (worse or not old.on)):
            self._raised += 1
            alarm = Alarm(
                number=self._raised,
                key=self._next_key(),
                kind=kind,
                level=level,
                text=text,
                since_s=now,
                on=True,
                input=input,
            )
        else:
            level = level if worse else old.level
            key = self._next_key() if worse or not old.on else old.key
            alarm = replace(old, key=key, level=level, text=text, on=True, gone_s=None, input=input)
        self._alarms[kind] = alarm
        return alarm

    def clear(self, kind: str, now_s: float) -> None:
        """Say that a condition no longer holds; its alarm waits for a person where it must.

        Args:
            kind: What it is about; nothing happens where there is no such alarm.
            now_s: This moment, monotonic seconds.
        """
        now = self._moment(now_s)
        alarm = self._alarms.get(kind)
        if alarm is None or not alarm.on:
            return
        if alarm.acknowledged:
            del self._alarms[kind]
        else:
            self._alarms[kind] = replace(alarm, on=False, gone_s=now)

    def new_grasp(self) -> None:
        """Note that another grasp begins: a condition that alarms again in it is a new alarm."""
        self._leaving = True

    def renew_grasp(self) -> None:
        """Note that one of several grasps begins to alarm or gets worse.

        That somebody acknowledged the alarm of another grasp, or is about to, must not silence
        this one's.
        """
        alarm = self._alarms.get(GRASP)
        if alarm is None:
            return
        if alarm.acknowledged:
            del self._alarms[GRASP]
        else:
            self._alarms[GRASP] = replace(alarm, key=self._next_key())

    def watch(self, decision: StabilityDecision, armed: bool, now_s: float) -> None:
        """Set and clear the alarms GRASP and INPUT by a decision.

        UNKNOWN clears no grasp alarm: silence is no evidence. NO_GRASP does: the grasp that it
        was about has ended, and that somebody acknowledged it must not silence the next one's. So
        does the first calm word after `new_grasp`.

        Args:
            decision: The newest state of the grasp.
            armed: True while something acts on the decision.
            now_s: This moment, monotonic seconds.
        """
        state = decision.state
        if state is Stability.WARNING:
            self.set(GRASP, Level.WARNING, "the grasp begins to slip", now_s)
        elif state is Stability.UNSTABLE:
            self.set(GRASP, Level.DANGER, "the grasp is unstable", now_s)
        elif state is Stability.NO_GRASP or self._leaving:
            self._leaving = False
            self._put_aside(now_s)
        elif state is Stability.STABLE:
            self.clear(GRASP, now_s)
        if state is Stability.UNKNOWN and armed and not self._begins(decision, now_s):
            text = f"no decision: {decision.reason or 'the input is lost'}"
            self.set(INPUT, Level.DANGER, text, now_s, input=True)
        else:
            self.clear(INPUT, now_s)
        if state is not Stability.UNKNOWN:
            self._begun_s = None

    def _put_aside(self, now_s: float) -> None:
        """Count the alarm of a grasp that is over with those before it, unless acknowledged."""
        self.clear(GRASP, now_s)
        alarm, before = self._alarms.pop(GRASP, None), self._alarms.get(EARLIER)
        if alarm is None:
            return
        key, count, level, since_s = alarm.key, 1, alarm.level, alarm.since_s
        if before is not None:
            key, count, since_s = self._next_key(), 1 + before.count, before.since_s
            level = max(level, before.level, key=_RANK.__getitem__)
        text = (
            f"an earlier grasp {_WAS[level]}" if count == 1 else f"{count} earlier grasps alarmed"
        )
        self._alarms[EARLIER] = replace(
            alarm, key=key, kind=EARLIER, level=level, text=f"{text}: not acknowledged",
            since_s=since_s, count=count,
        )  # fmt: skip

    def _begins(self, decision: StabilityDecision, now_s: float) -> bool:
        """True while a grasp's first moments are UNKNOWN, for no longer than they may take."""
        if kind_of(decision.reason) not in BEGINNING:
            self._begun_s = None
            return False
        now = self._moment(now_s)
        if self._begun_s is None:
            self._begun_s = now
        return now - self._begun_s <= BEGINNING_S

    def acknowledge(self, number: int, now_s: float) -> bool:
        """Acknowledge one alarm, on behalf of a person; return whether it was waiting for that.

        A number that has been replaced by a newer alarm acknowledges nothing: a person can
        only acknowledge what they saw.

        Args:
            number: The alarm's `number`.
            now_s: This moment, monotonic seconds.
        """
        now = self._moment(now_s)
        for kind, alarm in self._alarms.items():
            if alarm.number == number and not alarm.acknowledged:
                self._acknowledged += alarm.count
                if alarm.on:
                    self._alarms[kind] = replace(alarm, acknowledged_s=now)
                else:
                    del self._alarms[kind]
                return True
        return False

    def acknowledge_seen(self, seen: Collection[int] | None, now_s: float) -> bool:
        """Acknowledge the alarms that a person saw; return whether no other one waits.

        Args:
            seen: Their keys; of an alarm that has become another since then, the key is no longer
                its own. None for all alarms.
            now_s: This moment, monotonic seconds.
        """
        for alarm in self.alarms:
            if seen is None or alarm.key in seen:
                self.acknowledge(alarm.number, now_s)
        return self.sounding is None

    @property
    def alarms(self) -> tuple[Alarm, ...]:
        """Alarms to show: those that wait for a person first, then the worst, then the newest.

        Those of earlier grasps come after what waits of the present.
        """
        order = sorted(
            self._alarms.values(),
            key=lambda alarm: (
                alarm.acknowledged,
                alarm.kind == EARLIER,
                -_RANK[alarm.level],
                -alarm.number,
            ),
        )
        return tuple(order)

    @property
    def sounding(self) -> Level | None:
        """The worst level that nobody has acknowledged; None where none waits."""
        waiting = [alarm.level for alarm in self._alarms.values() if not alarm.acknowledged]
        return max(waiting, key=_RANK.__getitem__, default=None)

    @property
    def counts(self) -> AlarmCounts:
        """What has happened so far."""
        alarms = self._alarms.values()
        return AlarmCounts(
            raised=self._raised,
            acknowledged=self._acknowledged,
            waiting=sum(alarm.count for alarm in alarms if not alarm.acknowledged),
            on=sum(alarm.on for alarm in alarms),
        )

    def shown(self, state: Stability) -> Stability:
        """Return the state that may be shown: never STABLE while the input is lost."""
        lost = any(alarm.input and alarm.on for alarm in self._alarms.values())
        return Stability.UNKNOWN if lost and state is Stability.STABLE else state

    def as_json(self) -> dict[str, Any]:
        """Return alarms and counts as values that `json.dumps` takes; times in seconds."""
        return {
            "alarms": [{**asdict(alarm), "state": alarm.state} for alarm in self.alarms],
            "sounding": self.sounding,
            "counts": asdict(self.counts),
        }

    def _next_key(self) -> int:
        self._keys += 1
        return self._keys

    def _moment(self, now_s: float) -> float:
        if math.isfinite(now_s):
            self._latest_s = now_s
        return self._latest_s
