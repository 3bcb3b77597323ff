"""A station: sources, monitors, recorder and page as processes, and the supervisor over them.

The supervisor is this process. It reads decisions and signs of life every few milliseconds,
starts again what died, and orders the actuator by the interlock; nothing it calls waits. Knows
nothing about windows, models or pixels.

Background of our choices: docs/decisions/0019.
"""

from __future__ import annotations

import contextlib
from collections import deque
from collections.abc import Callable, Collection
from multiprocessing.process import BaseProcess
from pathlib import Path
from time import monotonic
from typing import Any, Self

from taxel.actions.actuators import Actuator
from taxel.actions.grip_policy import GripPolicy, GripPolicyConfig
from taxel.actions.interlock import Interlock
from taxel.clock import asleep_s
from taxel.decisions.reasons import kind_of
from taxel.decisions.stability import Stability
from taxel.live.station.alarm_watch import AlarmWatch, watch
from taxel.live.station.answers import Answers, end_alarms, weigh_alarm
from taxel.live.station.beats import Beats, Work
from taxel.live.station.driving import Driving
from taxel.live.station.guard import NO_GRASP, Guard
from taxel.live.station.late_cameras import LateCameras
from taxel.live.station.packets import notes_of, pack, unpack
from taxel.live.station.page_link import ViewConfig
from taxel.live.station.page_requests import fulfil
from taxel.live.station.person import Person
from taxel.live.station.process_watch import ProcessWatch
from taxel.live.station.processes import ProcessGroup, Worker
from taxel.live.station.recorder_link import RecorderLink
from taxel.live.station.ring import RingReader, RingWriter, wait_for_any
from taxel.live.station.shared import sweep
from taxel.live.station.snapshots import Latencies, consumer_snapshot, guard_snapshot
from taxel.live.station.wiring import StationConfig, Wiring, begin_grasp
from taxel.live.station.worker import Place, hurry, settle_memory

TICK_S = 0.001
"""How often the supervisor looks where no decision wakes it. Source: our choice: it notices what
falls silent, and hears actuators, so much later at most."""
_REST_S = 0.0002
"""The supervisor sleeps at least so long between two ticks, where nothing waits for it: on a slow
core a tick takes longer than `TICK_S`, and in real time nobody else would run there. Our choice."""
_STATUS_S = 0.05
"""How often the page gets the status. Source: our choice."""
_EVENTS = 200
UNKNOWN = Stability.UNKNOWN.word
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
        sweep()
        self._beats = self._stack.enter_context(Beats())
        self._processes = ProcessGroup(self._beats, patient=config.drill)
        limits = config.interlock
        policy = GripPolicy(max(limits.min_n, 0.1), GripPolicyConfig(most_n=limits.max_n))
        self.guard = Guard(Interlock(limits), config.guard, policy)
        self.driving = Driving(self.guard, limits.min_n, self._happened)
        self._recorder = RecorderLink(self.guard, self._happened)
        self.person = Person(self.guard, monotonic(), self._recorder.keep_trial)
        self._late = LateCameras(self.guard, self._happened)
        self.latencies = Latencies()
        self.answers = Answers(())
        self.events: deque[tuple[int, float, str]] = deque(maxlen=_EVENTS)
        """What happened last: (running number, monotonic seconds, words)."""
        self._event_number = 0
        self.skipped = 0
        """Sets of frames that monitors let go because they had fallen behind."""
        self.refused_requests = 0
        """Requests of the page that were refused."""
        self._status_s = 0.0
        self._logged: tuple[str, str | None] = (NO_GRASP, None)
        self._since_s, self._disarms = 0.0, 0
        self._stopped = False
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
        every = self._processes.workers
        return {worker.name: worker.process for worker in every if worker.process is not None}

    def order(self, name: str, note: dict[str, Any]) -> None:
        """Send an order to a source's or a monitor's process."""
        to = self.wiring.send_to(name)
        if to is not None:
            to.put(pack(note))

    def record(
        self,
        path: Path,
        labels: dict[str, str],
        groups: dict[str, str] | None = None,
        *,
        overwrite: bool = False,
    ) -> None:
        """Begin to record all sources; news say how it goes."""
        self._recorder.begin(path, labels, groups or {}, overwrite=overwrite)

    def end_recording(self) -> None:
        """Complete the recording under way."""
        self._recorder.end()

    @property
    def recording(self) -> dict[str, Any]:
        """The recorder's newest note."""
        return self._recorder.newest

    def react(self, what: str) -> None:
        """Log a person's reaction to the grasp, or its outcome.

        Raises:
            ValueError: It is neither.
        """
        now_s = monotonic()
        self.person.say(what, now_s)
        self._happened(now_s, f"the person: {what}")

    def new_grasp(self) -> None:
        """Announce to every monitor that the next moments are a new grasp's settled first ones."""
        begin_grasp(self.wiring.monitors)

    def drive(self, actuator: Actuator) -> None:
        """Give each tick's order to one more actuator, which is connected."""
        self.driving.add(actuator)

    def arm(self) -> tuple[str, ...]:
        """Arm the interlock, on behalf of a person at the terminal; return what forbids it."""
        return self.guard.interlock.arm(monotonic())

    def disarm(self, by: str = "a person at the terminal") -> None:
        """Order nothing more, on behalf of a person; a stop stays a stop."""
        self.guard.interlock.disarm(monotonic(), by)

    def acknowledge(self, seen: Collection[int] | None = None) -> None:
        """Acknowledge alarms by their keys, all unless given, on behalf of who saw them."""
        if self.guard.alarms.acknowledge_seen(seen, monotonic()):
            self.person.acknowledged(monotonic())

    def say(self, text: str) -> None:
        """Add words to the events, such as what a person did."""
        self._happened(monotonic(), text)

    def stop(self) -> None:
        """End `run` at its next tick."""
        self._stopped = True

    def ledger(self) -> dict[str, dict[str, int]]:
        """Return, for each process, what it made, took in and lost."""
        return self._processes.ledger() if self._final is None else self._final

    def last_beat_s(self, name: str) -> float:
        """Return when a process last gave a sign of life, monotonic seconds."""
        row = next(worker.row for worker in self._processes.workers if worker.name == name)
        return self._beats.read(row).beat_s

    def view_config(self) -> ViewConfig:
        """Return what the page needs to see this station."""
        return self.wiring.view_config()

    def add_process(
        self,
        name: str,
        entry: Callable[[Any], None],
        job: Callable[[Place], Any],
        *,
        ends_itself: bool = False,
    ) -> tuple[Any, ...]:
        """Start one more process under this supervisor, such as the page; return its report.

        Args:
            name: What it is called.
            entry: What it runs.
            job: Gives what it is to do, from its place.
            ends_itself: It completes its work where this process was killed.
        """
        return self._processes.opened(
            self._processes.add(name, entry, job, ends_itself=ends_itself)
        )

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
        self.person.begin(began_s)
        while not (self._stopped or stopped()):
            now_s = monotonic()
            if seconds is not None and now_s - began_s >= seconds:
                break
            self.tick(now_s)
            on_tick(now_s)
            if all(self._over(feed.worker) for feed in self.wiring.feeds):
                break
            left_s = max(now_s + TICK_S - monotonic(), _REST_S)
            wait_for_any([monitor.heard for monitor in self.wiring.monitors], left_s)
        self._beats.rest()

    def _over(self, worker: Worker) -> bool:
        """True once a source has ended by itself, or was given up."""
        return worker.given_up or self._beats.read(worker.row).work is Work.ENDED

    @property
    def failed(self) -> str:
        """Names of the processes that were given up; empty where none was."""
        return ", ".join(worker.name for worker in self._processes.workers if worker.given_up)

    def tick(self, now_s: float) -> None:
        """Read the processes' notes, judge them, act and report, once.

        Between two of them this process must not stand still: the alarm watch raises the alarm
        where it does, until `run` returns or the station is closed.
        """
        self._beats.tick(now_s)
        for gap in (self.guard.wake(now_s), self.guard.slept(asleep_s(), now_s)):
            if gap:
                self._happened(now_s, gap)
        notes = self._hear(now_s)
        self._watch.look(now_s)
        self._late.forget(self.wiring.given_up, now_s)
        end_alarms(self.guard, self.wiring.given_up, now_s)
        self.driving.tick(now_s)
        self.person.tick(now_s)
        acted_s = monotonic()
        for note in notes:
            self.latencies.add(note, acted_s)
            self._on_note(note)
        self._log_state(now_s)
        interlock = self.guard.interlock
        if interlock.disarms != self._disarms:
            self._disarms = interlock.disarms
            self._happened(now_s, interlock.reason)
        if now_s - self._status_s >= _STATUS_S:
            self._status_s = now_s
            self._status_to.put(pack(self.snapshot(now_s)))

    def _log_state(self, now_s: float) -> None:
        """Add what is shown to the events: each new word, and each new kind of reason for it."""
        word, reason, since_s = self.guard.shown
        shown = word, kind_of(reason)
        if shown == self._logged:
            return
        if self._logged[0] == UNKNOWN and word != UNKNOWN:
            reason += f"{', ' if reason else ''}after {since_s - self._since_s:.1f} s of {UNKNOWN}"
        if self.guard.decision.alarm and self.guard.slip is not None:
            reason = reason or self.guard.slip.words
        self._logged, self._since_s = shown, since_s
        self._happened(now_s, f"{word}{': ' if reason else ''}{reason}")

    def snapshot(self, now_s: float) -> dict[str, Any]:
        """Return the state of everything, as the page's link gives it."""
        bundles = [entry for monitor in self.wiring.monitors for entry in monitor.bundles]
        limits = next((entry for entry in bundles if "warn" in entry), {})
        answers = self.answers.newest(self.wiring.given_up)
        return guard_snapshot(self.guard, now_s) | {
            "thresholds": {k: limits[k] for k in ("clear", "warn", "unstable") if k in limits},
            "scored": limits.get("is_score", False),
            "answers": answers, "do": self.person.advice(answers), "trial": self.person.trial(),
            "consumers": [
                consumer_snapshot(worker.name, self._beats.read(worker.row), now_s)
                for worker in self._processes.workers
                if all(worker is not feed.worker for feed in self.wiring.feeds)
            ],
            "latency_ms": self.latencies.lately_ms(now_s),
            "gripper": self.driving.snapshot(),
            "recording": self._recorder.snapshot(),
            "events": [[time_s, text] for _, time_s, text in self.events],
        }  # fmt: skip

    def _hear(self, now_s: float) -> list[dict[str, Any]]:
        """Take in what monitors, recorder and page have sent; return the monitors' notes."""
        heard = []
        for monitor in self.wiring.monitors:
            if monitor.watches:
                # Before the decisions: one made before this beat is then among them.
                beat = self._beats.read(monitor.worker.row)
                for who in monitor.watchers:
                    self.guard.beat(who, beat.beat_s, beat.patience_s)
            for note in notes_of(monitor.heard.take()):
                heard.append(note)
                self._take_in(note, now_s)
        for note in self._recorder.hear(now_s):
            self._on_note(note)
        for content in self._requests.take():
            try:
                fulfil(self, unpack(content))
            except (ValueError, KeyError, TypeError):
                self.refused_requests += 1
        return heard

    def _take_in(self, note: dict[str, Any], now_s: float) -> None:
        """Pass one note of a monitor or a recogniser on to whom it concerns."""
        if note["kind"] == "new grasp":
            who = note.get("who", "")
            self.driving.new_grasp(who)
            self.person.new_grasp(now_s, str(note.get("outcome", "")), who)
        elif note["kind"] == "reaction":
            self.person.marked(str(note["what"]), float(note["time_s"]), note.get("who", ""))
        elif note["kind"] == "grasp":
            self.guard.decide(note["who"], note)
            self._recorder.keep_slip(note)
            self.skipped = max(self.skipped, int(note["skipped"]))
            self._late.hear(note, now_s)
        elif note["kind"] in ("waiting", "level"):
            self.answers.keep(note)
        elif note["kind"] == "news":
            self.say(note["text"])
        else:
            answer, news = self.answers.add(note)
            weigh_alarm(self.guard, answer, now_s)
            self.driving.recognised(answer)
            if news:
                self._happened(now_s, news)

    def _happened(self, now_s: float, text: str) -> None:
        self._event_number += 1
        self.events.append((self._event_number, now_s, text))

    # Starting and ending.

    def _start(self) -> None:
        self._stack.callback(hurry, hurry())
        self.wiring = wiring = Wiring(self.config, self._stack, self._processes)
        self._status_to = self._stack.enter_context(RingWriter(wiring.status))
        self._requests = self._stack.enter_context(RingReader(wiring.requests))
        self._recorder.wire(wiring.to_recorder, wiring.news)
        watched = self._processes, wiring, self._beats, self.guard
        self._watch = ProcessWatch(*watched, self._happened, self._recorder)
        now_s = monotonic()
        for monitor in wiring.monitors:
            for who in monitor.watchers:
                self.guard.expect(who, now_s)
        self.person.watch(wiring.watchers_by_cameras(), now_s)
        own = [e for monitor in wiring.monitors for e in monitor.bundles if e["kind"] == "answer"]
        self.answers = Answers(own, self.config.rules)
        wiring.levels = self.answers.levels
        stall_s = self.config.interlock.stall_s
        self.add_process(
            "alarm watch", watch, lambda place: AlarmWatch(place=place, stall_s=stall_s),
            ends_itself=True,
        )  # fmt: skip
        settle_memory()

    def close(self) -> None:
        """End every process, the sources first; what is recorded is completed."""
        if self._final is not None:
            return
        self._beats.rest()
        self._recorder.closing()
        over_s = monotonic()  # a last verdict may be waited for, and no grasp lasts meanwhile
        for name in self._processes.close():
            self.say(f"{name} did not end in time: what it had not sent yet is lost")
        with contextlib.suppress(AttributeError):  # where it never came to a start
            for note in self._hear(over_s):  # a trial's verdict may come at the source's end
                self._on_note(note)
        self.person.new_grasp(over_s)
        self._recorder.close()
        self._final = self._processes.ledger()
        self._stack.close()
