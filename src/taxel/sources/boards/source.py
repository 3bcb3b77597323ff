"""`serial://PATH,PATH,…`: sensor boards on serial ports, as one array.

Each board's clock is fitted, their scans are merged on one grid, and each
board has a ledger. Knows nothing about files, models or what commands mean.

Background of our choices: docs/decisions/0014.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Any, Self

from taxel.clock import Clock
from taxel.errors import BadSource
from taxel.plain_text import number_of
from taxel.signals import CameraInfo, Frame, Mark, Samples, SensorInfo
from taxel.sources.boards.csv_lines import CsvStream, numbers_of
from taxel.sources.boards.merge import WAIT_S, BoardMerge
from taxel.sources.boards.options import read_options
from taxel.sources.boards.port import Chunk, SerialPort
from taxel.sources.boards.stream import IDENTIFY, BoardStream, volts_a_count
from taxel.wire.framing import frame_of
from taxel.wire.messages import EVERY_BOARD, PROTOCOL, Command, Hello, Message, Order, pack

_POLL_S = 0.001
"""How often `read` looks for news while it waits, seconds. Source: docs/decisions/0014."""
_SLICE_S = 0.02
"""What came is merged in slices of this length, oldest first, so that the boards stay
in step when nobody read for a while, seconds. Our choice."""
_ASK_S = 0.2
"""How often a board without a hello is asked for one, seconds. Source: protocol/SPEC.md."""
_SAME_RATE = 0.02
"""Boards that print may differ by this in their measured rates, as a fraction. Our choice."""


class SerialBoards:
    """One or more boards as one array: a row is one scan of all their channels.

    Columns stand in the order of the paths. Missing values are flagged MISSING, and
    RECONNECTING from when a port vanishes until its board's scans are back; values at
    an end of the converter SATURATED. Rows go on while boards are away. With one board
    `Samples.counter` starts as that board's own count; it rises by one a row
    throughout. `Samples.device_s` is the first board's clock, NaN while it is missing.

    Args:
        name: Paths joined by commas.
        options: See docs/how-to/serial-boards.md.
        clock: The host's clock: stamps arrivals, and is slept on.

    Raises:
        BadSource: The address is wrong; or a port is missing, held or silent, or what comes is
            not what the format says: the message names the port and what to look at.
    """

    def __init__(self, name: str, options: dict[str, str], clock: Clock) -> None:
        self._options = read_options(name, options)
        self._clock = clock
        self._closed = False
        self._asked_s = self._next_s = -math.inf
        self._ports = [SerialPort(path, self._options.baud, clock) for path in self._options.paths]
        try:
            self._streams = [self._stream(path) for path in self._options.paths]
            self._wire = [stream for stream in self._streams if isinstance(stream, BoardStream)]
            self._wait_for_all()
            if self._options.format == "wire" and self._options.rate_hz is not None:
                self._set_rate(round(self._options.rate_hz))
            self._info = self._describe()
            for stream in self._wire:
                stream.settle()
        except BaseException:
            self._close()
            raise
        self._merge = BoardMerge(
            [len(_board_of(stream).channels) for stream in self._streams],
            [stream.ledger for stream in self._streams],
            self._info.rate_hz,
            self._options.late_s,
        )
        self._none = Samples.empty(len(self._info.channels))

    @property
    def info(self) -> SensorInfo:
        return self._info

    @property
    def cameras(self) -> tuple[CameraInfo, ...]:
        return ()

    @property
    def ended(self) -> bool:
        """True once the block was left: boards that are away may always come back."""
        return self._closed

    def read(self, timeout_s: float = 0.1) -> Samples:
        """Return the rows since the last call; none after `timeout_s` seconds without any.

        A row comes as soon as all boards' scans of its moment are there, and at the
        latest 30 ms after it (100 ms with a single board; late_ms= says otherwise), with what
        is missing flagged.
        """
        now_s = self._clock.now_s()
        until_s = now_s + timeout_s
        while not self._closed:
            if now_s < self._next_s <= until_s:
                self._clock.sleep(self._next_s - now_s)
            rows = self._collect()
            now_s = self._clock.now_s()
            if len(rows):
                self._next_s = now_s + self._options.bundle_s
            if len(rows) or now_s >= until_s:
                return rows
            self._clock.sleep(min(_POLL_S, until_s - now_s))
            now_s = self._clock.now_s()
        return self._none

    def frames(self) -> list[Frame]:
        return []

    def marks(self) -> list[Mark]:
        return []

    def boards(self) -> list[dict[str, Any]]:
        """Return one ledger a board, as `BoardLedger` says, in the order of the paths."""
        now_s = self._clock.now_s()
        ledgers: list[dict[str, Any]] = []
        for port, stream in zip(self._ports, self._streams, strict=True):
            ledger = replace(stream.ledger, overrun=port.overrun)
            silent_s = now_s - self._merge.last_arrival_s(len(ledgers))
            if ledger.state == "running" and silent_s > WAIT_S:
                ledger.state = "silent"
            ledgers.append(ledger.as_dict())
        return ledgers

    def send(self, board: int, message: Message) -> bool:
        """Send a message to the board on the path of this number; False where it is away."""
        return self._ports[board].write(frame_of(pack(message)))

    def messages(self, board: int) -> list[Message]:
        """Return what that board said since the last call that is no data, oldest first.

        `read` takes it in; at most 256 are kept.
        """
        if not self._wire:
            return []
        messages = self._wire[board].messages
        heard = list(messages)
        messages.clear()
        return heard

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self._close()

    def _close(self) -> None:
        self._closed = True
        for port in self._ports:
            port.close()

    def _stream(self, path: str) -> BoardStream | CsvStream:
        options = self._options
        if options.format == "wire":
            return BoardStream(path, zero_is_end=options.zero_is_end)
        return CsvStream(
            path, time=options.time, rate_hz=options.rate_hz, full_scale=options.full_scale
        )

    def _collect(self) -> Samples:
        """Take in what came, oldest first, and return the rows that it completes."""
        looked_s = min(port.looked_s for port in self._ports)  # before taking
        arrived: list[tuple[float, int, Chunk]] = []
        for index, port in enumerate(self._ports):
            arrived += [(chunk.arrival_s, index, chunk) for chunk in port.take()]
        if len(self._ports) > 1:
            arrived.sort(key=lambda scan: scan[:2])
        while arrived:
            end_s = arrived[0][0] + _SLICE_S
            count = sum(1 for scan in arrived if scan[0] <= end_s)
            self._take_in(arrived[:count])
            arrived = arrived[count:]
        self._ask()
        return self._merge.release(self._clock.now_s(), looked_s)

    def _take_in(self, arrived: list[tuple[float, int, Chunk]]) -> None:
        for index, stream in enumerate(self._streams):
            chunks = [chunk for _, whose, chunk in arrived if whose == index]
            if not chunks:
                continue
            for scans in stream.feed(chunks):
                self._merge.put(index, scans)
            if any(chunk.gone for chunk in chunks):
                self._merge.gone(index)
            if any(chunk.opened for chunk in chunks):
                self._asked_s = -math.inf  # ask for the hello at once

    def _ask(self, every_s: float = _ASK_S) -> None:
        """Ask boards whose hello is wanted for it."""
        wanting = [
            port
            for port, stream in zip(self._ports, self._wire, strict=False)  # none where they print
            if stream.wants_hello and port.is_open
        ]
        now_s = self._clock.now_s()
        if wanting and now_s - self._asked_s >= every_s:
            self._asked_s = now_s
            for port in wanting:
                port.write(IDENTIFY)

    def _wait_for_all(self) -> None:
        until_s = self._clock.now_s() + self._options.wait_s
        while True:
            for port, stream in zip(self._ports, self._streams, strict=True):
                for scans in stream.feed(port.take()):
                    stream.ledger.early += len(scans.seq)
            if all(stream.confirmed for stream in self._streams):
                return
            if self._clock.now_s() >= until_s:
                break
            self._ask()
            self._clock.sleep(5 * _POLL_S)
        for port, stream in zip(self._ports, self._streams, strict=True):
            if not stream.ready:
                raise self._why_not(port, stream)

    def _why_not(self, port: SerialPort, stream: BoardStream | CsvStream) -> BadSource:
        options = self._options
        heard = stream.heard
        if not port.is_open:
            needed, got, mend = "a port", port.trouble, "look at the cable; taxel find lists ports"
            if "permission" in got or "holds" in got:
                mend = "then try again"
            return BadSource(f"{needed} at {port.path}", got, mend)
        if isinstance(stream, CsvStream):
            needed = f"lines of numbers from {port.path} within {options.wait_s:g} s"
            mend = f"look at its sketch, and whether it prints at {options.baud} baud"
        else:
            needed = f"a hello from the board at {port.path} within {options.wait_s:g} s"
            mend = f"look whether it runs taxel's firmware, at {options.baud} baud"
            hello = stream.refused
            if hello is not None and hello.protocol == PROTOCOL and hello.channels:
                return BadSource(
                    f"{options.rate_hz:g} Hz from the board at {port.path}",
                    f"{hello.rate_hz} Hz after it was asked to change",
                    "leave rate_hz out, or choose a rate that its firmware can do",
                )
            if hello is not None and hello.protocol == PROTOCOL:
                return BadSource(
                    f"a sensor board at {port.path}",
                    f"the board {hello.board_id or hello.board} without channels, as of a hand",
                    "give the port of a sensor board; a hand's address begins with hand://",
                )
            if hello is not None:
                got = (
                    f"one of protocol {hello.protocol} with {number_of(hello.channels, 'channel')}"
                )
                return BadSource(
                    f"a hello of protocol {PROTOCOL} with channels from {port.path}",
                    got,
                    "bring its firmware up to date",
                )
            if any(numbers_of(line.strip()) for line in heard.split(b"\n")[1:-1]):
                mend = "it prints numbers: add format=csv to the address"
        got = (
            "nothing"
            if not heard
            else f"{number_of(len(heard), 'byte')} without one, {heard[:24]!r} …"
        )
        return BadSource(needed, got, mend)

    def _set_rate(self, rate_hz: int) -> None:
        """Order the boards that scan at another rate to change it, and wait for their hello."""
        for index, stream in enumerate(self._wire):
            if _hello(stream).rate_hz != rate_hz:
                now_us = int(self._clock.now_s() * 1e6) & 0xFFFFFFFF
                order = Command(
                    board=EVERY_BOARD, seq=1, t_us=now_us, order=Order.SET_RATE, a=rate_hz
                )
                stream.change_rate(rate_hz)
                self.send(index, order)
        self._wait_for_all()

    def _describe(self) -> SensorInfo:
        boards = [_board_of(stream) for stream in self._streams]
        rates = [board.rate_hz for board in boards]
        csv = self._options.format == "csv"
        if max(rates) / min(rates) - 1.0 > (_SAME_RATE if csv else 0.0):
            raise BadSource(
                "boards that scan at one rate",
                ", ".join(f"{rate:g} Hz" for rate in rates),
                "set it for all of them: rate_hz=…",
            )
        channels = self._options.channels or self._own_names(boards)
        width = sum(len(board.channels) for board in boards)
        if len(channels) != width:
            raise BadSource(
                f"a name for each of {number_of(width, 'channel')}",
                number_of(len(channels), "name"),
                "mend channels=",
            )
        tops = [board.top_v for board in boards if board.top_v is not None]
        return SensorInfo(
            name=self._options.name,
            channels=channels,
            units=(self._options.unit if csv else "V",) * width,
            rate_hz=rates[0],
            full_scale=min(tops, default=self._options.full_scale),
            serial=",".join(stream.ledger.board_id for stream in self._streams).strip(","),
            details=self._details(boards),
        )

    def _own_names(self, boards: list[_Board]) -> tuple[str, ...]:
        """Return the boards' own names: of a single print's header, else by board and channel."""
        alone = self._options.format == "csv" and len(boards) == 1
        return tuple(
            name if alone else f"b{number}-{name}"
            for number, board in enumerate(boards)
            for name in board.channels
        )

    def _details(self, boards: list[_Board]) -> dict[str, str]:
        details = {"format": self._options.format, "baud": str(self._options.baud)}
        for number, (board, path) in enumerate(zip(boards, self._options.paths, strict=True)):
            details[f"board {number}"] = path
            if board.says:
                details[f"board {number} says"] = board.says
        return details


@dataclass(frozen=True, slots=True, kw_only=True)
class _Board:
    """What a board is: by its hello, or by the lines that it prints."""

    channels: tuple[str, ...]
    """By its own names, those of a print's header, else c0, c1, …"""
    rate_hz: float
    top_v: float | None = None
    """Of the converter's largest count; None where numbers are printed."""
    says: str = ""
    """The rest of its hello, in words."""


def _board_of(stream: BoardStream | CsvStream) -> _Board:
    """Return what a board is, once it is ready."""
    if isinstance(stream, CsvStream):
        return _Board(channels=stream.channels, rate_hz=stream.rate_hz)
    hello = _hello(stream)
    return _Board(
        channels=tuple(f"c{channel}" for channel in range(hello.channels)),
        rate_hz=float(hello.rate_hz),
        top_v=volts_a_count(hello) * ((1 << hello.adc_bits) - 1),
        says=f"number {hello.board}, id {hello.board_id or 'none'}, "
        f"firmware {stream.ledger.firmware}, {hello.adc_bits} bits, "
        f"reference {hello.reference_mv} mV",
    )


def _hello(stream: BoardStream) -> Hello:
    assert stream.hello is not None, "asked before the board was ready"
    return stream.hello
