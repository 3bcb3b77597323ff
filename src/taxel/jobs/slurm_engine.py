"""Jobs on SLURM through submitit: an array of jobs, each with its log in a shared folder.

A job that a node took with it is submitted again. The same jobs run as processes of this machine
with `executor=local`, to try them before a queue is waited in. Knows nothing about the work.

Source: docs/decisions/0050.
"""

from __future__ import annotations

import threading
from collections.abc import Callable, Sequence
from concurrent.futures import Future, InvalidStateError
from contextlib import suppress
from dataclasses import dataclass, replace
from typing import Any

from taxel.errors import BadInput, MissingExtra, WorkerLost
from taxel.jobs.call import Call, JobResult, last_line, perform
from taxel.jobs.local import ATTEMPTS
from taxel.jobs.place import Place

LOOK_S = {"slurm": 5.0, "local": 0.05}
"""How often finished jobs are looked for, seconds. A queue is not asked more often than it bears.
Source: our choice, docs/decisions/0050."""


@dataclass(slots=True)
class _Waiting:
    call: Call
    future: Future[JobResult]
    attempt: int = 1
    job: Any = None


class SlurmEngine:
    """Jobs in SLURM's queue.

    Args:
        place: Partition, limits and folder.
        workers: Jobs at a time.
        log: Called with lines of the log.

    Raises:
        MissingExtra: Submitit is not installed.
        BadInput: There is no SLURM here.
    """

    logs_each = True
    lost: tuple[type[Exception], ...] = ()

    def __init__(self, place: Place, workers: int, log: Callable[[str], None]) -> None:
        try:
            import submitit
        except ModuleNotFoundError as error:
            raise MissingExtra("submitit", "slurm", "jobs on SLURM") from error
        self.workers, self.log, self._place = workers, log, place
        self._gone: tuple[type[BaseException], ...] = (
            submitit.core.utils.UncompletedJobError, submitit.core.utils.FailedJobError,
        )  # fmt: skip
        try:
            self._executor = submitit.AutoExecutor(
                folder=str(place.folder / "%j"), cluster=place.executor
            )
        except RuntimeError as error:
            raise BadInput("SLURM on this machine", f"none ({error})",
                           "start this on a login node, or try slurm://?executor=local") \
                from error  # fmt: skip
        self._executor.update_parameters(name="taxel", timeout_min=place.minutes, cpus_per_task=1)
        if place.executor == "slurm":
            self._executor.update_parameters(
                mem_gb=place.memory_gb, slurm_array_parallelism=workers,
                **({"slurm_partition": place.address} if place.address else {}),
            )  # fmt: skip
        self._queue: list[_Waiting] = []
        self._submitted: list[_Waiting] = []
        self._change = threading.Condition()
        self._closed = False
        self._thread = threading.Thread(target=self._watch, name="taxel-slurm", daemon=True)
        self._thread.start()

    def submit(self, calls: Sequence[Call]) -> list[Future[JobResult]]:
        """Hand over jobs; return a future for each."""
        waiting = [_Waiting(call, Future()) for call in calls]
        with self._change:
            self._queue += waiting
            self._change.notify()
        return [job.future for job in waiting]

    def close(self) -> None:
        """Cancel what is not done."""
        with self._change:
            self._closed = True
            self._change.notify()
        self._thread.join()
        for job in self._submitted:
            with suppress(Exception):
                job.job.cancel()

    def _watch(self) -> None:
        """Submit, look for what is done, until closed."""
        look_s = LOOK_S[self._place.executor]
        while True:
            with self._change:
                if self._closed:
                    return
                if not self._queue and not self._submitted:
                    self._change.wait()
                elif self._submitted:
                    self._change.wait(look_s)
                new = self._due()
            if new:
                self._start(new)
            for job in list(self._submitted):
                if job.future.cancelled():  # another of the same work failed
                    self._submitted.remove(job)
                    with suppress(Exception):
                        job.job.cancel()
                elif job.job.done():
                    self._submitted.remove(job)
                    with suppress(InvalidStateError):  # cancelled just now
                        self._finish(job)

    def _due(self) -> list[_Waiting]:
        """Return what is submitted now: all to a queue, as many as may run to this machine."""
        room = len(self._queue)
        if self._place.executor == "local":
            room = max(0, self.workers - len(self._submitted))
        new, self._queue = self._queue[:room], self._queue[room:]
        return [job for job in new if not job.future.cancelled()]

    def _start(self, new: list[_Waiting]) -> None:
        try:
            jobs = self._executor.map_array(perform, [job.call for job in new])
        except Exception as error:  # the queue refused: each of its jobs says so
            for job in new:
                with suppress(InvalidStateError):
                    job.future.set_exception(error)
            return
        for job, own in zip(new, jobs, strict=True):
            job.job = own
        self._submitted += new

    def _finish(self, job: _Waiting) -> None:
        try:
            done = replace(job.job.result(), attempt=job.attempt)
        except self._gone as error:
            if job.attempt < ATTEMPTS:
                self.log(f"{job.call.name}: its job {job.job.job_id} was lost; it starts again")
                job.attempt += 1
                with self._change:
                    self._queue.append(job)
                    self._change.notify()
                return
            job.future.set_exception(WorkerLost(job.call.name, last_line(error), ATTEMPTS))
        except Exception as error:
            job.future.set_exception(error)
        else:
            job.future.set_result(done)
