"""A grasp monitor in a process of its own: frames from a ring, decisions into another.

Knows nothing about what is done with a decision.

Background of our choices: docs/decisions/0019.
"""

from __future__ import annotations

import math
import os
from dataclasses import replace
from pathlib import Path
from time import monotonic
from typing import Any

from taxel.bundles.envelope import is_grasp_bundle
from taxel.bundles.grasp import read_grasp_bundle
from taxel.decisions.reasons import kind_of
from taxel.decisions.stability import Stability, StabilityDecision
from taxel.live.station.drill_head import FixedHead
from taxel.live.station.packets import Packet, asks, ends_grasp, pack
from taxel.live.station.ring import RingWriter
from taxel.live.station.watching import AGAIN_S, Came, Inference, Note, number_or_none
from taxel.live.station.worker import Pulse
from taxel.signals import Frame, Mark
from taxel.windows.pairs import FramePairer, FrameSet

BEHIND = 3
"""Sets of frames that may wait: older ones are let go. Source: our choice, 50 ms at 60 Hz."""
_SETTLING_S = 1.0
"""What taking in a new grasp's settled frames at once may take, seconds. Source: our choice."""


class GraspWatcher:
    """A grasp monitor on the ring's frames."""

    def __init__(self, path: Path, job: Inference, writer: RingWriter, number: int) -> None:
        from taxel.live.grasp_monitor import GraspMonitor  # needs the extra of cameras

        threads = min(len(job.cameras), _cores())
        bundle = read_grasp_bundle(path, threads=threads, trust=job.trust, device=job.device)
        self._who = f"{job.place.name}/{number}"
        self._monitor = GraspMonitor(bundle, job.cameras)
        self._pairer = FramePairer(len(job.cameras))
        self._writer = writer
        self._state: Stability | None = None
        self._why: str | None = None
        self._sent_s = -math.inf
        self._mute = False
        self._skipped = 0
        # Two that watch one source hear of the same grasps: the first of them reports each.
        self._reports = not any(map(is_grasp_bundle, job.bundles[:number]))
        stability = bundle.contract.stability
        self._is_score = not bundle.contract.gives_probability
        self.what: Note = {
            "kind": "grasp", "who": self._who, "bundle": str(path), "rule": bundle.contract.rule,
            "clear": stability.clear, "warn": stability.warn, "unstable": stability.unstable,
            "is_score": self._is_score,
        }  # fmt: skip

    def take(self, packets: list[Packet], came: Came, pulse: Pulse) -> None:
        """Watch what came; of many sets the newest few."""
        sets: list[FrameSet] = []
        for packet in packets:
            if isinstance(packet, Frame):
                self._monitor.see(packet)
                found = self._pairer.push(packet)
                if found is not None:
                    sets.append(found)
            elif ends_grasp(packet):
                self._watch(sets, came, pulse)
                sets = []
                self._report_grasp(packet.labels["outcome"])
                self._say(self._monitor.over(packet.end_s, came["taken_s"]), monotonic())
            elif asks(packet, "new grasp"):
                self._watch(sets, came, pulse)
                sets = []
                if packet.get("report", True):
                    self._report_grasp(every=packet.get("all", False))
                self._monitor.reset()
            elif isinstance(packet, Mark) and "reaction" in packet.labels:
                reaction = {"what": packet.labels["reaction"], "time_s": packet.start_s}
                self._writer.put(pack({"kind": "reaction", "who": self._who, **reaction}))
            elif isinstance(packet, dict) and "ended" in packet:
                self._monitor.end()
        self._watch(sets, came, pulse)
        now_s = monotonic()
        if now_s - self._sent_s >= AGAIN_S:  # frames that make no set: one camera is gone
            self.silent(now_s)

    def spoil(self, value: float = float("nan")) -> None:
        """Let the model give one value from now on, NaN by default: a drill."""
        self._monitor.bundle = replace(self._monitor.bundle, head=FixedHead(value))

    def mute(self, on: bool) -> None:
        """Send no decision, and live: a drill."""
        self._mute = on

    def end(self) -> None:
        """A grasp that is not over has no last answer."""

    def silent(self, now_s: float) -> None:
        """Look at the input's age when nothing came; send the state now and then."""
        decision = self._monitor.at(now_s)
        changed = decision.state is not self._state or kind_of(decision.reason) != self._why
        if changed or now_s - self._sent_s >= AGAIN_S:
            self._say(decision, now_s)

    def _report_grasp(self, outcome: str = "", *, every: bool = False) -> None:
        """Send that a new grasp begins here, or everywhere, and what came of the one before."""
        if self._reports:
            who = "" if every else self._who
            self._writer.put(pack({"kind": "new grasp", "outcome": outcome, "who": who}))

    def _say(self, decision: StabilityDecision, now_s: float) -> None:
        """Send a decision that no frames gave, taken now."""
        self._state, self._why = decision.state, kind_of(decision.reason)
        p, times = decision.probability, {"decided_s": now_s}
        self._send(decision.state, decision.reason, decision.since_s, p, times)

    def _watch(self, sets: list[FrameSet], came: Came, pulse: Pulse) -> None:
        self._skipped += max(0, len(sets) - BEHIND)
        for found in sets[-BEHIND:]:
            pulse.beat(patience_s=_SETTLING_S if self._monitor.settling else 0.0)
            began_s = monotonic()
            answer = self._monitor.push(found, began_s, came["taken_s"])
            decision = answer.decision
            if answer.began:
                self._report_grasp()
            self._state, self._why = decision.state, kind_of(decision.reason)
            times: dict[str, Any] = {
                "time_s": found.time_s,
                "arrival_s": max(frame.arrival_s for frame in found.frames),
                **came,
                "began_s": began_s,
                "decided_s": monotonic(),
            }
            if decision.slip is not None:
                times["slip"] = decision.slip.as_dict()
            self._send(decision.state, decision.reason, decision.since_s, answer.probability, times)

    def _send(
        self, state: Stability, reason: str, since_s: float, p: float, times: dict[str, Any]
    ) -> None:
        note: dict[str, Any] = {
            "kind": "grasp", "who": self._who, "state": state.name, "reason": reason,
            "skipped": self._skipped,
            "since_s": number_or_none(since_s), "p": number_or_none(p),
            "is_score": self._is_score, "late": self._monitor.late(),
            **times,
        }  # fmt: skip
        self._sent_s = times["decided_s"]
        if not self._mute:
            self._writer.put(pack(note))


def _cores() -> int:
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else 1
