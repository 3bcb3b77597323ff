"""What the operator's page sees of a station: the newest of every ring, never waiting.

Runs in the page's own process, so that a slow page costs the station nothing. Knows nothing
about HTTP.

Background of our choices: docs/decisions/0019.
"""

from __future__ import annotations

import math
import threading
from collections import OrderedDict, deque
from collections.abc import Collection, Iterable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from time import monotonic, sleep
from typing import Any

import numpy as np

from taxel.calibration.live import LiveNewtons
from taxel.calibration.stored import read_calibration
from taxel.decisions.reasons import REASONS
from taxel.errors import TaxelError
from taxel.image_head import is_sound
from taxel.live.station.beats import BeatsView
from taxel.live.station.evidence_trace import EvidenceTrace
from taxel.live.station.packets import pack, unpack
from taxel.live.station.recording import apart
from taxel.live.station.ring import RingReader, RingWriter
from taxel.live.station.snapshots import stalled_snapshot
from taxel.signals import DEPTH_PNG, ROUNDING_S, CameraInfo, Frame, Samples, SensorInfo

_KEPT_S = 30.0
_ROW_S = 0.01
"""Time between kept rows of the array: the common grid's, docs/decisions/0003."""
_MAP_ROWS = 12
_POINTS_HZ = 50
_ANSWER_S = 3.0
"""How long a request may take until it is known to be fulfilled, seconds. Our choice."""
_TINY_S = 1e-6
_ANSWERS = 1000
"""Answers of `traces` that are remembered: those of some seconds to each open page. Our choice."""
_GAP_S, _GAP_PERIODS = 0.5, 5.0
"""Rows of an array further apart, in seconds and in its periods, are not joined by a line, and the
newest is not shown as the present. Our choice, as for images (docs/decisions/0018)."""
_SILENT_S = 1.0
"""A source that has not reported for so long is not shown as live: it reports several times a
second. Our choice."""
_EVERY = max(1, round(1 / _ROW_S / _POINTS_HZ))
"""Rows of which a trace shows one, of an array that is faster than its points."""
_DEPTH_S = 0.2
"""How often a depth image is drawn in colours: that takes some milliseconds. Our choice."""


@dataclass(frozen=True, slots=True, kw_only=True)
class PageSeen:
    """One source as the page sees it."""

    url: str
    ring: str
    sensor: SensorInfo
    cameras: tuple[CameraInfo, ...]
    calibration: Path | None = None
    """Of the array, which is then shown in newtons."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ViewConfig:
    """The rings that the page reads, and the one that it writes."""

    sources: tuple[PageSeen, ...]
    decisions: tuple[str, ...]
    status: str
    requests: str
    beats: str
    """Name of the board of beats: the page sees by itself where the supervisor stands still."""
    stall_s: float
    """A supervisor's tick that is older than this is a stall, seconds."""
    watchers: tuple[str, ...] = ()
    """Names of all grasp monitors."""
    recognisers: tuple[tuple[str, str], ...] = ()
    """Name and target of each recogniser."""


@dataclass(slots=True)
class _Array:
    """The array that is shown."""

    sensor: SensorInfo
    gap_s: float
    """Rows further apart are not joined, seconds."""
    newtons: LiveNewtons | None = None
    every: int = _EVERY
    """Rows of which a trace shows one."""
    rows: deque[tuple[float, list[float]]] = field(
        default_factory=lambda: deque(maxlen=round(_KEPT_S / _ROW_S))
    )

    def lack(self) -> None:
        """Break the trace, once: what came since its last row was not read, or nothing came."""
        if self.rows and not all(map(math.isnan, self.rows[-1][1])):
            time_s, values = self.rows[-1]
            for number in range(1, self.every + 1):  # as many as a trace leaves out
                self.rows.append((time_s + number * _TINY_S, [math.nan] * len(values)))

    def add(self, samples: Samples) -> None:
        """Keep rows that are a grid's step apart; what is not usable is a gap."""
        if self.newtons is not None:
            samples = self.newtons.push(samples)
        last_s = self.rows[-1][0] if self.rows else -math.inf
        for index, time_s in enumerate(samples.fitted_s.tolist()):
            if time_s - last_s > self.gap_s:
                self.lack()
            if time_s - last_s >= _ROW_S - ROUNDING_S:
                values = np.where(samples.usable[index], samples.values[index], np.nan)
                self.rows.append((time_s, values.tolist()))
                last_s = time_s


class StationView:
    """The page's link; fulfils `taxel.views.page.link.StationLink`.

    Args:
        config: The station's rings.

    Raises:
        MissingExtra: A camera gives depth images, which need OpenCV to be shown.
    """

    def __init__(self, config: ViewConfig) -> None:
        self._cameras = apart([camera for source in config.sources for camera in source.cameras])
        need_depth_pictures(self._cameras)
        self._config = config
        self._sources = [RingReader(source.ring) for source in config.sources]
        self._decisions = [RingReader(name) for name in config.decisions]
        self._status = RingReader(config.status)
        self._requests = RingWriter(config.requests)
        self._asking = threading.Lock()  # a ring has one writer, and requests come from threads
        self._board = BeatsView(config.beats)
        self._frames: list[tuple[int, bytes] | None] = [None] * len(self._cameras)
        self._depth: dict[int, bytes] = {}
        """Depth images that came and were not drawn yet, the newest of each camera."""
        self._drawn_s = [-math.inf] * len(self._cameras)
        self._array_at = _choose_array(config.sources)
        self._array = None
        if self._array_at is not None:
            self._array = _shown_array(config.sources[self._array_at])
        self._evidence = EvidenceTrace(_KEPT_S)
        self._newest: dict[str, Any] = {}
        self._notes: list[dict[str, Any]] = [{} for _ in config.sources]
        self._noted_s = [-math.inf] * len(config.sources)
        self._answered: OrderedDict[float, tuple[float, float, float]] = OrderedDict()
        """Time of an answer of `traces` → the newest row, chance and event that were in it: they
        come by several ways, and the newest of all says nothing of the others."""

    def snapshot(self) -> dict[str, Any]:
        """Return the newest state of everything."""
        self._refresh()
        array = self._array
        nothing: dict[str, Any] = {
            "time_s": 0.0, "state": "UNKNOWN", "reason": REASONS["no station"].say(),
            "since_s": 0.0, "probability": None, "slip": None, "alarms": [], "answers": [],
            "consumers": [],
            "latency_ms": {}, "gripper": None, "recording": {}, "do": None, "trial": None,
        }  # fmt: skip
        newest = {key: value for key, value in self._newest.items() if key != "events"}
        now_s = monotonic()
        still_s = self._board.still_s(now_s)
        if still_s > self._config.stall_s:
            newest |= stalled_snapshot(newest, still_s, now_s)
        return nothing | newest | {
            "sources": [
                how_it_does(note, monotonic() - noted_s) | {"kind": note["kind_of"]}
                for note, noted_s in zip(self._notes, self._noted_s, strict=True)
                if note
            ],
            "cameras": [
                {"name": camera.name, "width": camera.width, "height": camera.height}
                for camera in self._cameras
            ],
            "array": None if array is None else {
                "name": array.sensor.name, "channels": list(array.sensor.channels),
                "unit": shown_unit(array.sensor), "rows": _MAP_ROWS, "gap_s": array.gap_s,
                "scale": "full scale" if array.sensor.full_scale else "the largest value",
            },
        }  # fmt: skip

    def frame(self, camera: int) -> tuple[int, bytes] | None:
        """Return a camera's newest image."""
        if camera in self._depth and monotonic() - self._drawn_s[camera] >= _DEPTH_S:
            self._drawn_s[camera] = monotonic()
            picture = draw_depth(self._depth.pop(camera), self._cameras[camera])
            if picture is not None:
                self._show(camera, picture)
        return self._frames[camera] if 0 <= camera < len(self._frames) else None

    def _show(self, camera: int, jpeg: bytes) -> None:
        before = self._frames[camera]
        self._frames[camera] = ((before[0] if before else 0) + 1, jpeg)

    def traces(self, since_s: float) -> dict[str, Any]:
        """Return what came after a moment, at most 50 points a second."""
        self._refresh()
        rows = [] if self._array is None else list(self._array.rows)
        events = self._newest.get("events", [])
        each = (
            rows[-1][0] if rows else -math.inf,
            max([t for t, _ in self._evidence.points], default=-math.inf),  # not always the last
            float(events[-1][0]) if events else -math.inf,
        )
        newest_s = max([moment for moment in each if math.isfinite(moment)], default=0.0)
        after = self._answered.get(since_s, (since_s, since_s, since_s))
        if since_s > newest_s:
            after = (-math.inf, -math.inf, -math.inf)
        self._answered.setdefault(newest_s, each)
        while len(self._answered) > _ANSWERS:
            self._answered.popitem(last=False)
        chances = [(t, p) for t, p in self._evidence.points if t > after[1]]
        every = _EVERY if self._array is None else self._array.every
        kept = [row for row in rows if row[0] > after[0]][::every]
        columns = zip(*(values for _, values in kept), strict=True) if kept else ()
        return {
            "time_s": newest_s,
            "probability": {"t": [t for t, _ in chances], "p": [p for _, p in chances]},
            "sensors": {"t": [t for t, _ in kept], "values": [list(column) for column in columns]},
            "map": self._map(rows[-_MAP_ROWS:]),
            "events": [{"t": t, "text": text} for t, text in events if t > after[2]],
        }

    def acknowledge(self, seen: Collection[int]) -> None:
        """Report to the supervisor which alarms a person saw."""
        self._ask({"do": "acknowledge", "seen": sorted(seen)})

    def record(self, on: bool, labels: dict[str, str]) -> str:
        """Start or stop recording; wait until it is so, or why not."""
        old: str | None = None  # the error that stood there before; None until it is asked
        with RingReader(self._config.status) as status:
            if not on:
                self._ask({"do": "end"})
            until_s = monotonic() + _ANSWER_S
            while monotonic() < until_s:
                content = status.newest()
                note = unpack(content) if content is not None else {}
                found = note.get("recording", {}) if isinstance(note, dict) else {}
                error = str(found.get("error") or "")
                if found and on and old is None:
                    if found.get("on"):
                        return f"recording already: {found.get('path')}"
                    self._ask({"do": "record", "labels": labels})
                    old = error
                elif found and bool(found.get("on")) == on:
                    return ""
                elif on and error != old and error:
                    return error
                sleep(0.02)
        return old or "the recorder does not answer"

    def react(self, what: str) -> str:
        """Report a person's reaction, or the grasp's outcome, to the supervisor."""
        self._ask({"do": "react", "what": what})
        return ""

    def disarm(self) -> None:
        """Ask the supervisor for no more orders."""
        self._ask({"do": "disarm"})

    def _ask(self, request: dict[str, Any]) -> None:
        with self._asking:
            self._requests.put(pack(request))

    def close(self) -> None:
        """Let go of the rings and the board."""
        self._board.close()
        for ring in (*self._sources, *self._decisions, self._status, self._requests):
            ring.close()

    def _refresh(self) -> None:
        content = self._status.newest()
        if content is not None:
            note = unpack(content)
            self._newest = note if isinstance(note, dict) else {}
        first = 0
        for number, (seen, reader) in enumerate(
            zip(self._config.sources, self._sources, strict=True)
        ):
            self._follow(number, reader, first)
            first += len(seen.cameras)
        for reader in self._decisions:
            lost, came = reader.lost, reader.take()
            # While no page is open nothing is read, and a ring keeps the newest alone: no line is
            # drawn across what is not known.
            if reader.lost > lost:
                self._evidence.lack()
            for content in came:
                note = unpack(content)
                if isinstance(note, dict) and self._draws(note):
                    p = math.nan if note.get("p") is None else note["p"]
                    self._evidence.add(str(note.get("who")), note["time_s"], p)

    def _draws(self, note: dict[str, Any]) -> bool:
        """True for a decision about frames; scores and probabilities are not mixed in one trace."""
        alike = bool(note.get("is_score")) is bool(self._newest.get("scored"))
        return note.get("kind") == "grasp" and "time_s" in note and alike

    def _follow(self, number: int, reader: RingReader, first_camera: int) -> None:
        lost, came = reader.lost, reader.take()
        if reader.lost > lost and self._array is not None and number == self._array_at:
            self._array.lack()
        for content in came:
            packet = unpack(content)
            if isinstance(packet, Frame):
                camera = first_camera + packet.camera
                if not is_sound(packet.jpeg, self._cameras[camera]):
                    continue  # a browser would decode it
                if self._cameras[camera].coding == DEPTH_PNG:
                    self._depth[camera] = packet.jpeg
                else:
                    self._show(camera, packet.jpeg)
            elif isinstance(packet, Samples):
                if self._array is not None and number == self._array_at:
                    self._array.add(packet)
            elif isinstance(packet, dict) and packet.get("kind") == "source":
                self._notes[number], self._noted_s[number] = packet, monotonic()

    def _map(self, rows: Sequence[tuple[float, list[float]]]) -> list[list[float]] | None:
        array = self._array
        if array is None or not rows:
            return None
        values = np.array([values for _, values in rows])
        top = array.sensor.full_scale or float(np.nanmax(np.abs(values), initial=1e-9))
        found: list[list[float]] = np.clip(values / top, 0.0, 1.0).tolist()
        return found


def _shown_array(seen: PageSeen) -> _Array:
    """Return a source's array, in newtons where it has a calibration."""
    gap_s = trace_gap_s(seen.sensor)
    every = 1 if 0.0 < seen.sensor.rate_hz <= _POINTS_HZ else _EVERY
    if seen.calibration is None:
        return _Array(seen.sensor, gap_s, every=every)
    newtons = LiveNewtons(read_calibration(seen.calibration), seen.sensor)
    return _Array(newtons.info, gap_s, newtons, every)


def trace_gap_s(sensor: SensorInfo) -> float:
    """Return how far apart two rows of an array may be that a line joins, seconds."""
    return max(_GAP_S, _GAP_PERIODS / sensor.rate_hz if sensor.rate_hz > 0 else math.inf)


def how_it_does(note: dict[str, Any], age_s: float) -> dict[str, Any]:
    """Return a source's newest report; an old one claims nothing of the present, save an end.

    Args:
        note: As `source_news` makes it.
        age_s: How long ago it came, seconds.
    """
    if age_s <= _SILENT_S or note["state"] in ("ended", "failed"):
        return note
    return note | {"state": "silent", "rate_hz": 0.0, "note": f"no report for {age_s:.0f} s"}


def need_depth_pictures(cameras: Iterable[CameraInfo]) -> None:
    """Refuse to show a depth camera where no image can be drawn: its place would stay empty.

    Raises:
        MissingExtra: OpenCV is not installed.
    """
    if any(camera.coding == DEPTH_PNG for camera in cameras):
        import taxel.frame_codec  # noqa: F401  # names its extra where it is missing


def shown_unit(sensor: SensorInfo) -> str:
    """Return the unit that all channels share, in words where they have several."""
    return sensor.units[0] if len(set(sensor.units)) == 1 else "mixed units"


def draw_depth(png: bytes, camera: CameraInfo) -> bytes | None:
    """Return a depth image as a JPEG for people; None where it cannot be drawn."""
    try:
        from taxel.frame_codec import depth_picture

        return depth_picture(png, camera)
    except (TaxelError, ValueError):
        return None


def _choose_array(sources: Sequence[PageSeen]) -> int | None:
    """Return which source's array is shown: the first without cameras, else the first."""
    with_array = [i for i, source in enumerate(sources) if source.sensor.channels]
    bare = [i for i in with_array if not sources[i].cameras]
    found = bare or with_array
    return found[0] if found else None
