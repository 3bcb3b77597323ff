"""Boards fed by hand, on simulated time: lost scans, reboots, wraps, drift, rows that line up."""

from dataclasses import dataclass, field

import numpy as np
import pytest

from taxel.signals import Samples, Validity
from taxel.sources.boards.emulation import EmulatedBoard, value_at
from taxel.sources.boards.ledger import Scans
from taxel.sources.boards.merge import WAIT_ALONE_S, WAIT_S, BoardMerge
from taxel.sources.boards.port import Chunk
from taxel.sources.boards.stream import BoardStream
from taxel.wire.counters import unwrap
from taxel.wire.framing import frame_of
from taxel.wire.messages import Data, Hello, pack

GOOD, MISSING = int(Validity.GOOD), int(Validity.MISSING)
AWAY = int(Validity.MISSING | Validity.RECONNECTING)
VOLT = 5.0 / 1024


def greeted(board: EmulatedBoard) -> BoardStream:
    stream = BoardStream("here")
    stream.feed([Chunk(0.0, b"", opened=True), Chunk(0.0, board.hello())])
    stream.settle()
    return stream


def come(stream: BoardStream, data: bytes, arrival_s: float) -> list[Scans]:
    return stream.feed([Chunk(arrival_s, data)])


@dataclass
class Rig:
    """Boards, each with a clock of its own, read every 5 ms; scans come 1 to 2 ms late."""

    ppm: tuple[float, ...]
    late_s: float = 0.001
    now_s: float = 0.0
    boards: list[EmulatedBoard] = field(default_factory=list)
    silent: set[int] = field(default_factory=set)

    def __post_init__(self) -> None:
        self.boards = [EmulatedBoard(board=i) for i in range(len(self.ppm))]
        self.streams = [greeted(board) for board in self.boards]
        ledgers = [stream.ledger for stream in self.streams]
        self.merge = BoardMerge([4] * len(self.ppm), ledgers, 1000.0)
        self.random = np.random.default_rng(0)

    def run(self, seconds: float) -> Samples:
        """Let time pass; return the rows of it."""
        given = []
        for _ in range(round(seconds / 0.005)):
            self.now_s += 0.005
            for index, board in enumerate(self.boards):
                chunks = []
                rate_hz = 1000.0 * (1 + self.ppm[index] * 1e-6)
                while (taken_s := board.tick / rate_hz) < self.now_s - 2 * self.late_s:
                    late_s = self.late_s * (1 + self.random.random())
                    chunks.append(Chunk(taken_s + late_s, board.scan()))
                if index not in self.silent and chunks:
                    for scans in self.streams[index].feed(chunks):
                        self.merge.put(index, scans)
            given.append(self.merge.release(self.now_s, self.now_s))
        return Samples.join(given)


def test_volts_are_counts_of_the_boards_own_reference_and_both_ends_are_saturated():
    board = EmulatedBoard()
    stream = greeted(board)
    frame = frame_of(pack(Data(0, 0, 0, (0, 1, 512, 1023))))
    (scans,) = come(stream, frame, 1.0)
    np.testing.assert_allclose(scans.values, [[0.0, VOLT, 2.5, 1023 * VOLT]], rtol=1e-6)
    assert scans.flags.tolist() == [[4, 0, 0, 4]]


def test_where_zero_is_a_good_reading_only_the_top_is_saturated():
    stream = BoardStream("here", zero_is_end=False)
    come(stream, EmulatedBoard().hello(), 0.0)
    (scans,) = come(stream, frame_of(pack(Data(0, 0, 0, (0, 1, 512, 1023)))), 1.0)
    assert scans.flags.tolist() == [[0, 0, 0, 4]]


def test_lost_scans_are_seen_by_their_count():
    board = EmulatedBoard()
    stream = greeted(board)
    come(stream, board.scan() + board.scan(), 0.002)
    board.skip(3)
    (scans,) = come(stream, board.scan(), 0.006)
    assert scans.seq.tolist() == [5]
    assert (stream.ledger.scans, stream.ledger.lost) == (3, 3)


def test_counters_wrap_without_a_seam():
    """The tick wraps after 49 days and the clock after 71 minutes; here both within 20 scans."""
    board = EmulatedBoard(first_tick=2**32 - 10, first_us=2**32 - 5000)
    stream = greeted(board)
    first = come(stream, b"".join(board.scan() for _ in range(12)), 0.012)[0]
    (second,) = come(stream, b"".join(board.scan() for _ in range(12)), 0.024)
    seq = np.concatenate([first.seq, second.seq])
    assert seq.tolist() == list(range(2**32 - 10, 2**32 + 14))
    assert np.diff(np.concatenate([first.device_s, second.device_s])) == pytest.approx(1e-3)
    assert (stream.ledger.lost, stream.ledger.reboots, stream.ledger.bad["message"]) == (0, 0, 0)


def test_a_clock_that_wrapped_while_nobody_listened_is_placed_by_the_hosts_clock():
    near = 3 * 2**32 + 17
    raw = np.array([(near + 500) % 2**32, (near + 700) % 2**32], np.uint32)
    assert unwrap(raw, near).tolist() == [near + 500, near + 700]


def test_another_boot_id_is_a_reboot_and_the_same_one_a_reconnect():
    board = EmulatedBoard()
    stream = greeted(board)
    come(stream, b"".join(board.scan() for _ in range(50)), 0.05)
    stream.feed([Chunk(0.06, b"", gone=True), Chunk(0.1, b"", opened=True)])
    board.skip(50)
    (scans,) = come(stream, board.hello() + board.scan(), 0.101)
    assert (stream.ledger.reconnects, stream.ledger.reboots, scans.boot) == (1, 0, 0)
    assert (stream.ledger.lost, stream.ledger.lost_away) == (0, 50)
    assert come(stream, board.reboot() + board.scan() + board.scan(), 0.11) == []
    (scans,) = come(stream, board.scan(), 0.122)
    assert (stream.ledger.reconnects, stream.ledger.reboots, scans.boot) == (1, 1, 1)
    assert scans.seq.tolist() == [0, 1, 2]
    assert stream.ledger.lost == 0


def test_after_a_reconnect_a_clock_that_ran_on_like_the_hosts_needs_no_hello():
    board = EmulatedBoard()
    stream = greeted(board)
    come(stream, board.scan(), 0.001)
    stream.feed([Chunk(0.002, b"", gone=True), Chunk(0.5, b"", opened=True)])
    assert stream.wants_hello
    board.skip(499)
    (scans,) = come(stream, board.scan(), 0.501)
    assert scans.seq.tolist() == [500]
    assert (stream.ledger.reboots, stream.ledger.lost_away) == (0, 499)


def test_after_a_reconnect_a_boot_whose_numbers_would_fit_the_one_before_waits_for_its_hello():
    """Away for a second, and booted for 20 ms: counts and clock went on alike, but too little."""
    board = EmulatedBoard()
    stream = greeted(board)
    come(stream, board.scan(), 0.001)
    stream.feed([Chunk(0.002, b"", gone=True), Chunk(1.0, b"", opened=True)])
    board.reboot()
    board.skip(20)
    assert come(stream, b"".join(board.scan() for _ in range(5)), 1.001) == []
    assert stream.wants_hello
    (scans,) = come(stream, board.hello(), 1.002)
    assert (scans.seq.tolist(), scans.boot) == ([20, 21, 22, 23, 24], 1)
    assert (stream.ledger.reboots, stream.ledger.lost, stream.ledger.lost_away) == (1, 0, 0)
    assert not stream.wants_hello


def test_a_reboot_whose_hello_was_lost_is_asked_for_it_and_loses_no_scan():
    board = EmulatedBoard()
    stream = greeted(board)
    come(stream, b"".join(board.scan() for _ in range(500)), 0.5)
    board.reboot()
    for i in range(22):
        assert come(stream, board.scan(), 0.501 + 0.001 * i) == []
        assert stream.wants_hello == (0.501 + 0.001 * i - 0.5 >= 0.02)
    (scans,) = come(stream, board.hello() + board.scan(), 0.523)
    assert scans.seq.tolist() == list(range(23))
    assert (stream.ledger.reboots, stream.ledger.lost) == (1, 0)
    assert not stream.wants_hello


def test_one_number_out_of_all_bounds_is_thrown_away_alone():
    """Damage that passed the check, at odds of 2⁻¹⁶: it must not move the board's time."""
    board = EmulatedBoard()
    stream = greeted(board)
    come(stream, board.scan(), 0.001)
    wild = frame_of(pack(Data(0, 4_000_000, 7, (1, 2, 3, 4))))
    (scans,) = come(stream, board.scan() + wild + board.scan(), 0.003)[:1]
    rest = come(stream, board.scan(), 0.004)
    assert stream.ledger.scans == 4
    assert stream.ledger.bad["message"] == 1
    assert (stream.ledger.reboots, stream.ledger.lost) == (0, 0)
    assert scans.seq[0] == 1
    assert rest[0].seq.tolist() == [3]


@pytest.mark.parametrize("change", ["board_id", "channels", "rate_hz"])
def test_another_board_on_the_same_cable_is_refused(change: str):
    board = EmulatedBoard()
    stream = greeted(board)
    come(stream, board.scan(), 0.001)
    other = {"board_id": "EMU-9"} if change == "board_id" else {change: 500}
    if change == "channels":
        other = {"channels": 5}
    stranger = EmulatedBoard(first_tick=5000, first_us=5_000_000, **other)  # type: ignore[arg-type]
    assert come(stream, stranger.hello() + stranger.scan(), 0.01) == []
    assert stream.ledger.state == "running"  # it may be a word out of place
    assert come(stream, stranger.scan(), 0.022) == []
    assert stream.ledger.state == "refused"
    board.skip(20)
    assert len(come(stream, board.hello() + board.scan(), 0.023)) == 1
    assert stream.ledger.state == "running"


def test_a_hello_of_another_protocol_is_not_taken():
    stream = BoardStream("here")
    come(stream, frame_of(pack(Hello(board=0, seq=0, t_us=0, protocol=2, channels=4))), 0.0)
    assert not stream.ready
    assert stream.refused is not None


def test_one_board_gives_each_scan_as_a_row_and_holes_as_missing():
    rig = Rig((0.0,))
    rig.run(0.1)
    rig.boards[0].skip(2)
    rows = rig.run(0.1)
    assert (np.diff(rows.counter) == 1).all()
    missing = rows.validity[:, 0] == MISSING
    assert missing.sum() == 2
    assert (rows.values[missing] == 0).all()
    expected = [value_at(int(tick), 0, 0) * VOLT for tick in rows.counter[~missing]]
    np.testing.assert_allclose(rows.values[~missing, 0], expected, rtol=1e-5)
    assert np.isnan(rows.device_s[missing]).all()


@pytest.mark.parametrize("ppm", [(0.0, 400.0, -400.0), (2000.0, -3000.0, 5000.0)])
def test_boards_with_clocks_of_their_own_stay_within_a_scan_of_each_other(ppm: tuple[float, ...]):
    """With poor crystals (400 ppm) and with resonators (0.5 %), once the fit has learned."""
    rig = Rig(ppm)
    rig.run(3.0)
    rows = rig.run(3.0)
    assert (np.diff(rows.counter) == 1).all()
    assert (rows.validity == GOOD).all()
    true_s = []
    for index in range(3):
        counts = np.round(rows.values[:, 4 * index] / VOLT).astype(int) - 1 - 17 * index
        residue = counts * pow(5, -1, 1022) % 1022
        near = rows.fitted_s * 1000 * (1 + ppm[index] * 1e-6)
        tick = np.round((near - residue) / 1022) * 1022 + residue
        true_s.append(tick / (1000 * (1 + ppm[index] * 1e-6)))
    for other in true_s[1:]:
        assert np.abs(other - true_s[0]).max() < 1.2e-3
    spread = max(abs(deviation - ppm[0]) for deviation in ppm) * 1e-6 * 8000
    for stream in rig.streams:
        slips = stream.ledger.repeated + stream.ledger.skipped + stream.ledger.late
        assert slips <= 1.2 * spread + 2
        assert stream.ledger.lost == 0


def test_each_rows_values_are_accounted_for():
    rig = Rig((0.0, 5000.0, -5000.0))
    rows = rig.run(2.0)
    for index, stream in enumerate(rig.streams):
        held = int((rows.validity[:, 4 * index] == GOOD).sum())
        ledger = stream.ledger
        kept = sum(len(ticks) for ticks, _ in rig.merge._boards[index].kept)
        counted = ledger.scans + ledger.repeated - ledger.early - ledger.late - ledger.skipped
        assert held == counted - kept


def test_a_silent_board_holds_the_others_up_for_30_ms_and_then_not_at_all():
    rig = Rig((0.0, 0.0))
    rig.run(1.0)
    rig.silent = {1}
    held = rig.run(0.5)
    lag_s = held.arrival_s - held.fitted_s
    assert lag_s.max() <= WAIT_S + 0.011
    assert (held.validity[-400:, :4] == GOOD).all()
    assert (held.validity[-400:, 4:] == MISSING).all()
    rig.silent = set()
    rows = rig.run(0.5)
    assert (rows.validity[-450:] == GOOD).all()
    assert (np.diff(rows.counter) == 1).all()


def test_the_first_board_may_be_the_one_that_is_gone():
    rig = Rig((300.0, 0.0, 0.0))
    rig.run(3.0)
    rig.silent = {0}
    rig.streams[0].feed([Chunk(rig.now_s, b"", gone=True)])
    rig.merge.gone(0)
    rows = rig.run(2.0)
    assert (rows.validity[-1900:, :4] == AWAY).all()
    assert (rows.validity[-1900:, 4:] == GOOD).all()
    assert len(rows) == pytest.approx(2000, abs=40)
    rig.silent = set()
    rig.streams[0].feed(
        [Chunk(rig.now_s, b"", opened=True), Chunk(rig.now_s, rig.boards[0].hello())]
    )
    rows = rig.run(0.5)
    assert (rows.validity[-450:] == GOOD).all()
    assert (np.diff(rows.counter) == 1).all()
    assert (np.diff(rows.fitted_s) >= 0).all()


def test_rows_go_on_while_the_only_board_is_away():
    rig = Rig((0.0,))
    rig.run(0.5)
    rig.silent = {0}
    rig.streams[0].feed([Chunk(rig.now_s, b"", gone=True)])
    rig.merge.gone(0)
    rows = rig.run(1.0)
    assert len(rows) == pytest.approx(1000 * (1.0 - WAIT_ALONE_S), abs=10)
    assert (rows.validity[10:] == AWAY).all()


def test_a_backlog_is_not_late_where_it_was_the_program_that_had_no_turn():
    rig = Rig((0.0, 0.0))
    rig.run(0.5)
    before = rig.merge.release(rig.now_s + 5.0, rig.now_s)
    assert not (before.validity & np.uint8(MISSING)).any()
    assert (rig.run(0.2).validity == GOOD).all()
