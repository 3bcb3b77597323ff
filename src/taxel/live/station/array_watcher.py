"""A recogniser in a process of its own: an array's scans from a ring, answers into another.

Knows nothing about what is done with an answer.

Background of our choices: docs/decisions/0019.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from time import monotonic

from taxel.bundles.reader import read_bundle
from taxel.decisions.recognition import RecogniseConfig
from taxel.decisions.still_channels import StillChannel
from taxel.decisions.value_scale import OtherScale
from taxel.live.outages import Outage, OutageWatch
from taxel.live.rate_watch import RateChange
from taxel.live.recogniser import Answer, Recogniser
from taxel.live.station.packets import Packet, asks, ends_grasp, pack
from taxel.live.station.ring import RingWriter
from taxel.live.station.watching import Came, Inference, Note, number_or_none
from taxel.live.station.worker import Pulse
from taxel.signals import Samples
from taxel.windows.following import GateMove

_WAITING_S = 1.0
"""How often it is looked at what a first window waits for, seconds. Source: our choice."""
_MOST_KEPT = 4096
"""Channels of which a level is sent: more would not fit a ring of notes. Source: our choice."""


class ArrayWatcher:
    """A recogniser on the ring's scans."""

    def __init__(self, path: Path, job: Inference, writer: RingWriter, number: int) -> None:
        bundle = read_bundle(path, trust=job.trust, device=job.device)
        self._who = f"{job.place.name}/{number}"
        config = RecogniseConfig(least_confidence=job.least_confidence)
        self._recogniser = Recogniser(bundle, job.sensor, config)
        if self._who in job.levels:
            self._recogniser.resume_level(job.levels[self._who])
        self._touches = self._recogniser.touches
        contract = bundle.contract
        self._vote = self._recogniser.new_vote()
        self._began_s = monotonic()  # who follows a dead process counts contacts anew
        self._outages = OutageWatch(contract.window.max_gap_s)
        self._waiting, self._waited_s = "", -math.inf
        self._target, self._padded = contract.target, contract.window.pad
        self._writer = writer
        self.what: Note = {"kind": "answer", "who": self._who, "bundle": str(path),
                     "target": contract.target, "classes": list(contract.classes)}  # fmt: skip

    def take(self, packets: list[Packet], came: Came, pulse: Pulse) -> None:
        """Answer each window that the scans complete."""
        scans = [packet for packet in packets if isinstance(packet, Samples)]
        newest_s = float(scans[-1].arrival_s[-1]) if scans else math.nan
        for packet in packets:
            # A padded window of a grasp comes after its mark, and is still of that contact.
            if (ends_grasp(packet) and not self._padded) or asks(packet, "new grasp"):
                self._vote.over()
                self._recogniser.new_touch()
            if not isinstance(packet, Samples):
                continue
            pulse.beat()
            arrival_s = float(packet.arrival_s[-1])
            behind_s = max(0.0, newest_s - arrival_s)  # all of a ring may wait, minutes of scans
            times = {"arrival_s": arrival_s, **came, "began_s": monotonic()}
            if math.isfinite(behind_s):
                times["as_of_s"] = came["put_s"] - behind_s
            for answer in self._recogniser.push(packet):
                self._send(answer, times)
            self._say(self._recogniser.gate_moves())
            self._say(self._recogniser.still_channels())
            self._say(self._recogniser.other_scales())
            self._say(self._recogniser.rate_changes())
        self._keep_level()

    def _keep_level(self) -> None:
        """Send where the level stands after each touch: a process that follows goes on from it."""
        if self._recogniser.touches == self._touches:
            return
        self._touches = self._recogniser.touches
        state, now = self._recogniser.level_state(), self._recogniser.level()
        if state is not None and now is not None and len(state["level"]) <= _MOST_KEPT:
            note = {"kind": "level", "who": self._who, "state": state, "text": now.words()}
            self._writer.put(pack(note))

    def end(self) -> None:
        """Answer the stream's last, padded window, if there is one."""
        for answer in self._recogniser.flush():
            self._send(answer, {})
        self._say(self._recogniser.still_channels())
        self._say(self._recogniser.other_scales())
        if why := self._recogniser.untouched():
            self._put_news(why)

    def _say(
        self, news: Sequence[GateMove | StillChannel | Outage | OtherScale | RateChange]
    ) -> None:
        """Send news of channels, for the log and the page."""
        for item in news:
            self._put_news(item.words())

    def _put_news(self, words: str) -> None:
        text = f"{self._target}: {words}"
        self._writer.put(pack({"kind": "news", "who": self._who, "text": text}))

    def _send(self, answer: Answer, times: dict[str, float]) -> None:
        decision = answer.decision
        voted, confidence = self._vote.add(decision)
        if (outage := self._outages.look(decision)) is not None:
            self._say([outage])
        note = {
            "kind": "answer", "who": self._who, "target": self._target, "label": decision.label,
            "confidence": number_or_none(decision.confidence), "reason": decision.reason,
            "grasp": voted, "grasp_confidence": number_or_none(confidence),
            "touch": [self._began_s, self._vote.contacts],
            "time_s": decision.end_s, **times, "decided_s": monotonic(),
        }  # fmt: skip
        self._writer.put(pack(note))

    def spoil(self, value: float = float("nan")) -> None:
        """Nothing to spoil: an answer opens no gripper."""

    def mute(self, on: bool) -> None:
        """Nothing that anybody waits for."""

    def silent(self, now_s: float) -> None:
        """Say what the first window waits for; a hand that touches nothing says nothing."""
        if now_s - self._waited_s < _WAITING_S:
            return
        self._waited_s = now_s
        words = self._recogniser.waiting()
        if words != self._waiting:
            self._waiting = words
            self._writer.put(pack({"kind": "waiting", "who": self._who, "text": words}))
