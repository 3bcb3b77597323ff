"""A JAKA arm over its controller's TCP/JSON commands, port 10001.

    {"cmdName":"get_robot_state"}    power and enable, in words
    {"cmdName":"get_tcp_pos"}        tool: x, y, z in mm, then three angles in degrees
    {"cmdName":"moveL","relFlag":1,"cartPosition":[0,0,-z,0,0,0],"speed":mm/s,"accel":mm/s²}
    {"cmdName":"stop_program"}       ends the motion, power stays on

Replies are JSON objects without any delimiter, with `errorCode` "0" where the command was taken
and `errorMsg` where not, and most with `cmdName`. Taken is not done: the controller answers
before it moves. So motion is read from the position, twice.

It neither powers the arm on nor enables it, nor clears an error: a person does. The controller
keeps one client on this port; a second one pushes the first out, which is then a fault here.

What could not be tried: there is no JAKA here. Tested against a TCP server that speaks the JSON
above. To check on the real one, slowly and with nothing in its way: that z of the coordinate
system chosen on the controller points up; that `speed` is in mm/s (one user of an old firmware
reports mm/min); what the lag of `stop_program` is. Controllers that want TLS are not supported.

Knows nothing about decisions. Source: JAKA, TCP/IP control protocol (controllers 1.7.1, 1.7.2
and V3), framework and port descriptions; `relFlag`, units and replies as in public programs that
use it; jaka.com/docs.

Background of our choices: docs/decisions/0016.
"""

from __future__ import annotations

import json
import math
import socket
from dataclasses import dataclass, field
from typing import Any

from taxel.actions.arm import ArmLimits, ArmStatus
from taxel.actions.bus_worker import BusWorker, Command
from taxel.actions.gripper import Latency
from taxel.clock import Clock
from taxel.errors import BadInput

_LONGEST = 16_384
"""Bytes of an unfinished reply that are kept."""
_STILL_MM = 0.05
"""Two positions nearer than this are no motion, millimetres. Source: our choice."""


@dataclass(frozen=True, slots=True, kw_only=True)
class JakaConfig:
    """Address of a JAKA arm's controller, its limits, and times of its line."""

    host: str
    """The controller's address."""
    port: int = 10_001
    """Its command port."""
    limits: ArmLimits = field(default_factory=ArmLimits)
    """How far and how fast it may be moved."""
    timeout_s: float = 0.2
    """How long a reply may take, seconds. Source: our choice."""
    look_s: float = 0.05
    """How often it is looked at, seconds."""
    again_s: float = 0.5
    """Pause before a lost controller is tried again, seconds."""
    stale_s: float = 1.0
    """A state older than this is a fault, seconds."""

    def __post_init__(self) -> None:
        times = (self.timeout_s, self.look_s, self.again_s, self.stale_s)
        if not self.host or not 1 <= self.port <= 65535 or not all(0 < t < math.inf for t in times):
            raise BadInput(
                "a host, a port of 1 to 65535 and times above 0 s",
                f"{self.host!r}, {self.port}, {times}",
                "mend the address",
            )


class JakaArm:
    """An `Arm` over JAKA's TCP/JSON commands."""

    def __init__(self, config: JakaConfig, clock: Clock) -> None:
        self._config = config
        self._clock = clock
        self._line = _Line(config, clock)
        self._worker = BusWorker("jaka-arm", self._line, clock, config.look_s, config.again_s)

    def connect(self) -> None:
        fault = self._worker.start(10 * self._config.timeout_s + 2.0)
        if fault:
            self._worker.close()
            raise BadInput(
                f"a JAKA controller at {self._config.host}:{self._config.port}",
                fault,
                "check power, network and address",
            )

    def hold(self, expires_s: float = math.inf) -> None:
        self._worker.put(Command("hold", expires_s=expires_s))

    def lower(
        self,
        way_mm: float,
        speed_mm_s: float | None = None,
        expires_s: float = math.inf,
        number: int = 0,
    ) -> None:
        way, speed = self._config.limits.lowering(way_mm, speed_mm_s)
        if number and number == self._line.number:
            return
        self._line.speed_mm_s = speed
        until_s = min(expires_s, self._clock.now_s() + self._config.stale_s)
        self._worker.put(Command("lower", way, until_s, number=number))

    def stop(self) -> None:
        self._worker.put(Command("stop"))

    def status(self) -> ArmStatus:
        read, fault = self._line.status, self._worker.fault or self._line.refused
        age_s = self._clock.now_s() - read.read_s
        if not fault and not age_s <= self._config.stale_s:
            fault = f"no answer from the arm for {age_s:.1f} s"
        if not fault and not read.ready:
            fault = "not enabled: power it on and enable it on the arm's own panel"
        return ArmStatus(
            ready=read.ready,
            moving=read.moving,
            height_mm=read.height_mm,
            fault=fault,
            read_s=read.read_s,
        )

    @property
    def latency(self) -> Latency:
        """How long commands took from the call to the controller's reply."""
        return self._worker.latency

    def close(self) -> None:
        if self._line.began:
            self.stop()
        self._worker.close()


class JsonReplies:
    """Cut a stream of bytes into JSON objects, however they come in pieces.

    What is no object is skipped to the next brace and counted. Never raises, and keeps at most
    `_LONGEST` bytes.
    """

    def __init__(self) -> None:
        self._kept = b""
        self.bad = 0
        """Stretches thrown away."""

    def feed(self, data: bytes) -> list[dict[str, Any]]:
        """Take in bytes as they came; return the objects that they complete."""
        self._kept += data
        found = []
        while (end := self._end()) is not None:
            piece, self._kept = self._kept[:end], self._kept[end:]
            try:
                found.append(_object(piece))
            except (ValueError, RecursionError):
                self.bad += 1
        if len(self._kept) > _LONGEST:
            self.bad += 1
            self._kept = b""
        return found

    def _end(self) -> int | None:
        """Return where the first object ends; None where it has not ended yet."""
        start = self._kept.find(b"{")
        skipped = self._kept if start < 0 else self._kept[:start]
        self.bad += bool(skipped.strip())
        self._kept = b"" if start < 0 else self._kept[start:]
        depth, in_text, escaped = 0, False, False
        for i, byte in enumerate(self._kept):
            if in_text:
                in_text = escaped or byte != 0x22
                escaped = byte == 0x5C and not escaped
            elif byte == 0x22:
                in_text = True
            elif byte == 0x7B:
                depth += 1
            elif byte == 0x7D:
                depth -= 1
                if depth == 0:
                    return i + 1
        return None


def _object(piece: bytes) -> dict[str, Any]:
    value = json.loads(piece.decode("utf-8"))
    if not isinstance(value, dict):
        raise ValueError("no object")
    return value


class _Line:
    """The connection; everything here runs in the worker's thread but plain values."""

    def __init__(self, config: JakaConfig, clock: Clock) -> None:
        self._config = config
        self._clock = clock
        self._socket: socket.socket | None = None
        self._replies = JsonReplies()
        self._waiting: list[dict[str, Any]] = []
        self._place: tuple[float, ...] | None = None
        self.speed_mm_s = config.limits.speed_mm_s
        self.number = 0
        """Of the alarm whose lowering was sent last: it is never sent twice."""
        self.began = False
        """True from a lowering to the next stop."""
        self.refused = ""
        """Why the last lowering or stop was refused; empty where it was taken."""
        self.status = ArmStatus()

    def open(self) -> None:
        config = self._config
        self._socket = socket.create_connection((config.host, config.port), config.timeout_s)
        self._socket.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        self._replies, self._waiting, self._place = JsonReplies(), [], None

    def look(self) -> None:
        asked_s = self._clock.now_s()
        state = self._ask("get_robot_state")
        place = self._ask("get_tcp_pos").get("tcp_pos")
        if not (isinstance(place, list) and len(place) == 6 and all(map(_is_number, place))):
            raise ConnectionError("the arm's position is no list of six numbers")
        now = tuple(float(value) for value in place)
        before, self._place = self._place, now
        self.status = ArmStatus(
            ready=state.get("enable") == "robot_enabled" and state.get("power") == "powered_on",
            moving=before is not None and math.dist(before[:3], now[:3]) > _STILL_MM,
            height_mm=now[2],
            read_s=asked_s,
        )

    def do(self, command: Command) -> bool:
        if command.name == "lower":
            return self._lower(command.value, command.number)
        if command.stops or (command.name == "hold" and self.began):
            self.refused = self._try("stop_program")
            if self.refused:
                raise ConnectionError(self.refused)  # tried again until it is taken
            self.began = False
            return True
        return False

    def _lower(self, way_mm: float, number: int) -> bool:
        if number and number == self.number:
            return False
        if not self.status.ready:
            self.refused = "not enabled: it was not lowered"
            return False
        # Before it is sent: where the reply is lost, the arm may be on its way.
        self.began, self.number = True, number
        self.refused = self._try(
            "moveL",
            relFlag=1,
            cartPosition=[0, 0, -way_mm, 0, 0, 0],
            speed=self.speed_mm_s,
            accel=self._config.limits.accel_mm_s2,
        )
        return not self.refused

    def shut(self) -> None:
        line, self._socket = self._socket, None
        if line is not None:
            line.close()

    def _try(self, name: str, **arguments: Any) -> str:
        """Send a command; return why the controller refused it, empty where it took it."""
        reply = self._send(name, arguments)
        if str(reply.get("errorCode")) == "0":
            return ""
        words = " ".join(str(reply.get("errorMsg", "")).split())[:120]
        return f"the arm refuses {name}: error {str(reply.get('errorCode'))[:20]} {words}".strip()

    def _ask(self, name: str) -> dict[str, Any]:
        reply = self._send(name, {})
        if str(reply.get("errorCode")) != "0":
            words = " ".join(str(reply.get("errorMsg", "")).split())[:120]
            raise ConnectionError(f"the arm refuses {name}: {words}")
        return reply

    def _send(self, name: str, arguments: dict[str, Any]) -> dict[str, Any]:
        """Send a command; return the reply that names it."""
        line = self._socket
        if line is None:
            raise ConnectionError("not connected")
        silence = f"no reply to {name} within {self._config.timeout_s:g} s"
        until_s = self._clock.now_s() + self._config.timeout_s
        line.settimeout(self._config.timeout_s)
        line.sendall(json.dumps({"cmdName": name, **arguments}).encode())
        while True:
            while self._waiting:
                reply = self._waiting.pop(0)
                if reply.get("cmdName", name) == name:
                    return reply
            left_s = until_s - self._clock.now_s()
            if left_s <= 0:
                raise ConnectionError(silence)
            line.settimeout(left_s)
            try:
                data = line.recv(4096)
            except TimeoutError as error:
                raise ConnectionError(silence) from error
            if not data:
                raise ConnectionError("the arm closed the connection: another client may have come")
            self._waiting += self._replies.feed(data)


def _is_number(value: object) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and -1e6 < value < 1e6
