"""A station's state: latencies a stage, and the snapshot that the page shows.

Knows nothing about processes.

Background of our choices: docs/decisions/0019.
"""

from __future__ import annotations

import math
from collections import deque
from typing import Any

import numpy as np
from numpy.typing import NDArray

from taxel.actions.alarm import Level
from taxel.decisions.advice import Advice
from taxel.live.station.alarm_watch import stall_words
from taxel.live.station.beats import Beat, Work
from taxel.live.station.guard import NO_GRASP, STALL, STOP, Guard

STAGES = ("capture", "source", "hand over", "wait", "model", "alarm")
"""From the shutter to the host, until the source has put it into its ring, until the monitor has
taken it, until the model begins, until it has decided, until the supervisor has acted."""
_OVERHEAD = ("source", "hand over", "wait", "alarm")
_KEPT = 2000
"""Decisions kept for percentiles. Source: our choice."""
_SILENT_S = 1.0
"""A process without a sign of life for so long, beside the patience that it asked for, is not shown
as running. Source: our choice."""
_WEIGH_S = 1.0
"""How often percentiles are computed. Source: our choice."""
_STALL_KEY = 0
"""Of the alarm that the page itself raises: a supervisor's own keys begin at 1."""


class Latencies:
    """How long the stages of the newest decisions took."""

    def __init__(self) -> None:
        self._ms = {stage: deque[float](maxlen=_KEPT) for stage in STAGES}
        self._weighed: dict[str, list[float]] = {}
        self._weighed_s = -math.inf

    def add(self, note: dict[str, Any], acted_s: float) -> None:
        """Take in a decision's note, if it has times."""
        if "arrival_s" not in note:
            return
        steps = (note["time_s"], note["arrival_s"], note["put_s"], note["taken_s"],
                 note["began_s"], note["decided_s"], acted_s)  # fmt: skip
        for stage, before_s, after_s in zip(STAGES, steps[:-1], steps[1:], strict=True):
            self._ms[stage].append(1000.0 * (after_s - before_s))

    def clear(self) -> None:
        """Forget what was measured, such as a start."""
        for kept in self._ms.values():
            kept.clear()

    def percentiles_ms(self) -> dict[str, list[float]]:
        """Return p50, p95 and p99 of each stage, milliseconds."""
        return {
            stage: [float(p) for p in np.percentile(np.array(kept), (50, 95, 99))]
            for stage, kept in self._ms.items()
            if kept
        }

    def lately_ms(self, now_s: float) -> dict[str, list[float]]:
        """Return the same, computed once a second."""
        if now_s - self._weighed_s > _WEIGH_S:
            self._weighed_s, self._weighed = now_s, self.percentiles_ms()
        return self._weighed

    def overhead_ms(self) -> NDArray[np.float64]:
        """Return what each decision took from the host to the alarm without the model, ms,
        shape (decisions,).
        """
        parts = np.array([self._ms[stage] for stage in _OVERHEAD])
        return np.asarray(parts.sum(axis=0), np.float64)

    def whole_ms(self) -> NDArray[np.float64]:
        """Return what each decision took from the shutter to the alarm, ms, shape (decisions,)."""
        parts = np.array(list(self._ms.values()))
        return np.asarray(parts.sum(axis=0), np.float64)


def guard_snapshot(guard: Guard, now_s: float) -> dict[str, Any]:
    """Return state and alarms as the page's link gives them."""
    word, reason, since_s = guard.shown
    p, score = guard.probability, guard.score
    return {
        "time_s": now_s, "state": word, "reason": reason,
        "since_s": None if word == NO_GRASP else since_s,
        "probability": p if math.isfinite(p) else None,
        "score": score if math.isfinite(score) else None,
        "slip": None if guard.slip is None else guard.slip.as_dict(),
        "alarms": [
            {"key": a.key, "kind": a.kind, "text": a.text, "level": str(a.level),
             "since_s": a.since_s, "acknowledged": a.acknowledged}
            for a in guard.alarms.alarms
        ],
    }  # fmt: skip


def stalled_snapshot(newest: dict[str, Any], still_s: float, now_s: float) -> dict[str, Any]:
    """Return what replaces the newest snapshot while the supervisor stands still.

    Args:
        newest: The newest snapshot, however old.
        still_s: How long ago the supervisor's last tick was, seconds.
        now_s: This moment, monotonic seconds: the page must not take it for stale.
    """
    since_s, text = now_s - still_s, stall_words(still_s)
    alarm = {"key": _STALL_KEY, "kind": STALL, "text": text, "level": str(Level.DANGER),
             "since_s": since_s, "acknowledged": False}  # fmt: skip
    others = [alarm for alarm in newest.get("alarms", []) if alarm["kind"] != STALL]
    return {"time_s": now_s, "state": STOP, "reason": text, "since_s": since_s,
            "alarms": [alarm, *others],
            "do": {"word": Advice.HOLD_STILL.value, "why": text, "since_s": since_s}}  # fmt: skip


def consumer_snapshot(name: str, beat: Beat, now_s: float) -> dict[str, Any]:
    """Return how one process does, as the page's link gives it; "silent" where it hangs."""
    age_s = now_s - beat.beat_s
    hangs = beat.work is Work.RUNNING and age_s > beat.patience_s + _SILENT_S
    return {
        "name": name, "consumed": beat.consumed, "dropped": beat.dropped,
        "produced": beat.produced, "beat_age_s": age_s,
        "state": "silent" if hangs else beat.work.name.lower(),
    }  # fmt: skip
