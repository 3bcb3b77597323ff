"""Run a grasp monitor on a source until it ends; keep the counts that a person wants to see.

Knows nothing about screens.
"""

from __future__ import annotations

from collections import Counter, deque
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from taxel.bundles.grasp import GraspBundle
from taxel.decisions.reasons import kind_of
from taxel.decisions.stability import Stability, StabilityConfig
from taxel.gel.slip_signal import Slip
from taxel.live.frame_loop import ends_grasp, moments_and_marks
from taxel.live.grasp_monitor import GraspAnswer, GraspMonitor
from taxel.signals import Mark
from taxel.sources.contract import Source
from taxel.windows.pairs import FramePairer

_KEPT = 10_000
"""Latencies kept for the summary: the last three minutes at 60 frames a second."""


@dataclass
class GraspTally:
    """What a session has found so far."""

    moments: int = 0
    states: Counter[str] = field(default_factory=Counter)
    """State → moments."""
    latencies_s: deque[float] = field(default_factory=lambda: deque(maxlen=_KEPT))
    alarms: int = 0
    """Grasps in which the state went to WARNING or UNSTABLE."""
    grasps: list[dict[str, Any]] = field(default_factory=list)
    """One entry a grasp whose outcome the source marked: outcome, first alarm (s)."""
    starts: list[float] = field(default_factory=list)
    """When grasps were found to begin, seconds since the first frame, where cameras ask for it."""
    dropped: int = 0
    """Frames that found no partner."""
    slip: Slip | None = None
    """The newest; None where the bundle does not follow slip."""
    largest_slip_mm: float | None = None
    """In the grasp that slipped furthest."""

    def add(self, answer: GraspAnswer) -> None:
        """Take in one moment's answer."""
        self.moments += 1
        self.states[answer.decision.state.name] += 1
        self.latencies_s.append(answer.latency_s)
        slip = answer.decision.slip
        if slip is not None and slip.seen:
            self.slip = slip
            self.largest_slip_mm = max(self.largest_slip_mm or 0.0, slip.distance_mm)

    def summary(self) -> dict[str, Any]:
        """Return the counts and latencies, for printing."""
        latencies = np.array(self.latencies_s or [np.nan]) * 1e3
        return {
            "moments": self.moments,
            "states": dict(self.states.most_common()),
            "alarms": self.alarms,
            "grasps": self.grasps,
            "starts": self.starts,
            "frames_without_partner": self.dropped,
            "slip": None if self.slip is None else self.slip.as_dict(),
            "largest_slip_mm": self.largest_slip_mm,
            "latency_ms_median": float(np.median(latencies)),
            "latency_ms_p99": float(np.percentile(latencies, 99)),
        }


@dataclass
class _Alarm:
    """Successive moments of a warning: when the first and the last of them were taken, seconds."""

    first_s: float
    last_s: float


def run_grasp_session(
    source: Source,
    bundle: GraspBundle,
    seconds: float | None = None,
    config: StabilityConfig | None = None,
    on_answer: Callable[[GraspAnswer, bool], None] | None = None,
    stopped: Callable[[], bool] = lambda: False,
) -> GraspTally:
    """Watch a source until it ends, is stopped, or for some of its seconds; return the tally.

    A mark with an outcome ends a grasp: the next frames are a new one's settled first moments.

    Args:
        source: An open source with cameras.
        bundle: Features, head and thresholds.
        seconds: Length on the frames' fitted clock, seconds; None has no end. Frames and marks
            beyond it are left out, however many a read gives at once.
        config: Thresholds in place of the bundle's.
        on_answer: Called with each answer, and True where the state, or why it is so, has changed.
        stopped: True once it shall end early.

    Raises:
        BadBundle: The bundle was not made for such cameras.
    """
    monitor = GraspMonitor(bundle, source.cameras, config)
    pairer = FramePairer(len(source.cameras))
    tally = GraspTally()
    before: tuple[Stability, str | None] | None = None
    begin_s: float | None = None
    alarms: deque[_Alarm] = deque(maxlen=_KEPT)  # since the last mark
    alarmed = counted = False
    for found in moments_and_marks(source, pairer, monitor.see, seconds, stopped):
        if isinstance(found, Mark):
            if not ends_grasp(found):
                continue
            tally.grasps.append(_outcome(found, alarms))
            gone = monitor.over(found.end_s)
            alarms.clear()
            alarmed = counted = False
            if on_answer is not None:
                on_answer(GraspAnswer(gone, float("nan"), found.end_s, 0.0, (), False), True)
            before = gone.state, kind_of(gone.reason)
            continue
        answer = monitor.push(found)
        begin_s = found.time_s if begin_s is None else begin_s
        if answer.began:
            tally.starts.append(round(found.time_s - begin_s, 3))
            counted = False
        shown = answer.decision.state, kind_of(answer.decision.reason)
        tally.add(answer)
        if answer.decision.alarm:
            if not alarmed:
                alarms.append(_Alarm(answer.time_s, answer.time_s))
            alarms[-1].last_s = answer.time_s
            tally.alarms += not counted
            counted = True
        alarmed = answer.decision.alarm
        if on_answer is not None:
            on_answer(answer, shown != before)
        before = shown
    tally.dropped = pairer.dropped
    return tally


def _outcome(mark: Mark, alarms: Iterable[_Alarm]) -> dict[str, Any]:
    inside = (alarm for alarm in alarms if mark.start_s <= alarm.last_s)
    first = next(inside, None)
    after_s = None if first is None else max(0.0, first.first_s - mark.start_s)
    return {"outcome": mark.labels.get("outcome", ""), "first_alarm_s": after_s, **mark.groups}
