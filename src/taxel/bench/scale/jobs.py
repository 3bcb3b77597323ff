"""Jobs of `taxel bench scale`: small pieces of real work, in a module that workers can import."""

from __future__ import annotations

import hashlib
import os
import signal
from pathlib import Path

from taxel.sim.pour.cup_pour import CupPourConfig, list_runs, simulate_pour

POURS = CupPourConfig(cups=2, positions=("middle",), forces_n=tuple(range(10, 50, 5)), still=0.0)
"""Sixteen pours. Source: issue 19's sixteen tasks."""


def pour_digest(folder: Path, number: int, dies: bool) -> str:
    """Simulate a pour's dynamics and return the digest of its truth.

    Args:
        folder: Where the first worker with a job that dies leaves a sign, and kills itself.
        number: Which pour.
        dies: Whether the job's first worker is killed with SIGKILL.
    """
    if dies and not (folder / "died").exists():
        (folder / "died").touch()
        os.kill(os.getpid(), signal.SIGKILL)
    run = list_runs(POURS)[number]
    return hashlib.sha256(simulate_pour(run, 60.0, 2.0).truth.tobytes()).hexdigest()


def nothing(number: int) -> int:
    """Return what is given: what a job costs beside its work."""
    return number
