"""The process that watches the supervisor: it raises the alarm while nobody else can.

It looks at the supervisor's tick in shared memory. Once that is too old it writes a line to the
terminal and rings its bell, again each second while it lasts; the page looks at the same tick
itself. It gives no orders: those that are under way expire, and the supervisor stops by itself
as soon as it goes on. Knows nothing about grasps, grippers or pages.

Background of our choices: docs/decisions/0030.
"""

from __future__ import annotations

import contextlib
import os
import queue
import signal
import threading
from dataclasses import dataclass
from time import monotonic, sleep

from taxel.live.station.beats import BeatsView
from taxel.live.station.worker import Place, Rank, at_work, settle_memory

_LOOK_S = 0.005
"""How often the tick is looked at, seconds. Source: our choice, docs/decisions/0030."""
_AGAIN_S = 1.0
"""How often the alarm sounds while it lasts, seconds. Source: our choice."""
_TERMINAL = 2
"""Standard error."""


@dataclass(frozen=True, slots=True, kw_only=True)
class AlarmWatch:
    """What is watched."""

    place: Place
    stall_s: float
    """A tick that is older than this is a stall, seconds."""


def watch(job: AlarmWatch) -> None:
    """Watch until asked to end, or until the supervisor is gone; the entry point of the process."""
    with (
        at_work(job.place, urgent=Rank.SUPERVISOR) as pulse,
        contextlib.closing(BeatsView(job.place.beats)) as board,
    ):
        # A supervisor that was sent to the background keeps its terminal busy: write all the same.
        signal.signal(signal.SIGTTOU, signal.SIG_IGN)
        voice = _Voice()
        pulse.report("opened")
        settle_memory()
        alarm = StallAlarm(job.stall_s)
        while not pulse.stopping:
            text = alarm.look(board.still_s(monotonic()))
            if text:
                voice.say(text)
            pulse.produced = alarm.raised
            pulse.beat()
            sleep(_LOOK_S)
        if pulse.orphaned and board.still_s(monotonic()) and not board.stopping:
            voice.say("the supervisor has ended without a word: nothing watches the grasp")
        voice.close()


class StallAlarm:
    """When to say what about a supervisor that stands still.

    Args:
        stall_s: A tick that is older than this is a stall, seconds.
    """

    def __init__(self, stall_s: float) -> None:
        self._stall_s = stall_s
        self._alarmed_s = 0.0
        self.raised = 0
        """Stalls so far."""

    def look(self, still_s: float) -> str:
        """Return what is to be said now; empty where nothing is.

        Args:
            still_s: How long ago the last tick was, seconds; 0 where none is due.
        """
        if not still_s > self._stall_s:
            self._alarmed_s = 0.0
            return ""
        if self._alarmed_s and still_s - self._alarmed_s < _AGAIN_S:
            return ""
        self.raised += not self._alarmed_s
        self._alarmed_s = still_s
        return stall_words(still_s)


def stall_words(still_s: float) -> str:
    """Return the alarm's words.

    Args:
        still_s: How long ago the last tick was, seconds.
    """
    return (
        f"the supervisor has stood still for {still_s:.2f} s: nothing watches the grasp, "
        "orders have expired"
    )


class _Voice:
    """Writes to the terminal in a thread: one that takes nothing must not stop the watch."""

    def __init__(self) -> None:
        self._lines: queue.Queue[str | None] = queue.Queue(maxsize=8)
        self._bell = "\a" if os.isatty(_TERMINAL) else ""
        self._thread = threading.Thread(target=self._run, name="taxel alarm", daemon=True)
        self._thread.start()

    def say(self, text: str) -> None:
        with contextlib.suppress(queue.Full):
            self._lines.put_nowait(f"{self._bell}ALARM: {text}\r\n")

    def close(self) -> None:
        with contextlib.suppress(queue.Full):
            self._lines.put_nowait(None)
        self._thread.join(1.0)

    def _run(self) -> None:
        while (line := self._lines.get()) is not None:
            with contextlib.suppress(OSError):
                os.write(_TERMINAL, line.encode())
