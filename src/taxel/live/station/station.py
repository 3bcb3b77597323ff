"""A station: sources, monitors, recorder and page as processes, and the supervisor over them.

The supervisor is this process. It reads decisions and signs of life every few milliseconds,
starts again what died, and orders the actuator by the interlock; nothing it calls waits. Knows
nothing about windows, models or pixels.
"""

from __future__ import annotations

import contextlib
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, field
from multiprocessing.process import BaseProcess
from pathlib import Path
from time import monotonic, sleep
from typing import Any, Self

from taxel.actions.actuators import Actuator, hear_all
from taxel.actions.grip_policy import GripPolicy
from taxel.actions.interlock import Interlock, InterlockConfig
from taxel.live.station.acquisition import Acquisition, acquire
from taxel.live.station.beats import Beats, Work
from taxel.live.station.crew import Crew, Worker
from taxel.live.station.fitting import misfit
from taxel.live.station.guard import Guard, GuardConfig
from taxel.live.station.inference import Inference, infer
from taxel.live.station.packets import pack, unpack
from taxel.live.station.page_link import Seen, ViewConfig
from taxel.live.station.recording import Recording, choose_recorded, record
from taxel.live.station.ring import Ring, RingReader, RingWriter
from taxel.live.station.telling import Latencies, consumer_snapshot, guard_snapshot
from taxel.live.station.worker import Place, hurry, settle_memory
from taxel.signals import CameraInfo, SensorInfo

TICK_S = 0.001
"""How often the supervisor looks. Source: our choice: half of it is in every alarm's latency."""
_TELL_S = 0.05
"""How often the page is told. Source: our choice."""
_RING_BYTES = 16 * 2**20
"""Of a source: six seconds of two cameras at 60 Hz. Source: our choice."""
_NOTE_BYTES = 2**18
_EVENTS = 200
_NO_RECORDING: dict[str, Any] = {"on": False, "path": "", "seconds": 0.0, "bytes": 0, "error": ""}


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
class _Feed:
    """One open source."""

    url: str
    ring: str
    to: RingWriter
    worker: Worker
    sensor: SensorInfo = field(
        default_factory=lambda: SensorInfo(name="none", channels=(), units=(), rate_hz=0.0)
    )
    cameras: tuple[CameraInfo, ...] = ()


@dataclass(slots=True)
class _Mind:
    """One inference process."""

    worker: Worker
    decisions: str
    heard: RingReader
    to: RingWriter
    told: list[dict[str, Any]] = field(default_factory=list)
    """What each bundle is."""

    @property
    def watches(self) -> bool:
        """True where one of them watches a grasp."""
        return any(one["kind"] == "grasp" for one in self.told)


Listener = Callable[[dict[str, Any]], None]
"""Called with each note of a monitor, a recogniser or the recorder."""


class Station:
    """Everything that runs live. Use it in a `with` block, then call `run`.

    Args:
        config: What runs.
        on_note: Called with each decision and each piece of news; must not wait.

    Raises:
        BadSource: A source cannot be opened.
        BadBundle: A bundle is damaged, or fits none of the sources.
    """

    def __init__(self, config: StationConfig, on_note: Listener = lambda _: None) -> None:
        self.config = config
        self._on_note = on_note
        self._stack = contextlib.ExitStack()
        self._beats = self._stack.enter_context(Beats())
        self._crew = Crew(self._beats, patient=config.drill)
        self.feeds: list[_Feed] = []
        self._minds: list[_Mind] = []
        self.guard = Guard(
            Interlock(config.interlock), config.guard, GripPolicy(config.interlock.min_n)
        )
        self._actuators: list[Actuator] = []
        self._faults: dict[str, str] = {}
        self._releasing = False
        self.latencies = Latencies()
        self._answers: dict[str, dict[str, Any]] = {}
        self.recording = dict(_NO_RECORDING)
        """The recorder's newest note."""
        self.events: deque[tuple[float, str]] = deque(maxlen=_EVENTS)
        """What happened, (monotonic seconds, words)."""
        self.not_recorded = ""
        """Names of arrays that a recording of this station does not hold."""
        self._told_s = 0.0
        self._word = ""
        self._stopped = False
        self._coming: list[Worker] = []
        self._final: dict[str, dict[str, int]] | None = None

    def __enter__(self) -> Self:
        try:
            self._start()
        except BaseException:
            self.close()
            raise
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    # What others may ask.

    def workers(self) -> dict[str, BaseProcess]:
        """Return the processes by name, as drills need them."""
        every = self._crew.workers
        return {one.name: one.process for one in every if one.process is not None}

    def order(self, name: str, note: dict[str, Any]) -> None:
        """Send an order to a source's or a monitor's process."""
        ends = [(mind.worker, mind.to) for mind in self._minds]
        ends += [(feed.worker, feed.to) for feed in self.feeds]
        for worker, to in ends:
            if worker.name == name:
                to.put(pack(note))

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

    def drive(self, actuator: Actuator) -> None:
        """Give each tick's order to one more actuator, which is connected."""
        self._actuators.append(actuator)

    def arm(self) -> tuple[str, ...]:
        """Arm the interlock, on behalf of a person at the terminal; return what forbids it."""
        return self.guard.interlock.arm(monotonic())

    def acknowledge(self) -> None:
        """Acknowledge every alarm, on behalf of a person."""
        for alarm in self.guard.alarms.alarms:
            self.guard.alarms.acknowledge(alarm.number, monotonic())

    def stop(self) -> None:
        """End `run` at its next tick."""
        self._stopped = True

    def ledger(self) -> dict[str, dict[str, int]]:
        """Return, for each process, what it made, took in and lost."""
        return self._crew.ledger() if self._final is None else self._final

    def last_beat_s(self, name: str) -> float:
        """Return when a process last gave a sign of life, monotonic seconds."""
        row = next(worker.row for worker in self._crew.workers if worker.name == name)
        return self._beats.read(row).beat_s

    def view_config(self, recordings: Path) -> ViewConfig:
        """Return what the page needs to see this station.

        Args:
            recordings: Folder of recordings that are started from the page.
        """
        return ViewConfig(
            sources=tuple(
                Seen(url=feed.url, ring=feed.ring, sensor=feed.sensor, cameras=feed.cameras)
                for feed in self.feeds
            ),
            decisions=tuple(mind.decisions for mind in self._minds),
            status=self._status_name,
            requests=self._requests_name,
            recordings=recordings,
        )

    def add_process(
        self, name: str, entry: Callable[[Any], None], job: Callable[[Place], Any]
    ) -> tuple[Any, ...]:
        """Start one more process under this supervisor, such as the page; return its report."""
        return self._crew.opened(self._crew.add(name, entry, job))

    # The supervisor.

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
            works = [self._beats.read(feed.worker.row).work for feed in self.feeds]
            if all(work in (Work.ENDED, Work.FAILED) for work in works):
                break
            sleep(max(0.0, now_s + TICK_S - monotonic()))

    def tick(self, now_s: float) -> None:
        """Hear, weigh, act, tell: once."""
        notes = self._hear(now_s)
        self._look(now_s)
        faults = hear_all(self.guard.interlock, self._actuators, now_s)
        order = self.guard.tick(now_s)
        if self._releasing:
            self._releasing = not self.guard.interlock.release(self.config.interlock.min_n)
        for actuator in self._actuators:
            actuator.tell(self.guard.decision, order, now_s)
        acted_s = monotonic()
        self._weigh_actuators(faults, now_s)
        for note in notes:
            self.latencies.add(note, acted_s)
            self._on_note(note)
        word, reason, _ = self.guard.shown
        if word != self._word:
            self._word = word
            self.events.append((now_s, f"{word}{': ' if reason else ''}{reason}"))
        if now_s - self._told_s >= _TELL_S:
            self._told_s = now_s
            self._status_to.put(pack(self.snapshot(now_s)))

    def snapshot(self, now_s: float) -> dict[str, Any]:
        """Return the state of everything, as the page's link gives it."""
        interlock = self.guard.interlock
        gripper = None
        if self._actuators:
            gripper = {
                "interlock": str(interlock.state), "armed": interlock.armed,
                "commanded_n": interlock.force_n, "force_n": None, "motion": "",
                "note": next(iter(self._faults.values()), interlock.reason),
                **self._actuators[0].told(),
            }  # fmt: skip
        limits = next((one for mind in self._minds for one in mind.told if "warn" in one), {})
        return guard_snapshot(self.guard, now_s) | {
            "thresholds": {key: limits[key] for key in ("warn", "unstable") if key in limits},
            "answers": [
                {"target": a["target"], "label": a["grasp"], "confidence": a["grasp_confidence"],
                 "reason": a["reason"]} for a in self._answers.values()
            ],
            "consumers": [
                consumer_snapshot(worker.name, self._beats.read(worker.row), now_s)
                for worker in self._crew.workers
                if all(worker is not feed.worker for feed in self.feeds)
            ],
            "latency_ms": self.latencies.lately_ms(now_s),
            "gripper": gripper,
            "recording": {key: self.recording.get(key) for key in _NO_RECORDING},
            "events": [list(event) for event in self.events],
        }  # fmt: skip

    def _hear(self, now_s: float) -> list[dict[str, Any]]:
        heard = []
        for mind in self._minds:
            for note in _notes(mind.heard):
                heard.append(note)
                if note["kind"] == "new grasp":
                    self._begin_grasp()
                elif note["kind"] == "grasp":
                    self.guard.decide(mind.worker.name, note)
                    self._weigh_late(note, now_s)
                else:
                    self._answers[note["target"]] = note
            if mind.watches:
                beat = self._beats.read(mind.worker.row)
                self.guard.beat(mind.worker.name, beat.beat_s, beat.patience_s)
        for note in _notes(self._news):
            self.recording = note
            self._weigh_recording(note, now_s)
            self._on_note(note)
        for wish in _notes(self._requests):
            self._grant(wish)
        return heard

    def _begin_grasp(self) -> None:
        """Begin again at the least force, once the new grasp is calm: that is the robot's doing."""
        self.guard.new_grasp(self.config.interlock.min_n)
        self._releasing = True

    def _weigh_actuators(self, faults: dict[str, str], now_s: float) -> None:
        for name in self._faults.keys() - faults.keys():
            self.guard.over(name, now_s)
        for name, fault in faults.items():
            if self._faults.get(name) != fault:
                self.guard.trouble(name, f"{name}: {fault}", now_s)
        self._faults = faults

    def _weigh_late(self, note: dict[str, Any], now_s: float) -> None:
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

    def _grant(self, wish: dict[str, Any]) -> None:
        """Do what the page may ask: it cannot arm or move anything."""
        if wish.get("do") == "acknowledge":
            self.acknowledge()
        elif wish.get("do") == "record":
            self.record(Path(wish["path"]), dict(wish.get("labels", {})))
        elif wish.get("do") == "end":
            self.end_recording()

    def _look(self, now_s: float) -> None:
        """See which processes have died; start them again."""
        for worker, how in self._crew.dead():
            self.guard.died(worker.name)
            text = f"{worker.name} ended by {how}"
            self.guard.trouble(worker.name, text, now_s)
            self.events.append((now_s, text))
            if self._crew.again(worker):
                self._coming.append(worker)
        for worker in list(self._coming):
            if self._beats.read(worker.row).work is Work.RUNNING:
                self._coming.remove(worker)
                self.guard.over(worker.name, now_s)
                if any(mind.worker is worker and mind.watches for mind in self._minds):
                    self.guard.expect(worker.name, now_s)

    # Starting and ending.

    def _start(self) -> None:
        hurry()
        self._status_name = self._ring()
        self._status_to = self._stack.enter_context(RingWriter(self._status_name))
        self._requests_name = self._ring()
        self._requests = self._stack.enter_context(RingReader(self._requests_name))
        for number, url in enumerate(self.config.sources):
            self._start_feed(url, number)
        for feed in self.feeds:
            feed.sensor, feed.cameras = self._crew.opened(feed.worker)
        chosen = self._assign()
        for index, paths in chosen.items():
            self._start_mind(self.feeds[index], paths, index)
        recorder = self._start_recorder()
        now_s = monotonic()
        for mind in self._minds:
            mind.told = self._crew.opened(mind.worker)[0]
            if mind.watches:
                self.guard.expect(mind.worker.name, now_s)
        self._crew.opened(recorder)
        settle_memory()

    def _start_feed(self, url: str, number: int) -> None:
        ring, orders = self._ring(_RING_BYTES), self._ring()
        name = f"source {number + 1}" if len(self.config.sources) > 1 else "source"

        def job(place: Place) -> Acquisition:
            return Acquisition(place=place, url=url, ring=ring, orders=orders)

        to = self._stack.enter_context(RingWriter(orders))
        self.feeds.append(_Feed(url, ring, to, self._crew.add(name, acquire, job)))

    def _assign(self) -> dict[int, tuple[Path, ...]]:
        """Return the bundles of each source: each bundle goes to the first that it fits.

        Raises:
            BadBundle: It fits none.
        """
        chosen: dict[int, tuple[Path, ...]] = {}
        for path in self.config.bundles:
            why = [misfit(path, feed.sensor, feed.cameras) for feed in self.feeds]
            fitting = [index for index, one in enumerate(why) if one is None]
            if not fitting:
                raise next(one for one in why if one is not None)
            chosen[fitting[0]] = (*chosen.get(fitting[0], ()), path)
        return chosen

    def _start_mind(self, feed: _Feed, paths: tuple[Path, ...], number: int) -> None:
        decisions, orders = self._ring(), self._ring()
        name = f"monitor {number + 1}" if len(self.feeds) > 1 else "monitor"

        def job(place: Place) -> Inference:
            return Inference(
                place=place, bundles=paths, sensor=feed.sensor, cameras=feed.cameras,
                ring=feed.ring, source_row=feed.worker.row, decisions=decisions,
                least_confidence=self.config.least_confidence, orders=orders,
                drill=self.config.drill,
            )  # fmt: skip

        heard = self._stack.enter_context(RingReader(decisions))
        to = self._stack.enter_context(RingWriter(orders))
        self._minds.append(_Mind(self._crew.add(name, infer, job), decisions, heard, to))

    def _start_recorder(self) -> Worker:
        orders, news = self._ring(), self._ring()
        self._to_recorder = self._stack.enter_context(RingWriter(orders))
        self._news = self._stack.enter_context(RingReader(news))
        sources, self.not_recorded = choose_recorded(
            [(f.ring, f.worker.row, f.sensor, f.cameras) for f in self.feeds]
        )

        def job(place: Place) -> Recording:
            return Recording(
                place=place, sources=sources, orders=orders, news=news,
                largest_bytes=self.config.disk_bytes,
            )  # fmt: skip

        return self._crew.add("recorder", record, job)

    def _ring(self, size: int = _NOTE_BYTES) -> str:
        return self._stack.enter_context(Ring(size)).name

    def close(self) -> None:
        """End every process, the sources first; what is recorded is completed."""
        if self._final is not None:
            return
        self._crew.close()
        with contextlib.suppress(AttributeError):  # where it never came to a start
            self._hear(monotonic())
        self._final = self._crew.ledger()
        self._stack.close()


def _notes(reader: RingReader) -> list[dict[str, Any]]:
    found = [unpack(content) for content in reader.take()]
    return [note for note in found if isinstance(note, dict)]
