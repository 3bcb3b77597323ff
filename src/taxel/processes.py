"""Processes that end with their parent, however it ends. Knows nothing about their work."""

from __future__ import annotations

import ctypes
import os
import signal
import sys
import threading
import time

_PARENT_DEATH = 1
"""PR_SET_PDEATHSIG of prctl(2)."""
_LOOK_S = 1.0
"""How often a worker looks whether its parent lives, seconds."""


def end_with_parent(parent: int) -> None:
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
