"""Jobs on Dask: a scheduler that runs already, or a small cluster on this machine.

Dask gives a job to another worker when its own dies, three times. Its servers here bind
127.0.0.1, and the dashboard is off. Who reaches a Dask scheduler can run anything on its workers:
only in networks that are trusted. Knows nothing about the work.

Source: docs/decisions/0050.
"""

from __future__ import annotations

import logging
from collections.abc import Callable, Sequence
from concurrent.futures import Future

from taxel.errors import MissingExtra
from taxel.jobs.call import Call, JobResult, perform


class DaskEngine:
    """Dask's workers.

    Args:
        address: HOST:PORT of a scheduler; empty starts one with workers here.
        workers: How many to start.
        log: Called with lines of the log.

    Raises:
        MissingExtra: Dask is not installed.
    """

    logs_each = True

    def __init__(self, address: str, workers: int, log: Callable[[str], None]) -> None:
        try:
            from distributed import Client, KilledWorker, LocalCluster
        except ModuleNotFoundError as error:
            raise MissingExtra("distributed", "dask", "jobs on Dask") from error
        self.log = log
        self.lost: tuple[type[Exception], ...] = (KilledWorker,)
        self._cluster = None
        if address:
            where: object = f"tcp://{address}"
        else:
            self._cluster = where = LocalCluster(
                n_workers=workers, threads_per_worker=1, host="127.0.0.1",
                dashboard_address="127.0.0.1:0", scheduler_kwargs={"dashboard": False},
                silence_logs=logging.CRITICAL,
            )  # fmt: skip
        self._client = Client(where, set_as_default=False)
        known = self._client.scheduler_info(n_workers=-1)["workers"]
        self.workers = workers if self._cluster is not None else len(known)
        self._executor = self._client.get_executor(pure=False)

    def submit(self, calls: Sequence[Call]) -> list[Future[JobResult]]:
        """Hand over jobs; return a future for each."""
        return [self._executor.submit(perform, call, key=None) for call in calls]

    def close(self) -> None:
        """Let go of the scheduler; end the cluster that was started here."""
        self._executor.shutdown(wait=False)
        self._client.close()
        if self._cluster is not None:
            self._cluster.close()
