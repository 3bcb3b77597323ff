"""A recogniser of camera trials in a process of its own: frames from a ring, verdicts into another.

A trial ends with its mark, a new grasp that a person announces, or the source. Nothing urgent waits
for a verdict: a look at a crop may take a second, so that this process runs behind all monitors.
Knows nothing about what is done with a verdict.

Background of our choices: docs/decisions/0041.
"""

from __future__ import annotations

import math
from pathlib import Path
from time import monotonic

from taxel.bundles.trials import read_trial_bundle
from taxel.decisions.recognition import UNKNOWN
from taxel.decisions.trial_verdict import no_verdict
from taxel.live.frame_loop import ends_trial
from taxel.live.station.packets import Packet, asks, pack
from taxel.live.station.ring import RingWriter
from taxel.live.station.watching import LOOK_S, Came, Inference, Note, number_or_none
from taxel.live.station.worker import Pulse
from taxel.live.trial_watch import TrialAnswer, TrialWatch
from taxel.plain_text import number_of
from taxel.signals import Frame, Mark
from taxel.windows.pairs import FramePairer

_COUNT_S = 0.5
"""How often it is sent how many frames a first crop still needs. Source: our choice,
docs/decisions/0041."""
_BEGAN_ANEW = "this recogniser was started again within the trial"
_LOST = "images of this trial were lost on the way"


class TrialWatcher:
    """A recogniser of camera trials on the ring's frames.

    Args:
        path: Its bundle.
        job: What its process is given.
        writer: Where its answers go.
        number: Of the process's bundles.

    Raises:
        BadBundle: The bundle cannot be read, or was not made for such cameras.
    """

    def __init__(self, path: Path, job: Inference, writer: RingWriter, number: int) -> None:
        bundle = read_trial_bundle(path, job.trust, job.device)
        self._contract = bundle.contract
        self._watch = TrialWatch(bundle, job.cameras, job.least_confidence, self._before_look)
        self._pairer = FramePairer(len(job.cameras))
        self._who, self._writer = f"{job.place.name}/{number}", writer
        self._pulse: Pulse | None = None
        self._lost = 0
        self._in_doubt = _BEGAN_ANEW if job.place.again else ""
        self._trial = 1
        self._before = ""
        """The last trial's verdict, in words."""
        self._shown: tuple[str, int, bool] | None = None
        self._sent_s = -math.inf
        self.what: Note = {
            "kind": "answer", "who": self._who, "bundle": str(path), "of": "trial",
            "target": bundle.contract.target, "classes": list(bundle.contract.classes),
        }  # fmt: skip

    def take(self, packets: list[Packet], came: Came, pulse: Pulse) -> None:
        """Watch what came. Where more waits than half a crop, crops that are over are let go: the
        verdict so far rests on fewer, the one on the whole trial on all its frames.
        """
        self._pulse = pulse
        if pulse.dropped > self._lost:
            self._lost, self._in_doubt = pulse.dropped, _LOST
        waiting = sum(isinstance(packet, Frame) for packet in packets)
        for packet in packets:
            if isinstance(packet, Frame):
                waiting -= 1
                self._show(self._watch.see(packet))
                found = self._pairer.push(packet)
                if found is not None:
                    behind = waiting // len(found.frames) >= self._contract.layout.every
                    self._show(self._watch.push(found, look=not behind))
            elif isinstance(packet, Mark):
                if ends_trial(packet, self._contract.target):
                    self._finish(packet)
            elif asks(packet, "new grasp") or (isinstance(packet, dict) and "ended" in packet):
                self._finish(None)

    def silent(self, now_s: float) -> None:
        """Look at the age of what came last: without a camera nothing is known of the trial. Where
        the station ends, its sources end first: no camera is gone then.
        """
        if self._pulse is None or not self._pulse.stopping:
            self._show(self._watch.at(now_s))

    def end(self) -> None:
        """Give the verdict on the trial under way: nothing more comes."""
        self._finish(None)

    def spoil(self, value: float = float("nan")) -> None:
        """Nothing to spoil: a verdict opens no gripper."""

    def mute(self, on: bool) -> None:
        """Nothing that anybody waits for."""

    def _before_look(self) -> None:
        if self._pulse is not None:
            self._pulse.beat(patience_s=LOOK_S)

    def _finish(self, mark: Mark | None) -> None:
        """Give the verdict on the whole trial; the next frames begin another."""
        answer = self._watch.finish(mark)
        if answer is not None:
            truth = None if mark is None else mark.labels.get(self._contract.target)
            self._send(answer, truth)
        self._shown, self._in_doubt = None, ""
        self._trial += 1

    def _show(self, answer: TrialAnswer | None) -> None:
        """Send a verdict where it is another than the last, or counts on towards a first crop."""
        if answer is None:
            return
        verdict = answer.verdict
        shown = verdict.label, verdict.crops, bool(verdict.reason)
        counts = not verdict.crops and monotonic() - self._sent_s >= _COUNT_S
        if shown != self._shown or counts:
            self._send(answer)
            self._shown = shown

    def _send(self, answer: TrialAnswer, truth: str | None = None) -> None:
        verdict = answer.verdict
        if self._in_doubt:
            verdict = no_verdict(self._contract.classes, self._in_doubt)
        self._sent_s = monotonic()
        sure = number_or_none(verdict.confidence)
        named = verdict.label if sure is None else f"{verdict.label} {sure:.2f}"
        if answer.last:
            of = f"whole trial, {number_of(answer.frames, 'frame')}"
            why = f"; {verdict.reason}" if verdict.label == UNKNOWN and verdict.reason else ""
            self._before = f"{named} ({of}{why})"
        elif verdict.crops:
            of = f"{number_of(verdict.crops, 'crop')} so far"
        else:
            of = f"the trial before: {self._before}" if self._before else ""
        self._writer.put(pack({
            "kind": "answer", "who": self._who, "target": self._contract.target,
            "label": verdict.label, "confidence": sure, "reason": verdict.reason,
            "grasp": verdict.label, "grasp_confidence": sure, "of": of, "last": answer.last,
            "touch": self._trial,
            "truth": truth, "time_s": answer.time_s, "decided_s": self._sent_s,
        }))  # fmt: skip
        if answer.last:
            text = f"{self._contract.target}: {self._before}"
            self._writer.put(pack({"kind": "news", "who": self._who, "text": text}))
