"""Every number that a board and the host must agree on is the same on both sides (0049)."""

import re
from pathlib import Path

import pytest

from taxel.wire import framing, messages
from taxel.wire.messages import (
    Ability,
    Command,
    Current,
    Data,
    Heartbeat,
    Hello,
    Kind,
    Order,
    Result,
    State,
    pack,
    unpack,
)

LIBRARY = Path(__file__).parents[2] / "firmware" / "libraries" / "TaxelWire" / "src"
HEADER = (LIBRARY / "taxel_message.h").read_text()


@pytest.mark.parametrize("names", [Kind, Ability, Order, State, Result])
def test_names_have_the_numbers_that_the_firmware_gives_them(names: type):
    (body,) = re.findall(rf"enum taxel_{names.__name__.lower()} \{{(.*?)\}}", HEADER, re.DOTALL)
    numbers = {name: int(number) for name, number in re.findall(r"TAXEL_(\w+) = (\d+)", body)}
    numbers.pop("NO_MESSAGE", None)

    assert {member.name: member.value for member in names} == numbers


@pytest.mark.parametrize(("name", "number"), [
    ("PROTOCOL", messages.PROTOCOL), ("EVERY_BOARD", messages.EVERY_BOARD),
    ("LONGEST_ID", messages._LONGEST_ID), ("LONGEST_LIST", messages._LONGEST_LIST),
])  # fmt: skip
def test_limits_are_the_firmware_s(name: str, number: int):
    assert f"#define TAXEL_{name} {number} " in HEADER.replace("\n", " \n")


def test_what_a_message_says_unless_told_otherwise():
    assert Hello(board=1, seq=2, t_us=3) == Hello(
        board=1, seq=2, t_us=3, protocol=1, firmware=(0, 0, 0), boot_id=0, rate_hz=1000, channels=0,
        adc_bits=10, reference_mv=5000, abilities=Ability.SENSORS, board_id="",
    )  # fmt: skip
    assert Command(board=1, seq=2, t_us=3, order=0) == Command(
        board=1, seq=2, t_us=3, order=0, expires_ms=0, a=0, b=0, c=0
    )
    assert Heartbeat(board=1, seq=2, t_us=3, state=0) == Heartbeat(
        board=1, seq=2, t_us=3, state=0, dropped=0, bad=0
    )


@pytest.mark.parametrize("message", [Data(0, 0, 0, (1,) * 115), Current(0, 0, 0, (-1,) * 115)])
def test_a_list_of_115_is_read_and_no_longer_or_broken_one(message: messages.Message):
    payload = pack(message)
    assert unpack(payload) == message
    for bad in (payload + b"\1\1", payload + b"\1", payload[:-1], payload[:10], payload[:9]):
        assert unpack(bad) is None


HELLO = Hello(board=1, seq=2, t_us=3, channels=115, board_id="~ pad")


@pytest.mark.parametrize("change", [
    {"adc_bits": 8}, {"adc_bits": 16}, {"rate_hz": 1}, {"reference_mv": 1}, {"board_id": ""},
    {"board_id": "x" * 32}, {"channels": 0}, {"abilities": Ability(7)}, {"firmware": (1, 2, 255)},
])  # fmt: skip
def test_a_hello_at_the_ends_of_its_ranges_is_read(change: dict[str, object]):
    hello = Hello(**{name: getattr(HELLO, name) for name in Hello.__slots__} | change)

    assert unpack(pack(hello)) == hello


def replaced(at: int, *values: int) -> bytes:
    payload = bytearray(pack(HELLO))
    payload[at : at + len(values)] = bytes(values)
    return bytes(payload)


@pytest.mark.parametrize("payload", [
    replaced(18, 0, 0), replaced(20, 116), replaced(21, 7), replaced(21, 17), replaced(22, 0, 0),
    replaced(25, 4), replaced(25, 6), replaced(26, 0x7F), replaced(26, 0x1F), pack(HELLO)[:25],
    pack(HELLO)[:24], replaced(25, 33) + b"x" * 28,
], ids=[
    "no rate", "channels", "few bits", "many bits", "no reference", "id shorter", "id longer",
    "delete", "control", "no id", "cut", "id of 33",
])  # fmt: skip
def test_a_hello_outside_its_ranges_is_no_message(payload: bytes):
    assert unpack(payload) is None


def test_a_frame_of_244_bytes_is_the_longest():
    """Payloads of 240 bytes without a zero take one byte of COBS and three of the check."""
    decoder = framing.FrameDecoder()
    longest = framing.frame_of(b"x" * 240)

    assert (framing.LONGEST_FRAME, len(longest)) == (244, 245)
    assert decoder.feed(longest) == [b"x" * 240]
    assert decoder.feed(b"x" * 244 + b"\0" + b"x" * 245) == []
    assert decoder.bad.by_reason() == {"short": 0, "long": 1, "check": 1, "cobs": 0, "message": 0}
    assert decoder.feed(b"\0" + framing.frame_of(b"\1")) == [b"\1"]


@pytest.mark.parametrize(("size", "reason"), [(4, "short"), (5, "check")])
def test_fewer_than_five_bytes_are_short(size: int, reason: str):
    decoder = framing.FrameDecoder()
    decoder.feed(b"x" * size + b"\0")

    assert decoder.bad.by_reason()[reason] == decoder.bad.total == 1
