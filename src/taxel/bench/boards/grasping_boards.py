"""The whole hand on emulated boards: three boards of pads and one of motors, closing on objects.

Firmware, converters, current sensors and serial lines are those of `taxel.bench.boards.emulator`;
between the motors and the pads stand the simulated fingers and the object
(`taxel.sim.teng.grasped_hand`). After each slice of virtual time the fingers are moved as the
motors' pins were driven, contact is sent to the emulated motors, and the pads' voltages are laid on
the converters' pins. Knows nothing about plans.
"""

from __future__ import annotations

from pathlib import Path
from typing import Self

import numpy as np

from taxel.actions.actuators import HandActuator
from taxel.actions.bus_worker import Command
from taxel.actions.hand import HandController
from taxel.actions.hand_link import HandConfig, HandLink
from taxel.bench.boards.emulator import (
    PINS,
    BoardSetup,
    EmulatedBoards,
    Event,
    Firmware,
    tenths_of_millivolts,
)
from taxel.bench.boards.hand import MOTORS
from taxel.bench.boards.sensors import CHANNELS
from taxel.sim.teng.grasped_hand import STEP_S, GraspedHand, Motors
from taxel.sources.boards.source import SerialBoards

STROKE_S = 0.6
"""HAND_STROKE_MS of the firmware hand_control_quick, seconds."""
SENSOR_BOARDS = 3
_HAND = SENSOR_BOARDS
"""The motors' board: the last."""
_WRITE_S = 10.0
"""How long a write may take in real time, seconds: virtual time does not pass meanwhile."""
_SLICE_S = 0.01
"""Between two looks at the motors' pins, virtual seconds: how late a finger may meet its object."""


class _Turns:
    """Serves the hand's link when its turn comes, instead of a thread of its own."""

    def __init__(self, link: HandLink) -> None:
        self._link = link
        self.open = False
        self.fault = ""

    def start(self, timeout_s: float) -> str:
        self._link.open()
        self.open = True
        return ""

    def put(self, command: Command) -> None:
        if self.open:
            self._link.do(command)

    def turn(self) -> None:
        if self.open:
            self._link.look()

    def close(self) -> None:
        self.open = False
        self._link.shut()


class GraspingBoards:
    """Boards, fingers and object; also the clock of whoever lives with them. Use it in a `with`.

    Args:
        firmware: As built.
    """

    def __init__(self, firmware: Firmware) -> None:
        self.plant = GraspedHand(motors=Motors(stroke_s=STROKE_S))
        quiet = np.zeros((1, PINS))
        setups = [
            BoardSetup(elf=firmware.elf(f"teng_daq_{n}"), volts=quiet) for n in range(SENSOR_BOARDS)
        ]
        setups.append(BoardSetup(elf=firmware.elf("hand_control_quick"), sensors=MOTORS))
        self.boards = EmulatedBoards(firmware, setups)
        self._folder = Path(self.boards.port(0)).parent
        self._turns: _Turns | None = None
        self._source: SerialBoards | None = None
        self._taken = 0
        self._touching = np.zeros(MOTORS, bool)
        self._busy = False

    def now_s(self) -> float:
        """Return the boards' virtual time, seconds."""
        return self.boards.now_s

    def sleep(self, duration_s: float) -> None:
        """Let the boards run for a duration, seconds."""
        until_s = self.boards.now_s + duration_s
        while (left_s := until_s - self.boards.now_s) > 1e-6:
            self._slice(min(_SLICE_S, left_s))

    def open(self) -> tuple[SerialBoards, HandActuator]:
        """Return the pads as a source and the motors behind their real driver, connected."""
        ports = ",".join(str(self.boards.port(n)) for n in range(SENSOR_BOARDS))
        self._source = SerialBoards(ports, {}, self)
        config = HandConfig(port=str(self.boards.port(_HAND)), write_s=_WRITE_S)
        hand = HandController(config, self, self._serve)
        hand.connect()
        return self._source, HandActuator("emulated hand", hand)

    def _serve(self, link: HandLink) -> _Turns:
        self._turns = _Turns(link)
        return self._turns

    def _slice(self, seconds: float) -> None:
        start_s = self.boards.now_s
        self.boards.run(seconds)
        self._follow(start_s, seconds)
        self.boards.wait_for_readers(range(SENSOR_BOARDS))
        if self._turns is not None and not self._busy:
            self._busy = True  # what the link does may sleep, and so come back here
            self._turns.turn()
            self._busy = False

    def _follow(self, start_s: float, seconds: float) -> None:
        """Move the fingers as the motors were driven; report contacts; lay voltages on the pins."""
        fresh = [e for e in self.boards.events[self._taken :] if e.board == _HAND]
        self._taken = len(self.boards.events)
        turns = [event for event in fresh if event.what == "motor"]
        charge = []
        for number in range(max(1, round(seconds / STEP_S))):
            self._drive(turns, start_s + (number + 1) * STEP_S)
            charge.append(self.plant.step())
        self._drive(turns, np.inf)
        pressed = self.plant.touching & (self.plant.turning >= 0)
        for motor in np.flatnonzero(pressed != self._touching):
            self.boards.command(f"contact {_HAND} {motor} {int(pressed[motor])}")
        self._touching = pressed
        volts = self.plant.volts(np.stack(charge))
        for board in range(SENSOR_BOARDS):
            rows = np.zeros((len(volts), PINS))
            rows[:, CHANNELS] = volts[:, 4 * board : 4 * board + 4]
            path = self._folder / f"next{board}"
            tenths_of_millivolts(rows).tofile(path)
            self.boards.command(f"wave {board} {path}")

    def _drive(self, turns: list[Event], until_s: float) -> None:
        while turns and turns[0].at_s <= until_s:
            event = turns.pop(0)
            directions = self.plant.turning.copy()
            directions[int(event.values[0])] = int(event.values[1])
            self.plant.turn(directions)

    def contact_to_off_ms(self) -> list[float]:
        """Return, for each contact so far, how long the motor ran on, milliseconds."""
        found = []
        events = [event for event in self.boards.events if event.board == _HAND]
        for number, event in enumerate(events):
            if event.what != "contact" or event.values[1] != "1":
                continue
            off = next(
                (e for e in events[number:] if e.what == "motor"
                 and e.values[0] == event.values[0] and e.values[1] == "0"), None,
            )  # fmt: skip
            if off is not None:
                found.append(1000.0 * (off.at_s - event.at_s))
        return found

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        if self._turns is not None:
            self._turns.close()
        source, self._source = self._source, None
        if source is not None:
            source.__exit__(None, None, None)
        self.boards.close()
