"""What every process of a station does alike: begin, beat, look whether to end.

Knows nothing about touch.

Background of our choices: docs/decisions/0019.
"""

from __future__ import annotations

import contextlib
import ctypes
import gc
import os
import signal
import sys
import threading
from collections.abc import Iterator
from dataclasses import dataclass
from enum import IntEnum
from multiprocessing.connection import Connection
from types import FrameType

from taxel.clock import Clock, SystemClock
from taxel.errors import TaxelError
from taxel.live.station.beats import BeatsView, Work
from taxel.processes import signal_at_parents_end

_NICENESS = -10
"""Of every rank above ORDINARY, where real-time scheduling is not permitted. Our choice."""
LONGEST_WHY = 300
"""Characters of a process's own words on why it ended. Source: our choice, docs/decisions/0019."""
_given_up: list[int] = []
"""The niceness that this process had before it hurried, to go back to: `nice taxel …` stays so."""
_SWITCH_S = 0.0005
"""How soon another thread of an urgent process lets go of the interpreter, seconds. Our choice:
Python's own 5 ms are longer than an alarm may take."""
_SLACK_NS = 1
"""How late a timer may ring so as to ring with others; the system's own is 50 µs. Our choice."""
_PR_SET_TIMERSLACK = 29
"""Option of prctl(2). Source: linux/prctl.h."""


class Rank(IntEnum):
    """Who runs first where not all can; a higher rank interrupts a lower at once.

    The values are real-time priorities, the lowest there are: whatever else a machine runs in
    real time goes before. Source: our choice, docs/decisions/0032.
    """

    ORDINARY = 0
    """Recorder, page, viewers."""
    MODEL = 1
    SOURCE = 2
    """Short work that a model must not hold up."""
    SUPERVISOR = 3
    """It ends a model that computes without end."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Place:
    """Where a process belongs: picklable, given to it at its start."""

    name: str
    beats: str
    """Name of the board of beats."""
    row: int
    """Its own row."""
    parent: int
    """Process id of the supervisor; a process without it ends."""
    ends_itself: bool = False
    """It completes its work without the supervisor, and ends; else it is killed with it."""
    report: Connection
    """Where it says what it opened, or why it could not."""
    again: bool = False
    """It follows a process that died."""


class Pulse:
    """A process's signs of life, and the word to end. Made by `at_work`."""

    def __init__(self, place: Place) -> None:
        self._place = place
        self._board = BeatsView(place.beats)
        self._ended_here = False
        self.produced = 0
        self.consumed = 0
        self.dropped = 0

    @property
    def stopping(self) -> bool:
        """True once this process shall end: it was asked to, or nobody is there to ask."""
        return self._ended_here or self._board.stopping or self.orphaned

    @property
    def orphaned(self) -> bool:
        """True once the supervisor is gone: nobody will say that anybody else has ended."""
        return os.getppid() != self._place.parent

    @property
    def may_begin(self) -> bool:
        """True once everybody who follows the sources is there."""
        return self._board.gone

    def end_here(self, *_: int | FrameType | None) -> None:
        """Let this process end by itself, as at a signal."""
        self._ended_here = True

    def beat(self, work: Work = Work.RUNNING, *, patience_s: float = 0.0) -> None:
        """Give a sign of life; ask for patience before a step that is known to be long."""
        self._board.write(
            self._place.row, work, produced=self.produced, consumed=self.consumed,
            dropped=self.dropped, patience_s=patience_s,
        )  # fmt: skip

    def work_of(self, row: int) -> Work:
        """Return the state that another process reports."""
        return self._board.read(row).work

    def report(self, *words: object) -> None:
        """Report to the supervisor what was opened, or that it failed; nobody there is no error."""
        with contextlib.suppress(OSError):
            self._place.report.send(words)

    def close(self) -> None:
        """Let go of the board."""
        self._board.close()


@contextlib.contextmanager
def at_work(place: Place, *, urgent: int = Rank.ORDINARY) -> Iterator[Pulse]:
    """Be one process of a station: signals end it cleanly, errors and the end are reported.

    Args:
        place: Where it belongs.
        urgent: Its rank from the beginning, where the system allows it. Who has much to open
            first does so as ORDINARY and then takes its rank by `hurry_threads`: what opens in
            real time holds up what already runs, on a computer with few cores for half a second.
    """
    at_the_end = signal.SIGCONT if place.ends_itself else signal.SIGKILL
    signal_at_parents_end(place.parent, at_the_end)
    pulse = Pulse(place)
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the terminal's Ctrl-C is the supervisor's
    signal.signal(signal.SIGTERM, pulse.end_here)
    if hasattr(signal, "SIGHUP"):
        signal.signal(signal.SIGHUP, signal.SIG_IGN)
        # Ctrl-Z stops the supervisor alone: page and alarm must be there to say so.
        signal.signal(signal.SIGTSTP, signal.SIG_IGN)
    hurry(Rank(urgent))
    pulse.beat(Work.STARTING)
    try:
        yield pulse
        pulse.beat(Work.ENDED)
    except BaseException as error:
        pulse.beat(Work.FAILED)
        message = error if isinstance(error, TaxelError) else f"{type(error).__name__}: {error}"
        pulse.report("failed", message)
        raise SystemExit(1) from error
    finally:
        pulse.close()


def hurry(rank: Rank = Rank.SUPERVISOR) -> Rank:
    """Run before what has a lower rank: in real time where that is permitted, else by niceness.

    Threads and processes that a source or a model starts later run as it does, such as one that
    reads a camera; those of the supervisor run like any other.

    Returns:
        The rank before, to go back to.
    """
    before = _rank_now()
    if not _schedule(rank):
        with contextlib.suppress(OSError, AttributeError):
            now = os.getpriority(os.PRIO_PROCESS, 0)
            if rank and now != _NICENESS:
                os.setpriority(os.PRIO_PROCESS, 0, _NICENESS)
                _given_up.append(now)
            elif not rank and now == _NICENESS:
                os.setpriority(os.PRIO_PROCESS, 0, _given_up.pop() if _given_up else 0)
    if rank:
        sys.setswitchinterval(_SWITCH_S)
        _sharpen_timers()
    return before


@contextlib.contextmanager
def hurried(clock: Clock) -> Iterator[None]:
    """Run before all others meanwhile, where a clock is the host's: simulated time waits for nobody
    and would leave nothing to them.
    """
    before = hurry() if isinstance(clock, SystemClock) else None
    try:
        yield
    finally:
        if before is not None:
            hurry(before)


def hurry_threads(rank: Rank) -> None:
    """Give this process's threads a rank, also those that a library has started; see `hurry`.

    A thread with a niceness of its own stands back on purpose, and stays as it is. ORDINARY changes
    nothing: it is what a process begins with.
    """
    if rank is Rank.ORDINARY:
        return
    mine = threading.get_native_id()
    with contextlib.suppress(OSError, AttributeError):
        own = os.getpriority(os.PRIO_PROCESS, mine)
        for name in os.listdir("/proc/self/task"):
            thread = int(name)
            with contextlib.suppress(ProcessLookupError):
                if thread == mine or os.getpriority(os.PRIO_PROCESS, thread) != own:
                    continue
                if not _schedule(rank, thread):
                    os.setpriority(os.PRIO_PROCESS, thread, _NICENESS)
    hurry(rank)


def may_run_in_real_time() -> bool:
    """Try whether this process may be scheduled in real time; return it to what it was."""
    before = _rank_now()
    permitted = _schedule(Rank.MODEL)
    _schedule(before)
    return permitted


def _schedule(rank: Rank, thread: int = 0) -> bool:
    """Schedule a thread, this one by default; return False where it is not in real time then.

    All ranks or none: where only low ones are permitted, a model would run before the supervisor.
    """
    with contextlib.suppress(OSError, AttributeError):
        # Without the right to schedule others nobody may take this mark off again.
        mark = os.sched_getscheduler(thread) & os.SCHED_RESET_ON_FORK
        if rank is Rank.SUPERVISOR:
            mark = os.SCHED_RESET_ON_FORK
        policy = os.SCHED_FIFO if rank else os.SCHED_OTHER
        if rank:
            os.sched_setscheduler(thread, policy | mark, os.sched_param(int(max(Rank))))
        os.sched_setscheduler(thread, policy | mark, os.sched_param(int(rank)))
        return bool(rank)
    return False


def _rank_now() -> Rank:
    with contextlib.suppress(OSError, AttributeError, ValueError):
        if os.sched_getscheduler(0) & ~os.SCHED_RESET_ON_FORK == os.SCHED_FIFO:
            return Rank(os.sched_getparam(0).sched_priority)
        if os.getpriority(os.PRIO_PROCESS, 0) == _NICENESS:
            return Rank.SUPERVISOR
    return Rank.ORDINARY


def _sharpen_timers() -> None:
    """Let this thread's sleeps end on time, where it is not scheduled in real time."""
    if sys.platform == "linux":
        ctypes.CDLL(None).prctl(_PR_SET_TIMERSLACK, _SLACK_NS, 0, 0, 0)


def settle_memory() -> None:
    """Leave what start-up made out of every later collection: a full one takes milliseconds."""
    gc.collect()
    gc.freeze()
