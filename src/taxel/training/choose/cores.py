"""Cores shared among candidates that are tried side by side. Knows nothing about candidates.

Linear algebra takes all cores unless it is stopped: two tries side by side then wait for each other
most of the time. Source: docs/decisions/0039.
"""

from __future__ import annotations

import warnings
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager

import torch
from threadpoolctl import threadpool_limits

AT_ONCE = 2
"""Models at work at a time: issue 16 gives two cores."""


@contextmanager
def working_threads(at_once: int = AT_ONCE) -> Iterator[ThreadPoolExecutor]:
    """Yield threads that share the cores evenly.

    They keep still about models that end before they converge: a hundred steps are enough for a
    regularised one. Set here, for filters belong to all threads; forests of two threads may empty
    them (see `kept_warnings`), so that warnings are caught, too. After an error or Ctrl-C only what
    is at work is completed: what waits for a thread may take as long as the whole search.

    Args:
        at_once: How many work side by side.
    """
    with (
        warnings.catch_warnings(record=True),
        shared_cores(at_once),
        ThreadPoolExecutor(at_once) as pool,
    ):
        warnings.simplefilter("ignore")
        try:
            yield pool
        except BaseException:
            pool.shutdown(cancel_futures=True)
            raise


@contextmanager
def shared_cores(at_once: int) -> Iterator[None]:
    """Give each of the threads that are started here an equal share of this process's cores.

    Args:
        at_once: How many work side by side.
    """
    before = torch.get_num_threads()
    share = max(1, before // at_once)
    torch.set_num_threads(share)  # threads to come begin with it
    try:
        with threadpool_limits(limits=share):
            yield
    finally:
        torch.set_num_threads(before)
