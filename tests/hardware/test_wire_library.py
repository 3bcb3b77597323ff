"""TaxelWire, the firmware's C library, against the golden bytes and against Python's codec."""

from __future__ import annotations

import json
import random
from pathlib import Path
from typing import Any

import pytest

from taxel.wire.framing import FrameDecoder, frame_of
from taxel.wire.messages import unpack

VECTORS = json.loads(
    (Path(__file__).parents[2] / "protocol" / "vectors.json").read_text(encoding="utf-8")
)
REASONS = ("short", "long", "check", "cobs", "message")


def named(cases: list[dict[str, Any]]) -> list[Any]:
    return [pytest.param(case, id=case["name"]) for case in cases]


def feed(wire: Any, data: bytes) -> tuple[list[bytes], dict[str, int], bytes]:
    """Return payloads, nonzero counts of bad frames, and what still waits."""
    answer = wire.ask(f"feed {data.hex()}")
    payloads, *counts, rest = answer.split(" ")
    bad = {reason: int(n) for reason, n in zip(REASONS, counts, strict=True) if int(n)}
    found = [bytes.fromhex(text) for text in payloads.split(",") if text]
    return found, bad, bytes.fromhex(rest)


def test_the_crc_is_the_specifications(wire: Any):
    crc = VECTORS["crc"]
    assert wire.ask(f"crc {crc['ascii'].encode().hex()}") == str(crc["value"])


@pytest.mark.parametrize("case", named(VECTORS["valid"]))
def test_every_golden_message_is_framed_and_packed_byte_for_byte(wire: Any, case: dict[str, Any]):
    assert wire.ask(f"frame {case['payload']}") == case["frame"]
    assert wire.ask(f"repack {case['payload']}") == case["payload"]
    assert feed(wire, bytes.fromhex(case["frame"])) == ([bytes.fromhex(case["payload"])], {}, b"")


@pytest.mark.parametrize("case", named(VECTORS["invalid"]))
def test_every_damaged_frame_is_thrown_away_for_the_reason_it_should(
    wire: Any, case: dict[str, Any]
):
    found, bad, rest = feed(wire, bytes.fromhex(case["frame"]))
    assert (bad, rest) == ({case["reason"]: 1}, b"")
    assert bool(found) == (case["reason"] == "message")  # a sound frame that says nothing


@pytest.mark.parametrize("case", named(VECTORS["streams"]))
def test_every_golden_stream_gives_its_payloads_bytewise(wire: Any, case: dict[str, Any]):
    data = bytes.fromhex(case["bytes"])
    whole = feed(wire, data)
    assert whole == (
        [bytes.fromhex(text) for text in case["payloads"]],
        case["bad"],
        bytes.fromhex(case["rest"]),
    )


def test_no_payload_of_a_wrong_length_is_framed(wire: Any):
    assert wire.ask("frame ") == "none"
    assert wire.ask("frame " + "01" * 241) == "none"


def test_c_and_python_agree_on_noise_and_on_damaged_frames(wire: Any):
    """200 kB of noise, frames, and frames with bytes flipped, dropped and inserted."""
    chance = random.Random(20)
    payloads = [bytes.fromhex(case["payload"]) for case in VECTORS["valid"]]
    decoder, together = FrameDecoder(), dict.fromkeys(REASONS, 0)
    for _ in range(400):
        data = bytearray()
        while len(data) < 500:
            frame = bytearray(frame_of(chance.choice(payloads)))
            for _ in range(chance.choice((0, 0, 1, 2))):
                at = chance.randrange(len(frame))
                damage = chance.randrange(4)
                if damage == 0:
                    frame[at] ^= 1 << chance.randrange(8)
                elif damage == 1 and len(frame) > 1:
                    del frame[at]
                elif damage == 2:
                    frame.insert(at, chance.randrange(256))
                else:
                    frame[at:at] = chance.randbytes(chance.randrange(300))
            data += frame
        found, bad, _ = feed(wire, bytes(data))
        theirs = decoder.feed(bytes(data))
        assert found == theirs
        decoder.bad.message += sum(unpack(payload) is None for payload in theirs)
        together |= bad
    assert together == decoder.bad.by_reason()
    assert together["check"] > 100
