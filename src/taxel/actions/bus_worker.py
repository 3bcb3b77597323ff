"""A thread that owns a slow device, so that nobody else ever waits for it.

A mailbox of one: the latest command wins, except that a stop that waits is never replaced by
anything else. Between commands the thread looks at the device; after an error it closes it and
tries again with a pause. An error of any kind ends in words, never in a dead thread.
Knows nothing about what a command means.
"""

from __future__ import annotations

import math
import threading
from collections import deque
from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np

from taxel.actions.gripper import Latency
from taxel.clock import Clock

_KEPT = 1000
"""Latencies kept for the median."""


@dataclass(frozen=True, slots=True)
class Command:
    """One thing to send."""

    name: str
    """What to do; "stop" goes before all else."""
    value: float = math.nan
    """Its number, in the device's unit."""
    expires_s: float = math.inf
    """From this moment on it is not sent, monotonic seconds."""
    given_s: float = -math.inf
    """When it was put into the mailbox, monotonic seconds."""
    number: int = 0
    """Of what asks for it; 0 where that does not matter."""

    @property
    def stops(self) -> bool:
        """True for the command that nothing may replace."""
        return self.name == "stop"


class Device(Protocol):
    """What the thread does with its device; called from that thread only."""

    def open(self) -> None:
        """Open it; any exception means that it could not."""
        ...

    def look(self) -> None:
        """Read its state; any exception means that it is lost."""
        ...

    def do(self, command: Command) -> bool:
        """Carry out a command; True where the device answered one, any exception: it is lost.

        A device that takes its time looks at `expires_s` again before each thing that it sends.
        """
        ...

    def shut(self) -> None:
        """Close it; never raises."""
        ...


class BusWorker:
    """The thread and its mailbox.

    Args:
        name: Of the thread.
        device: What it owns.
        clock: For times of commands; pauses are the system's.
        look_s: How often the device is looked at between commands, seconds.
        again_s: Pause before a lost device is tried again, seconds.
    """

    def __init__(
        self, name: str, device: Device, clock: Clock, look_s: float, again_s: float
    ) -> None:
        self._device = device
        self._clock = clock
        self._look_s = look_s
        self._again_s = again_s
        self._bell = threading.Condition()
        self._waiting: Command | None = None
        self._ended = False
        self._looked_s = -math.inf
        self._fault = "not connected"
        self._tried = threading.Event()
        self._took_s: deque[float] = deque(maxlen=_KEPT)
        self._commands = 0
        self._worst_s = math.nan
        self._thread = threading.Thread(target=self._run, name=name, daemon=True)

    def start(self, timeout_s: float) -> str:
        """Start; wait for the first try to open and look; return what is wrong, empty if nothing.

        Args:
            timeout_s: How long to wait at most, seconds.
        """
        self._thread.start()
        self._tried.wait(timeout_s)
        return self._fault

    def put(self, command: Command) -> None:
        """Leave a command for the thread, at once."""
        given = replace(command, given_s=self._clock.now_s())
        with self._bell:
            if self._waiting is None or given.stops or not self._waiting.stops:
                self._waiting = given
                self._bell.notify()

    @property
    def fault(self) -> str:
        """Why the device is lost, in words; empty where it answers."""
        return self._fault

    @property
    def latency(self) -> Latency:
        """How long commands took from `put` to the device's answer."""
        took = list(self._took_s)
        if not took:
            return Latency()
        return Latency(
            commands=self._commands,
            last_s=took[-1],
            p50_s=float(np.median(took)),
            worst_s=self._worst_s,
        )

    def close(self, timeout_s: float = 2.0) -> None:
        """End the thread after a stop that waits has been sent; the device is closed by it."""
        with self._bell:
            self._ended = True
            self._bell.notify()
        if self._thread.is_alive():
            self._thread.join(timeout_s)

    def _run(self) -> None:
        opened = False
        while True:
            try:
                if not opened:
                    self._device.open()
                    opened = True
                    self._device.look()
                self._fault = ""
                self._tried.set()
                while self._turn():
                    pass
                break
            except Exception as error:  # a dead thread would be silence: every error is reported
                self._fault = (f"{error}".strip() or repr(error)).splitlines()[0]
                self._device.shut()
                opened = False
                self._tried.set()
                if self._rest():
                    break
        self._device.shut()

    def _turn(self) -> bool:
        """Carry out what waits, or look; return False at the end."""
        with self._bell:
            if self._waiting is None and not self._ended:
                self._bell.wait(self._look_s)
            command, self._waiting = self._waiting, None
            ended = self._ended
        if command is not None and (command.stops or self._clock.now_s() < command.expires_s):
            try:
                answered = self._device.do(command)
            except Exception:
                self._keep(command)
                raise
            if answered:
                self._count(self._clock.now_s() - command.given_s)
        if ended:
            return False
        self._look_if_due()
        return True

    def _look_if_due(self) -> None:
        """Look, unless commands come faster than looks are wanted."""
        now_s = self._clock.now_s()
        if not 0 <= now_s - self._looked_s < self._look_s:
            self._looked_s = now_s
            self._device.look()

    def _keep(self, command: Command) -> None:
        """Try a stop again once the device is back; anything else only while it is valid."""
        with self._bell:
            if self._waiting is None or (command.stops and not self._waiting.stops):
                self._waiting = command

    def _count(self, took_s: float) -> None:
        self._commands += 1
        self._took_s.append(took_s)
        self._worst_s = took_s if math.isnan(self._worst_s) else max(self._worst_s, took_s)

    def _rest(self) -> bool:
        """Pause after an error; return True where the end has come."""
        with self._bell:
            if not self._ended:
                self._bell.wait_for(lambda: self._ended, self._again_s)
            return self._ended
