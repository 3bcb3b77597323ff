"""The process that turns one source's ring into decisions.

When it falls behind it goes on with the newest frames. Knows nothing about what is done with
a decision.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from time import monotonic, sleep
from typing import Any

import numpy as np
from numpy.typing import NDArray

from taxel.bundles.grasp import is_grasp_bundle, read_grasp_bundle
from taxel.bundles.reader import read_bundle
from taxel.decisions.recognition import GraspVote, RecogniseConfig
from taxel.decisions.stability import Stability
from taxel.live.grasp_monitor import GraspMonitor
from taxel.live.recogniser import Answer, Recogniser
from taxel.live.station.beats import Work
from taxel.live.station.packets import Packet, pack, unpack
from taxel.live.station.ring import RingReader, RingWriter
from taxel.live.station.worker import IDLE_S, Place, Pulse, at_work, settle_memory
from taxel.signals import CameraInfo, Frame, Mark, Samples, SensorInfo
from taxel.windows.pairs import FramePairer, FrameSet

BEHIND = 3
"""Sets of frames that may wait: older ones are let go. Source: our choice, 50 ms at 60 Hz."""
_SETTLING_S = 1.0
"""What taking in a new grasp's settled frames at once may take, seconds. Source: our choice."""
_LOOK_S = 0.005
"""How often a silent input is looked at: its age makes the state UNKNOWN."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Inference:
    """Bundles, one source's ring, and where the decisions go."""

    place: Place
    bundles: tuple[Path, ...]
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


def infer(job: Inference) -> None:
    """Decide until asked to end; the entry point of the process."""
    with (
        at_work(job.place, urgent=True) as pulse,
        RingReader(job.ring) as reader,
        RingReader(job.orders) as orders,
        RingWriter(job.decisions) as writer,
    ):
        watchers = [_watcher(path, job, writer, i) for i, path in enumerate(job.bundles)]
        pulse.report("opened", [watcher.what for watcher in watchers])
        settle_memory()
        looked_s = 0.0
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
                now_s = monotonic()
                if now_s - looked_s >= _LOOK_S:
                    looked_s = now_s
                    for watcher in watchers:
                        watcher.silent(now_s)
                sleep(IDLE_S)
                continue
            taken_s = monotonic()
            packets = [unpack(one) for one in content]
            packets += _orders(orders, job.drill, watchers)
            for watcher in watchers:
                watcher.take(packets, taken_s, pulse)
            pulse.produced, pulse.consumed = writer.written, reader.taken
            pulse.dropped = reader.lost


class _GraspWatcher:
    """A grasp monitor on the ring's frames."""

    def __init__(self, path: Path, job: Inference, writer: RingWriter, number: int) -> None:
        bundle = read_grasp_bundle(path)
        self._who = f"{job.place.name}/{number}"
        self._monitor = GraspMonitor(bundle, job.cameras)
        self._pairer = FramePairer(len(job.cameras))
        self._writer = writer
        self._state: Stability | None = None
        self._skipped = 0
        stability = bundle.contract.stability
        self.what = {
            "kind": "grasp", "who": self._who, "bundle": str(path), "rule": bundle.contract.rule,
            "warn": stability.warn, "unstable": stability.unstable,
        }  # fmt: skip

    def take(self, packets: list[Packet], taken_s: float, pulse: Pulse) -> None:
        """Watch what came; of many sets the newest few."""
        sets: list[FrameSet] = []
        for packet in packets:
            if isinstance(packet, Frame):
                self._monitor.see(packet)
                found = self._pairer.push(packet)
                if found is not None:
                    sets.append(found)
            elif _ends_grasp(packet) or _asks(packet, "new grasp"):
                self._watch(sets, taken_s, pulse)
                sets = []
                self._monitor.reset()
                self._writer.put(pack({"kind": "new grasp"}))
        self._watch(sets, taken_s, pulse)

    def spoil(self) -> None:
        """Let the model give NaN from now on: a drill."""
        self._monitor.bundle = replace(self._monitor.bundle, head=_NanHead())

    def end(self) -> None:
        """A grasp that is not over has no last answer."""

    def silent(self, now_s: float) -> None:
        """Look at the input's age when nothing came."""
        decision = self._monitor.at(now_s)
        if decision.state is not self._state:
            self._state = decision.state
            self._tell(decision.state, decision.reason, decision.since_s, float("nan"), {})

    def _watch(self, sets: list[FrameSet], taken_s: float, pulse: Pulse) -> None:
        self._skipped += max(0, len(sets) - BEHIND)
        for found in sets[-BEHIND:]:
            pulse.beat(patience_s=_SETTLING_S if self._monitor.settling else 0.0)
            began_s = monotonic()
            answer = self._monitor.push(found, began_s)
            decision = answer.decision
            self._state = decision.state
            times = {
                "time_s": found.time_s,
                "arrival_s": max(frame.arrival_s for frame in found.frames),
                "taken_s": taken_s,
                "began_s": began_s,
                "decided_s": monotonic(),
            }
            self._tell(decision.state, decision.reason, decision.since_s, answer.probability, times)

    def _tell(
        self, state: Stability, reason: str, since_s: float, p: float, times: dict[str, float]
    ) -> None:
        note: dict[str, Any] = {
            "kind": "grasp", "who": self._who, "state": state.name, "reason": reason,
            "skipped": self._skipped,
            "since_s": since_s if since_s == since_s else None,
            "p": p if p == p else None, "late": self._monitor.late(), **times,
        }  # fmt: skip
        self._writer.put(pack(note))


class _RecogniseWatcher:
    """A recogniser on the ring's scans."""

    def __init__(self, path: Path, job: Inference, writer: RingWriter, number: int) -> None:
        bundle = read_bundle(path)
        self._who = f"{job.place.name}/{number}"
        config = RecogniseConfig(least_confidence=job.least_confidence)
        self._recogniser = Recogniser(bundle, job.sensor, config)
        contract = bundle.contract
        self._vote = GraspVote(contract.classes, contract.window.max_gap_s, bundle.strangeness)
        self._target = contract.target
        self._writer = writer
        self.what = {"kind": "answer", "who": self._who, "bundle": str(path),
                     "target": contract.target, "classes": list(contract.classes)}  # fmt: skip

    def take(self, packets: list[Packet], taken_s: float, pulse: Pulse) -> None:
        """Answer each window that the scans complete."""
        for packet in packets:
            if not isinstance(packet, Samples):
                continue
            pulse.beat()
            times = {"arrival_s": float(packet.arrival_s[-1]), "taken_s": taken_s,
                     "began_s": monotonic()}  # fmt: skip
            for answer in self._recogniser.push(packet):
                self._tell(answer, times)

    def end(self) -> None:
        """Answer the stream's last, padded window, if there is one."""
        for answer in self._recogniser.flush():
            self._tell(answer, {})

    def _tell(self, answer: Answer, times: dict[str, float]) -> None:
        decision = answer.decision
        voted, confidence = self._vote.add(decision)
        note = {
            "kind": "answer", "who": self._who, "target": self._target, "label": decision.label,
            "confidence": _number(decision.confidence), "reason": decision.reason,
            "grasp": voted, "grasp_confidence": _number(confidence),
            "time_s": decision.end_s, **times, "decided_s": monotonic(),
        }  # fmt: skip
        self._writer.put(pack(note))

    def spoil(self) -> None:
        """Nothing to spoil: an answer opens no gripper."""

    def silent(self, now_s: float) -> None:
        """A hand that touches nothing says nothing."""


class _NanHead:
    """A model that gives NaN."""

    def run(self, **_: NDArray[np.float32]) -> NDArray[np.float32]:
        return np.full(1, np.nan, np.float32)


_Watcher = _GraspWatcher | _RecogniseWatcher


def _watcher(path: Path, job: Inference, writer: RingWriter, number: int) -> _Watcher:
    made: Callable[[Path, Inference, RingWriter, int], _Watcher] = (
        _GraspWatcher if is_grasp_bundle(path) else _RecogniseWatcher
    )
    return made(path, job, writer, number)


def _orders(orders: RingReader, drill: bool, watchers: list[_Watcher]) -> list[Packet]:
    """Return the supervisor's orders; a drill's are carried out here."""
    found = [unpack(order) for order in orders.take()]
    for one in found:
        if drill and _asks(one, "hang"):
            while True:
                pass
        if drill and _asks(one, "nan"):
            for watcher in watchers:
                watcher.spoil()
    return found


def _ends_grasp(packet: Packet) -> bool:
    """True for a mark that tells a grasp's outcome; a hand's marks in the same file do not."""
    return isinstance(packet, Mark) and "outcome" in packet.labels


def _number(value: float) -> float | None:
    return value if value == value else None


def _asks(packet: Packet, what: str) -> bool:
    return isinstance(packet, dict) and packet.get("do") == what
