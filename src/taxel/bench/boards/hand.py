"""The hand's firmware, measured on an emulated board: how soon its motors are off.

Each drill arms the hand, closes its fingers, brings something about at a moment that has
no relation to the firmware's tick, and reads off the motors' pins when they went off. Virtual time.
Knows nothing about sensors of touch.

Background of our choices: docs/decisions/0020.
"""

from __future__ import annotations

import os
import tty
from dataclasses import dataclass
from typing import Self

import numpy as np

from taxel.bench.boards.emulator import BoardSetup, EmulatedBoards, Event, Firmware
from taxel.wire.framing import FrameDecoder, frame_of
from taxel.wire.messages import (
    EVERY_BOARD,
    Acknowledge,
    Command,
    Heartbeat,
    Message,
    Order,
    Result,
    State,
    pack,
    unpack,
)

MOTORS = 4
CONTACT_MA = 700
"""At which a grip stops a motor; emulated ones run at 300 mA and stall at 1500. Our choice."""
_STEP_S = 0.005
_TINY_S = 1e-6
"""The emulator counts whole microseconds."""
_BEAT_S = 0.04
_REFRESH_S = 0.1
_CLOSING_S = 0.2
"""How long fingers close before something happens: longer than the start-up peak. Our choice."""


class VirtualHost:
    """A host in virtual time at the port of an emulated hand; use it in a `with` block."""

    def __init__(self, boards: EmulatedBoards, board: int = 0) -> None:
        self.boards = boards
        self.heard: list[Message] = []
        self.beat_sent_s = -1.0
        """When the last heartbeat was sent, virtual seconds."""
        self._fd = os.open(boards.port(board), os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK)
        tty.setraw(self._fd)
        self._decoder = FrameDecoder()
        self._count = 0

    def send(self, message: Message) -> None:
        """Send a message."""
        os.write(self._fd, frame_of(pack(message)))

    def send_bytes(self, data: bytes) -> None:
        """Send bytes as they are."""
        os.write(self._fd, data)

    def order(self, order: int, expires_ms: int = 0, a: int = 0, b: int = 0, c: int = 0) -> int:
        """Send a command; return its number."""
        self._count += 1
        self.send(
            Command(
                board=EVERY_BOARD,
                seq=self._count,
                t_us=self._now_us(),
                order=order,
                expires_ms=expires_ms,
                a=a,
                b=b,
                c=c,
            )
        )
        return self._count

    def grip(self, fingers: int = 0b1111, closed: int = 1000, lasts_ms: int = 500) -> int:
        """Ask to close fingers until contact."""
        return self.order(Order.GRIP, lasts_ms, fingers, closed, CONTACT_MA)

    def beat(self) -> None:
        """Send a heartbeat."""
        self.beat_sent_s = self.boards.now_s
        self.send(Heartbeat(board=EVERY_BOARD, seq=0, t_us=self._now_us(), state=State.ARMED))

    def run(self, seconds: float, *, beats: bool = True) -> None:
        """Let time pass with heartbeats, or without."""
        until_s = self.boards.now_s + seconds
        while (left_s := until_s - self.boards.now_s) > _TINY_S:
            if beats and self.boards.now_s - self.beat_sent_s >= _BEAT_S:
                self.beat()
            self.boards.run(min(_STEP_S, left_s))
            self.hear()

    def hear(self) -> None:
        """Take in what the board said."""
        try:
            data = os.read(self._fd, 65536)
        except BlockingIOError:
            return
        found = [unpack(payload) for payload in self._decoder.feed(data)]
        self.heard += [message for message in found if message is not None]

    def result(self, number: int) -> Result | None:
        """Return the result of a command; None where it was not acknowledged."""
        answers = [m for m in self.heard if isinstance(m, Acknowledge) and m.command_seq == number]
        return Result(answers[0].result) if answers else None

    @property
    def state(self) -> State:
        """What the board said last."""
        return State(next(m.state for m in reversed(self.heard) if isinstance(m, Heartbeat)))

    def ready(self) -> None:
        """Arm the hand; raises AssertionError where it refuses."""
        self.run(0.1)
        number = self.order(Order.ARM)
        self.run(0.02)
        assert self.result(number) == Result.DONE, self.result(number)

    def close_fingers(self, seconds: float = _CLOSING_S) -> None:
        """Close the fingers for some time, refreshing the grip."""
        self.grip()
        refresh_s = self.boards.now_s
        until_s = self.boards.now_s + seconds
        while (left_s := until_s - self.boards.now_s) > _TINY_S:
            self.run(min(_STEP_S, left_s))
            if self.boards.now_s - refresh_s > _REFRESH_S:
                self.grip()
                refresh_s = self.boards.now_s

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        os.close(self._fd)

    def _now_us(self) -> int:
        return round(self.boards.now_s * 1e6) & 0xFFFFFFFF


@dataclass(frozen=True, slots=True, kw_only=True)
class Drill:
    """One kind of trouble, brought about several times."""

    name: str
    off_ms: list[float]
    """From the trouble to the last of the motors concerned being off, each time, milliseconds."""
    state: State
    """What the hand said afterwards."""

    @property
    def worst_ms(self) -> float:
        """The longest."""
        return max(self.off_ms)


def hand_setup(firmware: Firmware) -> BoardSetup:
    """Return a hand with four fingers and a current sensor each."""
    return BoardSetup(elf=firmware.elf("hand_control"), sensors=MOTORS)


def drill(firmware: Firmware, name: str, times: int, seed: int = 0) -> Drill:
    """Bring one kind of trouble about some times, each on a fresh board.

    Args:
        firmware: As built.
        name: contact, silence, silent, hangs, low, power, over-current, stop, or hang 0 or 1.
        times: How often; each at another moment of the firmware's tick.
        seed: Chooses the moments.
    """
    random = np.random.default_rng(seed)
    off_ms, state = [], State.IDLE
    for number in range(times):
        with (
            EmulatedBoards(firmware, [hand_setup(firmware)]) as boards,
            VirtualHost(boards) as host,
        ):
            host.ready()
            host.close_fingers(_CLOSING_S + float(random.uniform(0.0, 0.004)))
            assert running(boards) == set(range(MOTORS)), "the fingers do not close"
            since_s, concerned = _bring_about(host, name, number % MOTORS)
            off_ms.append(1000.0 * (_all_off_s(host, concerned) - since_s))
            if name == "contact":
                assert running(boards) == set(range(MOTORS)) - concerned, "others stopped too"
            host.run(0.06, beats=name != "silence")
            state = host.state
    return Drill(name=name, off_ms=off_ms, state=state)


def _bring_about(host: VirtualHost, name: str, motor: int) -> tuple[float, set[int]]:
    """Bring it about; return when it began, virtual seconds, and which motors must stop."""
    boards, every = host.boards, set(range(MOTORS))
    now_s = boards.now_s
    if name == "contact":
        boards.command(f"contact 0 {motor} 1")
        host.run(0.02)
        return now_s, {motor}
    if name == "silence":
        host.grip(lasts_ms=5000)
        host.beat()
        host.run(0.3, beats=False)
        return host.beat_sent_s, every
    if name == "over-current":
        boards.command(f"load 0 {motor} 3000 3000")
    elif name == "stop":
        host.order(Order.STOP)
    elif name.startswith("hang "):
        boards.command(f"hang 0 {name[-1]}")
    elif name == "power":
        boards.command("power 0")
    else:
        boards.command(f"i2c 0 {name}")
    host.run(0.2)
    return now_s, every


def _all_off_s(host: VirtualHost, concerned: set[int]) -> float:
    """Return when the last of these motors went off, virtual seconds."""
    assert not running(host.boards) & concerned, "still running"
    offs = {motor: event.at_s for motor, event in _last_changes(host.boards).items()}
    return max(offs[motor] for motor in concerned)


def _last_changes(boards: EmulatedBoards) -> dict[int, Event]:
    return {int(e.values[0]): e for e in boards.events if e.what == "motor"}


def running(boards: EmulatedBoards) -> set[int]:
    """Return the motors that are on."""
    return {motor for motor, e in _last_changes(boards).items() if e.values[1] != "0"}
