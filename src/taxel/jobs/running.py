"""Jobs side by side on the engine in use, results as they come or in order.

`use_engine` says where; without it, in processes of this machine. Inside a job nothing is shared
out again. Knows nothing about other engines, or about the work.

Source: docs/decisions/0050.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Generator, Iterator, Sequence
from concurrent.futures import Future, as_completed
from contextlib import contextmanager
from contextvars import ContextVar
from typing import Any, Protocol, TypeVar

from taxel.errors import BadInput, TaxelError, WorkerLost
from taxel.jobs.call import Call, JobResult, code_digest, inside_a_job, last_line, perform
from taxel.jobs.local import LocalEngine

_Result = TypeVar("_Result")
WORKERS_VARIABLE = "TAXEL_WORKERS"
"""Environment variable: processes at a time, where no option says."""
MOST_WORKERS = 1024
"""Source: our choice, docs/decisions/0050."""


class Engine(Protocol):
    """What runs jobs somewhere."""

    workers: int
    """Jobs at a time, where the engine knows."""
    log: Callable[[str], None]
    """Called with lines of the log."""
    logs_each: bool
    """Whether the log names every job's host: where there may be more than one."""
    lost: tuple[type[Exception], ...]
    """What a future raises where the engine gave a job up."""

    def submit(self, calls: Sequence[Call]) -> list[Future[JobResult]]:
        """Hand over jobs; return a future for each."""
        ...

    def close(self) -> None:
        """Let go of the workers; of those that the engine started itself, end them."""
        ...


_IN_USE: ContextVar[Engine | None] = ContextVar("taxel_engine", default=None)


def usual_workers() -> int:
    """Return $TAXEL_WORKERS, else how many cores this process may use, its CPU affinity.

    Raises:
        BadInput: The variable holds no number from 1 to `MOST_WORKERS`.
    """
    given = os.environ.get(WORKERS_VARIABLE)
    if given:
        if not given.isdecimal() or not 1 <= int(given) <= MOST_WORKERS:
            raise BadInput(f"1 to {MOST_WORKERS} in ${WORKERS_VARIABLE}", given, "set another")
        return int(given)
    return cores_here()


def cores_here() -> int:
    """Return how many cores this process may use."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


@contextmanager
def use_engine(engine: Engine) -> Iterator[Engine]:
    """Run the jobs of a block on an engine, and close it afterwards."""
    token = _IN_USE.set(engine)
    try:
        yield engine
    finally:
        _IN_USE.reset(token)
        engine.close()


def shared_out() -> bool:
    """Return whether an engine is in use that does more than a job at a time, or does it elsewhere.

    Work that is as well done here, where its data lie in memory, asks this first.
    """
    engine = _IN_USE.get()
    alone = isinstance(engine, LocalEngine) and engine.workers == 1
    return engine is not None and not alone and not inside_a_job()


def as_done(
    work: Callable[..., _Result],
    jobs: Sequence[tuple[Any, ...]],
    workers: int | None = None,
    names: Sequence[str] = (),
) -> Generator[tuple[int, _Result], None, None]:
    """Yield each job's number and result, in the order in which they are done.

    Args:
        work: A function of a module, so that a worker can import it.
        jobs: Arguments of each call: paths and configurations.
        workers: So many processes of this machine, for this call alone; unless given, the engine
            in use, or without any `usual_workers` processes. 1 works in this process.
        names: How logs call the jobs.

    Raises:
        WorkerLost: A job ended its worker each time.
    """
    used = _IN_USE.get() if workers is None else None
    engine = used or LocalEngine(workers or usual_workers())
    if inside_a_job() or (isinstance(engine, LocalEngine) and min(engine.workers, len(jobs)) < 2):
        for number, job in enumerate(jobs):
            yield number, work(*job)
        return
    code = code_digest() if engine.logs_each else ""
    calls = [Call(work=work, args=job, name=_name(work, names, number), code=code)
             for number, job in enumerate(jobs)]  # fmt: skip
    try:
        yield from _as_done(engine, calls)
    finally:
        if engine is not used:
            engine.close()


def _as_done(engine: Engine, calls: Sequence[Call]) -> Iterator[tuple[int, Any]]:
    futures = engine.submit(calls)
    numbers = {future: number for number, future in enumerate(futures)}
    try:
        for count, future in enumerate(as_completed(futures), start=1):
            number = numbers[future]
            done = take(engine, calls[number].name, future)
            if engine.logs_each:
                engine.log(f"{count} of {len(calls)}: {_log(calls[number].name, done)}")
            yield number, done.value()
    finally:
        for future in futures:
            future.cancel()


def submit(work: Callable[..., Any], *args: Any, name: str) -> Future[JobResult]:
    """Hand one job to the engine in use; without any, or with one worker, it is done now and here.

    Who submits so looks after the futures itself, with `result_of`.
    """
    engine = _IN_USE.get()
    if engine is None or not shared_out():
        done: Future[JobResult] = Future()
        done.set_result(perform(Call(work=work, args=args, name=name)))
        return done
    code = code_digest() if engine.logs_each else ""
    (future,) = engine.submit([Call(work=work, args=args, name=name, code=code)])
    return future


def result_of(name: str, future: Future[JobResult]) -> Any:
    """Return what a job gave that `submit` handed over, or raise what it raised."""
    engine = _IN_USE.get()
    if engine is None:
        return future.result().value()
    done = take(engine, name, future)
    if engine.logs_each:
        engine.log(_log(name, done))
    return done.value()


def width() -> int:
    """Return how many jobs are done at a time."""
    engine = _IN_USE.get()
    return engine.workers if engine is not None and shared_out() else 1


def take(engine: Engine, name: str, future: Future[JobResult]) -> JobResult:
    """Return a job's result.

    Raises:
        WorkerLost: The engine gave it up.
        BadInput: A worker could not even begin it.
    """
    try:
        return future.result()
    except TaxelError:
        raise
    except engine.lost as error:
        raise WorkerLost(name, last_line(error), 0) from error
    except Exception as error:  # what a job raises is in `JobResult`: here the worker itself failed
        raise BadInput(
            f"a worker that can begin {name}", last_line(error),
            "install the same taxel where the workers are",
        ) from error  # fmt: skip


def side_by_side(
    work: Callable[..., _Result],
    jobs: Sequence[tuple[Any, ...]],
    on_done: Callable[[_Result], None] = lambda _: None,
    workers: int | None = None,
) -> list[_Result]:
    """Return what a function gives for each job, in their order.

    Args:
        work: A function of a module, so that a worker can import it.
        jobs: Arguments of each call.
        on_done: Called here with each result, in the jobs' order.
        workers: As for `as_done`.
    """
    found: dict[int, _Result] = {}
    due = 0
    for number, result in as_done(work, jobs, workers):
        found[number] = result
        while due in found:
            on_done(found[due])
            due += 1
    return [found[number] for number in range(len(jobs))]


def _name(work: Callable[..., Any], names: Sequence[str], number: int) -> str:
    return names[number] if names else f"{work.__name__.strip('_')} {number + 1}"


def _log(name: str, done: JobResult) -> str:
    again = f", attempt {done.attempt}" if done.attempt > 1 else ""
    return f"{name} on {done.host}, process {done.process}, {done.seconds:.1f} s{again}"
