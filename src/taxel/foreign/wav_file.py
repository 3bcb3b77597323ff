"""Read a WAV file: uncompressed integers of 8 to 32 bits, or floats.

The head is read here, in a few lines, and refused where it contradicts the file's size; values are
read block by block, those of the wanted channels only. Knows nothing about what the values mean.

Background of our choices: docs/decisions/0033.
"""

from __future__ import annotations

import os
import struct
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import BinaryIO

import numpy as np
from numpy.typing import NDArray

from taxel.errors import BadFile
from taxel.foreign.files import MIB, open_file, size_of
from taxel.plain_text import number_of

WAV_ENDING = ".wav"
"""Of the names of WAV files, in capitals or not."""
_MOST_CHUNKS = 10_000
"""That are passed over before the values. Source: our choice."""
_BLOCK_BYTES = 8 * MIB
_PCM, _FLOAT, _EXTENSIBLE = 1, 3, 0xFFFE
_SUBTYPE = b"\0\0\0\0\x10\0\x80\0\0\xaa\0\x38\x9b\x71"
"""What follows the coding's number in an extensible head (KSDATAFORMAT_SUBTYPE). Source:
Microsoft, WAVEFORMATEXTENSIBLE."""
_CODECS = {2: "ADPCM", 6: "A-law", 7: "µ-law", 0x11: "ADPCM", 0x31: "GSM", 0x50: "MPEG audio",
           0x55: "MP3", 0xFF: "AAC"}  # fmt: skip
"""Compressed codings that are named; others by their number. Source: RFC 2361."""
_UNKNOWN_SIZES = (0, 0xFFFFFFFF)
"""What a recorder writes as the size of its values while it does not know it yet."""
_AGAIN = "write it again, as with ffmpeg -i FILE -c:a pcm_s16le NEW.wav"


@dataclass(frozen=True, slots=True, kw_only=True)
class WavHead:
    """What the head of a WAV file says, held against the file's size."""

    rate_hz: int
    """Values of each channel a second, hertz."""
    channels: int
    rows: int
    bits: int
    """Of each value: 8, 16, 24 or 32; of floats 32 or 64."""
    is_float: bool
    start: int
    """Where the values begin, bytes from the file's start."""

    @property
    def row_bytes(self) -> int:
        """Bytes of one value of each channel."""
        return self.channels * self.bits // 8

    @property
    def rails(self) -> tuple[float, float] | None:
        """Lowest and highest value that its integers can hold, shares of full scale; None of floats
        have such ends.
        """
        return None if self.is_float else (-1.0, 1.0 - 2.0 ** (1 - self.bits))

    def __str__(self) -> str:
        coding = f"{self.bits}-bit {'floats' if self.is_float else 'integers'}"
        return (f"{number_of(self.channels, 'channel')} of {number_of(self.rows, 'value', ',')}, "
                f"{coding}, {self.rate_hz:,} a second")  # fmt: skip


def read_wav_head(path: Path) -> WavHead:
    """Return what a WAV file's head says.

    Raises:
        BadFile: It is none, compressed, cut short, or its head contradicts itself or the file.
        OSError: It is not there, or may not be read.
    """
    with open_file(path) as file:
        return _head(file)


def read_wav(path: Path, wanted: Sequence[int], most: int) -> tuple[WavHead, NDArray[np.float64]]:
    """Return the values of some channels, integers as shares of full scale.

    Args:
        path: The file.
        wanted: Channels, from 0, in the order of the result.
        most: Values that may be taken.

    Returns:
        The head, and values of shape (rows, wanted). Integers of n bits are divided by 2^(n-1),
        after 128 is subtracted from those of 8 bits, so that they lie from -1 to below 1; floats
        are returned as they stand.

    Raises:
        BadFile: As `read_wav_head`; or it has not all of these channels, or too many values.
        OSError: It is not there, or may not be read.
    """
    with open_file(path) as file:
        head = _head(file)
        if any(not 0 <= channel < head.channels for channel in wanted):
            raise BadFile(f"channels from 1 to {head.channels}", f"{max(wanted) + 1}", "correct it")
        if head.rows * len(wanted) > most:
            raise BadFile(f"at most {most:,} values", f"{head.rows * len(wanted):,}",
                          "cut it into several, or take fewer channels")  # fmt: skip
        values = np.empty((head.rows, len(wanted)))
        step = max(1, _BLOCK_BYTES // head.row_bytes)
        file.seek(head.start)
        for row in range(0, head.rows, step):
            count = min(step, head.rows - row)
            content = file.read(count * head.row_bytes)
            if len(content) != count * head.row_bytes:  # it shrank meanwhile
                raise _cut_short("fewer")
            values[row : row + count] = _decoded(content, head)[:, list(wanted)]
        return head, values


def _decoded(content: bytes, head: WavHead) -> NDArray[np.float64]:
    """Return rows of all channels, shape (rows, channels), integers as shares of full scale."""
    shape = (-1, head.channels)
    if head.is_float:
        return np.frombuffer(content, f"<f{head.bits // 8}").reshape(shape).astype(np.float64)
    if head.bits == 8:  # the only one without a sign
        return (np.frombuffer(content, np.uint8).reshape(shape).astype(np.float64) - 128) / 128
    if head.bits == 24:  # as the upper three bytes of four
        wide = np.zeros((len(content) // 3, 4), np.uint8)
        wide[:, 1:] = np.frombuffer(content, np.uint8).reshape(-1, 3)
        return wide.view("<i4").reshape(shape) / 2.0**31
    return np.frombuffer(content, f"<i{head.bits // 8}").reshape(shape) / 2.0 ** (head.bits - 1)


def _head(file: BinaryIO) -> WavHead:
    size = size_of(file)
    top = file.read(12)
    if not (top[:4] == b"RIFF" and top[8:] == b"WAVE"):
        raise BadFile("a WAV file (RIFF)", _other_kind(top), _AGAIN)
    coding: tuple[int, int, int, bool] | None = None
    for _ in range(_MOST_CHUNKS):
        name, length = _chunk(file)
        start = file.tell()
        if name == b"data":
            if coding is None:
                raise BadFile("a WAV file with a format before its values", "one without", _AGAIN)
            return _held(coding, start, length, size)
        if name == b"fmt " and coding is None:
            coding = _coding(file.read(min(length, 40)))
        file.seek(start + length + length % 2)
    raise BadFile("a WAV file with values", f"none in its first {_MOST_CHUNKS:,} parts", _AGAIN)


def _chunk(file: BinaryIO) -> tuple[bytes, int]:
    """Return the next chunk's name and length, bytes."""
    top = file.read(8)
    if len(top) < 8:
        raise BadFile("a WAV file with values", "none: it is empty, or cut short", "copy it again")
    return top[:4], int.from_bytes(top[4:], "little")


def _coding(content: bytes) -> tuple[int, int, int, bool]:
    """Return a format's channels, rate, bits, and whether values are floats."""
    if len(content) < 16:
        raise BadFile("a format of 16 bytes or more", number_of(len(content), "byte"), _AGAIN)
    kind, channels, rate_hz, _, row_bytes, bits = struct.unpack_from("<HHIIHH", content)
    if kind == _EXTENSIBLE and len(content) >= 40 and content[26:40] == _SUBTYPE:
        (kind,) = struct.unpack_from("<H", content, 24)
    if kind not in (_PCM, _FLOAT):
        raise BadFile(
            "a WAV file of uncompressed integers or floats",
            f"the coding {_CODECS.get(kind, f'number {kind}')}", _AGAIN,
        )  # fmt: skip
    is_float = kind == _FLOAT
    if bits not in ((32, 64) if is_float else (8, 16, 24, 32)):
        raise BadFile("32 or 64 bits a float" if is_float else "8, 16, 24 or 32 bits an integer",
                      f"{bits}", _AGAIN)  # fmt: skip
    if not channels or not rate_hz:
        raise BadFile("a channel and a rate at least", f"{channels} channels, {rate_hz} Hz", _AGAIN)
    if row_bytes != channels * bits // 8:
        raise BadFile(f"{channels * bits // 8} bytes a row by its channels and bits",
                      f"{row_bytes} by its head", _AGAIN)  # fmt: skip
    return channels, rate_hz, bits, is_float


def _held(coding: tuple[int, int, int, bool], start: int, length: int, size: int) -> WavHead:
    """Return the head of values that are as many as it says."""
    channels, rate_hz, bits, is_float = coding
    if length in _UNKNOWN_SIZES and size > start:
        raise BadFile(
            "the size of its values in the head", "none, as where a recorder was interrupted",
            _AGAIN,
        )  # fmt: skip
    if length > size - start:
        raise _cut_short(f"{size - start:,} where its head says {length:,}")
    row_bytes = channels * bits // 8
    if length % row_bytes:
        raise BadFile(f"whole rows of {number_of(row_bytes, 'byte')}",
                      f"{length:,} bytes of values", "copy it again")  # fmt: skip
    return WavHead(rate_hz=rate_hz, channels=channels, rows=length // row_bytes, bits=bits,
                   is_float=is_float, start=start)  # fmt: skip


def _cut_short(got: str) -> BadFile:
    return BadFile(
        "as many bytes of values as its head says", got, "copy it again: it is cut short"
    )


def _other_kind(top: bytes) -> str:
    if top[:4] in (b"RF64", b"BW64", b"RIFX", b"riff"):
        return f"its relative {os.fsdecode(top[:4])}"
    return "an empty file" if not top else "contents that are none"
