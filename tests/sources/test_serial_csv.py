"""Sketches that print numbers: columns, names, rate, time, and lines that are no scan."""

import numpy as np
import pytest

from taxel.signals import Samples, Validity
from taxel.sources.boards.csv_lines import CsvStream, names_of, numbers_of
from taxel.sources.boards.ledger import BoardLedger, Scans
from taxel.sources.boards.merge import BoardMerge
from taxel.sources.boards.port import Chunk

HZ = 100.0


def start(line: str = "1,2,3", **options: object) -> CsvStream:
    """A stream that has watched 120 equal lines, 10 ms apart."""
    stream = CsvStream("here", **options)  # type: ignore[arg-type]
    for i in range(120):
        stream.feed([Chunk(i / HZ, f"{line}\r\n".encode())])
    assert stream.ready
    return stream


def come(stream: CsvStream, text: str, arrival_s: float = 2.0) -> list[Scans]:
    return stream.feed([Chunk(arrival_s, text.encode())])


@pytest.mark.parametrize(
    ("line", "numbers"),
    [
        ("1,2,3", [1, 2, 3]),
        ("1\t-2.5\t3e2", [1, -2.5, 300]),
        ("  .5   7. ", [0.5, 7]),
        ("1, 2; 3,", [1, 2, 3]),
        ("1_000", None),
        ("0x10,1", None),
        ("1,,a", None),
        ("", None),
    ],
)
def test_a_line_is_numbers_or_it_is_none(line: str, numbers: list[float] | None):
    assert numbers_of(line.encode()) == numbers


def test_columns_and_rate_are_measured_at_connecting():
    stream = start()
    assert stream.channels == ("c0", "c1", "c2")
    assert stream.rate_hz == pytest.approx(HZ, rel=0.02)


def test_a_header_line_gives_the_names():
    stream = CsvStream("here")
    stream.feed([Chunk(0.0, b"rest of a li\nthumb index\n")])
    for i in range(120):
        stream.feed([Chunk(i / HZ, b"10 20\n")])
    assert stream.channels == ("thumb", "index")


def test_a_column_of_time_is_the_boards_clock_and_gives_the_rate():
    stream = CsvStream("here", time="ms")
    for i in range(130):
        stream.feed([Chunk(0.3 * (i // 30), f"{i * 20},7\n".encode())])  # in lumps of 0.3 s
    assert stream.channels == ("c0",)
    assert stream.rate_hz == pytest.approx(50.0)
    (scans,) = come(stream, "2600,8\n2620,9\n")
    assert scans.device_s.tolist() == [2.6, 2.62]
    assert scans.values.tolist() == [[8], [9]]


def test_a_printed_clock_wraps_and_one_that_steps_back_is_a_reboot():
    stream = start("5,1", time="us", rate_hz=HZ)
    wrap = 2**32
    (first,) = come(stream, f"{wrap - 10_000},1\n", 4294.957296 + 1.2)
    (second,) = come(stream, "0,1\n10000,1\n", 4294.977296 + 1.2)
    assert np.diff(np.concatenate([first.device_s, second.device_s])) == pytest.approx(0.01)
    assert stream.ledger.reboots == 0
    come(stream, "5000000,1\n", 4299.957296 + 1.2)
    (third,) = come(stream, "70,1\n", 4303.0)
    assert (stream.ledger.reboots, third.boot) == (1, 1)
    assert third.device_s[0] == pytest.approx(7e-5)


@pytest.mark.parametrize("begin", [2**31 - 20, 2**32 - 20, 2**31 + 10_000])
def test_a_clock_printed_as_a_signed_number_goes_on_below_zero(begin: int):
    """`long now = millis()` is below zero after 24.9 days, one of micros() after 36 min."""
    stream = start("5,1", time="ms", rate_hz=HZ)
    device_s: list[float] = []
    for i in range(5):
        clock = (begin + 10 * i + 2**31) % 2**32 - 2**31
        for scans in come(stream, f"{clock},1\n", begin / 1000 + i / HZ):
            device_s += scans.device_s.tolist()
    assert np.diff(device_s) == pytest.approx(np.full(4, 0.01))
    assert stream.ledger.reboots == 0


def test_a_printed_clock_that_leaps_ahead_of_the_hosts_began_anew():
    """As where what lay in a buffer came first: else each later scan would lie in the future."""
    stream = CsvStream("here", time="ms", rate_hz=HZ)
    for i in range(60):
        stream.feed([Chunk(i / HZ, f"{10 * i},1\n".encode())])
    (scans,) = come(stream, "9000,1\n9010,1\n", 0.61)
    assert stream.ledger.reboots == 1
    assert scans.fitted_s.max() <= 0.61


def test_a_single_line_whose_clock_is_damaged_is_one_bad_line():
    """One digit of millis(), 900 ms too large: before, it held back all times that followed."""
    stream = CsvStream("here", time="ms", rate_hz=HZ)
    times_s, rows = [], []
    for i in range(300):
        clock = 10 * i + (900 if i == 100 else 0)
        for scans in stream.feed([Chunk(0.001 + i / HZ, f"{clock},{i}\n".encode())]):
            times_s += scans.device_s.tolist()
            rows += scans.values[:, 0].tolist()
    assert sorted(set(range(10, 300)) - set(rows)) == [100]
    assert np.diff(times_s[-250:]).max() == pytest.approx(0.02)  # the hole of that line
    assert np.diff(times_s).min() > 0
    assert (stream.ledger.bad["line"], stream.ledger.lost, stream.ledger.reboots) == (1, 1, 0)


def test_a_clock_that_goes_on_from_where_it_leapt_to_is_believed():
    """Lines that were not read for half a second come at once, some of them lost."""
    stream = CsvStream("here", time="ms", rate_hz=HZ)
    rows = []
    for i in [*range(100), *range(150, 200)]:
        for scans in stream.feed([Chunk(0.001 + min(i, 101) / HZ, f"{10 * i},{i}\n".encode())]):
            rows += scans.values[:, 0].tolist()
    assert rows[-50:] == [*range(150, 200)]
    assert (stream.ledger.lost, stream.ledger.reboots) == (0, 0)


@pytest.mark.parametrize(
    ("header", "names"),
    [("thumb,index,palm", ("thumb", "index", "palm")), ('"a","b","c"', ("a", "b", "c")),
     ("Fühler,b2,c (N)".replace(" ", ""), ("Fühler", "b2", "c(N)")),
     ("100,9x,250", ("c0", "c1", "c2")), ("Calibrating sensors done", ("c0", "c1", "c2")),
     ("a,a,b", ("c0", "c1", "c2")), ("a,,b", ("c0", "c1", "c2")), ("a,b", ("c0", "c1", "c2"))],
)  # fmt: skip
def test_only_a_line_of_names_gives_the_names(header: str, names: tuple[str, ...]):
    """A damaged line of numbers, a remark, or names that come twice do not."""
    stream = CsvStream("here")
    stream.feed([Chunk(0.0, b"rest\n" + header.encode() + b"\n")])
    for i in range(120):
        stream.feed([Chunk(i / HZ, b"1,2,3\n")])
    assert stream.channels == names


def test_losses_are_said_and_remarks_are_none():
    ledger = BoardLedger(path="here", late=7, bad={"line": 2, "columns": 1, "text": 9})
    assert ledger.losses() == (
        "7 too late for their rows (late_ms= sets how long these wait), 3 damaged lines or messages"
    )
    assert BoardLedger(path="here", scans=9, repeated=1, bad={"text": 9}).losses() == ""


def test_bytes_that_are_no_text_are_no_header():
    assert names_of(b"F\xff,b") == []


def test_a_damaged_line_of_a_single_column_is_a_lost_scan():
    """One damaged field alone might be a name."""
    stream = start("1")
    (before,) = come(stream, "1\n")
    (after,) = come(stream, "x40\n4\n")
    assert after.seq[0] - before.seq[0] == 2
    assert (stream.ledger.lost, stream.ledger.bad["line"]) == (1, 1)


def test_a_header_that_is_printed_again_is_no_lost_scan():
    stream = CsvStream("here")
    stream.feed([Chunk(0.0, b"\ns1,s2,s3\n")])
    for i in range(120):
        stream.feed([Chunk(i / HZ, b"1,2,3\n")])
    (before,) = come(stream, "1,2,3\n")
    (after,) = come(stream, "s1,s2,s3\n4,5,6\n")
    assert after.seq[0] - before.seq[0] == 1
    assert (stream.ledger.lost, stream.ledger.bad["text"]) == (0, 1)


@pytest.mark.parametrize("time", ["none", "ms"])
@pytest.mark.parametrize("boards", [1, 2])
def test_after_a_board_was_silent_its_scans_are_rows_at_once(time: str, boards: int):
    """The first is silent for 4 s, its port open; a line that was not printed is not counted."""
    streams = [CsvStream("here", time=time, rate_hz=HZ) for _ in range(boards)]
    merge = BoardMerge([1] * boards, [stream.ledger for stream in streams], HZ)
    given, printed = [], []
    for i in range(1200):
        now_s = 0.001 + i / HZ
        for index, stream in enumerate(streams):
            silent = index == 0 and 300 <= i < 700
            line = f"{10 * i},{i}\n" if time == "ms" else f"{i}\n"
            for scans in stream.feed([] if silent else [Chunk(now_s, line.encode())]):
                merge.put(index, scans)
        printed += [] if 300 <= i < 700 else [i]
        given.append(merge.release(now_s, now_s))
    rows = Samples.join(given)
    good = rows.values[rows.validity[:, 0] == 0, 0]
    assert len(set(good.tolist())) >= len(printed) - 20
    assert 700 in good or 701 in good
    assert (rows.validity[:, 0] != 0).sum() == pytest.approx(400, abs=15)
    if boards == 2:
        assert (rows.validity[:, 1] == 0).sum() >= 1170
    assert np.diff(rows.fitted_s).max() < 0.05
    apart = rows.fitted_s[rows.validity[:, 0] == 0] - good / HZ
    assert np.abs(apart).max() < 0.03


@pytest.mark.parametrize("time", ["none", "ms"])
@pytest.mark.parametrize(("wait_s", "least"), [(None, 0), (0.4, 1190)])
def test_a_link_that_delivers_in_bursts_loses_nothing_where_rows_wait_for_it(
    time: str, wait_s: float | None, least: int
):
    """30 lines at once each 0.3 s, as Bluetooth may; with the usual wait most come too late."""
    stream = CsvStream("here", time=time, rate_hz=HZ)
    merge = BoardMerge([1], [stream.ledger], HZ, wait_s)
    given = []
    for i in range(1230):
        now_s = 0.001 + i / HZ
        lines = [f"{10 * k},{k}\n" if time == "ms" else f"{k}\n" for k in range(i - 29, i + 1)]
        if i % 30 == 29:
            for scans in stream.feed([Chunk(now_s, "".join(lines).encode())]):
                merge.put(0, scans)
        given.append(merge.release(now_s, now_s))
    rows = Samples.join(given)
    good = rows.values[rows.validity[:, 0] == 0, 0]
    assert len(set(good.tolist())) == len(good) >= least
    assert (stream.ledger.late == 0) is (wait_s is not None)


@pytest.mark.parametrize(("silent", "most_s"), [(False, 0.001), (True, 0.2)])
def test_rows_wait_for_a_silent_board_only(silent: bool, most_s: float):
    """However long they may wait; the second of two boards is silent for 0.2 s."""
    streams = [CsvStream(name, time="ms", rate_hz=HZ) for name in "ab"]
    merge = BoardMerge([1, 1], [stream.ledger for stream in streams], HZ, 1.0)
    waited_s = []
    for i in range(300):
        now_s = i / HZ
        for board, stream in enumerate(streams):
            if silent and board and 2.0 <= now_s < 2.2:
                continue
            for scans in stream.feed([Chunk(now_s, f"{10 * i},{i}\n".encode())]):
                merge.put(board, scans)
        given = merge.release(now_s, now_s)
        waited_s += (now_s - given.fitted_s).tolist()
    assert max(waited_s[100:]) == pytest.approx(most_s, abs=0.011)


def test_bad_lines_are_counted_and_leave_a_hole_and_words_leave_none():
    stream = start()
    (before,) = come(stream, "1,2,3\n")
    (after,) = come(stream, "1,2\n1,2,3,4\n1,x2,3\nready\n\n4,5,6\n")
    assert after.seq[0] - before.seq[0] == 4
    assert stream.ledger.bad == {"line": 1, "columns": 2, "text": 1}
    assert stream.ledger.lost == 3
    assert after.values.tolist() == [[4, 5, 6]]


def test_nan_and_overflow_are_no_values_and_full_scale_saturates():
    stream = start(full_scale=1023.0)
    (scans,) = come(stream, "nan,ovf,1023\n")
    bad, end = int(Validity.NOT_FINITE), int(Validity.SATURATED)
    assert scans.flags.tolist() == [[bad, bad, end]]


def test_lines_that_come_together_are_one_period_apart():
    stream = start(rate_hz=HZ)
    (scans,) = come(stream, "1,2,3\n" * 4, 5.0)
    np.testing.assert_allclose(scans.fitted_s, [4.97, 4.98, 4.99, 5.0])
    assert np.isnan(scans.device_s).all()
    (more,) = come(stream, "1,2,3\n" * 4, 5.001)
    assert more.fitted_s[0] >= 5.0


def test_half_a_line_at_the_start_and_after_a_reconnect_is_no_bad_line():
    stream = start()
    stream.feed([Chunk(2.0, b"1,2", gone=False), Chunk(2.1, b"", gone=True)])
    assert stream.ledger.state == "away"
    stream.feed([Chunk(2.2, b"", opened=True), Chunk(2.21, b"5,5,5\n6,6,6\n")])  # stale
    (scans,) = come(stream, "2,3\n7,8,9\n", 2.3)
    assert scans.values.tolist() == [[7, 8, 9]]
    assert sum(stream.ledger.bad.values()) == 0
    assert stream.ledger.reconnects == 1


def test_bytes_without_a_line_take_no_memory_and_are_one_bad_line():
    stream = start()
    for _ in range(100):
        assert come(stream, "9" * 1000) == []
        assert len(stream._rest) <= 5096
    come(stream, "\n")
    (scans,) = come(stream, "1,2,3\n")
    assert len(scans.seq) == 1
    assert stream.ledger.bad["line"] >= 1


@pytest.mark.parametrize("seed", range(20))
def test_any_bytes_at_all_do_no_harm(seed: int):
    random = np.random.default_rng(seed)
    stream = CsvStream("here", time=("none", "ms", "us")[seed % 3])
    letters = np.frombuffer(b"0123456789,,\n\n\r\t .-+eEnaif\x00\xff", np.uint8)
    for i in range(300):
        stream.feed([Chunk(i / HZ, random.choice(letters, 30).tobytes())])
    kinds = sum(stream.ledger.bad.values())
    assert kinds >= stream.ledger.lost
