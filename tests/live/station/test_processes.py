"""Processes of a station: who is started again, given up, or killed, and what is said of it.

Nothing is started: the processes are dummies and the clock is set by hand.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from types import SimpleNamespace
from typing import Any, cast

import pytest

from taxel.actions.interlock import Interlock, InterlockConfig
from taxel.clock import ManualClock
from taxel.errors import BadRecording, BadSource, TaxelError
from taxel.live.station import processes as module
from taxel.live.station.beats import Beats, Work
from taxel.live.station.guard import Guard
from taxel.live.station.process_watch import ProcessWatch
from taxel.live.station.processes import ProcessGroup, Worker
from taxel.live.station.recorder_link import RecorderLink
from taxel.live.station.wiring import Wiring
from taxel.live.station.worker import Place


class Process:
    """A process that runs until it is told how to end."""

    def __init__(self, **_: Any) -> None:
        self.exitcode: int | None = None
        self.ends_when_asked = True

    def start(self) -> None:
        """It runs already."""

    def join(self, longest_s: float | None = None) -> None:
        if self.exitcode is None and self.ends_when_asked:
            self.exitcode = 0

    def is_alive(self) -> bool:
        return self.exitcode is None

    def kill(self) -> None:
        self.exitcode = -9


class Report:
    """The end of a pipe: one word, or none, or nothing in time."""

    def __init__(self, words: Any = None, *, ready: bool = True) -> None:
        self._words, self._ready = words, ready

    def poll(self, longest_s: float) -> bool:
        return self._ready

    def recv(self) -> Any:
        if self._words is None:
            raise EOFError
        return self._words

    def close(self) -> None:
        """Nothing to let go of."""


class Rig:
    """A crew of dummies."""

    def __init__(self, beats: Beats, clock: ManualClock, *, patient: bool = False) -> None:
        self.beats, self.clock = beats, clock
        self.processes = ProcessGroup(beats, patient=patient)
        pipe = (Report(), Report())
        context = SimpleNamespace(Pipe=lambda duplex: pipe, Process=Process)
        self.processes._context = cast("Any", context)

    def add(self, name: str) -> Worker:
        return self.processes.add(name, lambda _: None, lambda place: place)

    def running(self, worker: Worker, beat_s: float, patience_s: float = 0.0) -> None:
        """Let it have given its last sign of life then."""
        with pytest.MonkeyPatch.context() as patch:
            patch.setattr("time.monotonic_ns", lambda: round(beat_s * 1e9))
            self.beats._view.write(
                worker.row, produced=7, consumed=5, dropped=2, patience_s=patience_s
            )

    def die(self, worker: Worker, exitcode: int = -9) -> None:
        cast("Any", worker.process).exitcode = exitcode


@pytest.fixture
def rig(monkeypatch: pytest.MonkeyPatch) -> Iterator[Rig]:
    clock = ManualClock()
    monkeypatch.setattr(module, "monotonic", clock.now_s)
    with Beats() as beats:
        yield Rig(beats, clock)


def test_a_process_that_does_not_end_is_killed_and_its_counts_stay(rig: Rig):
    ends, hangs = rig.add("source"), rig.add("monitor")
    for worker in (ends, hangs):
        rig.running(worker, 1.0)
    cast("Any", hangs.process).ends_when_asked = False
    assert rig.processes.close() == ["monitor"]  # whose last words are lost

    assert [cast("Any", w.process).exitcode for w in (ends, hangs)] == [0, -9]
    assert rig.beats.read(hangs.row).work is Work.FAILED
    assert rig.beats.read(ends.row).work is Work.RUNNING
    assert rig.processes.ledger()["monitor"] == {
        "produced": 7, "consumed": 5, "dropped": 2, "starts": 1,
    }  # fmt: skip


@pytest.mark.parametrize(("works_s", "exitcode"), [(30.0, 0), (math.inf, -9)])
def test_a_recorder_is_waited_for_while_it_completes_its_file(
    rig: Rig, works_s: float, exitcode: int
):
    """A long recording's end takes longer than 5 s; a disk that stands still gives no signs."""
    worker = rig.processes.add("recorder", lambda _: None, lambda place: place, ends_itself=True)
    process = cast("Any", worker.process)

    def join(longest_s: float | None = None) -> None:
        rig.clock.advance(longest_s or 0.0)
        if rig.clock.now_s() < 20.0:
            rig.running(worker, rig.clock.now_s() - 1.0)  # the file grows
        elif rig.clock.now_s() >= works_s:
            process.exitcode = 0
        elif math.isfinite(works_s):
            rig.running(worker, rig.clock.now_s())

    process.join = join
    rig.processes.close()
    assert process.exitcode == exitcode
    assert rig.clock.now_s() < 31.0


@pytest.mark.parametrize(("looks_s", "exitcode"), [(14.0, 0), (math.inf, -9)])
def test_a_process_is_waited_for_as_long_as_it_asked_for_patience(
    rig: Rig, looks_s: float, exitcode: int
):
    """The verdict on a whole trial was lost on a busy machine, where it takes longer than 5 s."""
    worker = rig.add("recogniser")
    process = cast("Any", worker.process)
    rig.running(worker, 0.0, patience_s=10.0)

    def join(longest_s: float | None = None) -> None:
        rig.clock.advance(longest_s or 0.0)
        if 6.0 < rig.clock.now_s() < 7.0:  # the next look
            rig.running(worker, rig.clock.now_s(), patience_s=10.0)
        elif rig.clock.now_s() >= looks_s:
            process.exitcode = 0

    process.join = join
    rig.processes.close()
    assert process.exitcode == exitcode
    assert rig.clock.now_s() < 18.0


def test_a_process_that_dies_too_often_within_half_a_minute_is_given_up(rig: Rig):
    worker = rig.add("source")
    for _ in range(5):
        rig.clock.advance(5.0)
        assert rig.processes.again(worker)
    rig.clock.advance(4.9)
    assert not rig.processes.again(worker)
    assert (worker.given_up, worker.starts) == (True, 6)
    assert rig.beats.read(worker.row).work is Work.FAILED


def test_a_process_that_follows_a_dead_one_hears_so(rig: Rig):
    places: list[Place] = []
    worker = rig.processes.add("source", lambda _: None, places.append)
    rig.processes.again(worker)
    assert [place.again for place in places] == [False, True]


def test_a_process_that_dies_as_often_but_seldom_is_started_each_time(rig: Rig):
    worker = rig.add("source")
    for _ in range(20):
        rig.clock.advance(6.1)
        assert rig.processes.again(worker)
    assert not worker.given_up


def test_in_a_drill_a_process_is_started_however_often_it_dies(
    rig: Rig,
):
    patient = Rig(rig.beats, rig.clock, patient=True)
    worker = patient.add("source")
    assert all(patient.processes.again(worker) for _ in range(50))


@pytest.mark.parametrize("patient", [False, True])
def test_a_process_that_may_run_once_is_given_up_at_its_first_death(rig: Rig, patient: bool):
    dummies = Rig(rig.beats, rig.clock, patient=patient)
    worker = dummies.processes.add("source", lambda _: None, lambda place: place, once=True)
    assert not dummies.processes.again(worker)
    assert (worker.given_up, worker.starts) == (True, 1)
    assert rig.beats.read(worker.row).work is Work.FAILED


@pytest.mark.parametrize(("exitcode", "how"), [(-9, "signal 9"), (1, "an error")])
def test_the_dead_are_named_with_how_they_ended_and_not_once_given_up(
    rig: Rig, exitcode: int, how: str
):
    worker, other = rig.add("source"), rig.add("recorder")
    rig.die(worker, exitcode)
    assert rig.processes.dead() == [(worker, how)]
    assert other.process is not None
    worker.given_up = True
    assert rig.processes.dead() == []


def test_a_process_that_died_of_an_error_is_named_with_its_own_words(rig: Rig):
    worker = rig.add("monitor")
    reason = BadSource("a bundle", "another file", "put it back")
    worker.report = cast("Any", Report(("failed", reason)))
    rig.die(worker, 1)
    how = "an error (needed a bundle; got another file; put it back)"
    assert rig.processes.dead() == [(worker, how)]


def test_what_cannot_be_read_of_a_dead_process_does_not_end_the_supervisor(rig: Rig):
    class Broken(Report):
        def recv(self) -> Any:
            raise TypeError("an exception that does not cross")

    worker = rig.add("monitor")
    worker.report = cast("Any", Broken(("failed", "x")))
    rig.die(worker, 1)
    assert rig.processes.dead() == [(worker, "an error")]


def test_a_process_that_ended_its_work_is_not_dead(rig: Rig):
    worker = rig.add("source")
    rig.beats._view.write(worker.row, Work.ENDED)
    rig.die(worker, 0)
    assert rig.processes.dead() == []


def test_only_those_that_run_are_silent(rig: Rig):
    silent, starting, dead, lively = map(rig.add, ("a", "b", "c", "d"))
    for worker, beat_s in ((silent, 1.0), (dead, 1.0), (lively, 9.5)):
        rig.running(worker, beat_s)
    rig.die(dead)
    assert rig.processes.silent(10.0, 2.5) == [silent]
    assert rig.beats.read(starting.row).work is Work.STARTING


@pytest.mark.parametrize(
    ("report", "got"),
    [
        (Report(("failed", "no such port")), "no such port"),
        (Report(), "it ended without a word"),
        (Report(ready=False), "it took too long"),
        (None, "it ended without a word"),
    ],
)
def test_a_process_that_cannot_start_is_one_line_that_says_why(rig: Rig, report: Any, got: str):
    worker = rig.add("recorder")
    worker.report = report
    with pytest.raises(BadSource, match=f"the recorder to start.*{got}"):
        rig.processes.opened(worker)


def test_an_error_that_a_process_reports_is_raised_as_it_is(rig: Rig):
    worker = rig.add("source")
    error = BadSource("a port", "none", "plug it in")
    worker.report = cast("Any", Report(("refused", error)))
    with pytest.raises(TaxelError) as caught:
        rig.processes.opened(worker)
    assert caught.value is error


class Watched:
    """A crew with one monitor that watches a grasp, a recogniser, and one that does not decide."""

    def __init__(self, rig: Rig) -> None:
        self.rig = rig
        self.guard = Guard(Interlock(InterlockConfig(min_n=15.0, max_n=50.0)))
        self.monitor, self.recorder = rig.add("monitor"), rig.add("recorder")
        self.recogniser = rig.add("recogniser")
        self.words: list[str] = []
        wiring = SimpleNamespace(
            watchers_of=lambda worker: ["monitor/0"] if worker is self.monitor else [],
            decides=lambda worker: worker in (self.monitor, self.recogniser),
        )
        self.watch = ProcessWatch(
            rig.processes, cast("Wiring", wiring), rig.beats, self.guard,
            lambda _, text: self.words.append(text), RecorderLink(self.guard),
        )  # fmt: skip
        self.guard.expect("monitor/0", 0.0)

    def alarm_on(self, kind: str) -> bool | None:
        found = [a.on for a in self.guard.alarms.alarms if a.kind == kind]
        return found[0] if found else None


def test_a_silent_process_is_reported_once_and_over_when_it_lives_again(rig: Rig):
    watched = Watched(rig)
    rig.running(watched.recorder, 1.0)
    for now_s in (3.4, 3.6, 3.7):
        watched.watch.look(now_s)
    assert watched.words == ["recorder has not answered for 2.5 s"]
    assert watched.alarm_on("recorder") is True
    rig.running(watched.recorder, 3.75)
    watched.watch.look(3.8)
    assert watched.alarm_on("recorder") is False


def test_a_monitor_that_hangs_for_five_seconds_is_killed_and_a_recorder_never(rig: Rig):
    """A recorder that stands still may hold a file that it will complete."""
    watched = Watched(rig)
    rig.running(watched.monitor, 1.0)
    rig.running(watched.recorder, 1.0)
    watched.watch.look(5.9)
    assert cast("Any", watched.monitor.process).exitcode is None
    watched.watch.look(6.1)
    assert cast("Any", watched.monitor.process).exitcode == -9
    assert cast("Any", watched.recorder.process).exitcode is None


def test_a_recogniser_that_hangs_is_started_again_and_has_the_time_that_it_asked_for(rig: Rig):
    """It stayed as it was, with its last answer and its alarm, until the station ended."""
    watched = Watched(rig)
    rig.running(watched.recogniser, 1.0, patience_s=10.0)
    watched.watch.look(40.9)
    assert cast("Any", watched.recogniser.process).exitcode is None
    watched.watch.look(41.1)
    watched.watch.look(41.2)
    assert watched.recogniser.starts == 2
    assert watched.words[-1] == "recogniser ended by signal 9"


def test_a_dead_monitor_is_a_stop_until_another_runs(rig: Rig):
    watched = Watched(rig)
    rig.running(watched.monitor, 1.0)
    rig.die(watched.monitor)
    watched.watch.look(1.1)
    watched.guard.tick(1.1)
    assert watched.words == ["monitor ended by signal 9"]
    assert watched.guard.shown[:2] == ("STOP", "the monitor has ended")
    assert watched.alarm_on("monitor") is True

    watched.watch.look(1.2)
    watched.guard.tick(1.2)
    assert watched.guard.shown[0] == "STOP"
    rig.running(watched.monitor, 1.3)
    watched.watch.look(1.3)
    watched.guard.tick(1.3)
    assert watched.guard.shown[0] == "UNKNOWN"


def test_a_process_that_is_given_up_is_said_to_be(rig: Rig):
    watched = Watched(rig)
    for _ in range(6):
        rig.die(watched.recorder, 1)
        watched.watch.look(rig.clock.now_s())
    assert watched.words[-1] == "recorder ended by an error, too often: given up"
    assert watched.alarm_on("recorder") is True


def test_of_a_replay_that_cannot_be_read_on_it_is_said_why_and_that_it_does_not_begin_anew(
    rig: Rig,
):
    watched = Watched(rig)
    worker = rig.processes.add("source", lambda _: None, lambda place: place, once=True)
    reason = BadRecording("a whole recording", "damaged bytes", "run: taxel recover")
    worker.report = cast("Any", Report(("failed", reason)))
    rig.die(worker, 1)
    for now_s in (1.0, 1.1):
        watched.watch.look(now_s)
    assert watched.words == [
        "source ended by an error (needed a whole recording; got damaged bytes; run: taxel "
        "recover): given up, as it would begin anew"
    ]
    assert watched.alarm_on("source") is True
    assert worker.starts == 1
