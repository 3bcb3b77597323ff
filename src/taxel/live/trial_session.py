"""Run a recogniser of camera trials on a source until it ends; keep what a person wants to see.

Knows nothing about screens.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, field
from math import inf
from time import monotonic
from typing import Any

import numpy as np

from taxel.actions.rule_table import RuleTable
from taxel.bundles.trials import TrialBundle
from taxel.decisions.recognition import UNKNOWN
from taxel.live.frame_loop import ends_trial, moments_and_marks
from taxel.live.trial_watch import TrialAnswer, TrialWatch
from taxel.signals import Frame, Mark
from taxel.sources.contract import Source
from taxel.sources.paced_source import PacedSource
from taxel.windows.pairs import FramePairer

_NO_RULES = RuleTable(())
_AFTER_S = 1.0
"""A session of some seconds ends so long after them where cameras are silent. Source: our choice,
docs/decisions/0041."""
_KEPT = 10_000
"""Looks whose times are kept, the latest, so that memory stays constant."""


@dataclass
class TrialTally:
    """What a session has found so far."""

    target: str
    rules: RuleTable = _NO_RULES
    trials: list[dict[str, Any]] = field(default_factory=list)
    """One a trial: verdict, confidence, novelty, reason, action, frames, and the truth if known."""
    looks_s: deque[float] = field(default_factory=lambda: deque(maxlen=_KEPT))
    """Time that each of the latest looks at a crop took, seconds."""
    longest_s: float = 0.0
    """Time that the longest of all looks took, seconds."""

    def looked(self, latency_s: float) -> None:
        """Take in how long a look at a crop took, seconds."""
        self.looks_s.append(latency_s)
        self.longest_s = max(self.longest_s, latency_s)

    def take_in(self, other: TrialTally) -> None:
        """Add what another recording that has ended has shown."""
        self.trials += other.trials
        self.looks_s += other.looks_s
        self.longest_s = max(self.longest_s, other.longest_s)

    def add(self, answer: TrialAnswer, truth: str | None) -> None:
        """Take in a trial's last verdict."""
        verdict = answer.verdict
        self.trials.append(
            {
                "verdict": verdict.label,
                "confidence": verdict.confidence,
                "novelty": verdict.novelty,
                "reason": verdict.reason,
                "action": self.rules.action(self.target, verdict.label, verdict.confidence),
                "frames": answer.frames,
                "truth": truth,
            }
        )

    def summary(self) -> dict[str, Any]:
        """Return the verdicts and times, for printing."""
        marked = [trial for trial in self.trials if trial["truth"] is not None]
        looks_ms = np.array(self.looks_s or [np.nan]) * 1e3
        return {
            "target": self.target,
            "trials": self.trials,
            "marked": len(marked),
            "right": sum(trial["verdict"] == trial["truth"] for trial in marked),
            "unknown": sum(trial["verdict"] == UNKNOWN for trial in self.trials),
            "look_ms_median": float(np.median(looks_ms)),
            "look_ms_max": 1e3 * self.longest_s if self.looks_s else float("nan"),
        }


def run_trial_session(
    source: Source,
    bundle: TrialBundle,
    seconds: float | None = None,
    least_confidence: float = 0.5,
    on_answer: Callable[[TrialAnswer, bool], None] = lambda answer, changed: None,
    rules: RuleTable = _NO_RULES,
    stopped: Callable[[], bool] = lambda: False,
) -> TrialTally:
    """Watch a source until it ends, is stopped, or for some of its seconds; return the tally.

    A mark of a trial ends it (`ends_trial`), and so does the source's end.

    Args:
        source: An open source with cameras.
        bundle: What is recognised.
        seconds: Length on the frames' fitted clock, seconds; None has no end.
        least_confidence: Below this probability the verdict is UNKNOWN, 0…1.
        on_answer: Called with each answer, and True where the verdict or its crops have changed.
        rules: What is to be done about a verdict.
        stopped: True once it shall end early.

    Raises:
        BadBundle: The bundle was not made for such cameras.
    """
    watch = TrialWatch(bundle, source.cameras, least_confidence)
    pairer = FramePairer(len(source.cameras))
    tally = TrialTally(bundle.contract.target, rules)
    before: tuple[str, int, bool] | None = None
    last_s = inf

    def show(answer: TrialAnswer | None) -> None:
        nonlocal before
        if answer is None:
            return
        shown = answer.verdict.label, answer.verdict.crops, bool(answer.verdict.reason)
        on_answer(answer, shown != before)
        before = shown

    def see(frame: Frame) -> None:
        nonlocal last_s
        if last_s == inf and seconds is not None:
            last_s = frame.arrival_s + seconds + _AFTER_S
        show(watch.see(frame))

    def silent() -> bool:
        if isinstance(source, PacedSource):  # its clock is the recording's
            return False
        show(watch.at(monotonic()))
        return monotonic() > last_s

    def finish(mark: Mark | None) -> None:
        nonlocal before
        answer = watch.finish(mark)
        if answer is not None:
            tally.add(answer, None if mark is None else mark.labels.get(tally.target))
            on_answer(answer, True)
        before = None

    for found in moments_and_marks(source, pairer, see, seconds, stopped, silent):
        if isinstance(found, Mark):
            if ends_trial(found, tally.target):
                finish(found)
            continue
        answer = watch.push(found)
        if answer.looked:
            tally.looked(answer.latency_s)
        show(answer)
    finish(None)
    return tally
