"""The process that turns one source's ring into decisions.

When it falls behind it goes on with the newest frames. Knows nothing about what is done with
a decision.

Background of our choices: docs/decisions/0019.
"""

from __future__ import annotations

from pathlib import Path
from time import monotonic
from typing import Protocol

from taxel.bundles.envelope import checksum_of, is_grasp_bundle, is_trial_bundle
from taxel.errors import BadBundle
from taxel.live.station.array_watcher import ArrayWatcher
from taxel.live.station.beats import Work
from taxel.live.station.grasp_watcher import GraspWatcher
from taxel.live.station.packets import Packet, asks, unpack
from taxel.live.station.ring import RingReader, RingWriter
from taxel.live.station.watching import Came, Inference, Note
from taxel.live.station.worker import Pulse, at_work, hurry_threads, settle_memory

_LOOK_S = 0.005
"""How often a silent input is looked at: its age makes the state UNKNOWN."""


class Watcher(Protocol):
    """A bundle on the ring's messages."""

    what: Note
    """What it is, for the station: its kind, name, bundle and more."""

    def take(self, packets: list[Packet], came: Came, pulse: Pulse) -> None:
        """Take in what came, and decide."""

    def silent(self, now_s: float) -> None:
        """Look at the input's age when nothing came."""

    def end(self) -> None:
        """Give the last decision, where there is one: nothing more comes."""

    def spoil(self, value: float = float("nan")) -> None:
        """Let the model give one value from now on: a drill."""

    def mute(self, on: bool) -> None:
        """Send no decision, and live: a drill."""


def infer(job: Inference) -> None:
    """Decide until asked to end; the entry point of the process."""
    with (
        at_work(job.place) as pulse,
        RingReader(job.ring) as reader,
        RingReader(job.orders) as orders,
        RingWriter(job.decisions) as writer,
    ):
        watchers = [watcher_of(path, job, writer, i) for i, path in enumerate(job.bundles)]
        pulse.report("opened", [watcher.what for watcher in watchers])
        settle_memory()
        hurry_threads(job.rank)
        looked_s = monotonic()
        while True:
            pulse.beat(patience_s=job.last_step_s if pulse.stopping else 0.0)
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
            pulse.dropped = reader.lost
            for watcher in watchers:
                watcher.take(packets, came, pulse)
            pulse.produced, pulse.consumed = writer.written, reader.taken
            # Scans may come on and on while a camera is gone.
            if not reader.waiting and monotonic() - looked_s >= _LOOK_S:
                looked_s = _look(watchers)


def watcher_of(path: Path, job: Inference, writer: RingWriter, number: int) -> Watcher:
    """Open a bundle; a process that follows a dead one runs no other than that one did.

    Raises:
        BadBundle: The file was replaced since the station began.
    """
    if job.checksums and checksum_of(path) != job.checksums[number]:
        raise BadBundle(
            f"{path} as it was when this station began", "another file in its place",
            "put that bundle back, or end the station and start it again",
        )  # fmt: skip
    if is_grasp_bundle(path):
        return GraspWatcher(path, job, writer, number)
    if is_trial_bundle(path):
        from taxel.live.station.trial_watcher import TrialWatcher  # needs the extra of cameras

        return TrialWatcher(path, job, writer, number)
    return ArrayWatcher(path, job, writer, number)


def _look(watchers: list[Watcher]) -> float:
    """Look at the age of what came last; return when that was, monotonic seconds."""
    now_s = monotonic()
    for watcher in watchers:
        watcher.silent(now_s)
    return now_s


def _orders(orders: RingReader, drill: bool, watchers: list[Watcher]) -> list[Packet]:
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
