"""The line to the TENG hand's motor board: what is sent, sent again and heard.

Everything runs in the worker's thread but the plain values that `HandController` reads and
sets. A stop is repeated until it is acknowledged; an arm that was not acknowledged never
outlives a stop. Knows nothing about interlocks or sensors. Source: protocol/SPEC.md.
"""

from __future__ import annotations

import math
import termios
from collections import deque
from dataclasses import dataclass

import serial

from taxel.actions.bus_worker import Command
from taxel.clock import Clock
from taxel.errors import BadInput
from taxel.sources.boards.port import why_not_open
from taxel.wire import messages as wire
from taxel.wire.framing import DELIMITER, FrameDecoder, frame_of

_U32 = 0xFFFF_FFFF
_READ = 4096
"""Bytes read at a time."""
_KEPT = 1000
"""Round trips and current readings kept."""
_NO_ANSWER = "the hand does not acknowledge the stop"


@dataclass(frozen=True, slots=True, kw_only=True)
class HandConfig:
    """Port and number of the hand's board, and times of its line.

    Source: our choice, docs/decisions/0016.
    """

    port: str
    """The serial port, best by its name under /dev/serial/by-id."""
    board: int = wire.EVERY_BOARD
    """The board's number in its hand, or EVERY_BOARD where it is alone on the port."""
    baud: int = 500_000
    """Baud. Source: protocol/SPEC.md."""
    beat_s: float = 0.025
    """Time between heartbeats, seconds; the board waits for 0.095 s."""
    owner_s: float = 0.1
    """No heartbeat is sent when `refresh` was last called longer ago, seconds."""
    silent_s: float = 0.25
    """A board not heard for this long is lost, seconds; it should beat every 0.1 s."""
    again_s: float = 0.03
    """A stop or an arm without acknowledge is sent again after this long, seconds."""
    stop_s: float = 0.3
    """A stop without acknowledge is a fault after this long, seconds."""
    hello_s: float = 3.0
    """How long `connect` waits for the board's hello, seconds: a board may boot first."""

    write_s: float = 0.05
    """How long a write may take, seconds: a port that takes nothing is lost."""

    def __post_init__(self) -> None:
        times = (
            self.write_s,
            self.beat_s,
            self.owner_s,
            self.silent_s,
            self.again_s,
            self.stop_s,
            self.hello_s,
        )
        if not all(0 < t < math.inf for t in times):
            raise BadInput("times above 0 s", f"{times}", "choose others")
        if not 0 <= self.board <= wire.EVERY_BOARD or self.baud <= 0:
            raise BadInput(
                f"a board of 0 to {wire.EVERY_BOARD} and a baud rate above 0",
                f"{self.board} and {self.baud}",
                "mend them",
            )


@dataclass(frozen=True, slots=True)
class Grip:
    """The arguments of a grip on the wire; see `HandController.grip`."""

    fingers: int
    closed_permille: int
    contact_ma: int
    lasts_ms: int


class HandLink:
    """The port and what is under way; but for plain values all in the worker's thread."""

    def __init__(self, config: HandConfig, clock: Clock) -> None:
        self._config = config
        self._clock = clock
        self._port: serial.Serial | None = None
        self._decoder = FrameDecoder()
        self._commands = 0
        self._beats = 0
        self._beat_s = -math.inf
        self._sent: dict[int, tuple[str, float]] = {}
        self._since_s: dict[str, float] = {}  # "arm", "stop": first sent, not acknowledged
        self._again_s: dict[str, float] = {}
        self._armed = False
        self._stopped = False  # a stop was acknowledged, and nothing else was asked since
        self.grip: Grip | None = None
        self.arm_wanted = False
        self.ending = False
        self.owner_s = -math.inf
        self.state: wire.State | None = None
        self.currents_ma: tuple[int, ...] = ()
        self.current_s = -math.inf
        self.readings: deque[tuple[float, tuple[int, ...]]] = deque(maxlen=_KEPT)
        self.boot_id: int | None = None
        self.fault = ""
        self.heard_s = -math.inf
        self.trips_s: deque[float] = deque(maxlen=_KEPT)
        self.answered = 0
        self.worst_s = math.nan

    def open(self) -> None:
        config = self._config
        try:
            self._port = serial.Serial(
                config.port, config.baud, timeout=0, write_timeout=config.write_s, exclusive=True
            )
        except (OSError, ValueError, termios.error) as error:
            why = why_not_open(error)
            raise ConnectionError(f"a port that cannot be opened: {why}") from error
        self._decoder = FrameDecoder()
        self._port.write(DELIMITER)
        hello = self._await_hello()
        if not hello.abilities & wire.Ability.MOTION:
            raise ConnectionError(f"the board {hello.board_id or hello.board} has no motors")

    def _await_hello(self) -> wire.Hello:
        until_s = self._clock.now_s() + self._config.hello_s
        asked_s = -math.inf
        while (now_s := self._clock.now_s()) < until_s and not self.ending:
            if now_s - asked_s >= 0.2:
                self._command("identify", wire.Order.IDENTIFY)
                asked_s = now_s
            for message in self._receive():
                self._take(message)
                if isinstance(message, wire.Hello):
                    if message.protocol != wire.PROTOCOL:
                        raise ConnectionError(
                            f"the board speaks protocol {message.protocol}, not {wire.PROTOCOL}"
                        )
                    return message
            self._clock.sleep(0.002)
        raise ConnectionError(f"no hello within {self._config.hello_s:g} s")

    def look(self) -> None:
        for message in self._receive():
            self._take(message)
        now_s = self._clock.now_s()
        config = self._config
        owned = now_s - self.owner_s <= config.owner_s
        if owned and now_s - self._beat_s >= config.beat_s:
            self._beat(now_s)
        if not owned and self.arm_wanted:
            # Whoever asked stood still meanwhile: a request to arm does not outlive that.
            self.arm_wanted = False
            self._done("arm")
        if self.arm_wanted and "stop" not in self._since_s:
            self._urge("arm", wire.Order.ARM, now_s)
        if "stop" in self._since_s:
            self._urge("stop", wire.Order.STOP, now_s)
            if now_s - self._since_s["stop"] > config.stop_s:
                self.fault = _NO_ANSWER

    def do(self, command: Command) -> bool:
        now_s = self._clock.now_s()
        if command.stops:
            if not self._stopped:
                self._armed = False
                self._done("arm")
                self._urge("stop", wire.Order.STOP, now_s)
        elif self.grip is not None and "stop" not in self._since_s:
            grip = self.grip
            # What is left of it: the board counts from the arrival.
            left_ms = min(grip.lasts_ms, (command.expires_s - now_s) * 1e3)
            if not left_ms >= 1:
                return False
            self._command(
                "grip",
                wire.Order.GRIP,
                int(left_ms),
                (grip.fingers, grip.closed_permille, grip.contact_ma),
            )
        return False

    def shut(self) -> None:
        port, self._port = self._port, None
        if port is not None:
            port.close()

    def _urge(self, name: str, order: wire.Order, now_s: float) -> None:
        """Send an order, and again while it is not acknowledged."""
        self._since_s.setdefault(name, now_s)
        if now_s - self._again_s.get(name, -math.inf) >= self._config.again_s:
            self._again_s[name] = now_s
            self._command(name, order)

    def _command(
        self,
        name: str,
        order: wire.Order,
        expires_ms: int = 0,
        arguments: tuple[int, int, int] = (0, 0, 0),
    ) -> None:
        now_s = self._clock.now_s()
        self._commands = (self._commands + 1) & _U32
        self._sent[self._commands] = (name, now_s)
        while len(self._sent) > _KEPT:
            del self._sent[next(iter(self._sent))]
        self._stopped = self._stopped and order not in (wire.Order.ARM, wire.Order.GRIP)
        a, b, c = arguments
        self._send(
            wire.Command(
                board=self._config.board,
                seq=self._commands,
                t_us=int(now_s * 1e6) & _U32,
                order=order,
                expires_ms=expires_ms,
                a=a,
                b=b,
                c=c,
            )
        )

    def _beat(self, now_s: float) -> None:
        self._beat_s = now_s
        self._beats = (self._beats + 1) & _U32
        self._send(
            wire.Heartbeat(
                board=self._config.board,
                seq=self._beats,
                t_us=int(now_s * 1e6) & _U32,
                state=wire.State.ARMED if self._armed else wire.State.IDLE,
                bad=self._decoder.bad.total & _U32,
            )
        )

    def _send(self, message: wire.Message) -> None:
        if self._port is None:
            raise ConnectionError("not connected")
        self._port.write(frame_of(wire.pack(message)))

    def _receive(self) -> list[wire.Message]:
        if self._port is None:
            raise ConnectionError("not connected")
        found = []
        for payload in self._decoder.feed(self._port.read(_READ)):
            message = wire.unpack(payload)
            if message is None:
                self._decoder.bad.message += 1
            elif self._config.board in (wire.EVERY_BOARD, message.board):
                found.append(message)
        return found

    def _take(self, message: wire.Message) -> None:
        now_s = self._clock.now_s()
        match message:
            case wire.Hello(boot_id=boot_id):
                if self.boot_id is not None and boot_id != self.boot_id and self._armed:
                    self.fault = "the hand has rebooted"
                    self._armed, self.state = False, None
                self.boot_id = boot_id
            case wire.Heartbeat(state=state):
                self._take_state(state)
            case wire.Acknowledge():
                self._take_answer(message, now_s)
            case wire.Current(milliamps=milliamps):
                self.currents_ma, self.current_s = milliamps, now_s
                self.readings.append((now_s, milliamps))
            case wire.Data() | wire.Command():
                pass
        self.heard_s = now_s

    def _take_state(self, state: int) -> None:
        if state not in list(wire.State):
            self.fault = f"the hand says state {state}, which is none"
            return
        self.state = wire.State(state)
        if self.state in (wire.State.ARMED, wire.State.MOVING):
            self._stopped = False
        if self.state is wire.State.FAULT:
            self.fault = "the hand reports a fault"
        elif self._armed and self.state in (wire.State.IDLE, wire.State.STOPPED):
            self._armed = False
            self.fault = "the hand has stopped by itself"

    def _take_answer(self, answer: wire.Acknowledge, now_s: float) -> None:
        name, sent_s = self._sent.get(answer.command_seq, ("", math.nan))
        if not name or answer.result == wire.Result.EXPIRED:
            return
        trip_s = now_s - sent_s
        self.answered += 1
        self.trips_s.append(trip_s)
        self.worst_s = trip_s if math.isnan(self.worst_s) else max(self.worst_s, trip_s)
        done = answer.result == wire.Result.DONE
        if name == "stop" and done and "stop" in self._since_s:
            self._done("stop")
            self._stopped, self.state = True, wire.State.STOPPED
            self.fault = "" if self.fault == _NO_ANSWER else self.fault
        elif name == "arm" and self.arm_wanted and "stop" not in self._since_s and done:
            self._done("arm")
            self.arm_wanted, self._armed = False, True
            self.state, self.fault = wire.State.ARMED, ""
        elif name == "grip" and answer.result in (wire.Result.BAD_ARGUMENT, wire.Result.UNKNOWN):
            self.fault = "the hand refuses to grip like this"

    def _done(self, name: str) -> None:
        self._since_s.pop(name, None)
        self._again_s.pop(name, None)
