"""Where jobs run, as data: the engine, its address, and the limits of a queue.

Knows nothing about how a place is written or opened.

Source: docs/decisions/0050.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path


@dataclass(frozen=True, slots=True, kw_only=True)
class Place:
    """Where jobs run."""

    engine: str
    """One of `places.PLACES`."""
    address: str = ""
    """HOST:PORT of a running scheduler, or a partition; empty starts an engine here."""
    minutes: int = 60
    """SLURM: the longest that a job may take."""
    memory_gb: int = 4
    """SLURM: memory of a job."""
    folder: Path = Path("taxel-slurm")
    """SLURM: where jobs and their logs are kept, on a disk that all nodes share."""
    executor: str = "slurm"
    """SLURM: "local" runs the same jobs as processes of this machine, to try them."""
