"""What a sensor board decides, in plain C on the host."""

from __future__ import annotations

from typing import Any

import pytest

from taxel.wire.messages import Order, Result

THESIS = "board 4 8 128 500000"
WIDE = "board 16 16 {prescaler} {baud}"


def test_a_scan_reads_the_grounded_pin_below_each_sensor_first(daq: Any):
    assert daq.ask("plan 1 1 4 7 10") == "0- 1+ 3- 4+ 6- 7+ 9- 10+"


def test_sixteen_channels_are_read_in_order_and_all_kept(daq: Any):
    assert daq.ask("plan 0 " + " ".join(map(str, range(16)))) == " ".join(
        f"{pin}+" for pin in range(16)
    )


def test_a_pin_that_is_a_channel_itself_or_does_not_exist_is_never_read_to_be_thrown_away(daq: Any):
    assert daq.ask("plan 1 0 1 5") == "0+ 1+ 4- 5+"


def test_every_rate_that_divides_a_million_is_kept_exactly_and_no_other_is_taken(daq: Any):
    daq.ask(THESIS)
    taken = []
    for rate_hz in range(1, 1101):
        answer = daq.ask(f"rate {rate_hz}")
        if answer == "no":
            continue
        tick_us, ticks = map(int, answer.split())
        assert tick_us <= 32768
        assert tick_us * ticks * rate_hz == 1_000_000
        taken.append(rate_hz)
    assert taken == [rate for rate in range(1, 1001) if 1_000_000 % rate == 0]


def test_a_board_refuses_a_rate_at_which_its_conversions_do_not_fit(daq: Any):
    """Eight conversions of 104 µs and their interrupts take 0.9 ms."""
    daq.ask(THESIS)
    assert daq.ask("rate 1250") == "no"
    assert daq.ask("rate 65535") == daq.ask("rate 0") == daq.ask("rate 999") == "no"


@pytest.mark.parametrize(
    ("prescaler", "baud", "highest"),
    [(128, 500_000, 500), (64, 1_000_000, 1000), (32, 1_000_000, 1250), (64, 500_000, 800)],
)
def test_sixteen_channels_go_as_fast_as_converter_line_and_processor_allow(
    daq: Any, prescaler: int, baud: int, highest: int
):
    daq.ask(WIDE.format(prescaler=prescaler, baud=baud))
    rates = [rate for rate in range(1, 5001) if daq.ask(f"rate {rate}") != "no"]
    assert rates[-1] == highest


def test_a_new_rate_is_confirmed_by_a_hello_and_a_bad_one_changes_nothing(daq: Any):
    daq.ask(THESIS)
    assert daq.ask(f"do 1 {Order.SET_RATE} 500") == f"{Result.DONE} 1 500"
    assert daq.ask(f"do 2 {Order.SET_RATE} 999") == f"{Result.BAD_ARGUMENT} 0 0"


@pytest.mark.parametrize("order", [Order.STOP, Order.ARM, Order.GRIP, 200])
def test_a_board_without_motors_knows_no_motion(daq: Any, order: int):
    daq.ask(THESIS)
    assert daq.ask(f"do 1 {order} 1") == f"{Result.UNKNOWN} 0 0"


def test_an_old_command_is_refused_and_a_host_that_begins_anew_is_heard(daq: Any):
    """Hosts begin with an identify and count from there; their last run may have gone further."""
    daq.ask(THESIS)
    assert daq.ask(f"do 5000 {Order.SET_RATE} 500").startswith(f"{Result.DONE} ")
    assert daq.ask(f"do 5000 {Order.SET_RATE} 250") == f"{Result.OLD} 0 0"
    assert daq.ask(f"do 1 {Order.SET_RATE} 250") == f"{Result.OLD} 0 0"
    assert daq.ask(f"do 0 {Order.IDENTIFY} 0") == f"{Result.DONE} 1 0"
    assert daq.ask(f"do 0 {Order.IDENTIFY} 0") == f"{Result.DONE} 1 0"
    assert daq.ask(f"do 1 {Order.SET_RATE} 250") == f"{Result.DONE} 1 250"


def test_the_count_of_commands_may_wrap(daq: Any):
    daq.ask(THESIS)
    assert daq.ask(f"do {2**32 - 1} {Order.SET_RATE} 500").startswith(f"{Result.DONE} ")
    assert daq.ask(f"do 0 {Order.SET_RATE} 250").startswith(f"{Result.DONE} ")
