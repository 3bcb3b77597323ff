"""The golden bytes of `protocol/vectors.json` hold, here and by a second, plain implementation."""

import json
from dataclasses import asdict
from pathlib import Path
from typing import Any

import pytest

from taxel.errors import BadInput
from taxel.wire import messages
from taxel.wire.framing import LONGEST_PAYLOAD, FrameDecoder, frame_of
from taxel.wire.messages import Command, Current, Data, Hello, pack, unpack

VECTORS: dict[str, Any] = json.loads(
    (Path(__file__).parents[2] / "protocol" / "vectors.json").read_text()
)


def named(cases: list[dict[str, Any]]) -> Any:
    return pytest.mark.parametrize("case", cases, ids=[case["name"] for case in cases])


def plain_crc(data: bytes) -> int:
    """CRC-16, 0x1021, start 0xFFFF, bit by bit, as a microcontroller would."""
    crc = 0xFFFF
    for byte in data:
        crc ^= byte << 8
        for _ in range(8):
            crc = (crc << 1 ^ 0x1021 if crc & 0x8000 else crc << 1) & 0xFFFF
    return crc


def plain_frame(payload: bytes) -> bytes:
    """COBS and check, written from the specification's words alone."""
    groups = payload.split(b"\0")
    encoded = bytearray()
    for group in groups:
        assert len(group) < 254
        encoded += bytes([len(group) + 1]) + group
    crc = plain_crc(bytes(encoded))
    check = [0x80 | crc >> 9, 0x80 | (crc >> 2 & 0x7F), 0x80 | (crc & 3) << 5]
    return bytes(encoded) + bytes(check) + b"\0"


def fields_of(message: messages.Message) -> dict[str, Any]:
    return {k: list(v) if isinstance(v, tuple) else v for k, v in asdict(message).items()}


def test_the_crc_is_the_one_that_is_meant():
    crc = VECTORS["crc"]
    assert plain_crc(crc["ascii"].encode()) == crc["value"] == 0x29B1


def test_every_type_of_message_has_golden_bytes():
    assert {case["type"] for case in VECTORS["valid"]} == {
        kind.name.lower() for kind in messages.Kind
    }


@named(VECTORS["valid"])
def test_a_message_has_exactly_these_bytes(case: dict[str, Any]):
    payload, frame = bytes.fromhex(case["payload"]), bytes.fromhex(case["frame"])
    message = unpack(payload)
    assert message is not None
    assert type(message).__name__.lower() == case["type"]
    assert fields_of(message) == case["fields"]
    assert pack(message) == payload
    assert frame_of(payload) == plain_frame(payload) == frame


@named(VECTORS["invalid"])
def test_a_damaged_frame_is_thrown_away_for_its_reason(case: dict[str, Any]):
    decoder = FrameDecoder()
    payloads = decoder.feed(bytes.fromhex(case["frame"]))
    if case["reason"] == "message":
        assert decoder.bad.total == 0
        assert [unpack(payload) for payload in payloads] == [None]
    else:
        assert payloads == []
        assert decoder.bad.by_reason()[case["reason"]] == decoder.bad.total == 1


@pytest.mark.parametrize("step", [1, 7, 10_000])
@named(VECTORS["streams"])
def test_a_stream_gives_these_payloads_however_it_is_cut(case: dict[str, Any], step: int):
    data = bytes.fromhex(case["bytes"])
    decoder = FrameDecoder()
    payloads = []
    for start in range(0, len(data), step):
        payloads += decoder.feed(data[start : start + step])
    assert [payload.hex() for payload in payloads] == case["payloads"]
    assert {k: n for k, n in decoder.bad.by_reason().items() if n} == case["bad"]


def test_what_does_not_fit_the_wire_is_refused_in_plain_words():
    for message in (
        Data(0, 0, 0, ()),
        Data(0, 2**32, 0, (1,)),
        Data(0, 0, 0, (65536,)),
        Data(0, 0, 0, (0,) * 116),
        Current(0, 0, 0, (40000,)),
        Hello(board=0, seq=0, t_us=0, board_id="µ"),
        Hello(board=0, seq=0, t_us=0, board_id="x" * 33),
        Command(board=256, seq=0, t_us=0, order=0),
    ):
        with pytest.raises(BadInput, match=r"protocol/SPEC\.md"):
            pack(message)
    for payload in (b"", b"x" * (LONGEST_PAYLOAD + 1)):
        with pytest.raises(BadInput, match="1 to 240 bytes"):
            frame_of(payload)
