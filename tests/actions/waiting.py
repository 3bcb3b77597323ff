"""Waiting, in real time, for what another thread or device does."""

import time
from collections.abc import Callable


def until(
    true: Callable[[], bool], limit_s: float = 20.0, state: Callable[[], object] = lambda: ""
) -> float:
    """Wait until something is so; return how long it took, seconds.

    Args:
        true: Whether it is so.
        limit_s: Fail after this long, seconds.
        state: What is said then.
    """
    start = time.monotonic()
    while not true():
        assert time.monotonic() - start < limit_s, f"waited too long: {state()}"
        time.sleep(0.002)
    return time.monotonic() - start
