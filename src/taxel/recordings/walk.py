"""Walk through the records of a recording, believing no length and no byte unchecked.

A clean file is walked from head to foot with every check sum it has: one a
chunk, one over all data, one over the summary. Recovery walks the same
records by itself (recovery.py). Knows nothing about scans or sensors.
"""

from __future__ import annotations

import io
import shlex
import struct
import zlib
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import BinaryIO

import lz4.frame
from mcap.data_stream import ReadDataStream
from mcap.opcode import Opcode
from mcap.records import Channel, Metadata

from taxel.errors import BadFile, BadRecording
from taxel.foreign.files import open_file
from taxel.recordings.footage_files import IMPORT_THEM, is_footage
from taxel.recordings.mcap_file import MAGIC, RECORD_HEAD

LARGEST_CHUNK = 32 * 1024 * 1024
"""Bytes; no chunk that taxel writes comes near, and no damaged length may cost more memory."""
LARGEST_METADATA = 4 * 1024 * 1024
"""Bytes of a metadata or channel record; a manifest of 10,000 channels has 0.3 MB."""
_BLOCK = 1024 * 1024
"""Bytes of other records that are held at a time."""
_CHUNK_HEAD = struct.Struct("<QQQII")
"""Start and end (ns), uncompressed size, CRC, length of the compression's name."""


_KEPT = {
    Opcode.CHUNK: LARGEST_CHUNK,
    Opcode.METADATA: LARGEST_METADATA,
    Opcode.CHANNEL: LARGEST_METADATA,
    Opcode.DATA_END: 4,
}
"""Records whose payload is held → bytes that it may have."""


class Damaged(ValueError):
    """A record whose bytes cannot be right."""


@dataclass(frozen=True, slots=True)
class Record:
    """One MCAP record."""

    opcode: int
    length: int
    """Bytes of its payload."""
    payload: bytes
    """Empty for kinds that no reader needs: only chunks, metadata and channels are held."""


def walk(path: Path) -> Iterator[Record]:
    """Yield the records of a finished recording in the order of the file.

    Chunks are yielded as they are; `open_chunk` checks and opens them. The
    check sums over the whole are verified when the walk arrives there.

    Raises:
        BadRecording: It is missing, no recording, cut short, or damaged.
    """
    try:
        with open_file(path) as file:
            yield from _records(file, path)
    except Damaged as error:
        raise damaged(path, str(error)) from error
    except BadFile as error:
        raise BadRecording("a recording's file", error.got, "name a recording (.mcap)") from error
    except OSError as error:
        raise BadRecording(
            "a recording that can be opened",
            f"{path}: {error.strerror or error}",
            "check the path",
        ) from error


def damaged(path: Path, what: str) -> BadRecording:
    """Return the error for a recording that only `taxel recover` can still read."""
    unfinished = path.name.endswith(".mcap.part") and not path.with_suffix("").exists()
    mended = path.with_suffix("") if unfinished else path.with_name(f"{path.stem}-recovered.mcap")
    return BadRecording(
        "a complete, undamaged recording",
        f"{path}: {what}",
        f"run: taxel recover {shlex.quote(str(path))} --output {shlex.quote(str(mended))}",
    )


def open_chunk(payload: bytes) -> bytes:
    """Return a chunk's content, whose CRC holds.

    Raises:
        Damaged: Any length or the CRC is wrong, or it is compressed in another way.
    """
    if len(payload) < _CHUNK_HEAD.size or len(payload) > LARGEST_CHUNK:
        raise Damaged("a chunk is cut short, or too large")
    _, _, size, crc, name_length = _CHUNK_HEAD.unpack_from(payload)
    at = _CHUNK_HEAD.size + name_length
    if at + 8 > len(payload) or size > LARGEST_CHUNK:
        raise Damaged("a chunk's head is wrong")
    name = payload[_CHUNK_HEAD.size : at]
    if int.from_bytes(payload[at : at + 8], "little") != len(payload) - at - 8:
        raise Damaged("a chunk's length is wrong")
    content = _decompress(name, payload[at + 8 :], size)
    if len(content) != size or zlib.crc32(content) != crc:
        raise Damaged("a chunk's check sum fails")
    return content


def parse_metadata(payload: bytes) -> tuple[str, dict[str, str]]:
    """Return a metadata record's name and pairs.

    Raises:
        Damaged: Its lengths or its text cannot be right.
    """
    try:
        record = Metadata.read(ReadDataStream(io.BytesIO(payload)))
    except Exception as error:  # mcap raises many kinds on damaged bytes
        raise Damaged("a metadata record is damaged") from error
    return record.name, record.metadata


def parse_channel(payload: bytes) -> Channel:
    """Return a channel record.

    Raises:
        Damaged: Its lengths or its text cannot be right.
    """
    try:
        channel: Channel = Channel.read(ReadDataStream(io.BytesIO(payload)))
    except Exception as error:  # mcap raises many kinds on damaged bytes
        raise Damaged("a channel record is damaged") from error
    return channel


def _records(file: BinaryIO, path: Path) -> Iterator[Record]:
    size = file.seek(0, io.SEEK_END)
    file.seek(0)
    if file.read(len(MAGIC)) != MAGIC:
        if is_footage(path):
            raise BadRecording("a recording (MCAP)", f"{path}, one video or image", IMPORT_THEM)
        raise BadRecording(
            "a recording (MCAP)", f"{path}, which is not one", "import tables with: taxel import"
        )
    crc, summary_crc, in_summary = zlib.crc32(MAGIC), 0, False
    while True:
        head, opcode, length = _read_head(file, size)
        if opcode == Opcode.FOOTER:
            _check_foot(file, summary_crc, head, file.read(length))
            return
        # What is passed over is read in blocks: only its check sum counts.
        parts = iter((file.read(length),)) if opcode in _KEPT else _blocks(file, length)
        if opcode == Opcode.DATA_END and not in_summary:
            in_summary, payload = True, b"".join(parts)
            if length != 4 or int.from_bytes(payload, "little") not in (0, crc):
                raise Damaged("the check sum of its data fails")
        elif in_summary:
            summary_crc = zlib.crc32(head, summary_crc)
            for payload in parts:
                summary_crc = zlib.crc32(payload, summary_crc)
        else:
            crc, payload = zlib.crc32(head, crc), b""
            for payload in parts:
                crc = zlib.crc32(payload, crc)
            yield Record(opcode, length, payload if opcode in _KEPT else b"")


def _read_head(file: BinaryIO, size: int) -> tuple[bytes, int, int]:
    """Return the next record's head, kind and length, which the file can hold."""
    head = file.read(RECORD_HEAD.size)
    if len(head) < RECORD_HEAD.size:
        raise Damaged("it ends before its end")
    opcode, length = RECORD_HEAD.unpack(head)
    if length > size - file.tell():
        raise Damaged("it is cut short or a length is wrong")
    if opcode == 0:
        raise Damaged("a record is of no kind")
    if (opcode in _KEPT or opcode == Opcode.FOOTER) and length > _KEPT.get(opcode, _BLOCK):
        raise Damaged(f"a record of {length:,} bytes is larger than such records are")
    return head, opcode, length


def _blocks(file: BinaryIO, length: int) -> Iterator[bytes]:
    while length > 0 and (block := file.read(min(_BLOCK, length))):
        length -= len(block)
        yield block


def _check_foot(file: BinaryIO, summary_crc: int, head: bytes, payload: bytes) -> None:
    if len(payload) != 20 or file.read(len(MAGIC) + 1) != MAGIC:
        raise Damaged("it does not end as a recording ends")
    crc = zlib.crc32(payload[:16], zlib.crc32(head, summary_crc))
    if int.from_bytes(payload[16:], "little") not in (0, crc):
        raise Damaged("the check sum of its summary fails")


def _decompress(name: bytes, content: bytes, size: int) -> bytes:
    if name == b"":
        return content
    if name != b"lz4":
        raise Damaged(f"a chunk is compressed by {name!r}, which taxel does not write")
    try:
        opened: bytes = lz4.frame.LZ4FrameDecompressor().decompress(content, max_length=size + 1)
    except (RuntimeError, EOFError, ValueError) as error:
        raise Damaged("a chunk cannot be decompressed") from error
    return opened
