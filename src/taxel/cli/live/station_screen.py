"""What `taxel live` prints while a station runs, and what its keys do.

Knows nothing about how a station is set up or what is printed of it at the end.
"""

from __future__ import annotations

import queue
import threading
from contextlib import suppress
from time import monotonic
from typing import TYPE_CHECKING

from rich.text import Text

from taxel.cli.printing import console, say
from taxel.plain_text import number_of, visible_line

if TYPE_CHECKING:
    from taxel.live.station.station import Station

_COLOURS = {
    "STABLE": "green", "WARNING": "yellow", "UNSTABLE": "red", "UNKNOWN": "magenta",
    "NO GRASP": "dim", "STOP": "bold white on red", "NONE": "dim",
    "NOT RECORDING": "bold white on red",
}  # fmt: skip
"""First words of an event → their colour."""
_KEYS = "keys: q end · a acknowledge · n new grasp"
_PERSON_KEYS = (
    "what you did: s stopped pouring · p put down · g grip changed; "
    "what came of it: h held · l slipped · x dropped"
)
_REACTIONS = {
    "s": "pour stopped", "p": "put down", "g": "grip changed",
    "h": "held", "l": "slipped", "x": "dropped",
}  # fmt: skip
"""Key → what a person says of the grasp."""
_GRIP_KEYS = " · m arm · d disarm"
_UNSEEN = "not acknowledged: an alarm that was not shown yet; look at it, then press a again"


def print_keys(*, acts: bool, watches: bool) -> None:
    """Print which keys there are.

    Args:
        acts: There is a gripper or an output, which can be armed.
        watches: A grasp is watched, so that a person may say what became of it.
    """
    say(_KEYS + (_GRIP_KEYS if acts else ""), style="dim")
    if watches:
        say(_PERSON_KEYS, style="dim")


def press(key: str, station: Station, seen: frozenset[int]) -> None:
    """Do what a key stands for; other keys do nothing.

    Args:
        key: It.
        station: What it is pressed for.
        seen: Keys of the alarms that had been shown: a person acknowledges what they saw.
    """
    if key == "q":
        station.stop()
    elif key == "a":
        station.acknowledge(seen)
        if station.guard.alarms.sounding is not None:
            station.say(_UNSEEN)
    elif key == "n":
        station.new_grasp()
    elif key in _REACTIONS:
        station.react(_REACTIONS[key])
    elif key == "d":
        station.disarm()
    elif key == "m":
        causes = station.arm()
        words = f"not armed: {causes[0]}" if causes else "armed"
        station.say(words)


class PrinterThread:
    """Prints in a thread of its own: a terminal that stands still must not stop the supervisor."""

    def __init__(self) -> None:
        self.shown: frozenset[int] = frozenset()
        """Keys of the alarms of which all lines are printed."""
        self._noted = self.shown
        self._lines: queue.Queue[Text | frozenset[int] | None] = queue.Queue(maxsize=256)
        self._thread = threading.Thread(target=self._run, name="taxel printer", daemon=True)
        self._thread.start()

    def say(self, line: Text) -> bool:
        """Print a line soon; return False where too many wait, and it is to be said again."""
        with suppress(queue.Full):
            self._lines.put_nowait(line)
            return True
        return False

    def note(self, alarms: frozenset[int]) -> None:
        """Let the alarms of these keys count as shown once all lines until now are printed."""
        if alarms != self._noted:
            with suppress(queue.Full):  # the next call tries again
                self._lines.put_nowait(alarms)
                self._noted = alarms

    def close(self) -> None:
        """Print what waits, for a second at most."""
        with suppress(queue.Full):
            self._lines.put(None, timeout=1.0)
        self._thread.join(1.0)

    def _run(self) -> None:
        while (line := self._lines.get()) is not None:
            if isinstance(line, frozenset):
                self.shown = line
            else:
                console.print(line, soft_wrap=True)


class EventLines:
    """Prints each event of a station once, with its seconds since the first call or event.

    Args:
        printer: What prints the lines.
    """

    def __init__(self, printer: PrinterThread) -> None:
        self._printed = 0
        self._began_s: float | None = None
        self._printer = printer

    def print_new(self, station: Station) -> bool:
        """Print the events since the last call; return False where some still wait for room.

        A station holds its latest events only: where some are gone before there was room, a line
        says how many, and shows the alarms that there are, which else counted as shown.
        """
        newest = station.events[-1][0] if station.events else 0
        if self._began_s is None:
            self._began_s = station.events[0][1] if station.events else monotonic()
        if newest == self._printed:
            return True
        if (gone := station.events[0][0] - self._printed - 1) > 0:
            texts = "; ".join(alarm.text for alarm in station.guard.alarms.alarms) or "none"
            line = f"the terminal stood still: {number_of(gone, 'event')} left out; alarms: {texts}"
            if not self._printer.say(Text(visible_line(line), "yellow")):
                return False
            self._printed += gone
        for number, time_s, text in station.events:
            if number <= self._printed:
                continue
            colour = _COLOURS.get(text.partition(":")[0], "cyan")
            when = f"{time_s - self._began_s:8.2f} s  "
            if not self._printer.say(Text.assemble(when, (visible_line(text), colour))):
                return False
            self._printed = number
        return True
