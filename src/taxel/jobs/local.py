"""Worker processes of this machine; a killed one costs its own job a second start, nothing else.

Each place for a worker is a thread that hands jobs to a process of its own through a pipe. Where
the process ends without an answer, a new one is started with the same job. `concurrent.futures`
alone ends every job when one process is killed. Knows nothing about the work.

Source: docs/decisions/0050.
"""

from __future__ import annotations

import atexit
import gc
import os
import signal
import sys
import threading
from collections.abc import Callable, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import suppress
from dataclasses import replace
from multiprocessing import get_context
from multiprocessing.connection import Connection
from typing import NoReturn

from taxel.errors import BadInput, WorkerLost
from taxel.jobs.call import Call, JobResult, perform
from taxel.processes import end_with_parent

ATTEMPTS = 4
"""Workers that a job may outlive, and one: a job that ends its worker each time ends the work.
Source: our choice, as Dask's three failures and Ray's three retries; docs/decisions/0050."""
_GUARD = (
    'a script of your own must be a file whose work stands under if __name__ == "__main__": '
    "each worker imports it"
)
_END_S = 5.0
"""How long an idle worker may take to end when it is asked to, seconds. Source: our choice,
docs/decisions/0050."""


class LocalEngine:
    """Processes on this machine; they start with the first jobs.

    Args:
        workers: Processes at a time.
        log: Called with a line when a worker was killed.
    """

    logs_each = False
    lost: tuple[type[Exception], ...] = ()

    def __init__(self, workers: int, log: Callable[[str], None] = lambda _: None) -> None:
        self.workers, self.log = workers, log
        self._threads = ThreadPoolExecutor(workers, "taxel-worker")
        self._own = threading.local()
        self._running: set[_Worker] = set()
        self._lock = threading.Lock()
        self._closed = False

    def submit(self, calls: Sequence[Call]) -> list[Future[JobResult]]:
        """Hand over jobs; return a future for each."""
        return [self._threads.submit(self._perform, call) for call in calls]

    def close(self) -> None:
        """End all workers: idle ones by asking, busy ones at once."""
        self._closed = True
        self._threads.shutdown(wait=False, cancel_futures=True)
        with self._lock:
            running = list(self._running)
        for worker in running:
            worker.end()
        for worker in running:
            worker.reap()
        self._threads.shutdown(wait=True)

    def _perform(self, call: Call) -> JobResult:
        for attempt in range(1, ATTEMPTS + 1):
            worker = self._worker(call.name)
            try:
                return replace(worker.perform(call), attempt=attempt)
            except (EOFError, OSError) as error:
                if self._closed:
                    raise WorkerLost(call.name, "the work was ended", attempt) from error
                self._forget(worker)
                if worker.ended_itself_at_once:
                    raise BadInput(
                        "workers that start", f"one that {worker.fate} before its first job", _GUARD
                    ) from error
                self.log(f"{call.name}: its worker {worker.pid} {worker.fate}; it starts again")
        raise WorkerLost(call.name, f"the last worker {worker.fate}", ATTEMPTS)

    def _worker(self, job: str) -> _Worker:
        worker: _Worker | None = getattr(self._own, "worker", None)
        if worker is None:
            with self._lock:
                if self._closed:
                    raise EOFError
                try:
                    worker = _Worker()
                except OSError as error:
                    raise BadInput(
                        f"a process for {job}", error.strerror or str(error), "use fewer --workers"
                    ) from error
                except RuntimeError as error:  # this is a worker that still imports its script
                    raise BadInput(
                        "work that begins once", "a script that begins it whenever it is imported",
                        _GUARD,
                    ) from error  # fmt: skip
                self._running.add(worker)
            self._own.worker = worker
        return worker

    def _forget(self, worker: _Worker) -> None:
        self._own.worker = None
        with self._lock:
            self._running.discard(worker)
        worker.reap()


class _Worker:
    """One process behind a pipe."""

    def __init__(self) -> None:
        context = get_context("spawn")
        self._pipe, theirs = context.Pipe()
        self._busy = self._began = False
        self._process = context.Process(
            target=_serve, args=(theirs, os.getpid()), name="taxel-worker", daemon=True
        )
        self._process.start()
        theirs.close()

    @property
    def pid(self) -> int | None:
        """The process's number."""
        return self._process.pid

    @property
    def fate(self) -> str:
        """How the process ended, in words."""
        code = self._process.exitcode
        if code is not None and code < 0:
            names = {number.value: number.name for number in signal.Signals}
            return f"was killed by {names.get(-code, f'signal {-code}')}"
        return f"ended with exit code {code}"

    @property
    def ended_itself_at_once(self) -> bool:
        """Whether the process has ended before it could do a job, and nothing killed it."""
        return not self._began and (self._process.exitcode or 0) > 0

    def perform(self, call: Call) -> JobResult:
        """Return a job's result.

        Raises:
            EOFError, OSError: The process ended.
        """
        self._busy = True
        if not self._began:
            self._began = self._pipe.recv()
        self._pipe.send(call)
        answer = self._pipe.recv()
        self._busy = False
        assert isinstance(answer, JobResult)
        return answer

    def end(self) -> None:
        """Let the process end, at once where it is busy; `reap` waits for it."""
        if self._busy:
            self._process.kill()
        else:
            with suppress(OSError):
                self._pipe.send(None)

    def reap(self) -> None:
        """Wait for the process's end, not for long."""
        self._process.join(_END_S)
        if self._process.is_alive():
            self._process.kill()
            self._process.join()


def _serve(pipe: Connection, parent: int) -> None:
    """Do jobs from a pipe until there are none; the life of a worker process."""
    gc.disable()  # the first job brings modules, in which there is nothing to be collected
    os.environ.setdefault("OMP_NUM_THREADS", "1")  # a worker a core: docs/decisions/0002
    os.environ.setdefault("OMP_WAIT_POLICY", "PASSIVE")
    os.environ.setdefault("OPENCV_FOR_THREADS_NUM", "1")
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the parent decides what an interrupt ends
    end_with_parent(parent)
    with suppress(EOFError, OSError):  # the parent is gone
        pipe.send(True)
        while (call := pipe.recv()) is not None:
            if not gc.isenabled():
                gc.freeze()
                gc.enable()
            _answer(pipe, perform(call))
    _leave()


def _leave() -> NoReturn:
    """End this process as Python does, but leave its memory to the system.

    Taking PyTorch's modules apart takes half a second, and the parent waits for it.
    """
    atexit._run_exitfuncs()
    for stream in (sys.stdout, sys.stderr):
        with suppress(AttributeError, OSError, ValueError):  # there is none, or it is closed
            stream.flush()
    os._exit(0)


def _answer(pipe: Connection, done: JobResult) -> None:
    try:
        pipe.send(done)
    except OSError:
        raise
    except Exception as error:  # a result that cannot travel is the job's fault, reported as such
        pipe.send(
            replace(done, result=None, error=RuntimeError(f"{type(error).__name__}: {error}"))
        )
