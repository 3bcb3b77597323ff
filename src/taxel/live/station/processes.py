"""The processes of a station: started, started again when they die, ended.

Knows nothing about what they do.

Background of our choices: docs/decisions/0019.
"""

from __future__ import annotations

import contextlib
import os
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, field
from multiprocessing import get_context
from multiprocessing.connection import Connection
from multiprocessing.process import BaseProcess
from time import monotonic
from typing import Any

from taxel.errors import BadSource, TaxelError
from taxel.live.station.beats import Beats, Work
from taxel.live.station.worker import LONGEST_WHY, Place

_OPEN_S = 30.0
"""How long a process may take to open what it needs, seconds. Source: our choice."""
_END_S = 5.0
"""How long processes may take to end before they are killed, seconds; of one that completes its
work, since its last sign of life, and beside the patience that one asks for. Our choice."""
_LOOK_S = 0.05
"""How often it is looked at meanwhile, seconds. Our choice."""
_RESTARTS, _WITHIN_S = 5, 30.0
"""A process that dies more often than so many times in so many seconds is given up. Our choice."""


@dataclass(slots=True)
class Worker:
    """One process and how to start it again."""

    name: str
    row: int
    """Its beats."""
    entry: Callable[[Any], None]
    job: Callable[[Place], Any]
    process: BaseProcess | None = None
    report: Connection | None = None
    starts: int = 0
    began_s: deque[float] = field(default_factory=lambda: deque(maxlen=_RESTARTS + 1))
    """When it was started last."""
    given_up: bool = False
    ends_itself: bool = False
    """It completes its work where the supervisor was killed; others are killed with it."""
    once: bool = False
    """It is never started again: another would begin from the start what this one was amid."""


class ProcessGroup:
    """The processes of a station, in the order in which they were added.

    Args:
        beats: Their signs of life.
        patient: Start again however often they die, as in drills.
    """

    def __init__(self, beats: Beats, *, patient: bool = False) -> None:
        self._beats = beats
        self._patient = patient
        self._context = get_context("spawn")
        self.workers: list[Worker] = []

    def add(
        self,
        name: str,
        entry: Callable[[Any], None],
        job: Callable[[Place], Any],
        *,
        ends_itself: bool = False,
        once: bool = False,
    ) -> Worker:
        """Start a process; `opened` waits until it is ready.

        Args:
            name: What it is called.
            entry: What it runs.
            job: Gives what it is to do, from its place.
            ends_itself: It completes its work where this process was killed.
            once: It is given up where it dies, and not started again.
        """
        row = len(self.workers)
        worker = Worker(name, row, entry, job, ends_itself=ends_itself, once=once)
        self.workers.append(worker)
        self._begin(worker)
        return worker

    @property
    def beats_name(self) -> str:
        """Name of the board of beats."""
        return self._beats.name

    def opened(self, worker: Worker) -> tuple[Any, ...]:
        """Return what a process reports once it has opened what it needs.

        Raises:
            TaxelError: It could not, as it says itself.
            BadSource: It ended or was silent.
        """
        words: tuple[Any, ...] = ("failed", "it ended without a word")
        if worker.report is not None:
            with contextlib.suppress(EOFError):
                ready = worker.report.poll(_OPEN_S)
                words = worker.report.recv() if ready else ("failed", "it took too long")
        if words[0] == "opened":
            return words[1:]
        if isinstance(words[1], TaxelError):
            raise words[1]
        raise BadSource(f"the {worker.name} to start", str(words[1]), "run: taxel doctor")

    def dead(self) -> list[tuple[Worker, str]]:
        """Return those that have ended without being asked to, and how; each once."""
        found = []
        for worker in self.workers:
            process = worker.process
            if process is None or worker.given_up or process.exitcode is None:
                continue
            if self._beats.read(worker.row).work is Work.ENDED and process.exitcode == 0:
                continue
            ended_by_signal = process.exitcode < 0
            how = f"signal {-process.exitcode}" if ended_by_signal else f"an error{_why(worker)}"
            process.join()
            found.append((worker, how))
        return found

    def silent(self, now_s: float, longest_s: float) -> list[Worker]:
        """Return those that run and have given no sign of life for longer than some seconds, beside
        the patience that they asked for.
        """
        found = []
        for worker in self.workers:
            beat = self._beats.read(worker.row)
            alive = worker.process is not None and worker.process.exitcode is None
            if (
                alive
                and beat.work is Work.RUNNING
                and now_s - beat.beat_s > longest_s + beat.patience_s
            ):
                found.append(worker)
        return found

    def again(self, worker: Worker) -> bool:
        """Start a dead process again; False where it may not be, or that was tried often enough."""
        often = len(worker.began_s) > _RESTARTS and not self._patient
        if worker.once or (often and monotonic() - worker.began_s[0] < _WITHIN_S):
            worker.given_up = True
            self._beats.fail(worker.row)
            return False
        self._begin(worker)
        return True

    def close(self) -> list[str]:
        """Ask all to end, wait, kill those that do not; return the names of these."""
        killed = []
        for worker in self.workers:  # nobody waits for one that is dead
            if worker.process is not None and worker.process.exitcode not in (None, 0):
                self._beats.fail(worker.row)
        self._beats.stop()
        for worker in self.workers:
            process = worker.process
            if process is None or worker.given_up:
                continue
            process.join(_END_S)
            while process.is_alive() and self._completes(worker):
                process.join(_LOOK_S)
            if process.is_alive():
                process.kill()
                process.join()
                self._beats.fail(worker.row)
                killed.append(worker.name)
        for worker in self.workers:
            if worker.report is not None:
                worker.report.close()
        return killed

    def _completes(self, worker: Worker) -> bool:
        """True while one goes on with its last work: it ends itself and says so, or has asked for
        patience, as for the verdict on a trial.
        """
        beat = self._beats.read(worker.row)
        longest_s = max(beat.patience_s, _END_S if worker.ends_itself else 0.0)
        return longest_s > 0 and monotonic() - beat.beat_s < longest_s

    def ledger(self) -> dict[str, dict[str, int]]:
        """Return, for each process, what it made, took in and lost, and how often it began."""
        found = {}
        for worker in self.workers:
            beat = self._beats.read(worker.row)
            found[worker.name] = {
                "produced": beat.produced, "consumed": beat.consumed, "dropped": beat.dropped,
                "starts": worker.starts,
            }  # fmt: skip
        return found

    def _begin(self, worker: Worker) -> None:
        self._beats.clear(worker.row)
        if worker.report is not None:
            worker.report.close()
        mine, theirs = self._context.Pipe(duplex=False)
        place = Place(
            name=worker.name, beats=self._beats.name, row=worker.row, parent=os.getpid(),
            report=theirs, ends_itself=worker.ends_itself, again=worker.starts > 0,
        )  # fmt: skip
        # Not daemonic: cameras have a capture process each. A worker ends with its parent.
        worker.process = self._context.Process(
            target=worker.entry, args=(worker.job(place),), name=f"taxel {worker.name}"
        )
        worker.report = mine
        worker.starts += 1
        worker.began_s.append(monotonic())
        worker.process.start()
        theirs.close()


def _why(worker: Worker) -> str:
    """Return in brackets what a dead process said of its error; empty where it said nothing."""
    words: tuple[Any, ...] = ("opened",)
    # Whatever it sent: the supervisor must not end by what another process died of.
    with contextlib.suppress(Exception):
        while worker.report is not None and words[0] == "opened" and worker.report.poll(0.0):
            words = worker.report.recv()
    if words[0] == "opened":
        return ""
    text = str(words[1]).partition("\n")[0].rstrip(".")
    return f" ({text[:LONGEST_WHY]})"
