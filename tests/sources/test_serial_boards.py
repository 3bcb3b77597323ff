"""`serial://` on real ports (pseudo-terminals), in real time."""

import contextlib
import json
import os
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pytest

from taxel.cli.main import main
from taxel.errors import BadSource
from taxel.signals import Samples, Validity
from taxel.sources.boards.emulation import EmulatedBoard, PseudoPort, RunningBoard, value_at
from taxel.sources.boards.source import SerialBoards
from taxel.sources.opening import open_source
from taxel.wire.messages import Acknowledge, Command, Hello, Order

VOLT = 5.0 / 1024
AWAY = int(Validity.MISSING | Validity.RECONNECTING)


@pytest.fixture
def board(tmp_path: Path) -> Iterator[RunningBoard]:
    with RunningBoard(EmulatedBoard(), tmp_path / "board") as running:
        yield running


def opened(*boards: RunningBoard, options: str = "") -> SerialBoards:
    source = open_source("serial://" + ",".join(str(b.port.path) for b in boards) + options)
    assert isinstance(source, SerialBoards)
    return source


def until(
    source: SerialBoards, right: Callable[[Samples], bool], timeout_s: float = 5.0
) -> Samples:
    """Read on until some rows are right; return all rows read."""
    parts, end_s = [], time.monotonic() + timeout_s
    while time.monotonic() < end_s:
        parts.append(source.read())
        if right(parts[-1]):
            return Samples.join(parts)
    raise AssertionError(f"never came: {source.boards()}")


def good(rows: Samples) -> bool:
    return bool(len(rows)) and not rows.validity[-1].any()


def away(rows: Samples) -> bool:
    return bool(len(rows)) and bool((rows.validity[-1] == AWAY).all())


def test_a_boards_scans_come_once_each_as_volts(board: RunningBoard):
    with opened(board) as source:
        rows = until(source, lambda rows: bool(len(rows)) and rows.counter[-1] > 400)
        info = source.info
    assert (np.diff(rows.counter) == 1).all()
    usable = rows.usable.all(axis=1)
    assert usable.mean() > 0.9
    expected = [[value_at(int(t), 0, i) * VOLT for i in range(4)] for t in rows.counter[usable]]
    np.testing.assert_allclose(rows.values[usable], expected, rtol=1e-5)
    assert (info.rate_hz, info.units, info.serial) == (1000.0, ("V",) * 4, "EMU-0")
    assert info.full_scale == pytest.approx(1023 * VOLT)


def test_three_boards_are_one_array_of_twelve_columns(tmp_path: Path):
    with contextlib.ExitStack() as stack:
        boards = [
            stack.enter_context(
                RunningBoard(EmulatedBoard(board=i, rate_hz=500), tmp_path / f"b{i}", ppm=40.0 * i)
            )
            for i in range(3)
        ]
        source = stack.enter_context(opened(*boards))
        rows = until(source, lambda rows: good(rows) and rows.counter[-1] > 250)
        assert rows.values.shape[1] == len(source.info.channels) == 12
        assert rows.usable.mean() > 0.8
        assert [ledger["board"] for ledger in source.boards()] == [0, 1, 2]


def test_a_cable_that_was_pulled_is_a_reconnect_and_data_are_back_within_100_ms(
    board: RunningBoard,
):
    """In the best of three tries: a busy machine may give the board itself no turn."""
    took_s = []
    with opened(board) as source:
        for tries in range(1, 4):
            until(source, good)
            board.unplug()
            until(source, away)
            assert source.boards()[0]["state"] == "away"
            back_s = board.replug()
            until(source, good)
            took_s.append(time.monotonic() - back_s)
            (ledger,) = source.boards()
            assert (ledger["reconnects"], ledger["reboots"]) == (tries, 0)
    assert min(took_s) < 0.1
    assert ledger["lost_away"] > 0


def test_a_board_that_lost_its_power_is_a_reboot(board: RunningBoard):
    with opened(board) as source:
        until(source, good)
        board.unplug()
        until(source, away)
        board.replug(reboot=True)
        rows = until(source, good)
        (ledger,) = source.boards()
    assert (ledger["reconnects"], ledger["reboots"]) == (1, 1)
    assert (np.diff(rows.counter) == 1).all()
    assert (np.diff(rows.fitted_s) >= 0).all()


def test_a_pressed_button_is_a_reboot_without_a_reconnect(board: RunningBoard):
    with opened(board) as source:
        until(source, good)
        board.reboot()
        until(source, lambda _: source.boards()[0]["reboots"] == 1)
        until(source, good)
        assert source.boards()[0]["reconnects"] == 0


def test_a_paused_board_is_silent_and_what_it_did_not_send_is_lost(board: RunningBoard):
    with opened(board) as source:
        until(source, good)
        board.pause()
        rows = until(source, lambda rows: bool(len(rows)) and bool(rows.validity[-1].all()))
        assert set(rows.validity[-1]) == {int(Validity.MISSING)}
        assert source.boards()[0]["state"] == "silent"
        board.pause(False)
        until(source, good)
        (ledger,) = source.boards()
    assert ledger["lost"] > 50
    assert (ledger["reconnects"], ledger["reboots"]) == (0, 0)


def test_damage_on_the_wire_is_counted_and_never_a_value(tmp_path: Path):
    random = np.random.default_rng(0)

    def damage(frame: bytes) -> bytes:
        flipped = bytearray(frame)
        if random.random() < 0.2:
            flipped[int(random.integers(len(frame)))] ^= int(random.integers(1, 256))
        return bytes(flipped)

    with (
        RunningBoard(EmulatedBoard(), tmp_path / "b", damage=damage) as board,
        opened(board) as source,
    ):
        rows = until(source, lambda rows: bool(len(rows)) and rows.counter[-1] > 600)
        (ledger,) = source.boards()
    usable = rows.usable.all(axis=1)
    assert 0.6 < usable.mean() < 0.95
    expected = [value_at(int(t), 0, 0) * VOLT for t in rows.counter[usable]]
    np.testing.assert_allclose(rows.values[usable, 0], expected, rtol=1e-5)
    assert ledger["bad"]["check"] > 20
    assert ledger["lost"] > 20


def test_a_rate_that_is_asked_for_is_set(board: RunningBoard):
    with opened(board, options="?rate_hz=200") as source:
        assert source.info.rate_hz == 200.0
        rows = until(source, lambda rows: bool(len(rows)) and rows.counter[-1] > 250)
        assert source.boards()[0]["bad"]["message"] == 0
    assert 0.003 < np.median(np.diff(rows.device_s)) < 0.007


def test_commands_go_out_and_answers_come_back(board: RunningBoard):
    with opened(board) as source:
        source.messages(0)
        assert source.send(0, Command(board=0, seq=7, t_us=99, order=Order.IDENTIFY))
        heard: list[object] = []
        until(source, lambda _: bool(heard.extend(source.messages(0)) or len(heard) >= 2))
    answer, hello = heard[:2]
    assert isinstance(answer, Acknowledge)
    assert (answer.command_seq, answer.host_us) == (7, 99)
    assert isinstance(hello, Hello)


def test_columns_may_be_named(board: RunningBoard):
    with opened(board, options="?channels=thumb,index,middle,ring&name=hand") as source:
        assert source.info.channels == ("thumb", "index", "middle", "ring")
        assert source.info.name == "hand"


def test_a_port_is_held_alone(board: RunningBoard):
    with (
        opened(board),
        pytest.raises(BadSource, match=r"got another program holds it"),
    ):
        opened(board, options="?wait_s=0.2")


def test_no_thread_and_no_descriptor_is_left_behind(board: RunningBoard):
    def held() -> tuple[int, int]:
        return threading.active_count(), len(os.listdir("/proc/self/fd"))

    before = held()
    with opened(board) as source:
        source.read()
    assert held() == before
    with pytest.raises(BadSource):
        opened(board, options="?channels=one")
    assert held() == before


def test_what_is_wrong_at_opening_is_said_in_one_line(tmp_path: Path):
    with pytest.raises(BadSource, match=r"port at .*nowhere; got no such device.*taxel find"):
        open_source(f"serial://{tmp_path}/nowhere?wait_s=0.1")
    port = PseudoPort(tmp_path / "port")
    port.plug()
    try:
        with pytest.raises(BadSource, match=r"a hello from the board at .*got nothing; .*firmware"):
            open_source(f"serial://{port.path}?wait_s=0.2")
        with sending(port, b"\x07\x12garbage\x00"), pytest.raises(BadSource, match="without one"):
            open_source(f"serial://{port.path}?wait_s=0.3")
        with sending(port, b"12,13,14\r\n"), pytest.raises(BadSource, match="add format=csv"):
            open_source(f"serial://{port.path}?wait_s=0.3")
        with sending(port, b"so it goes\n"), pytest.raises(BadSource, match="lines of numbers"):
            open_source(f"serial://{port.path}?format=csv&wait_s=0.3")
    finally:
        port.unplug()


@contextlib.contextmanager
def sending(port: PseudoPort, data: bytes) -> Iterator[None]:
    """Say the same every 10 ms."""
    ending = threading.Event()

    def run() -> None:
        while not ending.wait(0.01):
            port.write(data)

    thread = threading.Thread(target=run)
    thread.start()
    try:
        yield
    finally:
        ending.set()
        thread.join()


@pytest.mark.parametrize(
    ("address", "words"),
    [
        ("serial://a,,b", "each once"),
        ("serial://a,a", "each once"),
        ("serial://a?baud=fast", "baud as a number"),
        ("serial://a?format=xml", "format as one of wire, csv"),
        ("serial://a?time=ms", "got time"),
        ("serial://a?format=csv&zero=good", "got zero"),
        ("serial://a?colour=red", "got colour"),
        ("serial://a?channels=x,x", "each once"),
        ("serial://a?rate_hz=0", "rate_hz as a number"),
        ("serial://a?wait_s=nan", "wait_s as a number"),
    ],
)
def test_a_wrong_address_is_refused_before_any_port_is_opened(address: str, words: str):
    with pytest.raises(BadSource, match=words):
        open_source(address)


def test_boards_of_different_rates_are_refused(tmp_path: Path):
    with (
        RunningBoard(EmulatedBoard(board=0), tmp_path / "a") as first,
        RunningBoard(EmulatedBoard(board=1, rate_hz=500), tmp_path / "b") as second,
        pytest.raises(BadSource, match=r"one rate; got 1000 Hz, 500 Hz; .*rate_hz="),
    ):
        opened(first, second)


def test_the_board_of_a_hand_is_named_as_such(tmp_path: Path):
    """Its firmware is not out of date: it is another kind of board."""
    hand = RunningBoard(EmulatedBoard(board=3, channels=0, board_id="HAND"), tmp_path / "hand")
    hand.pause()  # it sends no scans
    with hand, pytest.raises(BadSource, match=r"sensor board at .*; got the board HAND .*hand://"):
        opened(hand, options="?wait_s=0.2")


@pytest.mark.slow
def test_lines_of_numbers_are_an_array_too(tmp_path: Path):
    port = PseudoPort(tmp_path / "sketch")
    port.plug()
    try:
        with sending(port, b"10\t20\n"), open_source(f"serial://{port.path}?format=csv") as source:
            rows = until(source, lambda rows: bool(len(rows)) and rows.counter[-1] > 150)  # type: ignore[arg-type]
            assert source.info.units == ("count", "count")
            assert 50 < source.info.rate_hz <= 110
        assert rows.values[rows.usable.all(axis=1)].tolist()[0] == [10, 20]
    finally:
        port.unplug()


@pytest.mark.slow
def test_record_prints_what_a_board_lost(tmp_path: Path, capsys: pytest.CaptureFixture[str]):
    port = PseudoPort(tmp_path / "sketch")
    port.plug()
    line = b"10\t20\n10\tx0\n"
    try:
        with sending(port, line):
            main(["record", f"serial://{port.path}?format=csv&rate_hz=200", "--seconds", "0.5",
                  "--output", str(tmp_path / "a.mcap"), "--json"])  # fmt: skip
        (board,) = json.loads(capsys.readouterr().out)["boards"]
        assert board["bad"]["line"] == board["lost"] > 10
    finally:
        port.unplug()
