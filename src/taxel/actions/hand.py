"""The TENG hand's motors, over the wire format: arm, close, stop, and a heart that beats.

What keeps the hand safe when something dies:

- the board stops its motors when it hears no heartbeat of the host for 95 ms;
- the host's thread beats only while its owner calls `refresh`: a hung owner stops the hand too;
- each grip names the current at which the board itself stops a motor (contact), and runs out
  unless it is refreshed; the interlock's `contact_ma` stands behind that, for a board that does
  not stop;
- a stop is sent again until it is acknowledged, and is a fault where it is not.

Knows nothing about sensors, decisions or force. Source: protocol/SPEC.md; contact by motor
current: Balapan 2025, ch. 3 (INA226); times: our choice, docs/decisions/0016.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Protocol

import numpy as np

from taxel.actions.bus_worker import BusWorker, Command
from taxel.actions.gripper import Latency
from taxel.actions.hand_contract import HandStatus, checked_grip
from taxel.actions.hand_link import Grip, HandConfig, HandLink
from taxel.clock import Clock
from taxel.errors import BadInput


class Worker(Protocol):
    """Whoever carries out what the controller leaves for it: a thread, or a bench's own loop."""

    @property
    def fault(self) -> str:
        """Why the device is lost, in words; empty where it answers."""
        ...

    def start(self, timeout_s: float) -> str:
        """Start; return what is wrong after the first try, empty if nothing."""
        ...

    def put(self, command: Command) -> None:
        """Take a command, at once."""
        ...

    def close(self) -> None:
        """End; the device is closed by it."""
        ...


class HandController:
    """The host's end of the hand's motors.

    Args:
        config: Where the hand is.
        clock: The host's clock.
        worker: Makes who serves the link; a thread of its own unless given.
    """

    def __init__(
        self,
        config: HandConfig,
        clock: Clock,
        worker: Callable[[HandLink], Worker] | None = None,
    ) -> None:
        self._config = config
        self._clock = clock
        self._link = HandLink(config, clock)
        self._worker: Worker = (
            BusWorker("teng-hand", self._link, clock, look_s=0.002, again_s=0.1)
            if worker is None
            else worker(self._link)
        )

    def connect(self) -> None:
        """Open the port and wait for the board's hello.

        Raises:
            BadInput: There is no such port, or no board with motors behind it.
        """
        fault = self._worker.start(self._config.hello_s + 2.0)
        if fault:
            self._worker.close()
            raise BadInput(
                f"a hand with motors on {self._config.port}",
                fault,
                "check power and cable, or find the port with: taxel find",
            )

    def refresh(self) -> None:
        """Say that the owner lives; call it every tick. Without it the hand stops."""
        self._link.owner_s = self._clock.now_s()

    def arm(self) -> None:
        """Ask the board to allow motion, on behalf of a person; `status().armed` says when."""
        self._link.arm_wanted = True

    def grip(
        self, fingers: int, closed_permille: int, contact_ma: int, lasts_s: float = 0.2
    ) -> None:
        """As `Hand.grip`, on the board."""
        lasts_ms = checked_grip(fingers, closed_permille, contact_ma, lasts_s)
        self._link.grip = Grip(fingers, closed_permille, contact_ma, lasts_ms)
        self._worker.put(Command("grip", expires_s=self._clock.now_s() + lasts_s))

    def stop(self) -> None:
        """Motors off and no longer armed; sent until the board acknowledges it."""
        self._link.arm_wanted = False
        self._worker.put(Command("stop"))

    def status(self) -> HandStatus:
        """Return what is known, at once."""
        link, now_s = self._link, self._clock.now_s()
        fault = self._worker.fault or link.fault
        age_s = now_s - link.heard_s
        if not fault and not age_s <= self._config.silent_s:
            fault = f"the hand has been silent for {age_s:.2f} s"
        return HandStatus(
            state=link.state,
            currents_ma=link.currents_ma,
            current_s=link.current_s,
            boot_id=link.boot_id,
            fault=fault,
            heard_s=link.heard_s,
        )

    def take_currents(self) -> list[tuple[float, tuple[int, ...]]]:
        """Return (monotonic seconds, mA of each motor) of each reading since the last call."""
        readings = self._link.readings
        return [readings.popleft() for _ in range(len(readings))]

    @property
    def latency(self) -> Latency:
        """Round trips from a command's sending to its acknowledge."""
        trips = list(self._link.trips_s)
        if not trips:
            return Latency()
        return Latency(
            commands=self._link.answered,
            last_s=trips[-1],
            p50_s=float(np.median(trips)),
            worst_s=self._link.worst_s,
        )

    def close(self) -> None:
        """Stop the hand and let go of the port."""
        self.stop()
        self._link.ending = True
        self._worker.close()
