"""The process that records what all sources give, bounded and loud.

It follows the rings with room for many seconds; what the disk makes it miss is counted,
reported and kept in the recording's ledger. Knows nothing about models.

Background of our choices: docs/decisions/0019.
"""

from __future__ import annotations

import contextlib
import itertools
import resource
from collections import deque
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor, wait
from dataclasses import dataclass, replace
from pathlib import Path
from time import monotonic, sleep
from typing import Any, TypeVar

from taxel.errors import TaxelError
from taxel.live.station.beats import Work
from taxel.live.station.packets import Packet, pack, unpack
from taxel.live.station.ring import RingReader, RingWriter
from taxel.live.station.worker import Place, Pulse, at_work, settle_memory
from taxel.plain_text import number_of
from taxel.recordings.manifest import NO_ARRAY, Manifest
from taxel.recordings.part_file import part_path
from taxel.recordings.trial_log import append_trial, log_of, trial_of
from taxel.recordings.writer import Recorder
from taxel.signals import CameraInfo, Frame, Mark, Samples, SensorInfo, SlipNote
from taxel.sim.pour.state import has_truth

_Sensor = TypeVar("_Sensor", CameraInfo, SensorInfo)
_PAUSE_S = 0.01
"""How often the rings are looked at. Source: our choice."""
_REPORT_S = 0.2
"""How often it reports to the supervisor. Source: our choice."""
_STALL_S = 2.0
"""How long the disk may stand still before the recording has failed. Source: our choice."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Recorded:
    """One source as the recorder sees it."""

    ring: str
    row: int
    """Its beats."""
    sensor: SensorInfo
    cameras: tuple[CameraInfo, ...]
    array: bool
    """True for the one array that the recording holds."""
    first_camera: int
    """What its camera 0 is called in the recording."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Recording:
    """Sources, and where orders come from and news go."""

    place: Place
    sources: tuple[Recorded, ...]
    orders: str
    """Ring of notes such as {"do": "record", "path": "x.mcap", "labels": {}}."""
    news: str
    """Ring of notes on how it goes."""
    largest_bytes: int | None = None
    """The disk's end, for drills: no file grows beyond it."""


def choose_recorded(
    sources: list[tuple[str, int, SensorInfo, tuple[CameraInfo, ...]]],
) -> tuple[tuple[Recorded, ...], str]:
    """Return what is recorded of each source, and the names of arrays left out, or "".

    A recording holds one array: that of the first source without cameras, else of the first
    that has one. All cameras are recorded.

    Args:
        sources: (ring, beats' row, array, cameras) of each.
    """
    with_array = [i for i, (_, _, sensor, _) in enumerate(sources) if sensor.channels]
    bare = [i for i in with_array if not sources[i][3]]
    chosen = (bare or with_array or [-1])[0]
    found, first = [], 0
    for index, (ring, row, sensor, cameras) in enumerate(sources):
        found.append(
            Recorded(
                ring=ring, row=row, sensor=sensor, cameras=cameras, array=index == chosen,
                first_camera=first,
            )
        )  # fmt: skip
        first += len(cameras)
    left = [_in_words(sources[i][2]) for i in with_array if i != chosen]
    return tuple(found), ", ".join(left)


def _in_words(array: SensorInfo) -> str:
    """Return an array's name; "truth" alone would not say that no sensor measured it."""
    is_truth = has_truth(array.channels)
    return f"{array.name} (what the simulator knows of forces and slip)" if is_truth else array.name


def apart(sensors: Sequence[_Sensor]) -> tuple[_Sensor, ...]:
    """Return the cameras, or the arrays, of several sources under names that differ."""
    found: list[_Sensor] = []
    for sensor in sensors:
        taken = {before.name for before in found}
        name, number = sensor.name, 2
        while name in taken:
            name, number = f"{sensor.name}-{number}", number + 1
        found.append(replace(sensor, name=name))
    return tuple(found)


def record(job: Recording) -> None:
    """Follow the rings until asked to end; the entry point of the process."""
    if job.largest_bytes is not None:
        hard = resource.getrlimit(resource.RLIMIT_FSIZE)[1]
        resource.setrlimit(resource.RLIMIT_FSIZE, (job.largest_bytes, hard))
    with contextlib.ExitStack() as stack:
        pulse = stack.enter_context(at_work(job.place))
        # From here on: one that follows a dead recorder must not carry out that one's orders.
        orders = stack.enter_context(RingReader(job.orders))
        news = stack.enter_context(RingWriter(job.news))
        readers = [stack.enter_context(RingReader(source.ring)) for source in job.sources]
        pulse.report("opened")
        settle_memory()
        desk = _Desk(job, readers, news, pulse.beat)
        while True:
            last_look = pulse.stopping and (pulse.orphaned or _sources_ended(job, pulse))
            for order in orders.take():
                desk.obey(unpack(order))
            busy = desk.follow(pulse)
            pulse.beat()
            if last_look and not busy:
                break
            if not busy:
                sleep(_PAUSE_S)
        desk.finish("stopped")


class _Desk:
    """The recording under way, where there is one.

    Args:
        job: What is recorded.
        readers: One a source.
        news: Where it says how it goes.
        beat: Gives a sign of life.
    """

    def __init__(
        self,
        job: Recording,
        readers: list[RingReader],
        news: RingWriter,
        beat: Callable[[], None] = lambda: None,
    ) -> None:
        self._job = job
        self._beat = beat
        self._readers = readers
        self._news = news
        self._recorder: Recorder | None = None
        self._path: Path | None = None
        self._groups: dict[str, str] = {}
        """What a person said that the recording under way belongs to."""
        self._began_s = 0.0
        self._lost_before = 0
        self._error = ""
        self._reported_s = 0.0
        self._kept = 0
        """Packets handed to the recording under way, and written where it has failed."""
        self._kept_before = 0
        """Those of the dead recorders whose recording this one goes on with."""
        self._unwritten = 0
        """Packets that came for a recording and are in none, as the disk had refused."""
        self._refused = False
        """True from the disk's refusal until a recording is ended or begun."""
        self._log = Path()
        """Where the grasps of the recording under way are logged."""
        self._logged = 0
        """Orders to log a grasp that were carried out."""
        self._trail: deque[tuple[int, list[list[int]]]] = deque()
        """Pieces handed over by then, and where each reader stood: what may not be written yet."""

    def obey(self, order: Packet) -> None:
        """Begin or end a recording."""
        if not isinstance(order, dict):
            return
        if order.get("do") == "record" and self._recorder is None:
            self._begin(order)
        elif order.get("do") == "slip":
            self._slip(order)
            return
        elif order.get("do") == "trial":
            self._trial(order)
        elif order.get("do") == "end":
            self._refused = False
            self.finish("cleanly")
        self._report(monotonic())

    def _slip(self, order: dict[str, Any]) -> None:
        """Keep the slip that a monitor measured, beside the frames."""
        if self._recorder is not None:
            note = SlipNote(time_s=order["time_s"], who=order["who"], values=order["slip"])
            try:
                self._recorder.slip(note)
            except TaxelError as error:  # the next frame ends the recording by the same error
                self._error = str(error)

    def _trial(self, order: dict[str, Any]) -> None:
        """Log what a person did in a grasp that is over, beside the recording."""
        self._logged += 1
        if self._recorder is None:
            return
        try:
            append_trial(self._log, trial_of(order["trial"]))
        except OSError as error:
            self._error = f"needed to write {self._log}; got {error.strerror or error}."

    def follow(self, pulse: Pulse) -> bool:
        """Take what came; return whether there was anything."""
        busy = False
        for source, reader in zip(self._job.sources, self._readers, strict=True):
            for content in reader.take(256):
                busy = True
                if self._recorder is not None:
                    self._write(self._recorder, source, unpack(content))
                    pulse.beat()
                elif self._refused:
                    self._unwritten += is_recorded(unpack(content), source)
        pulse.consumed = sum(reader.taken for reader in self._readers)
        pulse.dropped = self._lost()
        pulse.produced = self._kept_before + self._kept
        now_s = monotonic()
        if now_s - self._reported_s >= _REPORT_S:
            self._report(now_s)
        return busy

    def finish(self, ended: str) -> None:
        """Complete the file."""
        recorder, self._recorder = self._recorder, None
        if recorder is None:
            return
        lost = self._lost() - self._lost_before
        try:
            self._close(
                recorder,
                f"{ended}; {number_of(lost, 'message')} lost before the recorder"
                if lost
                else ended,
            )
        except TaxelError as error:
            self._error = str(error)
        self._report(monotonic(), recorder.statistics())

    def _close(self, recorder: Recorder, ended: str) -> None:
        """Complete a file; give signs of life for as long as it grows: a day's takes seconds."""
        size = recorder.size
        with ThreadPoolExecutor(1) as beside:
            closing = beside.submit(recorder.close, ended)
            while not wait([closing], _PAUSE_S).done:
                if recorder.size > size:
                    size = recorder.size
                    self._beat()
            closing.result()

    def _begin(self, order: dict[str, Any]) -> None:
        """Begin a recording; with `again` in the order, the rest of a dead recorder's."""
        again: dict[str, Any] = order.get("again") or {}
        asked, overwrite = Path(order["path"]), bool(order.get("overwrite"))
        path = beside(asked, overwrite=overwrite) if again else asked
        overwrite = overwrite and path == asked
        arrays = [source.sensor for source in self._job.sources if source.array]
        cameras = apart([camera for source in self._job.sources for camera in source.cameras])
        self._groups = dict(order.get("groups", {}))
        manifest = Manifest.started_now(
            arrays[0] if arrays else NO_ARRAY, dict(order.get("labels", {})), self._groups,
            cameras=cameras,
        )  # fmt: skip
        try:
            self._recorder = Recorder(path, manifest, stall_s=_STALL_S, overwrite=overwrite)
        except TaxelError as error:
            self._error = str(error)
            return
        self._path, self._began_s, self._error = path, monotonic(), ""
        self._log, self._kept_before = log_of(path), int(again.get("made", 0))
        if again:
            self._log = Path(again["log"])
        else:
            with contextlib.suppress(OSError):  # of the recording that is replaced
                self._log.unlink(missing_ok=True)
        for reader, (number, lost) in zip(self._readers, again.get("places", ()), strict=False):
            reader.go_back(number, lost)
        self._lost_before, self._kept, self._unwritten = self._lost(), 0, 0
        self._refused = False
        self._trail = deque([(0, self._places())])

    def _write(self, recorder: Recorder, recorded: Recorded, packet: Packet) -> None:
        if not is_recorded(packet, recorded):
            return
        try:
            if isinstance(packet, Samples):
                recorder.write(packet)
            elif isinstance(packet, Frame):
                recorder.frame(replace(packet, camera=packet.camera + recorded.first_camera))
            elif isinstance(packet, Mark):
                recorder.mark(packet.within(self._groups))
            self._kept += 1
        except TaxelError as error:
            self._error = str(error)
            self._recorder, self._refused = None, True
            with contextlib.suppress(TaxelError):
                recorder.close("cut short")
            waited = min(recorder.handed - recorder.written, self._kept)
            self._kept, self._unwritten = self._kept - waited, waited + 1
            self._report(monotonic())

    def _places(self) -> list[list[int]]:
        """Return for each ring what comes next and what was lost, as `go_back` takes it."""
        return [[reader.place, reader.lost] for reader in self._readers]

    def _lost(self) -> int:
        return sum(reader.lost for reader in self._readers)

    def _report(self, now_s: float, ledger: Mapping[str, Any] | None = None) -> None:
        self._reported_s = now_s
        recorder = self._recorder
        note: dict[str, Any] = {
            "kind": "recording", "on": recorder is not None, "path": str(self._path or ""),
            "seconds": now_s - self._began_s if recorder is not None else 0.0,
            "bytes": recorder.size if recorder is not None else 0,
            "error": self._error, "lost": self._lost() - self._lost_before, "kept": self._kept,
            "not_written": self._unwritten, "logged": self._logged,
            "made": self._kept_before + self._kept,
        }  # fmt: skip
        if recorder is not None:
            self._trail.append((recorder.handed, self._places()))
            while len(self._trail) > 1 and self._trail[1][0] <= recorder.written:
                self._trail.popleft()
            note["places"] = self._trail[0][1]
        if ledger is not None:
            note["ledger"] = dict(ledger)
        self._news.put(pack(note))


def is_recorded(packet: Packet, recorded: Recorded) -> bool:
    """Return whether a recording holds such a packet of this source."""
    return isinstance(packet, Frame | Mark) or (isinstance(packet, Samples) and recorded.array)


def beside(path: Path, *, overwrite: bool = False) -> Path:
    """Return where a recording goes on: x-2.mcap where there is an x.mcap or an unfinished one.

    Args:
        path: Where it was to be.
        overwrite: A finished recording of that very name may be replaced; no other one.
    """
    if not part_path(path).exists() and (overwrite or not path.exists()):
        return path
    others = (path.with_name(f"{path.stem}-{n}{path.suffix}") for n in itertools.count(2))
    return next(
        other
        for other in others
        if not any(taken.exists() for taken in (other, part_path(other), log_of(other)))
    )


def _sources_ended(job: Recording, pulse: Pulse) -> bool:
    return all(pulse.work_of(source.row) in (Work.ENDED, Work.FAILED) for source in job.sources)
