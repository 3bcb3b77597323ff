"""Ranks: who runs before whom, in real time or by niceness, and back again."""

from __future__ import annotations

import multiprocessing
import os
from multiprocessing.connection import Connection

import pytest

from taxel.live.station import worker
from taxel.live.station.worker import Rank, hurry, may_run_in_real_time

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
        worker._schedule = lambda _: False  # type: ignore[assignment]  # as without the right
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
