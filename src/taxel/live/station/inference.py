"""The process that turns one source's ring into decisions.

When it falls behind it goes on with the newest frames. Knows nothing about what is done with
a decision.

Background of our choices: docs/decisions/0019.
"""

from __future__ import annotations

import math
import os
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from time import monotonic
from typing import Any

from taxel.bundles.envelope import checksum_of, is_grasp_bundle
from taxel.bundles.grasp import read_grasp_bundle
from taxel.bundles.reader import read_bundle
from taxel.bundles.signing import Trust
from taxel.decisions.reasons import kind_of
from taxel.decisions.recognition import RecogniseConfig
from taxel.decisions.stability import Stability, StabilityDecision
from taxel.decisions.still_channels import StillChannel
from taxel.decisions.value_scale import OtherScale
from taxel.errors import BadBundle
from taxel.live.outages import Outage, OutageWatch
from taxel.live.rate_watch import RateChange
from taxel.live.recogniser import Answer, Recogniser
from taxel.live.station.beats import Work
from taxel.live.station.drill_head import FixedHead
from taxel.live.station.packets import Packet, asks, ends_grasp, pack, unpack
from taxel.live.station.ring import RingReader, RingWriter
from taxel.live.station.worker import Place, Pulse, Rank, at_work, settle_memory
from taxel.models.devices import CPU
from taxel.signals import CameraInfo, Frame, Mark, Samples, SensorInfo
from taxel.windows.following import GateMove
from taxel.windows.pairs import FramePairer, FrameSet

BEHIND = 3
"""Sets of frames that may wait: older ones are let go. Source: our choice, 50 ms at 60 Hz."""
_SETTLING_S = 1.0
"""What taking in a new grasp's settled frames at once may take, seconds. Source: our choice."""
_AGAIN_S = 0.1
"""How often a state that no new frames give is sent again, seconds: its reason says how long, and
a decision lives for 0.3 s. Source: our choice, docs/decisions/0030."""
_WAITING_S = 1.0
"""How often it is looked at what a first window waits for, seconds. Source: our choice."""
_MOST_KEPT = 4096
"""Channels of which a level is sent: more would not fit a ring of notes. Source: our choice."""
_LOOK_S = 0.005
"""How often a silent input is looked at: its age makes the state UNKNOWN."""
_Came = dict[str, float]
"""When the newest message was put into the ring, and when it was taken out, monotonic seconds."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Inference:
    """Bundles, one source's ring, and where the decisions go."""

    place: Place
    bundles: tuple[Path, ...]
    checksums: tuple[str, ...] = ()
    """Of the bundles as the station began with them; any others are refused. Empty: not known."""
    sensor: SensorInfo
    cameras: tuple[CameraInfo, ...]
    ring: str
    """The source's."""
    source_row: int
    """The source's beats."""
    decisions: str
    """Ring of notes."""
    least_confidence: float = 0.5
    orders: str = ""
    """Ring of notes from the supervisor, such as {"do": "new grasp"}."""
    drill: bool = False
    """Obey orders to go wrong on purpose, as `taxel bench faults` gives them."""
    trust: Trust | None = None
    """Keys of which one must have signed each bundle; any bundle unless given."""
    device: str = CPU
    """On which ONNX Runtime runs the bundles."""
    levels: dict[str, dict[str, Any]] = field(default_factory=dict)
    """Recogniser → where its session's level stood when its process died."""


def infer(job: Inference) -> None:
    """Decide until asked to end; the entry point of the process."""
    with (
        at_work(job.place, urgent=Rank.MODEL) as pulse,
        RingReader(job.ring) as reader,
        RingReader(job.orders) as orders,
        RingWriter(job.decisions) as writer,
    ):
        watchers = [_watcher(path, job, writer, i) for i, path in enumerate(job.bundles)]
        pulse.report("opened", [watcher.what for watcher in watchers])
        settle_memory()
        looked_s = monotonic()
        while True:
            pulse.beat()
            content = reader.take()
            if not content and not orders.waiting:
                source = pulse.work_of(job.source_row)
                if pulse.stopping and (pulse.orphaned or source in (Work.ENDED, Work.FAILED)):
                    for watcher in watchers:
                        watcher.end()
                    pulse.produced = writer.written
                    break
                if not reader.wait(_LOOK_S):
                    looked_s = _look(watchers)
                continue
            came = {"put_s": reader.put_s, "taken_s": monotonic()}
            packets = [unpack(packed) for packed in content]
            packets += _orders(orders, job.drill, watchers)
            for watcher in watchers:
                watcher.take(packets, came, pulse)
            pulse.produced, pulse.consumed = writer.written, reader.taken
            pulse.dropped = reader.lost
            # Scans may come on and on while a camera is gone.
            if not reader.waiting and monotonic() - looked_s >= _LOOK_S:
                looked_s = _look(watchers)


class _GraspWatcher:
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
        self.what = {
            "kind": "grasp", "who": self._who, "bundle": str(path), "rule": bundle.contract.rule,
            "clear": stability.clear, "warn": stability.warn, "unstable": stability.unstable,
            "is_score": self._is_score,
        }  # fmt: skip

    def take(self, packets: list[Packet], came: _Came, pulse: Pulse) -> None:
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
        if now_s - self._sent_s >= _AGAIN_S:  # frames that make no set: one camera is gone
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
        if changed or now_s - self._sent_s >= _AGAIN_S:
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

    def _watch(self, sets: list[FrameSet], came: _Came, pulse: Pulse) -> None:
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
            "since_s": _number(since_s), "p": _number(p),
            "is_score": self._is_score, "late": self._monitor.late(),
            **times,
        }  # fmt: skip
        self._sent_s = times["decided_s"]
        if not self._mute:
            self._writer.put(pack(note))


class _RecogniseWatcher:
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
        self._outages = OutageWatch(contract.window.max_gap_s)
        self._waiting, self._waited_s = "", -math.inf
        self._target, self._padded = contract.target, contract.window.pad
        self._writer = writer
        self.what = {"kind": "answer", "who": self._who, "bundle": str(path),
                     "target": contract.target, "classes": list(contract.classes)}  # fmt: skip

    def take(self, packets: list[Packet], came: _Came, pulse: Pulse) -> None:
        """Answer each window that the scans complete."""
        for packet in packets:
            # A padded window of a grasp comes after its mark, and is still of that contact.
            if (ends_grasp(packet) and not self._padded) or asks(packet, "new grasp"):
                self._vote.over()
                self._recogniser.new_touch()
            if not isinstance(packet, Samples):
                continue
            pulse.beat()
            times = {"arrival_s": float(packet.arrival_s[-1]), **came, "began_s": monotonic()}
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
            "confidence": _number(decision.confidence), "reason": decision.reason,
            "grasp": voted, "grasp_confidence": _number(confidence),
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


_Watcher = _GraspWatcher | _RecogniseWatcher


def _watcher(path: Path, job: Inference, writer: RingWriter, number: int) -> _Watcher:
    """Open a bundle; a process that follows a dead one runs no other than that one did.

    Raises:
        BadBundle: The file was replaced since the station began.
    """
    if job.checksums and checksum_of(path) != job.checksums[number]:
        raise BadBundle(
            f"{path} as it was when this station began", "another file in its place",
            "put that bundle back, or end the station and start it again",
        )  # fmt: skip
    made: Callable[[Path, Inference, RingWriter, int], _Watcher] = (
        _GraspWatcher if is_grasp_bundle(path) else _RecogniseWatcher
    )
    return made(path, job, writer, number)


def _cores() -> int:
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else 1


def _look(watchers: list[_Watcher]) -> float:
    """Look at the age of what came last; return when that was, monotonic seconds."""
    now_s = monotonic()
    for watcher in watchers:
        watcher.silent(now_s)
    return now_s


def _orders(orders: RingReader, drill: bool, watchers: list[_Watcher]) -> list[Packet]:
    """Return the supervisor's orders; a drill's are carried out here."""
    found = [unpack(order) for order in orders.take()]
    for answer in found:
        if drill and asks(answer, "hang"):
            while True:
                pass
        for watcher in watchers if drill else ():
            if asks(answer, "nan"):
                watcher.spoil()
            elif asks(answer, "give"):
                watcher.spoil(float(answer["p"]))
            elif asks(answer, "mute"):
                watcher.mute(bool(answer["on"]))
    return found


def _number(value: float) -> float | None:
    """Return a number as JSON has it: None in place of NaN."""
    return None if math.isnan(value) else value
