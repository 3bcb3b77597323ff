"""Claims about WAV files: the right values of every coding, and one plain line for bad files."""

import struct
import wave

import numpy as np
import pytest
from scipy.io import wavfile

from taxel.errors import BadFile
from taxel.foreign.wav_file import read_wav, read_wav_head

RATE_HZ = 8000
RAMP = np.linspace(-1.0, 0.9, 12).reshape(6, 2)
"""Two channels, within full scale."""


def head(kind=1, channels=1, rate_hz=RATE_HZ, row_bytes=2, bits=16, extra=b"") -> bytes:
    """Return a format chunk."""
    body = struct.pack("<HHIIHH", kind, channels, rate_hz, rate_hz * row_bytes, row_bytes, bits)
    return b"fmt " + struct.pack("<I", len(body + extra)) + body + extra


def riff(*chunks: bytes) -> bytes:
    """Return a WAV file of these chunks."""
    body = b"WAVE" + b"".join(chunks)
    return b"RIFF" + struct.pack("<I", len(body)) + body


def data(content: bytes = bytes(8), size: int | None = None) -> bytes:
    """Return a chunk of values that states its own size or another."""
    return b"data" + struct.pack("<I", len(content) if size is None else size) + content


def whole(path, most=1000):
    """Return all of a file's values."""
    found = read_wav_head(path)
    return read_wav(path, range(found.channels), most)[1]


@pytest.mark.parametrize("kind", ["u1", "i2", "i4", "f4", "f8"])
@pytest.mark.parametrize("channels", [1, 2])
def test_values_are_shares_of_full_scale(tmp_path, kind, channels):
    """Of integers; floats stay as they stand, also beyond 1. Written by SciPy."""
    scale = {"u1": 2**7, "i2": 2**15, "i4": 2**31}.get(kind, 1)
    wanted = RAMP[:, :channels] * (1 if scale > 1 else 3)
    raw = np.round(wanted * scale) + (128 if kind == "u1" else 0) if scale > 1 else wanted
    wavfile.write(tmp_path / "a.wav", RATE_HZ, raw.astype(kind))

    found, values = read_wav(tmp_path / "a.wav", range(channels), 1000)

    np.testing.assert_allclose(values, wanted, atol=1 / scale if scale > 1 else 1e-6)
    assert values.min() == (-1.0 if scale > 1 else np.array(-3.0, kind))
    assert (found.rate_hz, found.channels, found.rows) == (RATE_HZ, channels, 6)


def test_24_bits_are_read_with_their_sign(tmp_path):
    """As the standard library writes them."""
    raw = [0, 1, -1, 2**23 - 1, -(2**23), 0x123456]
    with wave.open(str(tmp_path / "a.wav"), "wb") as file:
        file.setparams((2, 3, RATE_HZ, 3, "NONE", ""))
        file.writeframes(b"".join(number.to_bytes(3, "little", signed=True) for number in raw))

    np.testing.assert_array_equal(whole(tmp_path / "a.wav"), np.reshape(raw, (3, 2)) / 2**23)


def test_an_extensible_head_and_other_chunks_are_passed_over(tmp_path):
    """Recorders of many channels and of 24 bits write such heads."""
    guid = b"\3\0" + bytes.fromhex("000000001000800000aa00389b71")
    form = head(0xFFFE, 1, RATE_HZ, 4, 32, struct.pack("<HHI", 22, 32, 4) + guid)
    values = np.array([0.5, -2.0], "<f4")
    odd = b"LIST" + struct.pack("<I", 3) + b"abc\0"  # padded to an even length
    (tmp_path / "a.wav").write_bytes(riff(odd, form, odd, data(values.tobytes()), b"id3 tags"))

    np.testing.assert_array_equal(whole(tmp_path / "a.wav"), [[0.5], [-2.0]])


def test_channels_come_in_the_wanted_order_block_by_block(tmp_path, monkeypatch):
    """However few bytes are read at once."""
    monkeypatch.setattr("taxel.foreign.wav_file._BLOCK_BYTES", 10)
    raw = np.arange(21, dtype=np.int16).reshape(7, 3)
    wavfile.write(tmp_path / "a.wav", RATE_HZ, raw)

    values = read_wav(tmp_path / "a.wav", (2, 0), 1000)[1]

    np.testing.assert_array_equal(values, raw[:, [2, 0]] / 2**15)


@pytest.mark.parametrize(
    ("content", "words"),
    [
        (b"", r"a WAV file \(RIFF\); got an empty file"),
        (b"t,a,b\n1,2,3\n" * 9, "contents that are none"),
        (b"RF64" + bytes(4) + b"WAVE", "its relative RF64"),
        (riff(), "a WAV file with values; got none"),
        (riff(head()), "a WAV file with values; got none"),
        (riff(data()), "a format before its values"),
        (riff(head()[:14]), "16 bytes or more"),
        (riff(head(2), data()), "the coding ADPCM; write it again, as with ffmpeg"),
        (riff(head(6), data()), "the coding A-law"),
        (riff(head(0x55), data()), "the coding MP3"),
        (riff(head(0x1234), data()), "the coding number 4660"),
        (riff(head(0xFFFE), data()), "the coding number 65534"),
        (riff(head(channels=0), data()), "got 0 channels"),
        (riff(head(rate_hz=0), data()), "got 1 channels, 0 Hz"),
        (riff(head(bits=12), data()), "8, 16, 24 or 32 bits an integer; got 12"),
        (riff(head(3), data()), "32 or 64 bits a float; got 16"),
        (riff(head(row_bytes=4), data()), "2 bytes a row .*; got 4 by its head"),
        (riff(head(), data(bytes(7))), "whole rows of 2 bytes; got 7"),
        (riff(head(), data(bytes(8), 4_000_000_000)), "got 8 where its head says 4,000,000,000"),
        (riff(head(), data(bytes(8), 0)), "none, as where a recorder was interrupted"),
        (riff(head(), data(bytes(8), 2**32 - 1)), "none, as where a recorder was interrupted"),
        (riff(head(), b"LIST" + struct.pack("<I", 2**32 - 1)), "a WAV file with values; got none"),
        (riff(head(), data(bytes(2002))), "at most 1,000 values; got 1,001"),
    ],
)  # fmt: skip
def test_a_bad_file_is_refused_in_one_line(tmp_path, content, words):
    """Before any value is read, with what it is and how to mend it."""
    (tmp_path / "a.wav").write_bytes(content)

    with pytest.raises(BadFile, match=words) as caught:
        whole(tmp_path / "a.wav")

    assert "\n" not in str(caught.value)


def test_endless_chunks_end(tmp_path, monkeypatch):
    """A head that never comes to its values is given up."""
    monkeypatch.setattr("taxel.foreign.wav_file._MOST_CHUNKS", 5)
    (tmp_path / "a.wav").write_bytes(riff(*[b"junk" + bytes(4)] * 5, head(), data()))

    with pytest.raises(BadFile, match="none in its first 5 parts"):
        read_wav_head(tmp_path / "a.wav")


def test_a_channel_that_is_not_there_is_refused(tmp_path):
    """Never another one in its place."""
    (tmp_path / "a.wav").write_bytes(riff(head(), data()))

    for channel in (-1, 1):
        with pytest.raises(BadFile, match="channels from 1 to 1"):
            read_wav(tmp_path / "a.wav", (channel,), 1000)
