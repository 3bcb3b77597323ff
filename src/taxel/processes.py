"""Work side by side in processes that end with their parent.

Processes, not threads: small networks gain nothing from a second thread
(docs/decisions/0002). Knows nothing about the work.
"""

from __future__ import annotations

import ctypes
import os
import signal
import sys
import threading
import time
from collections.abc import Callable, Sequence
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from typing import Any, TypeVar

_Result = TypeVar("_Result")
WORKERS = 2
"""Processes at a time. Source: our choice; the machines that test taxel have two cores."""
_PARENT_DEATH = 1
"""PR_SET_PDEATHSIG of prctl(2)."""
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


def signal_at_parents_end(parent: int, number: signal.Signals = signal.SIGKILL) -> None:
    """Let the system send this process a signal when its parent ends, however that happens.

    SIGKILL ends also a process that is stopped or hangs; SIGCONT only wakes one that is
    stopped, so that it can see for itself and complete its work. Linux only; nothing elsewhere.
    The parent is the thread that started this process: it must live as long as its process.

    Args:
        parent: Process number of the parent; the signal comes at once where it is gone already.
        number: The signal.
    """
    if sys.platform != "linux":
        return
    zero = ctypes.c_ulong(0)
    ctypes.CDLL(None).prctl(_PARENT_DEATH, ctypes.c_ulong(number), zero, zero, zero)
    if os.getppid() != parent:
        os.kill(os.getpid(), number)
