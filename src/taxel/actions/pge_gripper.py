"""A DH-Robotics PGE gripper over Modbus RTU: 115200 baud, 8N1, id 1 as delivered.

    0x0100  initialise: 1, or 0xA5 to look for both end stops      write
    0x0101  force, 20 to 100 %                                     write, read at connect
    0x0103  position, 0 closed to 1000 open, per mille             write
    0x0104  speed, 1 to 100 %                                      write
    0x0200  0 not initialised, 1 initialised                       read
    0x0201  0 moving, 1 reached, 2 caught, 3 dropped               read
    0x0202  position, per mille                                    read

`grip` writes the force, then sends the fingers to closed, so that they press with it. The PGE
has no register that stops: `stop` reads the state and, while the fingers move, sends them to
where they are. While an object is caught nothing is written: fingers told to stay where they
are might press less, and the force set before is what holds the object. `hold` writes nothing.

A thread of its own talks to the bus. RTU replies carry no number, so a late one could be taken
for the next: each reply is checked against its request (kind, register, value), and after any
error the line is left quiet for `late_s` and emptied before anything else is asked.

Knows nothing about decisions or newtons. Never tried on a real PGE here: tested against a
pymodbus server on a pseudo-terminal. Source of registers: DH-Robotics, PGE series, short
manual for Modbus RTU; Dobot's PGE-2 manual, tables 3.2 to 3.7, agrees.

Background of our choices: docs/decisions/0016.
"""

from __future__ import annotations

import logging
import math
import time
from contextlib import suppress
from dataclasses import dataclass, replace

from pymodbus.client import ModbusSerialClient
from pymodbus.exceptions import ModbusException
from pymodbus.pdu import ModbusPDU

from taxel.actions.bus_worker import BusWorker, Command
from taxel.actions.gripper import GripperStatus, Latency, Motion
from taxel.clock import Clock
from taxel.errors import BadInput
from taxel.plain_text import number_of
from taxel.sources.boards.port import trouble_of

INITIALISE, FORCE, POSITION, SPEED = 0x0100, 0x0101, 0x0103, 0x0104
INITIALISED = 0x0200
"""First of three registers that are read at once: initialised, state, position."""
BAUD = 115_200
MIN_PCT, MAX_PCT = 20, 100
CLOSED_PERMILLE = 0
# Its messages go to whoever asks for them, not unasked to the terminal; faults stand in `status`.
logging.getLogger("pymodbus.logging").addHandler(logging.NullHandler())
_MOTIONS = (Motion.MOVING, Motion.REACHED, Motion.CAUGHT, Motion.DROPPED)
_NOT_INITIALISED = "not initialised: take everything out of the hand and use initialise=1"
_FIRST_ANSWER_S = 3.0
"""How long `connect` waits, seconds. Source: our choice."""


@dataclass(frozen=True, slots=True, kw_only=True)
class PgeConfig:
    """Port and id of the gripper, and times of its bus."""

    port: str
    """The serial port, best by its name under /dev/serial/by-id."""
    device_id: int = 1
    """Modbus id, 1…247."""
    timeout_s: float = 0.05
    """How long an answer may take, seconds. Source: our choice; 19 bytes take 1.7 ms at 115200
    baud, USB adapters add up to 16 ms."""
    late_s: float = 0.1
    """How long after a timeout the line is left quiet for a late answer, seconds: one that is
    later still could be taken for the next. Source: our choice."""
    retries: int = 1
    """Times that a request is sent again."""
    look_s: float = 0.02
    """How often the state is read, seconds."""
    again_s: float = 0.2
    """Pause before a lost bus is opened again, seconds."""
    stale_s: float = 0.5
    """A state older than this is a fault, seconds; whatever the thread may be stuck in."""
    initialise: bool = False
    """Look for the end stops at connect if it has not: the fingers open all the way."""
    speed_pct: int | None = None
    """Speed of the fingers, 1…100 percent; None leaves what is set."""

    def __post_init__(self) -> None:
        if not 1 <= self.device_id <= 247:
            raise BadInput("a Modbus id of 1 to 247", f"{self.device_id}", "mend the id")
        if not all(
            0 < t < math.inf for t in (self.timeout_s, self.late_s, self.look_s, self.again_s)
        ):
            raise BadInput("times above 0 s", "0 or less", "choose others")
        if not 0 <= self.retries <= 5:
            raise BadInput("0 to 5 retries", f"{self.retries}", "choose fewer")
        if self.speed_pct is not None and not 1 <= self.speed_pct <= 100:
            raise BadInput("a speed of 1 to 100 %", f"{self.speed_pct}", "choose another")


class BusError(Exception):
    """A request over the bus failed: no reply, a damaged one, or an exception reply."""


class PgeGripper:
    """A `Gripper` over Modbus RTU."""

    def __init__(self, config: PgeConfig, clock: Clock) -> None:
        self._config = config
        self._clock = clock
        self._bus = _Bus(config, clock)
        self._worker = BusWorker(
            "pge-gripper", self._bus, clock, config.look_s, max(config.again_s, config.late_s)
        )

    def connect(self) -> None:
        fault = self._worker.start(_FIRST_ANSWER_S)
        if fault:
            self._worker.close()
            raise BadInput(
                f"a PGE gripper with id {self._config.device_id} on {self._config.port}",
                fault,
                "check power, cable and id, or find the port with: taxel find",
            )

    def grip(self, force_pct: float, expires_s: float = math.inf) -> None:
        if not math.isnan(force_pct):
            # Rounded down: a limit in newtons must not be passed by rounding.
            pct = math.floor(min(max(force_pct, MIN_PCT), MAX_PCT) + 1e-9)
            self._worker.put(Command("grip", pct, expires_s))

    def hold(self) -> None:
        """Nothing to send: the PGE keeps pressing with the force last written."""

    def stop(self) -> None:
        self._worker.put(Command("stop"))

    def status(self) -> GripperStatus:
        status, fault = self._bus.status, self._worker.fault
        age_s = self._clock.now_s() - status.read_s
        if not fault and not age_s <= self._config.stale_s:
            fault = f"no answer from the gripper for {age_s:.1f} s"
        if not fault and not status.initialised:
            fault = _NOT_INITIALISED
        return replace(status, fault=fault)

    @property
    def latency(self) -> Latency:
        """How long commands took from the call to the gripper's answer to the last write."""
        return self._worker.latency

    def close(self) -> None:
        self._worker.close()


class _Bus:
    """The registers; everything here runs in the worker's thread but `status`."""

    def __init__(self, config: PgeConfig, clock: Clock) -> None:
        self._config = config
        self._clock = clock
        self._client: ModbusSerialClient | None = None
        self._may_initialise = config.initialise
        self._force: int | None = None  # what was last written, percent and per mille
        self._position: int | None = None
        self.status = GripperStatus()

    def open(self) -> None:
        config = self._config
        self._client = ModbusSerialClient(
            config.port,
            baudrate=BAUD,
            bytesize=8,
            parity="N",
            stopbits=1,
            timeout=config.timeout_s,
            retries=0,  # ours are counted below, each with a quiet line before it
        )
        if not self._client.connect():
            why = trouble_of(config.port, BAUD)  # pymodbus keeps it to itself
            raise BusError(f"a port that cannot be opened{': ' if why else ''}{why}")
        self._force = self._position = None  # it may have been switched off: believe nothing
        initialised, _, _ = self._read()
        (set_pct,) = self._read_from(FORCE, 1)
        self._force = set_pct if MIN_PCT <= set_pct <= MAX_PCT else None
        if self._may_initialise and not initialised:
            self._write(INITIALISE, 1)
        # Once only: a gripper that lost its power with an object in it must not open by itself.
        self._may_initialise = False
        if config.speed_pct is not None:
            self._write(SPEED, config.speed_pct)

    def look(self) -> None:
        asked_s = self._clock.now_s()
        initialised, state, position = self._read()
        if state >= len(_MOTIONS):
            raise BusError(f"the gripper says state {state}; known are 0 to 3")
        self.status = GripperStatus(
            initialised=initialised == 1,
            motion=_MOTIONS[state],
            position_permille=float(position),
            force_pct=math.nan if self._force is None else float(self._force),
            read_s=asked_s,
        )

    def do(self, command: Command) -> bool:
        if command.stops:
            return self._stop()
        wanted = (int(command.value), CLOSED_PERMILLE)
        if not self.status.initialised or wanted == (self._force, self._position):
            return False
        if not self._write(FORCE, wanted[0], command.expires_s):
            return False
        self._force = wanted[0]
        if self._write(POSITION, wanted[1], command.expires_s):
            self._position = wanted[1]
        return True

    def _stop(self) -> bool:
        """End motion; what is caught stays pressed."""
        self.look()
        here = int(self.status.position_permille)
        still = self.status.motion in (Motion.CAUGHT, Motion.REACHED)
        if still or here == self._position:
            return False
        self._write(POSITION, here)
        self._position = here
        return True

    def shut(self) -> None:
        client, self._client = self._client, None
        if client is not None:
            with suppress(Exception):  # the port may be gone already
                client.close()  # type: ignore[no-untyped-call]

    def _read(self) -> tuple[int, int, int]:
        initialised, state, position = self._read_from(INITIALISED, 3)
        return initialised, state, position

    def _read_from(self, register: int, number: int) -> list[int]:
        reply = self._ask("read", register, number)
        assert reply is not None  # a read never expires
        return list(reply.registers)

    def _write(self, register: int, value: int, expires_s: float = math.inf) -> bool:
        """Write a register; False where the moment passed at which it had to be sent."""
        return self._ask("write", register, value, expires_s) is not None

    def _ask(
        self, what: str, register: int, number: int, expires_s: float = math.inf
    ) -> ModbusPDU | None:
        """Return the reply to a request, sent again as often as allowed.

        None where `expires_s` has passed: looked at before each try, since a try may wait.
        """
        for left in range(self._config.retries, -1, -1):
            if not self._clock.now_s() < expires_s:
                return None
            try:
                return self._ask_once(what, register, number)
            except (BusError, ModbusException) as error:
                if not left:  # the pause before the bus is opened again keeps the line quiet
                    raise BusError(_plain(error)) from error
                self._quiet()
        raise AssertionError("the loop ends in an answer or an error")

    def _ask_once(self, what: str, register: int, number: int) -> ModbusPDU:
        client = self._client
        if client is None:
            raise BusError("not connected")
        own = self._config.device_id
        if what == "read":
            reply = client.read_holding_registers(register, count=number, device_id=own)
            expected = 3
        else:
            reply = client.write_register(register, number, device_id=own)
            expected = 6
        if reply.isError():
            raise BusError(f"the gripper refuses to {what} register {register:#06x}")
        if reply.function_code != expected:
            raise BusError("a late reply came instead of the one awaited")
        if what == "read" and len(reply.registers) != number:
            raise BusError(
                f"asked for {number_of(number, 'register')}, the gripper sent "
                f"{len(reply.registers)}"
            )
        if what == "write" and (reply.address, *reply.registers) != (register, number):
            raise BusError("the gripper repeats another value than was written")
        return reply

    def _quiet(self) -> None:
        """Let a late reply arrive and throw it away."""
        time.sleep(self._config.late_s)
        if self._client is not None and self._client.socket is not None:
            self._client.socket.reset_input_buffer()


def _plain(error: Exception) -> str:
    """Return an error of the bus in one plain line."""
    text = str(error)
    return "no answer from the gripper" if "No response" in text else text
