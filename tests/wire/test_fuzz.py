"""The decoder under damage: no crash, no hang, nothing accepted that fails its check."""

from binascii import crc_hqx
from itertools import pairwise

import numpy as np
import pytest
from cobs import cobs
from hypothesis import given, settings
from hypothesis import strategies as st

from taxel.wire.framing import LONGEST_FRAME, LONGEST_PAYLOAD, FrameDecoder, frame_of
from taxel.wire.messages import Data, Kind, pack, unpack

FUZZ = settings(settings.get_profile("fuzz"))
payloads = st.binary(min_size=1, max_size=LONGEST_PAYLOAD)


def sound(frame: bytes) -> bool:
    """The specification's rule for a frame without its delimiter, written a second time."""
    if not 5 <= len(frame) <= 244 or 0 in frame:
        return False
    crc = crc_hqx(frame[:-3], 0xFFFF)
    return frame[-3:] == bytes([0x80 | crc >> 9, 0x80 | (crc >> 2 & 0x7F), 0x80 | (crc & 3) << 5])


def scan(seq: int, channels: int = 4) -> bytes:
    """A data frame such as a board of four channels sends a thousand times a second."""
    return frame_of(
        pack(
            Data(
                1, seq, 1000 * seq % (1 << 32), tuple((7 * seq + i) % 1024 for i in range(channels))
            )
        )
    )


@pytest.mark.data
@FUZZ
@given(st.lists(st.binary(max_size=600), max_size=12))
def test_any_bytes_give_only_sound_frames_however_they_are_cut(pieces: list[bytes]):
    data = b"".join(pieces)
    cut, whole = FrameDecoder(), FrameDecoder()
    given_out = [payload for piece in pieces for payload in cut.feed(piece)]
    assert given_out == whole.feed(data)
    assert cut.bad == whole.bad
    parts = data.split(b"\0")[:-1]
    assert len(given_out) + cut.bad.cobs == sum(map(sound, parts))
    assert cut.bad.total + len(given_out) <= sum(1 for part in parts if part) + 1
    for payload in given_out:
        unpack(payload)


@pytest.mark.data
@FUZZ
@given(st.lists(payloads, max_size=8), st.data())
def test_what_is_framed_comes_out_again(sent: list[bytes], data: st.DataObject):
    stream = b"".join(frame_of(payload) for payload in sent)
    assert stream.count(0) == len(sent)
    cuts = data.draw(st.lists(st.integers(0, len(stream)), max_size=5).map(sorted))
    decoder, got = FrameDecoder(), []
    for start, end in pairwise([0, *cuts, len(stream)]):
        got += decoder.feed(stream[start:end])
    assert got == sent
    assert decoder.bad.total == 0


messages = st.one_of(
    st.binary(min_size=1, max_size=LONGEST_PAYLOAD),
    st.builds(
        lambda kind, rest: bytes([kind]) + rest,
        st.sampled_from(Kind),
        st.binary(max_size=LONGEST_PAYLOAD - 1),
    ),
    *(
        st.binary(min_size=size - 1, max_size=size - 1).map(lambda rest, k=kind: bytes([k]) + rest)
        for kind, size in ((1, 26), (2, 18), (3, 19), (4, 19), (5, 19), (6, 18))
    ),
    st.builds(
        lambda rest, name: b"\x01" + rest + bytes([len(name)]) + name,
        st.binary(min_size=24, max_size=24),
        st.text(st.characters(min_codepoint=32, max_codepoint=126), max_size=34).map(str.encode),
    ),
)


@pytest.mark.data
@FUZZ
@given(messages)
def test_any_payload_unpacks_to_a_message_that_packs_to_it_or_to_none(payload: bytes):
    message = unpack(payload)
    assert message is None or pack(message) == payload


def test_bytes_without_end_take_no_memory():
    decoder = FrameDecoder()
    for _ in range(2000):
        assert decoder.feed(b"\x55" * 1000) == []
        assert len(decoder._kept) <= LONGEST_FRAME
    assert decoder.bad.long == 1
    assert decoder.feed(b"\0" + scan(3)) == [pack(Data(1, 3, 3000, (21, 22, 23, 24)))]


@pytest.mark.parametrize("seq", [0, 0x01020304])
def test_every_burst_of_up_to_16_bits_is_rejected(seq: int):
    """All 5.6 million of them in one frame's content and check, most significant bit first.

    CRC is linear: a burst is accepted only where the CRC of the difference fits the difference
    of the check, which a table of each bit's CRC shows at once. The frame's bytes enter only
    where a burst makes a zero of one, which ends the frame there: those are fed one by one.
    """
    frame = scan(seq)[:-1]
    content, bits = frame[:-3], 8 * len(frame)
    number = int.from_bytes(frame, "big")
    syndrome = [0] * bits
    for place in range(bits):  # place 0 is the last bit of the check
        flipped = (number ^ 1 << place).to_bytes(len(frame), "big")
        crc = crc_hqx(flipped[:-3], 0xFFFF)
        expected = bytes([0x80 | crc >> 9, 0x80 | (crc >> 2 & 0x7F), 0x80 | (crc & 3) << 5])
        syndrome[place] = int.from_bytes(expected, "big") ^ int.from_bytes(flipped[-3:], "big")
    assert len(content) == len(frame) - 3
    patterns = np.arange(1, 1 << 16, 2, dtype=np.uint32)  # the burst's last bit is set
    zero_made = 0
    for place in range(bits):
        width = min(16, bits - place)
        found = np.zeros(1 << (width - 1), np.uint32)
        chosen = patterns[: len(found)]
        for bit in range(width):
            found ^= np.where(chosen >> bit & 1, np.uint32(syndrome[place + bit]), np.uint32(0))
        assert found.all(), f"a burst at bit {place} passes"
        if place % 8 == 0 and width == 16:
            for byte in range(len(frame) - 1 - place // 8, len(frame)):
                zero_made += _split_is_rejected(frame, byte)
    assert zero_made > 0


def _split_is_rejected(frame: bytes, byte: int) -> int:
    """Make a byte zero, with every change of the byte before or after it, and feed it."""
    tried = 0
    for beside in (byte - 1, byte + 1):
        if 0 <= beside < len(frame):
            for other in range(256):
                damaged = bytearray(frame)
                damaged[byte], damaged[beside] = 0, other
                payloads = FrameDecoder().feed(bytes(damaged) + b"\0")
                assert [p for p in payloads if len(p) == 18] == []
                tried += 1
    return tried


def test_real_bursts_fed_through_the_decoder_are_rejected():
    """50,000 bursts of 1 to 16 bits at random places of random frames: none is accepted."""
    random = np.random.default_rng(0)
    accepted = 0
    for _ in range(50_000):
        frame = scan(int(random.integers(1 << 32)))[:-1]
        width = int(random.integers(1, 17))
        burst = 1 | int(random.integers(1 << width)) | 1 << (width - 1)
        place = int(random.integers(8 * len(frame) - width + 1))
        damaged = int.from_bytes(frame, "big") ^ burst << place
        accepted += len(FrameDecoder().feed(damaged.to_bytes(len(frame), "big") + b"\0"))
    assert accepted == 0


def test_random_damage_passes_at_most_at_the_rate_of_the_check():
    """Content replaced by noise under a well-formed check: 2⁻¹⁶ of 400,000 is 6; 20 is 5 sigma."""
    random = np.random.default_rng(1)
    accepted = 0
    for _ in range(400):
        noise = random.integers(1, 256, (1000, 19), np.uint8)
        noise[:, 0] = 19
        crc = random.integers(0, 1 << 16, 1000)
        check = np.stack([0x80 | crc >> 9, 0x80 | (crc >> 2) & 0x7F, 0x80 | (crc & 3) << 5], 1)
        frames = np.concatenate([noise, check, np.zeros((1000, 1), int)], 1).astype(np.uint8)
        decoder = FrameDecoder()
        accepted += len(decoder.feed(frames.tobytes())) + decoder.bad.cobs
    assert accepted <= 20


@pytest.mark.parametrize("fault", ["flipped", "dropped", "inserted"])
def test_a_damaged_byte_costs_one_frame_and_two_where_it_was_a_delimiter(fault: str):
    """One fault in every byte of the middle of seven frames, one at a time."""
    sent = [scan(seq) for seq in range(1, 8)]
    stream, start = b"".join(sent), len(sent[0]) * 3
    losses: dict[bool, set[int]] = {True: set(), False: set()}
    for place in range(start, start + len(sent[3])):
        for value in (0x00, 0x01, 0x55, 0xFF):
            byte = stream[place]
            middle = {"flipped": bytes([value]), "dropped": b"", "inserted": bytes([value, byte])}
            damaged = stream[:place] + middle[fault] + stream[place + 1 :]
            if damaged == stream:
                continue
            got = FrameDecoder().feed(damaged)
            assert set(got) <= {pack_of(frame) for frame in sent}
            losses[byte == 0].add(len(sent) - len(got))
    assert max(losses[False]) == 1
    assert max(losses[True]) == (1 if fault == "inserted" else 2)


def pack_of(frame: bytes) -> bytes:
    payload: bytes = cobs.decode(frame[:-4])
    return payload


def test_one_byte_in_a_thousand_damaged_leaves_97_percent_of_the_frames():
    """20,000 frames of 23 bytes: 2.3 % are hit, and a hit costs one frame, rarely two."""
    random = np.random.default_rng(2)
    stream = np.frombuffer(b"".join(scan(seq) for seq in range(20_000)), np.uint8).copy()
    hit = random.random(len(stream)) < 1e-3
    stream[hit] ^= random.integers(1, 256, int(hit.sum()), np.uint8)
    got = FrameDecoder().feed(stream.tobytes())
    assert len(got) >= 0.97 * 20_000
    assert len(got) >= 20_000 - 2 * int(hit.sum())
