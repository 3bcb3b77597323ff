"""What every process of a station does alike: begin, beat, look whether to end.

Knows nothing about touch.
"""

from __future__ import annotations

import contextlib
import gc
import os
import signal
import threading
from collections.abc import Iterator
from dataclasses import dataclass
from multiprocessing.connection import Connection
from types import FrameType

from taxel.errors import TaxelError
from taxel.live.station.beats import BeatsView, Work

IDLE_S = 0.0005
"""Pause of a process that finds nothing to do: a twentieth of what a model takes. Our choice."""
_URGENT = -10
"""Niceness of acquisition, inference and supervisor, where the system allows it. Our choice."""


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
    report: Connection
    """Where it says what it opened, or why it could not."""


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
        """Return what another process says of itself."""
        return self._board.read(row).work

    def report(self, *words: object) -> None:
        """Tell the supervisor what was opened, or that it failed; nobody there is no error."""
        with contextlib.suppress(OSError):
            self._place.report.send(words)

    def close(self) -> None:
        """Let go of the board."""
        self._board.close()


@contextlib.contextmanager
def at_work(place: Place, *, urgent: bool = False) -> Iterator[Pulse]:
    """Be one process of a station: signals end it cleanly, errors are told, the end is told.

    Args:
        place: Where it belongs.
        urgent: Run before other processes where the system allows it.
    """
    pulse = Pulse(place)
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the terminal's Ctrl-C is the supervisor's
    if threading.current_thread() is threading.main_thread():
        signal.signal(signal.SIGTERM, pulse.end_here)
        if hasattr(signal, "SIGHUP"):
            signal.signal(signal.SIGHUP, signal.SIG_IGN)
    hurry(_URGENT if urgent else 0)
    pulse.beat(Work.STARTING)
    try:
        yield pulse
        pulse.beat(Work.ENDED)
    except BaseException as error:
        pulse.beat(Work.FAILED)
        told = error if isinstance(error, TaxelError) else f"{type(error).__name__}: {error}"
        pulse.report("failed", told)
        raise SystemExit(1) from error
    finally:
        pulse.close()


def hurry(niceness: int = _URGENT) -> int:
    """Run before other processes where the system allows it; 0 runs like any other.

    Returns:
        The niceness before, to go back to.
    """
    before = 0
    with contextlib.suppress(OSError, AttributeError):
        before = os.getpriority(os.PRIO_PROCESS, 0)
        os.setpriority(os.PRIO_PROCESS, 0, niceness)
    return before


def settle_memory() -> None:
    """Leave what start-up made out of every later collection: a full one takes milliseconds."""
    gc.collect()
    gc.freeze()
