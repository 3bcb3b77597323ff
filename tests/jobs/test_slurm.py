"""Claims about SLURM's queue, with a queue that is made here."""

import sys
from collections.abc import Callable, Sequence
from threading import Event
from types import SimpleNamespace
from typing import Any

import pytest
from work_to_do import square

from taxel.jobs.call import Call, JobResult
from taxel.jobs.place import Place
from taxel.jobs.slurm_engine import SlurmEngine


class Lost(Exception):
    """A node took the job with it."""


class Job:
    """A job of the queue; one of "stuck" waits, and then cannot be read."""

    def __init__(self, work: Callable[[Call], JobResult], call: Call) -> None:
        self.work, self.call = work, call
        self.over, self.cancelled = Event(), Event()
        if call.name != "stuck":
            self.over.set()

    def done(self) -> bool:
        return self.over.is_set()

    def result(self) -> JobResult:
        if self.call.name == "stuck":
            raise ValueError("no such result")
        return self.work(self.call)

    def cancel(self) -> None:
        self.cancelled.set()


@pytest.fixture
def queue(monkeypatch: pytest.MonkeyPatch) -> list[Job]:
    jobs: list[Job] = []

    class Executor:
        def __init__(self, **_: object) -> None: ...

        def update_parameters(self, **_: object) -> None: ...

        def map_array(self, work: Callable[[Call], JobResult], calls: Sequence[Call]) -> list[Job]:
            new = [Job(work, call) for call in calls]
            jobs.extend(new)
            return new

    utils = SimpleNamespace(UncompletedJobError=Lost, FailedJobError=Lost)
    module: Any = SimpleNamespace(AutoExecutor=Executor, core=SimpleNamespace(utils=utils))
    monkeypatch.setitem(sys.modules, "submitit", module)
    return jobs


def call(name: str) -> Call:
    return Call(work=square, args=(3,), name=name)


@pytest.mark.parametrize("ends", [False, True])
def test_a_job_that_was_given_up_leaves_the_queue_and_later_work_is_done(
    queue: list[Job], ends: bool
) -> None:
    """As where another of the same work failed, whether the job has ended meanwhile or not."""
    engine = SlurmEngine(Place(engine="slurm", executor="local"), 2, print)
    try:
        stuck, first = engine.submit([call("stuck"), call("first")])
        assert first.result(10.0).value() == 9
        stuck.cancel()
        if ends:
            queue[0].over.set()
        (later,) = engine.submit([call("later")])
        assert later.result(10.0).value() == 9
        assert queue[0].cancelled.wait(10.0)
    finally:
        engine.close()
