"""A station: sources, monitors, recorder and page as processes, and the supervisor over them.

The supervisor is this process. It reads decisions and signs of life every few milliseconds,
restarts what died, and orders the actuator by the interlock; nothing it calls waits. Knows
nothing about windows, models or pixels.
"""

from __future__ import annotations

import contextlib
import math
import os
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, field
from multiprocessing import get_context
from multiprocessing.connection import Connection
from multiprocessing.process import BaseProcess
from pathlib import Path
from time import monotonic, sleep
from typing import Any, Self

import numpy as np

from taxel.actions.interlock import Interlock, InterlockConfig, Order
from taxel.errors import BadSource, TaxelError
from taxel.live.station.acquisition import Acquisition, acquire
from taxel.live.station.beats import Beats, Work
from taxel.live.station.fitting import misfit
from taxel.live.station.guard import Guard, GuardConfig
from taxel.live.station.inference import Inference, infer
from taxel.live.station.packets import pack, unpack
from taxel.live.station.page_link import Seen, ViewConfig
from taxel.live.station.recording import Recording, choose_recorded, record
from taxel.live.station.ring import Ring, RingReader, RingWriter
from taxel.live.station.worker import Place, hurry, settle_memory
from taxel.signals import CameraInfo, SensorInfo

TICK_S = 0.002
"""How often the supervisor looks. Source: our choice: a fortieth of the silence it allows."""
_TELL_S = 0.05
"""How often the page is told. Source: our choice."""
_OPEN_S = 30.0
"""How long a process may take to open what it needs, seconds. Source: our choice."""
_END_S = 5.0
"""How long processes may take to end before they are killed, seconds. Source: our choice."""
_RING_BYTES = 32 * 2**20
"""Of a source: twelve seconds of two cameras at 60 Hz. Source: our choice."""
_NOTE_BYTES = 2**20
_RESTARTS = 5
"""Times that a process is started again before it is given up. Source: our choice."""
_KEPT = 2000
"""Latencies kept for percentiles."""
STAGES = ("capture", "hand over", "wait", "model", "alarm")
"""From the shutter to the host, from the host to the monitor, until the model begins, until it
has decided, until the supervisor has acted."""


@dataclass(frozen=True, slots=True, kw_only=True)
class StationConfig:
    """What runs."""

    sources: tuple[str, ...]
    bundles: tuple[Path, ...]
    least_confidence: float = 0.5
    guard: GuardConfig = field(default_factory=GuardConfig)
    interlock: InterlockConfig = field(
        default_factory=lambda: InterlockConfig(min_n=15.0, max_n=50.0)
    )
    drill: bool = False
    """Let processes obey orders to go wrong, for `taxel bench faults`."""
    disk_bytes: int | None = None
    """Where the disk ends, for drills."""


@dataclass(slots=True)
class Worker:
    """One process and how to start it again."""

    name: str
    row: int
    entry: Callable[[Any], None]
    job: Callable[[Place], Any]
    process: BaseProcess | None = None
    report: Connection | None = None
    starts: int = 0
    given_up: bool = False


@dataclass(slots=True)
class _Feed:
    """One open source."""

    url: str
    ring: Ring
    orders: Ring
    worker: Worker
    sensor: SensorInfo
    cameras: tuple[CameraInfo, ...]
    to: RingWriter


@dataclass(slots=True)
class _Mind:
    """One inference process."""

    worker: Worker
    feed: _Feed
    decisions: Ring
    reader: RingReader
    orders: Ring
    to: RingWriter
    told: list[dict[str, Any]]
    """What each bundle is."""
    watches: bool
    """True where one of them watches a grasp."""


Watcher = Callable[[dict[str, Any]], None]
"""Called with each note of a monitor or recogniser as the supervisor hears it."""


class Station:
    """Everything that runs live. Use it in a `with` block, then call `run`.

    Args:
        config: What runs.
        on_note: Called with each decision and each piece of news; must not wait.

    Raises:
        BadSource: A source cannot be opened.
        BadBundle: A bundle is damaged, or fits none of the sources.
    """

    def __init__(self, config: StationConfig, on_note: Watcher = lambda _: None) -> None:
        self.config = config
        self._on_note = on_note
        self._context = get_context("spawn")
        self._stack = contextlib.ExitStack()
        self._workers: list[Worker] = []
        self._waiting: list[Worker] = []
        self.feeds: list[_Feed] = []
        self._minds: list[_Mind] = []
        self.guard = Guard(Interlock(config.interlock), config.guard)
        self._actuator: Callable[[Order, float], None] | None = None
        self._latencies = {stage: deque[float](maxlen=_KEPT) for stage in STAGES}
        self._percentiles: dict[str, list[float]] = {}
        self._answers: dict[str, dict[str, Any]] = {}
        self._recording: dict[str, Any] = {
            "on": False, "path": "", "seconds": 0.0, "bytes": 0, "error": "",
        }  # fmt: skip
        self._told_s = self._percentiles_s = 0.0
        self.stops: list[tuple[float, str]] = []
        """When the state shown became STOP, and why."""
        self.events: deque[tuple[float, str]] = deque(maxlen=200)
        self._word = ""
        self._stopped = False
        self._final: dict[str, Any] | None = None

    def __enter__(self) -> Self:
        try:
            self._start()
        except BaseException:
            self.close()
            raise
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    # ---- what others may ask -----------------------------------------------------------

    def workers(self) -> dict[str, BaseProcess]:
        """Return the processes by name, as drills need them."""
        return {one.name: one.process for one in self._workers if one.process is not None}

    def order(self, name: str, note: dict[str, Any]) -> None:
        """Send an order to an inference or acquisition process."""
        for mind in self._minds:
            if mind.worker.name == name:
                mind.to.put(pack(note))
        for feed in self.feeds:
            if feed.worker.name == name:
                feed.to.put(pack(note))

    def record(self, path: Path, labels: dict[str, str], *, overwrite: bool = False) -> None:
        """Begin to record all sources; news tell how it goes."""
        note = {"do": "record", "path": str(path), "labels": labels, "overwrite": overwrite}
        self._to_recorder.put(pack(note))

    def end_recording(self) -> None:
        """Complete the recording under way."""
        self._to_recorder.put(pack({"do": "end"}))

    def new_grasp(self) -> None:
        """Tell every monitor that the next moments are a new grasp's settled first ones."""
        for mind in self._minds:
            mind.to.put(pack({"do": "new grasp"}))

    def drive(self, actuator: Callable[[Order, float], None]) -> None:
        """Give each tick's order to an actuator; it must return at once."""
        self._actuator = actuator

    def stop(self) -> None:
        """End `run` at its next tick."""
        self._stopped = True

    @property
    def sources_over(self) -> bool:
        """True once every source has ended by itself."""
        rows = [self._beats.read(feed.worker.row).work for feed in self.feeds]
        return all(work in (Work.ENDED, Work.FAILED) for work in rows)

    # ---- the supervisor ----------------------------------------------------------------

    def run(
        self,
        seconds: float | None = None,
        stopped: Callable[[], bool] = lambda: False,
        on_tick: Callable[[float], None] = lambda _: None,
    ) -> None:
        """Supervise until the time is over, every source has ended or `stopped` says so."""
        self._beats.go()
        began_s = monotonic()
        while not (self._stopped or stopped()):
            now_s = monotonic()
            if seconds is not None and now_s - began_s >= seconds:
                break
            self.tick(now_s)
            on_tick(now_s)
            if self.sources_over:
                break
            sleep(max(0.0, now_s + TICK_S - monotonic()))

    def tick(self, now_s: float) -> None:
        """Hear, weigh, act, tell: once."""
        notes = self._hear(now_s)
        self._look(now_s)
        order = self.guard.tick(now_s)
        if self._actuator is not None:
            self._actuator(order, now_s)
        else:
            self.guard.interlock.device(True, now_s)
        acted_s = monotonic()
        for note in notes:
            self._time(note, acted_s)
            self._on_note(note)
        word, reason, _ = self.guard.shown
        if word != self._word:
            self._word = word
            self.events.append((now_s, f"{word}{': ' if reason else ''}{reason}"))
            if word == "STOP":
                self.stops.append((now_s, reason))
        if now_s - self._told_s >= _TELL_S:
            self._told_s = now_s
            self._tell(now_s)

    def _hear(self, now_s: float) -> list[dict[str, Any]]:
        heard = []
        for mind in self._minds:
            for content in mind.reader.take():
                note = unpack(content)
                if not isinstance(note, dict):
                    continue
                heard.append(note)
                if note["kind"] == "grasp":
                    self.guard.decide(mind.worker.name, note)
                    self._say_late(note, now_s)
                else:
                    self._answers[note["target"]] = note
            if mind.watches:
                self.guard.beat(mind.worker.name, self._beats.read(mind.worker.row).beat_s)
        for content in self._news.take():
            note = unpack(content)
            if isinstance(note, dict):
                self._recording = note
                self._weigh_recording(note, now_s)
                self._on_note(note)
        for content in self._requests.take():
            note = unpack(content)
            if isinstance(note, dict):
                self._grant(note, now_s)
        return heard

    def _say_late(self, note: dict[str, Any], now_s: float) -> None:
        late = note.get("late") or {}
        if late:
            text = ", ".join(f"{name} is {1000 * s:.0f} ms late" for name, s in late.items())
            self.guard.trouble("late camera", text, now_s, danger=False)
        elif "time_s" in note:
            self.guard.over("late camera", now_s)

    def _weigh_recording(self, note: dict[str, Any], now_s: float) -> None:
        if note.get("error"):
            self.guard.trouble("recording", str(note["error"]), now_s)
        elif note.get("lost"):
            self.guard.trouble("recording", f"the recorder lost {note['lost']} messages", now_s)

    def _grant(self, wish: dict[str, Any], now_s: float) -> None:
        """Do what the page may ask: it cannot arm or move anything."""
        if wish.get("do") == "acknowledge":
            for alarm in self.guard.alarms.alarms:
                self.guard.alarms.acknowledge(alarm.number, now_s)
        elif wish.get("do") == "record":
            self.record(Path(wish["path"]), dict(wish.get("labels", {})))
        elif wish.get("do") == "end":
            self.end_recording()

    def _look(self, now_s: float) -> None:
        """See which processes have died; start them again."""
        for worker in self._workers:
            process = worker.process
            if process is None or worker.given_up or process.exitcode is None:
                continue
            beat = self._beats.read(worker.row)
            if beat.work is Work.ENDED and process.exitcode == 0:
                continue
            self.guard.died(worker.name)
            how = f"signal {-process.exitcode}" if process.exitcode < 0 else "an error"
            self.guard.trouble(worker.name, f"{worker.name} ended by {how}", now_s)
            self.events.append((now_s, f"{worker.name} ended by {how}"))
            process.join()
            if worker.starts > _RESTARTS:
                worker.given_up = True
                self._fail(worker)
                continue
            self._begin(worker)
            if any(mind.worker is worker and mind.watches for mind in self._minds):
                self._waiting.append(worker)
        self._waiting = [worker for worker in self._waiting if not self._back(worker, now_s)]

    def _back(self, worker: Worker, now_s: float) -> bool:
        """Expect a monitor again once it has opened its bundle."""
        if self._beats.read(worker.row).work is not Work.RUNNING:
            return False
        self.guard.expect(worker.name, now_s)
        self.guard.over(worker.name, now_s)
        return True

    def _fail(self, worker: Worker) -> None:
        """Write for a process that no longer can that it will make nothing more."""
        with contextlib.suppress(AttributeError):
            self._beats.fail(worker.row)

    def _time(self, note: dict[str, Any], acted_s: float) -> None:
        if "arrival_s" not in note:
            return
        steps = (note["time_s"], note["arrival_s"], note["taken_s"], note["began_s"],
                 note["decided_s"], acted_s)  # fmt: skip
        for stage, before_s, after_s in zip(STAGES, steps[:-1], steps[1:], strict=True):
            self._latencies[stage].append(1000.0 * (after_s - before_s))

    def latencies_ms(self) -> dict[str, list[float]]:
        """Return p50, p95 and p99 of each stage, milliseconds."""
        return {
            stage: [float(p) for p in np.percentile(np.array(kept), (50, 95, 99))]
            for stage, kept in self._latencies.items()
            if kept
        }

    def overhead_ms(self) -> np.ndarray[Any, np.dtype[np.float64]]:
        """Return what each decision took from the host to the alarm, without the model, ms."""
        parts = [np.array(self._latencies[stage]) for stage in ("hand over", "wait", "alarm")]
        return np.asarray(sum(parts), float)

    # ---- telling the page --------------------------------------------------------------

    def snapshot(self, now_s: float) -> dict[str, Any]:
        """Return the state of everything, as the page's link gives it."""
        if now_s - self._percentiles_s > 1.0:
            self._percentiles_s, self._percentiles = now_s, self.latencies_ms()
        word, reason, since_s = self.guard.shown
        p = self.guard.probability
        interlock = self.guard.interlock
        first = next((what for mind in self._minds for what in mind.told if "warn" in what), {})
        return {
            "time_s": now_s, "state": word, "reason": reason, "since_s": since_s,
            "probability": p if math.isfinite(p) else None,
            "thresholds": {key: first[key] for key in ("warn", "unstable") if key in first},
            "alarms": [
                {"kind": a.kind, "text": a.text, "level": str(a.level), "since_s": a.since_s,
                 "acknowledged": a.acknowledged}
                for a in self.guard.alarms.alarms
            ],
            "answers": [
                {"target": a["target"], "label": a["grasp"], "confidence": a["grasp_confidence"],
                 "reason": a["reason"]} for a in self._answers.values()
            ],
            "consumers": [self._consumer(worker, now_s) for worker in self._workers],
            "latency_ms": self._percentiles,
            "gripper": None if self._actuator is None else {
                "interlock": str(interlock.state), "armed": interlock.armed,
                "force_n": interlock.force_n, "commanded_n": interlock.force_n, "motion": "",
                "note": interlock.reason,
            },
            "recording": {key: self._recording.get(key) for key in
                          ("on", "path", "seconds", "bytes", "error")},
            "events": [list(event) for event in self.events],
        }  # fmt: skip

    def _consumer(self, worker: Worker, now_s: float) -> dict[str, Any]:
        beat = self._beats.read(worker.row)
        return {
            "name": worker.name, "consumed": beat.consumed, "dropped": beat.dropped,
            "produced": beat.produced, "beat_age_s": now_s - beat.beat_s,
            "state": beat.work.name.lower(),
        }  # fmt: skip

    def _tell(self, now_s: float) -> None:
        self._status_to.put(pack(self.snapshot(now_s)))

    # ---- starting and ending -----------------------------------------------------------

    def _start(self) -> None:
        hurry()
        keep = self._stack.enter_context
        self._beats = keep(Beats())
        self.status = keep(Ring(_NOTE_BYTES))
        self._status_to = keep(RingWriter(self.status.name))
        self.requests = keep(Ring(_NOTE_BYTES))
        self._requests = keep(RingReader(self.requests.name))
        opening = [self._open_feed(url, number) for number, url in enumerate(self.config.sources)]
        for feed in opening:
            words = self._wait_for(feed.worker)
            feed.sensor, feed.cameras = words[1], words[2]
        self.feeds = opening
        self._assign()
        self._start_recorder()
        for worker in self._workers:
            if not any(feed.worker is worker for feed in opening):
                words = self._wait_for(worker)
                for mind in self._minds:
                    if mind.worker is worker:
                        mind.told = words[1]
                        mind.watches = any(one["kind"] == "grasp" for one in words[1])
        now_s = monotonic()
        for mind in self._minds:
            if mind.watches:
                self.guard.expect(mind.worker.name, now_s)
        settle_memory()

    def _open_feed(self, url: str, number: int) -> _Feed:
        ring, orders = Ring(_RING_BYTES), Ring(_NOTE_BYTES)
        self._stack.callback(ring.close)
        self._stack.callback(orders.close)
        name = f"source {number + 1}" if len(self.config.sources) > 1 else "source"

        def job(place: Place) -> Acquisition:
            return Acquisition(place=place, url=url, ring=ring.name, orders=orders.name)

        worker = self._add(name, acquire, job)
        none = SensorInfo(name="none", channels=(), units=(), rate_hz=0.0)
        to = self._stack.enter_context(RingWriter(orders.name))
        return _Feed(url, ring, orders, worker, none, (), to)

    def _assign(self) -> None:
        """Give each bundle to the first source that it fits; one process a source."""
        chosen: dict[int, list[Path]] = {}
        for path in self.config.bundles:
            why = [misfit(path, feed.sensor, feed.cameras) for feed in self.feeds]
            fitting = [index for index, one in enumerate(why) if one is None]
            if not fitting:
                raise next(one for one in why if one is not None)
            chosen.setdefault(fitting[0], []).append(path)
        for index, paths in chosen.items():
            self._start_mind(self.feeds[index], tuple(paths), index)

    def _start_mind(self, feed: _Feed, paths: tuple[Path, ...], number: int) -> None:
        decisions, orders = Ring(_NOTE_BYTES), Ring(_NOTE_BYTES)
        self._stack.callback(decisions.close)
        self._stack.callback(orders.close)
        reader = self._stack.enter_context(RingReader(decisions.name))
        to = self._stack.enter_context(RingWriter(orders.name))
        name = f"monitor {number + 1}" if len(self.feeds) > 1 else "monitor"

        def job(place: Place) -> Inference:
            return Inference(
                place=place, bundles=paths, sensor=feed.sensor, cameras=feed.cameras,
                ring=feed.ring.name, source_row=feed.worker.row, decisions=decisions.name,
                least_confidence=self.config.least_confidence, orders=orders.name,
                drill=self.config.drill,
            )  # fmt: skip

        worker = self._add(name, infer, job)
        self._minds.append(_Mind(worker, feed, decisions, reader, orders, to, [], False))

    def _start_recorder(self) -> None:
        orders, news = Ring(_NOTE_BYTES), Ring(_NOTE_BYTES)
        self._stack.callback(orders.close)
        self._stack.callback(news.close)
        self._to_recorder = self._stack.enter_context(RingWriter(orders.name))
        self._news = self._stack.enter_context(RingReader(news.name))
        sources, self.not_recorded = choose_recorded(
            [(f.ring.name, f.worker.row, f.sensor, f.cameras) for f in self.feeds]
        )

        def job(place: Place) -> Recording:
            return Recording(
                place=place, sources=sources, orders=orders.name, news=news.name,
                largest_bytes=self.config.disk_bytes,
            )  # fmt: skip

        self._add("recorder", record, job)

    def view_config(self, recordings: Path) -> ViewConfig:
        """Return what the page needs to see this station.

        Args:
            recordings: Folder of recordings that are started from the page.
        """
        return ViewConfig(
            sources=tuple(
                Seen(url=feed.url, ring=feed.ring.name, sensor=feed.sensor, cameras=feed.cameras)
                for feed in self.feeds
            ),
            decisions=tuple(mind.decisions.name for mind in self._minds),
            status=self.status.name,
            requests=self.requests.name,
            recordings=recordings,
        )

    def add_process(
        self, name: str, entry: Callable[[Any], None], job: Callable[[Place], Any]
    ) -> tuple[Any, ...]:
        """Start one more process under this supervisor, such as the page; return its report."""
        return self._wait_for(self._add(name, entry, job))

    def _add(self, name: str, entry: Callable[[Any], None], job: Callable[[Place], Any]) -> Worker:
        worker = Worker(name, len(self._workers), entry, job)
        self._workers.append(worker)
        self._begin(worker)
        return worker

    def _begin(self, worker: Worker) -> None:
        self._beats.clear(worker.row)
        if worker.report is not None:
            worker.report.close()
        mine, theirs = self._context.Pipe(duplex=False)
        place = Place(
            name=worker.name, beats=self._beats.name, row=worker.row, parent=os.getpid(),
            report=theirs,
        )  # fmt: skip
        # Not daemonic: cameras have a capture process each. A worker ends with its parent.
        worker.process = self._context.Process(
            target=worker.entry, args=(worker.job(place),), name=f"taxel {worker.name}"
        )
        worker.report = mine
        worker.starts += 1
        worker.process.start()
        theirs.close()

    def _wait_for(self, worker: Worker) -> tuple[Any, ...]:
        """Return a process's report.

        Raises:
            TaxelError: It could not open what it needs.
        """
        report = worker.report
        words: tuple[Any, ...] = ("failed", "it ended without a word")
        if report is not None:
            with contextlib.suppress(EOFError):
                words = report.recv() if report.poll(_OPEN_S) else ("failed", "it took too long")
        if words[0] == "opened":
            return words
        if isinstance(words[1], TaxelError):
            raise words[1]
        raise BadSource(f"the {worker.name} to start", str(words[1]), "run: taxel doctor")

    def close(self) -> None:
        """End every process, the sources first; what is recorded is completed."""
        with contextlib.suppress(AttributeError):
            self._beats.stop()
        until_s = monotonic() + _END_S
        for worker in self._workers:
            process = worker.process
            if process is None or process.pid is None:
                continue
            if worker.given_up:
                continue
            process.join(max(0.05, until_s - monotonic()))
            if process.is_alive():
                process.kill()
                process.join()
                self._fail(worker)
        self._hear_the_rest()
        with contextlib.suppress(AttributeError):
            self._final = self.ledger()
        for worker in self._workers:
            if worker.report is not None:
                worker.report.close()
        self._stack.close()

    def _hear_the_rest(self) -> None:
        """Take the recorder's last news and the last decisions."""
        with contextlib.suppress(AttributeError):
            self._hear(monotonic())

    def ledger(self) -> dict[str, Any]:
        """Return, for each process, what it made, took in and lost."""
        if self._final is not None:
            return self._final
        found: dict[str, Any] = {}
        for worker in self._workers:
            beat = self._beats.read(worker.row)
            found[worker.name] = {
                "produced": beat.produced, "consumed": beat.consumed, "dropped": beat.dropped,
                "starts": worker.starts,
            }  # fmt: skip
        return found
