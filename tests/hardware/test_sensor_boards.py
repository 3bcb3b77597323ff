"""The sensor boards' firmware on emulated boards, in virtual time."""

from __future__ import annotations

import itertools
import os
import random
import time
import tty
from pathlib import Path

import numpy as np
import pytest

from taxel.bench.boards.emulator import PINS, BoardSetup, EmulatedBoards, Firmware, VirtualClock
from taxel.bench.boards.sensors import (
    CHANNELS,
    ChainResult,
    expected_scans,
    messages_of,
    naive_rate_hz,
    run_chain,
    run_damage,
    run_wide,
)
from taxel.clock import SystemClock
from taxel.errors import BadSource
from taxel.sources.boards.port import Chunk
from taxel.sources.boards.source import SerialBoards
from taxel.sources.boards.stream import BoardStream
from taxel.wire.framing import FrameDecoder, frame_of
from taxel.wire.messages import Ability, Command, Data, Heartbeat, Hello, Order, pack, unpack


@pytest.fixture(scope="module")
def chain(firmware: Firmware) -> ChainResult:
    return run_chain(firmware, 2.0, (0.0, 40.0, -25.0))


def one_board(firmware: Firmware, **changes: object) -> BoardSetup:
    volts = np.random.default_rng(5).uniform(0.0, 5.2, (3000, PINS))
    return BoardSetup(elf=firmware.elf("teng_daq_1"), volts=volts, **changes)  # type: ignore[arg-type]


def test_three_boards_lose_no_frame_between_the_converter_and_the_recording(chain: ChainResult):
    for board in chain.boards:
        assert board["lost"] == board["late"] == board["dropped"] == board["overrun"] == 0
        assert not any(board["bad"].values())
        assert board["scans"] > 3000
    assert 0 <= chain.scans - chain.frames <= 6  # scans still in the boards at the end
    assert chain.rows > 2000
    assert chain.missing == 0


def test_every_converter_value_reaches_frames_and_recording_bit_for_bit(chain: ChainResult):
    assert chain.frame_values > 35_000
    assert chain.wrong_values == 0
    assert chain.wrong_rows == 0


def test_one_fault_on_the_line_costs_one_frame_at_most_and_invents_none(chain: ChainResult):
    """A bit flipped, a byte dropped or put in, delimiters included: each frame has two."""
    damage = run_damage(chain.sent, 20_000)
    assert damage.most_lost == 1
    assert damage.invented == 0
    assert damage.lost > 15_000


def test_a_board_says_who_it_is_and_its_boot_number_is_another_each_time(firmware: Firmware):
    with EmulatedBoards(firmware, [one_board(firmware, boots=41)]) as boards:
        boards.run(0.1)
        boards.command("reset 0")
        boards.run(0.1)
        heard = [unpack(payload) for payload in FrameDecoder().feed(boards.bytes_sent(0))]
    hellos = [m for m in heard if isinstance(m, Hello)]
    assert [hello.boot_id for hello in hellos] == [41, 42]
    assert (hellos[0].board, hellos[0].board_id, hellos[0].channels) == (1, "TENG-1", 4)
    assert (hellos[0].rate_hz, hellos[0].adc_bits, hellos[0].reference_mv) == (1000, 10, 5000)
    assert (hellos[0].firmware, hellos[0].abilities) == ((1, 0, 0), Ability.SENSORS)


def test_scans_count_ticks_and_begin_when_the_tick_was_due(firmware: Firmware):
    with EmulatedBoards(firmware, [one_board(firmware)]) as boards:
        boards.run(0.5)
        frames = [m for m in messages_of(boards.bytes_sent(0)) if isinstance(m, Data)]
        begun = boards.conversions(0)[:: 2 * len(CHANNELS)]["cycle"][: len(frames)] / 16
    assert [frame.seq for frame in frames] == list(range(len(frames)))
    assert {b.t_us - a.t_us for a, b in itertools.pairwise(frames)} == {1000}
    late_us = begun - np.array([frame.t_us for frame in frames])
    assert np.ptp(late_us) < 10.0  # all that moves a scan: interrupts of the serial line


def test_the_rate_is_changed_through_the_real_source_and_values_stay_exact(firmware: Firmware):
    with EmulatedBoards(firmware, [one_board(firmware)]) as boards:
        clock = VirtualClock(boards, readers=True)
        options = {"rate_hz": "250"}
        with SerialBoards(str(boards.port(0)), options, clock) as source:
            assert source.info.rate_hz == 250
            boards.run(0.5)
        frames = [m for m in messages_of(boards.bytes_sent(0)) if isinstance(m, Data)]
        scans = expected_scans(boards, 0)
    late = frames[-100:]
    assert {b.t_us - a.t_us for a, b in itertools.pairwise(late)} == {4000}
    assert [frame.seq for frame in frames] == list(range(len(frames)))
    assert np.array_equal([frame.values for frame in frames], scans[: len(frames)])


def test_boards_run_in_real_time_too(firmware: Firmware):
    """As a stand-in for hardware: any program may open the port."""
    with (
        EmulatedBoards(firmware, [one_board(firmware)], live=True) as boards,
        SerialBoards(str(boards.port(0)), {}, SystemClock()) as source,
    ):
        began_s, rows = time.monotonic(), 0
        while rows < 300 and time.monotonic() - began_s < 20.0:
            rows += len(source.read(0.1))
        took_s = time.monotonic() - began_s
        (ledger,) = source.boards()
    assert rows >= 300
    assert took_s > 0.2
    assert (ledger["lost"], ledger["dropped"]) == (0, 0)
    assert sum(ledger["bad"].values()) <= 1  # the frame that was under way when the port was opened


def test_no_scan_is_taken_for_a_repeated_one_whenever_a_board_is_asked_who_it_is(
    firmware: Firmware,
):
    """Its answer overtakes scans that are under way in the board: two at most."""
    order = frame_of(pack(Command(board=1, seq=7, t_us=0, order=Order.IDENTIFY)))
    overtaken = []
    for phase in range(20):
        with EmulatedBoards(firmware, [one_board(firmware)]) as boards:
            fd = os.open(boards.port(0), os.O_RDWR | os.O_NOCTTY)
            tty.setraw(fd)
            boards.run(0.1 + phase * 5e-5)
            begun = len(boards.bytes_sent(0))
            os.write(fd, order)
            boards.run(0.1)
            os.close(fd)
            sent = boards.bytes_sent(0)[begun:].split(b"\x00", 1)[1]  # from a frame's beginning
        stream = BoardStream("here")
        scans = stream.feed([Chunk(0.0, b"", opened=True), Chunk(0.1, sent)])
        heard = messages_of(sent)
        hello = next(m for m in heard if isinstance(m, Hello))
        after = [m.seq for m in heard[heard.index(hello) :] if isinstance(m, Data)]
        overtaken.append(hello.seq - after[0])
        assert [int(seq) for part in scans for seq in part.seq] == after
        assert not any(stream.ledger.bad.values())
    assert max(overtaken) == 2


def test_a_rate_that_the_converter_cannot_do_is_refused_by_the_board(firmware: Firmware):
    with EmulatedBoards(firmware, [one_board(firmware)]) as boards:
        options = {"rate_hz": "2000", "wait_s": "1"}
        with pytest.raises(BadSource, match="2000"):
            SerialBoards(str(boards.port(0)), options, VirtualClock(boards, readers=True))


def test_damaged_commands_are_counted_and_change_nothing(firmware: Firmware):
    chance = random.Random(3)
    order = frame_of(pack(Command(board=1, seq=7, t_us=0, order=Order.SET_RATE, a=500)))
    with EmulatedBoards(firmware, [one_board(firmware)]) as boards:
        fd = os.open(boards.port(0), os.O_RDWR | os.O_NOCTTY)
        tty.setraw(fd)
        boards.run(0.1)
        for _ in range(40):
            at = chance.randrange(len(order) - 1)
            flipped = order[at] ^ 1 << chance.randrange(8)
            os.write(fd, order[:at] + bytes((flipped or 0xFF,)) + order[at + 1 :])
            boards.run(0.01)
        os.close(fd)
        boards.run(0.1)
        heard = messages_of(boards.bytes_sent(0))
    assert next(m.bad for m in reversed(heard) if isinstance(m, Heartbeat)) >= 40
    frames = [m for m in heard if isinstance(m, Data)]
    assert {b.t_us - a.t_us for a, b in itertools.pairwise(frames)} == {1000}


@pytest.mark.parametrize(
    ("name", "rate_hz"), [("teng_daq_16", 500), ("teng_daq_16_64", 1000), ("teng_daq_16_32", 1250)]
)
def test_sixteen_channels_are_scanned_whole_and_exact_at_the_converters_pace(
    firmware: Firmware, name: str, rate_hz: int
):
    found = run_wide(firmware, name, 0.5)
    assert (found.lost, found.wrong_values) == (0, 0)
    assert found.rate_hz == pytest.approx(rate_hz, rel=1e-3)


def test_the_usual_sketch_is_three_times_slower_with_the_same_converter(firmware: Firmware):
    assert naive_rate_hz(firmware, 0.5) * 2.8 < run_wide(firmware, "teng_daq_16", 0.5).rate_hz


def test_a_machine_without_the_tools_names_what_to_install(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
):
    from taxel.bench.boards import emulator as board_emulator
    from taxel.bench.boards import steps as boards
    from taxel.errors import BadInput

    monkeypatch.setenv("PATH", str(tmp_path))
    assert {"gcc-avr", "gcc", "make"} <= set(board_emulator.missing_parts())
    with pytest.raises(BadInput, match="apt install gcc-avr avr-libc arduino-core-avr") as error:
        boards.quick_steps()
    assert "\n" not in str(error.value)
