"""A process of a station: how it ends and what it says of that; its rank, and back again."""

from __future__ import annotations

import multiprocessing
import os
import threading
from multiprocessing.connection import Connection

import pytest
from station_rig import WAIT_S

from taxel.clock import ManualClock, SystemClock
from taxel.errors import BadBundle
from taxel.live.station import worker
from taxel.live.station.beats import Beats, Work
from taxel.live.station.worker import (
    Place,
    Rank,
    at_work,
    hurried,
    hurry,
    hurry_threads,
    may_run_in_real_time,
)

CONTEXT = multiprocessing.get_context("spawn")
State = tuple[int, int, int]
"""Scheduler, its priority, niceness."""


def test_a_supervisor_goes_before_sources_and_these_before_models():
    assert Rank.SUPERVISOR > Rank.SOURCE > Rank.MODEL > Rank.ORDINARY


def state() -> State:
    policy = os.sched_getscheduler(0) & ~os.SCHED_RESET_ON_FORK
    return policy, os.sched_getparam(0).sched_priority, os.getpriority(os.PRIO_PROCESS, 0)


def _hurry(rank: int, permitted: bool, pipe: Connection) -> None:
    if not permitted:
        worker._schedule = lambda *_: False  # type: ignore[assignment]  # as without the right
    states = [state()]
    before = hurry(Rank(rank))
    states.append(state())
    child = os.fork()
    if child == 0:
        pipe.send(state())
        os._exit(0)
    os.waitpid(child, 0)
    hurry(before)
    states.append(state())
    pipe.send(states)


def ranked(rank: Rank, *, permitted: bool) -> tuple[State, list[State]]:
    """Return a child's state, and those before, during and after a process's hurry."""
    mine, theirs = CONTEXT.Pipe(duplex=False)
    process = CONTEXT.Process(target=_hurry, args=(int(rank), permitted, theirs))
    process.start()
    child, states = mine.recv(), mine.recv()
    process.join()
    return child, states


@pytest.mark.skipif(not may_run_in_real_time(), reason="real-time scheduling is not permitted")
@pytest.mark.parametrize("rank", [Rank.MODEL, Rank.SOURCE, Rank.SUPERVISOR])
def test_a_rank_is_a_real_time_priority_and_is_given_back(rank: Rank):
    child, (before, during, after) = ranked(rank, permitted=True)
    assert before[0] == os.SCHED_OTHER
    assert during[:2] == (os.SCHED_FIFO, rank)
    assert after == before
    # What a source starts reads its camera; what the supervisor starts says itself what it is.
    assert child[0] == (os.SCHED_OTHER if rank is Rank.SUPERVISOR else os.SCHED_FIFO)


def test_what_lives_in_simulated_time_does_not_hurry(monkeypatch: pytest.MonkeyPatch):
    """It never waits: in real time it would leave nothing to others."""
    ranks: list[Rank] = []
    monkeypatch.setattr(
        worker, "hurry", lambda rank=Rank.SUPERVISOR: ranks.append(rank) or Rank.ORDINARY
    )
    with hurried(ManualClock()):
        assert ranks == []
    with hurried(SystemClock()):
        assert ranks == [Rank.SUPERVISOR]
    assert ranks == [Rank.SUPERVISOR, Rank.ORDINARY]


def _hurry_threads(permitted: bool, pipe: Connection) -> None:
    if not permitted:
        worker._schedule = lambda *_: False  # type: ignore[assignment]  # as without the right
    over, numbers = threading.Event(), []

    def wait(niceness: int) -> None:
        os.setpriority(os.PRIO_PROCESS, threading.get_native_id(), niceness)
        numbers.append(threading.get_native_id())
        over.wait()

    own = os.getpriority(os.PRIO_PROCESS, 0)
    threads = [threading.Thread(target=wait, args=(at,)) for at in (own, own + 1)]
    for thread in threads:
        thread.start()
        while len(numbers) <= threads.index(thread):
            pass
    hurry_threads(Rank.MODEL)
    everybody = (threading.get_native_id(), *numbers)
    pipe.send([os.sched_getscheduler(number) for number in everybody])
    pipe.send([os.getpriority(os.PRIO_PROCESS, number) - own for number in everybody])
    over.set()


def hurried_threads(*, permitted: bool) -> tuple[list[int], list[int]]:
    """Return schedulers and how the niceness changed: of the main thread, one like it, one that
    stands back by one.
    """
    mine, theirs = CONTEXT.Pipe(duplex=False)
    process = CONTEXT.Process(target=_hurry_threads, args=(permitted, theirs))
    process.start()
    schedulers, nicer = mine.recv(), mine.recv()
    process.join()
    return schedulers, nicer


@pytest.mark.skipif(not may_run_in_real_time(), reason="real-time scheduling is not permitted")
def test_threads_that_were_there_before_take_the_rank_but_not_those_that_stand_back():
    """What a source or a model starts while it is opened, as a camera's reader."""
    schedulers, _ = hurried_threads(permitted=True)
    assert schedulers == [os.SCHED_FIFO, os.SCHED_FIFO, os.SCHED_OTHER]


def test_threads_that_were_there_before_share_the_niceness_that_stands_in():
    """A camera's reader waited behind other programs, though its source's main thread did not."""
    _, (main, like_it, stands_back) = hurried_threads(permitted=False)
    assert like_it == main
    assert stands_back == 1


def test_where_real_time_is_not_permitted_niceness_stands_in(monkeypatch: pytest.MonkeyPatch):
    _, (before, during, after) = ranked(Rank.SOURCE, permitted=False)
    assert before[0] == during[0] == os.SCHED_OTHER
    assert during[2] in (before[2], worker._NICENESS)
    assert after == before


def test_where_only_low_ranks_are_permitted_nobody_is_in_real_time(monkeypatch: pytest.MonkeyPatch):
    """With `rtprio 2` models would run before the supervisor that has to end one that hangs."""
    given: list[int] = []

    def permit(_: int, policy: int, param: os.sched_param) -> None:
        if param.sched_priority > 2:
            raise PermissionError
        given.append(param.sched_priority)

    monkeypatch.setattr(os, "sched_setscheduler", permit)
    assert not worker._schedule(Rank.MODEL)
    assert not may_run_in_real_time()
    assert max(given, default=0) == 0


def _fail(place: Place, error: Exception | None) -> None:
    with at_work(place) as pulse:
        pulse.produced = 3
        pulse.beat()
        if error is not None:
            raise error


REFUSAL = BadBundle("a bundle", "a picture", "train one")


@pytest.mark.parametrize(
    ("error", "code", "work", "words"),
    [
        (None, 0, Work.ENDED, None),
        (ZeroDivisionError("by no touch"), 1, Work.FAILED, "ZeroDivisionError: by no touch"),
        (REFUSAL, 1, Work.FAILED, REFUSAL),
    ],
    ids=["nothing", "an error", "a refusal"],
)
def test_a_process_that_fails_says_why_and_that_it_failed(
    error: Exception | None, code: int, work: Work, words: object
):
    """As a model that raises does: the supervisor must not wait for what will never come."""
    mine, theirs = CONTEXT.Pipe(duplex=False)
    with Beats() as beats:
        place = Place(name="monitor", beats=beats.name, row=4, parent=os.getpid(), report=theirs)
        process = CONTEXT.Process(target=_fail, args=(place, error))
        process.start()
        theirs.close()
        process.join(WAIT_S)
        beat = beats.read(4)
        assert (process.exitcode, beat.work, beat.produced) == (code, work, 3)
        heard = mine.recv() if mine.poll() and error is not None else ("failed", None)
    assert heard[0] == "failed"
    assert str(heard[1]) == str(words)
    assert type(heard[1]) is type(words)


def test_an_ordinary_process_stays_ordinary(monkeypatch: pytest.MonkeyPatch):
    """As that of a recogniser of camera trials: nothing urgent waits for it."""
    asked: list[object] = []
    monkeypatch.setattr(worker, "_schedule", lambda *words: asked.append(words))
    monkeypatch.setattr(os, "setpriority", lambda *words: asked.append(words))
    hurry_threads(Rank.ORDINARY)
    assert asked == []
