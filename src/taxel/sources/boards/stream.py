"""From a board's bytes to its scans: frames, hello, lost scans, reboots, fitted time.

A board is believed by its scans, not by what anybody says of it: another boot is taken in once its
hello is followed by scans that fit it and those of the boot before come no more. So a frame that
was sent before, or a hello of somebody else, costs itself alone. Takes what came and when; knows
nothing about ports, other boards or the present time.

Source: docs/decisions/0035.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from taxel.signals import Validity
from taxel.sources.boards.ledger import BoardLedger, ClockRate, Scans
from taxel.sources.boards.line import Line
from taxel.sources.boards.port import Chunk
from taxel.sources.fitted_time import FittedTime
from taxel.wire.counters import data_arrays, data_size
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

_SILENT_S = 0.02
_SILENT_PERIODS = 2.5
"""After so long without a scan of its boot, and so many periods, a board may be another boot,
seconds. Source: docs/decisions/0035; a row waits 30 ms."""
_AGREEING = 3
"""So many scans must fit a hello of another boot and each other. Source: as above."""
_YOUNG_US = 1_000_000
"""A boot has just begun so long, microseconds. Source: as above."""
_MOST_SUSPECTS = 4096
"""Scans kept while a board's hello is waited for; then the oldest go. Our choice."""
_MOST_PAST = 1024
"""Boots remembered, so that none is taken for a new one. Our choice."""
_KEPT_MESSAGES = 256
_HEARD = 200
"""Bytes kept of what came before a hello."""
IDENTIFY = frame_of(pack(Command(board=EVERY_BOARD, seq=0, t_us=0, order=Order.IDENTIFY)))
"""What asks a board for its hello."""


Came = tuple[bytes, float]
"""A data message's payload and when it came, host monotonic, seconds."""


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
        self._foreign = self._replayed = 0
        self._zero_is_end = zero_is_end
        self._settled = False
        self._boot = 0
        self._past: deque[int] = deque(maxlen=_MOST_PAST)
        self._data_begin = b""
        self._size = 0
        self._ordered_hz: int | None = None
        self._gap_is_away = self._returned = False
        self._claim: Hello | None = None
        self._suspects: deque[Came] = deque()
        self._misfits = 0

    @property
    def ready(self) -> bool:
        """True once a hello has come."""
        return self.hello is not None

    @property
    def confirmed(self) -> bool:
        """True once scans have come that fit the hello."""
        return self.hello is not None and self._line.begun

    def settle(self) -> None:
        """Take the board as it says it is for good: from now on another setting is refused."""
        self._settled = True

    def feed(self, chunks: Sequence[Chunk]) -> list[Scans]:
        """Take in what came, oldest first; return the scans that it completes."""
        done: list[Scans] = []
        run: list[Came] = []
        for chunk in chunks:
            if chunk.gone or chunk.opened:
                self._flush(run, done)
                self._port_changed(chunk)
                continue
            self.ledger.received_bytes += len(chunk.data)
            if self.hello is None and len(self.heard) < _HEARD:
                self.heard += chunk.data[:_HEARD]
            for payload in self._decoder.feed(chunk.data):
                if len(payload) == self._size and payload[:2] == self._data_begin:
                    run.append((payload, chunk.arrival_s))
                else:
                    self._flush(run, done)
                    self._hear(payload, chunk.arrival_s, done)
        self._flush(run, done)
        if chunks and self.hello is not None:
            self._decide(self.hello, chunks[-1].arrival_s, done)
        own = {"foreign": self._foreign, "replayed": self._replayed}
        self.ledger.bad = self._decoder.bad.by_reason() | own
        return done

    def change_rate(self, rate_hz: int) -> None:
        """Forget the hello, as the board was set to this rate; wait for one that does."""
        self._forget_claim()
        self.hello, self._size, self.wants_hello = None, 0, True
        self._ordered_hz = rate_hz

    def _flush(self, run: list[Came], done: list[Scans]) -> None:
        if run and self.hello is not None:
            self._scans(run, self.hello, done)
        run.clear()

    def _port_changed(self, chunk: Chunk) -> None:
        self._decoder.feed(b"\x00" * 2)  # what was half received is over
        if chunk.gone:
            self.ledger.state = "away"
            self._gap_is_away = True
            self._forget_claim()
        elif self.hello is not None:
            self.ledger.reconnects += 1
            self.wants_hello = self._returned = True

    def _hear(self, payload: bytes, arrival_s: float, done: list[Scans]) -> None:
        message = unpack(payload)
        if message is None:
            self._decoder.bad.message += 1
        elif isinstance(message, Hello):
            self._meet(message, arrival_s, done)
            self.messages.append(message)
        elif self.hello is not None and message.board != self.hello.board:
            self._foreign += 1
        elif isinstance(message, Data):
            self._decoder.bad.message += 1 if self._size else 0  # before a hello: of no known board
        else:
            if isinstance(message, Heartbeat):
                self.ledger.dropped = message.dropped
            self.messages.append(message)

    def _meet(self, hello: Hello, arrival_s: float, done: list[Scans]) -> None:
        """Take in a hello: the first, a word of the boot that is known, or a claim to be proved."""
        known, place = self.hello, (hello.seq, hello.t_us, arrival_s)
        if known is None or not (self._settled or self._line.begun):
            if self._usable(hello):
                self._begin(hello, arrival_s)
            elif known is None:
                self.refused = hello
        elif _setting(hello) != _setting(known):
            self._claim_anew(hello, arrival_s)
        elif hello.boot_id in self._past:
            self._foreign += 1
        elif hello.boot_id == known.boot_id and self._line.allows(*place):
            self._confirm(hello, known, arrival_s, done)
        elif self._suspects and self._other.allows(*place):
            self._claim, self.wants_hello = hello, False  # scans before it are this boot's too
        else:
            self._claim_anew(hello, arrival_s)

    def _usable(self, hello: Hello) -> bool:
        expected_hz = self._ordered_hz or hello.rate_hz
        return hello.protocol == PROTOCOL and hello.channels > 0 and hello.rate_hz == expected_hz

    def _begin(self, hello: Hello, arrival_s: float) -> None:
        """Begin with a hello; another may take its place until scans have shown that it holds."""
        ledger = self.ledger
        self._forget_claim()
        self.hello, self._size = hello, data_size(hello.channels)
        self._data_begin = bytes((Kind.DATA, hello.board))
        self._line = self._line_of(hello, arrival_s)
        self._fit, self._rate = FittedTime(), ClockRate()
        self._returned = False
        ledger.board, ledger.board_id, ledger.state = hello.board, hello.board_id, "silent"
        ledger.firmware = ".".join(str(part) for part in hello.firmware)

    @staticmethod
    def _line_of(hello: Hello, arrival_s: float) -> Line:
        return Line(hello.seq, hello.t_us, arrival_s, hello.rate_hz)

    def _confirm(self, hello: Hello, known: Hello, arrival_s: float, done: list[Scans]) -> None:
        """Go on with the boot that is known; scans that did not fit it are judged by its word."""
        self.wants_hello = self._returned = False
        if self.ledger.state in ("refused", "away"):
            self.ledger.state = "silent"
        if self._suspects and self._other.allows(hello.seq, hello.t_us, arrival_s):
            self._believe(hello, known, done)
        waiting, self._claim = list(self._suspects), None
        self._suspects.clear()
        if waiting:
            self._scans(waiting, known, done)
        self._forget_claim()

    def _claim_anew(self, hello: Hello, arrival_s: float) -> None:
        self._forget_claim()
        self._claim, self._other = hello, self._line_of(hello, arrival_s)
        self.wants_hello = False

    def _forget_claim(self) -> None:
        """Discard scans that fit no boot of the board, and the hello that claimed one."""
        self._foreign += self._claim is not None
        for suspect in self._suspects:
            self._throw(suspect)
        self._suspects.clear()
        self._claim, self._misfits = None, 0

    def _throw(self, suspect: Came) -> None:
        raw_seq, raw_us, _ = data_arrays([suspect[0]], self._channels)
        seq, t_us = self._line.placed(raw_seq, raw_us, suspect[1])
        if self._line.had(int(seq[0]), int(t_us[0])):
            self._replayed += 1
        else:
            self._decoder.bad.message += 1

    @property
    def _channels(self) -> int:
        return (self._size - data_size(0)) // 2

    def _scans(self, run: Sequence[Came], hello: Hello, done: list[Scans]) -> None:
        """Take in data frames in order; those that do not go on with the boot become suspects."""
        arrival_s = np.array([arrival_s for _, arrival_s in run])
        raw_seq, raw_us, counts = data_arrays([payload for payload, _ in run], hello.channels)
        line = self._line
        seq, t_us = line.placed(raw_seq, raw_us, float(arrival_s[0]))
        fits = line.goes_on(seq, t_us, arrival_s, returned=self._returned)
        if fits and self._is_of_a_young_claim(raw_seq, raw_us, arrival_s, hello):
            fits = False
        if fits:
            self._forget_claim()
            self._returned = False
            done.append(self._accept(seq, t_us, arrival_s, counts, hello))
        elif len(run) > 1:
            for single in run:
                self._scans([single], self.hello or hello, done)
        else:
            self._suspect(run[0], raw_seq, raw_us, hello)
            self._decide(hello, run[0][1], done)

    def _is_of_a_young_claim(
        self,
        raw_seq: NDArray[np.uint32],
        raw_us: NDArray[np.uint32],
        arrival_s: NDArray[np.float64],
        hello: Hello,
    ) -> bool:
        """Whether scans go on as well with a boot that says that it has just begun.

        So it is where a board is reset in its first moments: counts of both boots are the same.
        """
        claim = self._claim
        if claim is None or not self._suspects or claim.boot_id == hello.boot_id:
            return False
        if claim.t_us > _YOUNG_US or _setting(claim) != _setting(hello):
            return False
        seq, t_us = self._other.placed(raw_seq[:1], raw_us[:1], float(arrival_s[0]))
        return self._other.goes_on(seq, t_us, arrival_s[:1])

    def _suspect(
        self, came: Came, raw_seq: NDArray[np.uint32], raw_us: NDArray[np.uint32], hello: Hello
    ) -> None:
        """Keep a scan that may be another boot's, with others that it agrees with."""
        self._misfits += 1
        if self._suspects or self._claim is not None:
            seq, t_us = self._other.placed(raw_seq, raw_us, came[1])
            if self._other.goes_on(seq, t_us, np.array([came[1]])):
                if len(self._suspects) == _MOST_SUSPECTS:
                    self._throw(self._suspects.popleft())
                self._suspects.append(came)
                self._other.move(int(seq[0]), int(t_us[0]), came[1])
                return
            if self._claim is not None:
                self._throw(came)
                return
        while self._suspects:
            self._throw(self._suspects.popleft())
        self._suspects.append(came)
        self._other = Line(int(raw_seq[0]), int(raw_us[0]), came[1], hello.rate_hz, begun=True)

    def _decide(self, hello: Hello, now_s: float, done: list[Scans]) -> None:
        """Believe another boot, refuse another board, or ask, where the known boot is silent."""
        silent_s = max(_SILENT_S, _SILENT_PERIODS / hello.rate_hz)
        if not self._returned and now_s - self._line.arrival_s < silent_s:
            return
        claim = self._claim
        if claim is not None and _setting(claim) != _setting(hello):
            self.ledger.state, self.wants_hello = "refused", False
        elif claim is not None and len(self._suspects) >= _AGREEING:
            self._believe(claim, hello, done)
        elif self._misfits >= _AGREEING:
            self.wants_hello, self._misfits = True, 0

    def _believe(self, claim: Hello, hello: Hello, done: list[Scans]) -> None:
        """Go over to another boot; or, of the same one, to scans that lie ahead of the known."""
        waiting = list(self._suspects)
        arrival_s = np.array([arrival_s for _, arrival_s in waiting])
        raw_seq, raw_us, counts = data_arrays([payload for payload, _ in waiting], hello.channels)
        seq, t_us = self._line.placed(raw_seq, raw_us, float(arrival_s[0]))
        again = claim.boot_id == hello.boot_id
        if again and seq[0] <= self._line.seq:
            self._forget_claim()  # sent before: a boot does not count backwards
            return
        self._suspects.clear()
        self._claim, self._misfits = None, 0
        if again and not self._line.leaps(int(seq[0]), float(arrival_s[0])):
            done.append(self._accept(seq, t_us, arrival_s, counts, hello))
            return
        if not again:
            self._past.append(hello.boot_id)
            self.ledger.reboots += 1
        self._begin(claim, float(arrival_s[0]))
        self._line.move(int(raw_seq[0]), int(raw_us[0]), float(arrival_s[0]), begun=False)
        self._boot += 1
        self._gap_is_away = False
        self._scans(waiting, claim, done)

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
        if self._line.begun:
            before = int(seq[0]) - self._line.seq - 1
            ledger.lost_away += before if self._gap_is_away else 0
            holes += 0 if self._gap_is_away else before
        self._gap_is_away = False
        ledger.lost += holes
        ledger.scans += len(seq)
        ledger.state = "running"
        self.wants_hello = self.wants_hello and self._line.begun  # else the hello has held
        self._line.move(int(seq[-1]), int(t_us[-1]), float(arrival_s[-1]))
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
