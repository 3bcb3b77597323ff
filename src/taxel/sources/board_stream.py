"""From a board's bytes to its scans: frames, hello, lost scans, reboots, fitted time.

Told what came and when; knows nothing about ports, other boards or the present time.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from taxel.signals import Validity
from taxel.sources.board_ledger import BoardLedger, ClockRate, Scans
from taxel.sources.fitted_time import FittedTime
from taxel.sources.serial_port import Chunk
from taxel.wire.counters import data_arrays, data_size, unwrap
from taxel.wire.framing import FrameDecoder, frame_of
from taxel.wire.messages import (
    EVERY_BOARD,
    PROTOCOL,
    Command,
    Data,
    Heartbeat,
    Hello,
    Kind,
    Message,
    Order,
    pack,
    unpack,
)

_HELLO_S = 0.05
"""How long scans are held back after a port came back until a hello says which boot they are
of, seconds; then their own numbers must do. Source: docs/decisions/0014."""
_SLACK_US = 5000
_SLACK_SHARE = 0.1
"""seq and t_us must advance alike, within 5 ms and a tenth. Our choice: far above any
resonator's error (0.5 %), far below what damage makes of a number."""
_AGREEING = 3
"""So many scans that fit each other and not those before are a board that began anew."""
_KEPT_MESSAGES = 256
_HEARD = 200
"""Bytes kept of what came before a hello."""
IDENTIFY = frame_of(pack(Command(board=EVERY_BOARD, seq=0, t_us=0, order=Order.IDENTIFY)))
"""What asks a board for its hello."""


class BoardStream:
    """One board that speaks the wire format.

    Args:
        path: Its port, for the ledger.
        zero_is_end: Whether 0 counts is an end of the converter (SATURATED), or a good 0.
    """

    def __init__(self, path: str, *, zero_is_end: bool = True) -> None:
        self.ledger = BoardLedger(path=path)
        self.hello: Hello | None = None
        self.wants_hello = True
        """True while IDENTIFY should be sent."""
        self.heard = b""
        """The beginning of what came before any hello, for a message to a person."""
        self.refused: Hello | None = None
        """A first hello that cannot be used: another protocol, no channels, the wrong rate."""
        self.messages: deque[Message] = deque(maxlen=_KEPT_MESSAGES)
        """All that is no data, oldest first: for whoever sends commands."""
        self._decoder = FrameDecoder()
        self._zero_is_end = zero_is_end
        self._boot = 0
        self._size = 0
        self._told_hz: int | None = None
        self._held: list[tuple[bytes, float]] = []
        self._back_s: float | None = None
        self._gap_is_away = False
        self._suspects: list[tuple[bytes, float]] = []
        self._restart()

    @property
    def ready(self) -> bool:
        """True once a hello has come."""
        return self.hello is not None

    def feed(self, chunks: Sequence[Chunk]) -> list[Scans]:
        """Take in what came, oldest first; return the scans that it completes."""
        done: list[Scans] = []
        run: list[tuple[bytes, float]] = []
        for chunk in chunks:
            if chunk.gone or chunk.opened:
                self._flush(run, done)
                self._port_changed(chunk)
                continue
            self.ledger.received_bytes += len(chunk.data)
            if self.hello is None and len(self.heard) < _HEARD:
                self.heard += chunk.data[:_HEARD]
            for payload in self._decoder.feed(chunk.data):
                if payload[0] == Kind.DATA and len(payload) == self._size:
                    run.append((payload, chunk.arrival_s))
                else:
                    self._flush(run, done)
                    self._hear(payload)
            if self._back_s is not None and chunk.arrival_s - self._back_s > _HELLO_S:
                self._back_s = None  # no hello: the scans' own numbers must do
        self._flush(run, done)
        self.ledger.bad = self._decoder.bad.by_reason()
        return done

    def _flush(self, run: list[tuple[bytes, float]], done: list[Scans]) -> None:
        if self._back_s is not None:
            self._held += run
        else:
            waiting = self._held + run
            self._held = []
            if waiting and self.hello is not None and self.ledger.state != "refused":
                done += self._scans(waiting, self.hello)
        run.clear()

    def _port_changed(self, chunk: Chunk) -> None:
        ledger = self.ledger
        self._decoder.feed(b"\x00" * 2)  # what was half received is over
        if chunk.gone:
            ledger.state, self._held, self._back_s = "away", [], None
            self._gap_is_away = True
        elif self.hello is not None:
            ledger.reconnects += 1
            self.wants_hello, self._back_s = True, chunk.arrival_s

    def _hear(self, payload: bytes) -> None:
        message = unpack(payload)
        if message is None or (isinstance(message, Data) and self._size):
            self._decoder.bad.message += 1
            return
        if isinstance(message, Data):
            return  # before the hello: of no known board
        if isinstance(message, Hello):
            self._meet(message)
        elif isinstance(message, Heartbeat):
            self.ledger.dropped = message.dropped
        self.messages.append(message)

    def _meet(self, hello: Hello) -> None:
        ledger, before = self.ledger, self.hello
        if before is None and self._usable(hello):
            self.hello, self._size = hello, data_size(hello.channels)
            ledger.board, ledger.board_id = hello.board, hello.board_id
        elif before is None or _setting(hello) != _setting(before):
            if before is None:
                self.refused = hello
            else:
                ledger.state, self.wants_hello, self._back_s = "refused", False, None
            return
        elif hello.boot_id != before.boot_id:
            self._held = []  # cannot be told apart from the boot before: the hello comes first
            self.hello = hello
            self._begin_anew()
        self.wants_hello, self._back_s = False, None
        ledger.firmware = ".".join(str(part) for part in hello.firmware)
        if ledger.state in ("refused", "connecting"):
            ledger.state = "silent"

    def _usable(self, hello: Hello) -> bool:
        told_hz = self._told_hz or hello.rate_hz
        return hello.protocol == PROTOCOL and hello.channels > 0 and hello.rate_hz == told_hz

    def change_rate(self, rate_hz: int) -> None:
        """Forget the hello, as the board was told to scan at this rate; wait for one that does."""
        self.hello, self._size, self.wants_hello = None, 0, True
        self._told_hz = rate_hz

    def _begin_anew(self) -> None:
        self.ledger.reboots += 1
        self._boot += 1
        self._gap_is_away = False
        self._restart()

    def _restart(self) -> None:
        self._fit, self._rate = FittedTime(), ClockRate()
        self._last: tuple[int, int, float] | None = None
        self._suspects = []

    def _scans(self, run: list[tuple[bytes, float]], hello: Hello) -> list[Scans]:
        """Return the scans of data frames in order; what does not fit in is thrown away."""
        arrival_s = np.array([arrival_s for _, arrival_s in run])
        raw_seq, raw_us, counts = data_arrays([payload for payload, _ in run], hello.channels)
        seq, t_us = self._unwrapped(raw_seq, raw_us, arrival_s, hello)
        if not self._fits(seq, t_us, hello):
            return self._sorted_out(run, hello)
        self._suspects = []
        return [self._accept(seq, t_us, arrival_s, counts, hello)]

    def _unwrapped(
        self,
        raw_seq: NDArray[np.uint32],
        raw_us: NDArray[np.uint32],
        arrival_s: NDArray[np.float64],
        hello: Hello,
    ) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        if self._last is None:
            return unwrap(raw_seq, int(raw_seq[0])), unwrap(raw_us, int(raw_us[0]))
        seq, t_us, at_s = self._last
        passed_s = float(arrival_s[0]) - at_s
        return (
            unwrap(raw_seq, seq + round(passed_s * hello.rate_hz)),
            unwrap(raw_us, t_us + round(passed_s * 1e6)),
        )

    def _fits(self, seq: NDArray[np.int64], t_us: NDArray[np.int64], hello: Hello) -> bool:
        """Whether counts and times rise, and rise alike."""
        if self._last is not None:
            seq = np.concatenate(([self._last[0]], seq))
            t_us = np.concatenate(([self._last[1]], t_us))
        steps, passed_us = np.diff(seq), np.diff(t_us)
        due_us = steps * (1e6 / hello.rate_hz)
        slack_us = _SLACK_US + _SLACK_SHARE * due_us
        return bool(((steps >= 1) & (np.abs(passed_us - due_us) <= slack_us)).all())

    def _sorted_out(self, run: list[tuple[bytes, float]], hello: Hello) -> list[Scans]:
        """Take scans one by one: those that do not fit are damage, or a board begun anew."""
        done: list[Scans] = []
        for one in run:
            arrival_s = np.array([one[1]])
            raw_seq, raw_us, counts = data_arrays([one[0]], hello.channels)
            seq, t_us = self._unwrapped(raw_seq, raw_us, arrival_s, hello)
            if self._fits(seq, t_us, hello):
                self._decoder.bad.message += len(self._suspects)
                self._suspects = []
                done.append(self._accept(seq, t_us, arrival_s, counts, hello))
                continue
            self._suspects.append(one)
            if not self._suspects_agree(hello):
                self._decoder.bad.message += len(self._suspects) - 1
                self._suspects = [one]
            elif len(self._suspects) >= _AGREEING:
                began = self._suspects
                self._begin_anew()
                self.wants_hello = True
                done += self._scans(began, hello)
        return done

    def _suspects_agree(self, hello: Hello) -> bool:
        raw_seq, raw_us, _ = data_arrays([payload for payload, _ in self._suspects], hello.channels)
        last, self._last = self._last, None
        agree = self._fits(unwrap(raw_seq, int(raw_seq[0])), unwrap(raw_us, int(raw_us[0])), hello)
        self._last = last
        return agree

    def _accept(
        self,
        seq: NDArray[np.int64],
        t_us: NDArray[np.int64],
        arrival_s: NDArray[np.float64],
        counts: NDArray[np.uint16],
        hello: Hello,
    ) -> Scans:
        ledger = self.ledger
        holes = int(seq[-1] - seq[0]) + 1 - len(seq)
        if self._last is not None:
            before = int(seq[0]) - self._last[0] - 1
            ledger.lost_away += before if self._gap_is_away else 0
            holes += 0 if self._gap_is_away else before
        self._gap_is_away = False
        ledger.lost += holes
        ledger.scans += len(seq)
        ledger.state = "running"
        self._last = (int(seq[-1]), int(t_us[-1]), float(arrival_s[-1]))
        device_s = t_us.astype(np.float64) * 1e-6
        # No scan was taken after it came, whatever a fit that still learns may say.
        fitted_s = np.minimum(self._fit.of(device_s, arrival_s), arrival_s)
        ledger.clock_ppm = self._rate.add(float(device_s[-1]), float(fitted_s[-1]))
        top = (1 << hello.adc_bits) - 1
        ends = counts >= top
        if self._zero_is_end:
            ends |= counts == 0
        return Scans(
            seq=seq,
            device_s=device_s,
            arrival_s=arrival_s,
            fitted_s=fitted_s,
            values=counts * np.float32(volts_a_count(hello)),
            flags=ends * np.uint8(Validity.SATURATED),
            boot=self._boot,
        )


def volts_a_count(hello: Hello) -> float:
    """Return the volts of one count: the reference stands for 2^bits of them."""
    return hello.reference_mv / 1000.0 / (1 << hello.adc_bits)


def _setting(hello: Hello) -> tuple[object, ...]:
    """Return what must stay the same while a source is open."""
    return (
        hello.protocol,
        hello.board,
        hello.board_id,
        hello.rate_hz,
        hello.channels,
        hello.adc_bits,
        hello.reference_mv,
    )
