"""Work side by side in processes that end with their parent.

Processes, not threads: small networks gain nothing from a second thread
(docs/decisions/0002). Knows nothing about the work.
"""

from __future__ import annotations

import os
import threading
import time
from collections.abc import Callable, Sequence
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from typing import Any, TypeVar

_Result = TypeVar("_Result")
WORKERS = 2
"""Processes at a time. Source: our choice; the machines that test taxel have two cores."""
_LOOK_S = 1.0
"""How often a worker looks whether its parent lives, seconds."""


def side_by_side(
    work: Callable[..., _Result],
    jobs: Sequence[tuple[Any, ...]],
    on_done: Callable[[_Result], None] = lambda _: None,
    workers: int = WORKERS,
) -> list[_Result]:
    """Return what a function gives for each job, in their order.

    Args:
        work: A function of a module, so that a process can import it.
        jobs: Arguments of each call.
        on_done: Called here with each result.
        workers: Processes at a time; 1 works in this process.
    """
    results = []
    if workers == 1:
        for job in jobs:
            results.append(work(*job))
            on_done(results[-1])
        return results
    context = get_context("spawn")
    with ProcessPoolExecutor(workers, context, _end_with_parent, (os.getpid(),)) as pool:
        for result in pool.map(work, *zip(*jobs, strict=True)):
            results.append(result)
            on_done(result)
    return results


def _end_with_parent(parent: int) -> None:
    """End this process soon after its parent was killed: a pool alone would wait for ever."""

    def watch() -> None:
        while os.getppid() == parent:
            time.sleep(_LOOK_S)
        os._exit(1)

    threading.Thread(target=watch, daemon=True).start()
