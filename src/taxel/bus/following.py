"""Follow a station's rings for whoever sends on what they hold.

Each item has the topic that a recording gives it: touch/NAME, camera/NAME, slip, marks, and
beside them decisions, answers and state. The rings' writers never wait, so a follower that is late
loses the oldest, counted. Knows nothing about networks.

Background of our choices: docs/decisions/0052.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass
from time import monotonic
from typing import Any, Self

from taxel.image_head import is_sound
from taxel.live.station.beats import BeatsView
from taxel.live.station.packets import Packet, unpack
from taxel.live.station.page_link import ViewConfig
from taxel.live.station.recording import apart
from taxel.live.station.ring import RingReader, wait_for_any
from taxel.live.station.snapshots import stalled_snapshot
from taxel.recordings.frame_layout import frame_topic
from taxel.recordings.mark_layout import MARK_TOPIC
from taxel.recordings.scan_layout import scan_topic
from taxel.recordings.slip_layout import SLIP_TOPIC
from taxel.signals import CameraInfo, Frame, Mark, Samples

DECISIONS, ANSWERS, STATE, SOURCES = "/decisions", "/answers", "/state", "/sources"
"""Topics that a recording has not: each decision about a grasp, each answer of a recogniser, the
station's state with its alarms, and how each source does."""
_STALL_AGAIN_S = 0.1
"""How often a stalled supervisor is reported. Source: our choice."""


@dataclass(frozen=True, slots=True)
class Item:
    """One thing that came."""

    topic: str
    value: Samples | Frame | dict[str, Any]
    """Marks, decisions, states and slip are plain dicts."""
    time_s: float
    """When it was true, host monotonic, seconds."""


class Following:
    """All rings of a station, read by one process; use it in a `with` block.

    Args:
        view: The station's rings.
    """

    def __init__(self, view: ViewConfig) -> None:
        self._view = view
        self._sources = [RingReader(seen.ring) for seen in view.sources]
        self._decisions = [RingReader(name) for name in view.decisions]
        self._status = RingReader(view.status)
        self._board = BeatsView(view.beats)
        every = [camera for seen in view.sources for camera in seen.cameras]
        self.cameras = apart(every)
        """All cameras, under names that differ."""
        self._topics = [scan_topic(array.name) for array in apart([s.sensor for s in view.sources])]
        """Of each source's array: two hands of one kind are two topics."""
        self._newest: dict[str, Any] = {}
        self._stall_sent_s = 0.0

    @property
    def lost(self) -> int:
        """Messages that were overwritten before they were read here."""
        return sum(reader.lost for reader in (*self._sources, *self._decisions))

    @property
    def taken(self) -> int:
        """Messages that were read here."""
        return sum(reader.taken for reader in (*self._sources, *self._decisions))

    def wait(self, longest_s: float) -> None:
        """Sleep until something came, at most so long, seconds."""
        wait_for_any([*self._sources, *self._decisions], longest_s)

    def take(self) -> list[Item]:
        """Return what came since the last call, oldest first within a topic; never waits."""
        found: list[Item] = []
        first = 0
        for number, (seen, reader) in enumerate(
            zip(self._view.sources, self._sources, strict=True)
        ):
            topic = self._topics[number]
            cameras = self.cameras[first : first + len(seen.cameras)]
            found += _joined(topic, _source_items(number, topic, cameras, reader.take()))
            first += len(seen.cameras)
        for reader in self._decisions:
            for content in reader.take():
                found += _decision_items(unpack(content))
        return found + self._state(monotonic())

    def _state(self, now_s: float) -> list[Item]:
        """Return the station's newest state, where it is new or the supervisor stands still."""
        content = self._status.newest()
        note = unpack(content) if content is not None else None
        if isinstance(note, dict):
            self._newest = {key: value for key, value in note.items() if key != "events"}
            self._stall_sent_s = now_s
            return [Item(STATE, self._newest, float(note["time_s"]))]
        still_s = self._board.still_s(now_s)
        if still_s > self._view.stall_s and now_s - self._stall_sent_s >= _STALL_AGAIN_S:
            self._stall_sent_s = now_s
            return [Item(STATE, self._newest | stalled_snapshot(self._newest, still_s, now_s),
                         now_s)]  # fmt: skip
        return []

    def about(self) -> dict[str, Any]:
        """Return what the station has: each source's array and cameras, as a manifest has them."""
        return {
            "sources": [
                {"url": seen.url, "topic": topic,
                 "sensor": asdict(seen.sensor) if seen.sensor.channels else None}
                for seen, topic in zip(self._view.sources, self._topics, strict=True)
            ],
            "cameras": [{"topic": frame_topic(c.name), **asdict(c)} for c in self.cameras],
        }  # fmt: skip

    def close(self) -> None:
        """Let go of the rings and the board."""
        self._board.close()
        for reader in (*self._sources, *self._decisions, self._status):
            reader.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()


def _source_items(
    number: int, topic: str, cameras: Sequence[CameraInfo], contents: Sequence[bytes]
) -> Iterator[Item]:
    for content in contents:
        packet = unpack(content)
        if isinstance(packet, Samples):
            if len(packet):
                yield Item(topic, packet, float(packet.fitted_s[-1]))
        elif isinstance(packet, Frame):
            camera = cameras[packet.camera]
            if is_sound(packet.jpeg, camera):  # whoever shows it decodes it
                yield Item(frame_topic(camera.name), packet, packet.fitted_s)
        elif isinstance(packet, Mark):
            yield Item(MARK_TOPIC, asdict(packet), packet.end_s)
        elif packet.get("kind") == "source":
            # Two sources may have one address, as of a simulator.
            yield Item(SOURCES, packet | {"source": number + 1}, monotonic())


def _joined(topic: str, items: Iterator[Item]) -> list[Item]:
    """Return items with all scans of an array as one run, before the rest."""
    rest: list[Item] = []
    runs: list[Samples] = []
    for item in items:
        if isinstance(item.value, Samples):
            runs.append(item.value)
        else:
            rest.append(item)
    if not runs:
        return rest
    run = runs[0] if len(runs) == 1 else Samples.join(runs)
    return [Item(topic, run, float(run.fitted_s[-1])), *rest]


def _decision_items(note: Packet) -> list[Item]:
    if not isinstance(note, dict) or "time_s" not in note:
        return []
    if note.get("kind") != "grasp":
        return [Item(ANSWERS, note, note["time_s"])] if note.get("kind") == "answer" else []
    found = [Item(DECISIONS, note, note["time_s"])]
    if "slip" in note:
        slip = {"time_s": note["time_s"], "who": note["who"], **note["slip"]}
        found.append(Item(SLIP_TOPIC, slip, note["time_s"]))
    return found
