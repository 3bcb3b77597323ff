"""Jobs on Ray: a cluster that runs already, or one node of it on this machine.

Ray starts a job again when its worker or its node dies, three times. Its servers here bind
127.0.0.1 where Ray lets them, the dashboard is off, and no usage is reported. Who reaches a Ray
cluster can run anything on it: only in networks that are trusted. Knows nothing about the work.

Source: docs/decisions/0050.
"""

from __future__ import annotations

import logging
import os
import sys
from collections.abc import Callable, Sequence
from concurrent.futures import Future
from contextlib import redirect_stdout
from typing import Any

from taxel.errors import MissingExtra
from taxel.jobs.call import Call, JobResult, perform

RETRIES = 3
"""Further workers that a job may be given. Source: Ray's default of `max_retries`."""
STORE_BYTES = 100_000_000
"""Ray's shared memory: jobs carry no arrays, so the least that it takes will do, with some room.
Source: our choice, docs/decisions/0050."""


class RayEngine:
    """Ray's workers.

    Args:
        address: HOST:PORT of a cluster's head; empty starts a node here.
        workers: How many jobs at a time on the node that is started.
        log: Called with lines of the log.

    Raises:
        MissingExtra: Ray is not installed.
    """

    logs_each = True

    def __init__(self, address: str, workers: int, log: Callable[[str], None]) -> None:
        os.environ.setdefault("RAY_USAGE_STATS_ENABLED", "0")
        if not address:  # as on Windows and macOS, Ray then stays on the loopback address
            os.environ.setdefault("RAY_ENABLE_WINDOWS_OR_OSX_CLUSTER", "0")
        try:
            import ray
        except ModuleNotFoundError as error:
            raise MissingExtra("ray", "ray", "jobs on Ray") from error
        self.log, self._ray = log, ray
        self.lost: tuple[type[Exception], ...] = (
            ray.exceptions.WorkerCrashedError, ray.exceptions.NodeDiedError,
            ray.exceptions.OutOfMemoryError,
        )  # fmt: skip
        quiet: dict[str, Any] = {"log_to_driver": False, "logging_level": logging.ERROR}
        if address:
            ray.init(address=address, **quiet)
        else:
            ray.init(
                address="local", num_cpus=workers, include_dashboard=False,
                object_store_memory=STORE_BYTES, _node_ip_address="127.0.0.1", **quiet,
            )  # fmt: skip
        # Ray prints killed workers and nodes on the output, where a verb's JSON must stand alone.
        self._aside = redirect_stdout(sys.stderr)
        self._aside.__enter__()
        self.workers = int(ray.cluster_resources().get("CPU", workers))
        self._perform = ray.remote(perform).options(
            max_retries=RETRIES, scheduling_strategy="SPREAD"
        )

    def submit(self, calls: Sequence[Call]) -> list[Future[JobResult]]:
        """Hand over jobs; return a future for each."""
        return [self._perform.remote(call).future() for call in calls]

    def close(self) -> None:
        """Let go of the cluster; end the node that was started here."""
        self._ray.shutdown()
        self._aside.__exit__(None, None, None)
