"""Options of work that is shared out: how many workers, and where they are.

Knows nothing about the work.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass

from taxel.cli.printing import say_aside


@dataclass(frozen=True, kw_only=True)
class WorkOptions:
    """Who does the work."""

    workers: int | None = None
    """Number of worker processes; unless given $TAXEL_WORKERS, or else one for each core that taxel
    may use."""
    run_on: str | None = None
    """Where the workers run: local, dask, ray or slurm; or a cluster that is running, such as
    dask://127.0.0.1:8786, ray://127.0.0.1:6379 or slurm://PARTITION; unless given $TAXEL_RUN_ON, or
    else local."""

    @contextmanager
    def open(self, log: Callable[[str], None] | None = None) -> Iterator[None]:
        """Run the jobs of a block there; the log goes to the error stream.

        Args:
            log: Takes the log's lines instead.
        """
        from taxel.jobs.places import open_engine
        from taxel.jobs.running import use_engine

        with use_engine(open_engine(self.run_on, self.workers, log or _log)):
            yield


def _log(line: str) -> None:
    say_aside(f"taxel: {line}")
