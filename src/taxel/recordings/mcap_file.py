"""Append to an MCAP file, chunk by chunk, remembering 64 bytes a chunk and nothing a scan.

Every record is the `mcap` package's own; only the content of a chunk and its
message index come ready-made as numpy bytes. `mcap.writer.Writer` is not
used: it takes one call a message, keeps an object a chunk until the end, and
after a refusal of the disk it drops the chunk and goes on (docs/decisions/0004).
Knows nothing about sensors, scans or threads.
"""

from __future__ import annotations

import struct
import zlib
from array import array
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import BinaryIO

import lz4.frame
import numpy as np
from mcap.data_stream import RecordBuilder
from mcap.opcode import Opcode
from mcap.records import (
    Channel,
    Chunk,
    DataEnd,
    Footer,
    Header,
    McapRecord,
    Metadata,
    MetadataIndex,
    Schema,
    Statistics,
    SummaryOffset,
)
from numpy.typing import NDArray

MAGIC = b"\x89MCAP0\r\n"
"""The first and the last eight bytes of every MCAP file."""
PROFILE = "ros2"
"""What the header promises: every channel is CDR with a `ros2msg` schema. Source: MCAP's registry,
well-known profiles."""
COMPRESSION = "lz4"
"""Measured in docs/decisions/0004."""
RECORD_HEAD = struct.Struct("<BQ")
"""Opcode and length of what follows, before every MCAP record."""
_INDEX_HEAD = struct.Struct("<HI")
_AT_ONCE = 4096
"""Chunks whose summary is made at once. Our choice: a megabyte."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Messages:
    """Message records of one channel, in the order of the file."""

    channel: int
    content: bytes
    """The records' bytes, heads included."""
    log_ns: NDArray[np.uint64]
    """Shape (n,): each record's log time, wall nanoseconds."""
    offsets: NDArray[np.uint64]
    """Shape (n,): where each record starts within `content`, bytes."""


class McapFile:
    """An MCAP file that is being written; every call reaches the file before it returns.

    Args:
        file: Open for writing, unbuffered, at its beginning.
        library: What is said to have written the file.

    Raises:
        OSError: From every method, when the disk refuses.
    """

    def __init__(self, file: BinaryIO, library: str) -> None:
        self._file = file
        self._offset = 0
        self._data_crc = 0
        self._schemas: list[Schema] = []
        self._channels: list[Channel] = []
        self._metadata: list[MetadataIndex] = []
        self._chunks = array("Q")
        self._counts: list[int] = []
        self._start_ns: int | None = None
        self._end_ns = 0
        self._append(MAGIC + _bytes_of(Header(profile=PROFILE, library=library)))

    @property
    def size(self) -> int:
        """Bytes written so far."""
        return self._offset

    def add_metadata(self, name: str, pairs: Mapping[str, str]) -> None:
        """Append a metadata record."""
        content = _bytes_of(Metadata(name=name, metadata=dict(pairs)))
        self._metadata.append(MetadataIndex(offset=self._offset, length=len(content), name=name))
        self._append(content)

    def add_channel(
        self, topic: str, encoding: str, schema: Schema, pairs: Mapping[str, str] | None = None
    ) -> int:
        """Append a schema and a channel that uses it; return the channel's number, from 1.

        Chunks that are there already hold nothing of it.
        """
        fields = self._fields_a_chunk
        wider = array("Q")
        for at in range(0, len(self._chunks), fields):
            wider.extend(self._chunks[at : at + fields])
            wider.append(0)
        self._chunks = wider
        channel = Channel(
            id=len(self._channels) + 1,
            topic=topic,
            message_encoding=encoding,
            schema_id=schema.id,
            metadata=dict(pairs or {}),
        )
        self._schemas.append(schema)
        self._channels.append(channel)
        self._counts.append(0)
        self._append(_bytes_of(schema) + _bytes_of(channel))
        return channel.id

    def add_chunk(self, parts: Sequence[Messages]) -> None:
        """Append one chunk and its message index.

        Args:
            parts: At most one a channel, in the order of the channels, none empty.
        """
        content = b"".join(part.content for part in parts)
        start_ns = min(int(part.log_ns.min()) for part in parts)
        end_ns = max(int(part.log_ns.max()) for part in parts)
        compressed = lz4.frame.compress(content)
        chunk = _bytes_of(
            Chunk(
                compression=COMPRESSION,
                data=compressed,
                message_start_time=start_ns,
                message_end_time=end_ns,
                uncompressed_crc=zlib.crc32(content),
                uncompressed_size=len(content),
            )
        )
        counts = [0] * len(self._channels)
        for part in parts:
            counts[part.channel - 1] = len(part.log_ns)
        self._chunks.extend(
            (start_ns, end_ns, self._offset, len(chunk), len(compressed), len(content), *counts)
        )
        self._start_ns = start_ns if self._start_ns is None else min(self._start_ns, start_ns)
        self._end_ns = max(self._end_ns, end_ns)
        self._append(chunk + self._message_index(parts))

    def finish(self) -> None:
        """Append the summary and the footer; the file is complete after that."""
        self._append(_bytes_of(DataEnd(self._data_crc)))
        start = self._offset
        groups: list[tuple[Opcode, Sequence[McapRecord]]] = [
            (Opcode.SCHEMA, self._schemas),
            (Opcode.CHANNEL, self._channels),
            (Opcode.STATISTICS, [self._statistics()]),
            (Opcode.METADATA_INDEX, self._metadata),
        ]
        crc, offsets = 0, []
        for opcode, records in groups:
            content = b"".join(_bytes_of(record) for record in records)
            offsets.append(_summary_offset(opcode, self._offset, len(content)))
            crc = zlib.crc32(content, crc)
            self._append(content)
        group_start = self._offset
        for content in self._chunk_indices():
            crc = zlib.crc32(content, crc)
            self._append(content)
        offsets.append(_summary_offset(Opcode.CHUNK_INDEX, group_start, self._offset - group_start))
        offset_start = self._offset
        content = b"".join(map(_bytes_of, offsets))
        head = _bytes_of(Footer(start, offset_start, 0))[:-4]
        crc = zlib.crc32(head, zlib.crc32(content, crc))
        self._append(content + head + crc.to_bytes(4, "little") + MAGIC)

    def _append(self, content: bytes) -> None:
        """Write all of it; a raw file may take less than it is given."""
        rest = memoryview(content)
        while len(rest):
            rest = rest[self._file.write(rest) :]
        self._data_crc = zlib.crc32(content, self._data_crc)
        self._offset += len(content)

    def _message_index(self, parts: Sequence[Messages]) -> bytes:
        """Return the index records of a chunk, one a part."""
        content, base = b"", 0
        for part in parts:
            entries = np.empty((len(part.log_ns), 2), "<u8")
            entries[:, 0] = part.log_ns
            entries[:, 1] = part.offsets + np.uint64(base)
            base += len(part.content)
            length = _index_length(len(entries)) - RECORD_HEAD.size
            content += RECORD_HEAD.pack(Opcode.MESSAGE_INDEX, length)
            content += _INDEX_HEAD.pack(part.channel, entries.nbytes) + entries.tobytes()
            self._counts[part.channel - 1] += len(entries)
        return content

    def _chunk_indices(self) -> Iterator[bytes]:
        """Yield the summary's records of all chunks, thousands at a time: a day has a million, and
        whoever waits for a recording's end must not wait for each of them.
        """
        every = np.frombuffer(self._chunks, np.uint64).reshape(-1, self._fields_a_chunk)
        for first in range(0, len(every), _AT_ONCE):
            yield _chunk_index_bytes(every[first : first + _AT_ONCE].astype(np.int64))

    @property
    def _fields_a_chunk(self) -> int:
        return 6 + len(self._channels)

    def _statistics(self) -> Statistics:
        return Statistics(
            attachment_count=0,
            channel_count=len(self._channels),
            channel_message_counts=dict(enumerate(self._counts, start=1)),
            chunk_count=len(self._chunks) // self._fields_a_chunk,
            message_count=sum(self._counts),
            message_end_time=self._end_ns,
            message_start_time=self._start_ns or 0,
            metadata_count=len(self._metadata),
            schema_count=len(self._schemas),
        )


def _summary_offset(opcode: Opcode, start: int, length: int) -> SummaryOffset:
    return SummaryOffset(group_opcode=opcode, group_start=start, group_length=length)


def _index_length(messages: int) -> int:
    """Return the bytes of a message index record."""
    return RECORD_HEAD.size + _INDEX_HEAD.size + 16 * messages


def _chunk_index_bytes(chunks: NDArray[np.int64]) -> bytes:
    """Return chunk index records, one a chunk: what `mcap.records.ChunkIndex` writes.

    Args:
        chunks: Shape (n, 6 + channels): first and last log time, place, length, compressed and
            whole size, then the messages of each channel.
    """
    start_ns, end_ns, place, length, compressed, size = chunks[:, :6].T
    counts = chunks[:, 6:]
    held = counts > 0
    lengths = np.where(held, _index_length(0) + 16 * counts, 0)
    after = (place + length)[:, None] + np.cumsum(lengths, axis=1)
    pairs = [("channel", "<u2"), ("at", "<u8")]
    records = np.zeros(
        len(chunks),
        [
            ("opcode", "u1"), ("bytes", "<u8"), ("start_ns", "<u8"), ("end_ns", "<u8"),
            ("place", "<u8"), ("length", "<u8"), ("map_bytes", "<u4"),
            ("map", pairs, (counts.shape[1],)), ("indices", "<u8"), ("letters", "<u4"),
            ("compression", f"S{len(COMPRESSION)}"), ("compressed", "<u8"), ("size", "<u8"),
        ],
    )  # fmt: skip
    pair = records["map"].dtype.itemsize
    left_out = pair * (~held).sum(axis=1)
    records["opcode"] = int(Opcode.CHUNK_INDEX)
    records["bytes"] = records.itemsize - RECORD_HEAD.size - left_out
    records["start_ns"], records["end_ns"] = start_ns, end_ns
    records["place"], records["length"] = place, length
    records["map_bytes"] = pair * held.sum(axis=1)
    records["map"]["channel"] = np.arange(1, counts.shape[1] + 1)
    records["map"]["at"] = after - lengths
    records["indices"] = lengths.sum(axis=1)
    records["letters"], records["compression"] = len(COMPRESSION), COMPRESSION.encode()
    records["compressed"], records["size"] = compressed, size
    kept = np.ones((len(chunks), records.itemsize), bool)
    fields = records.dtype.fields
    assert fields is not None
    first = fields["map"][1]
    kept[:, first : first + pair * counts.shape[1]] = np.repeat(held, pair, axis=1)
    return bytes(records.view(np.uint8).reshape(kept.shape)[kept])


def _bytes_of(record: McapRecord) -> bytes:
    builder = RecordBuilder()
    record.write(builder)
    content: bytes = builder.end()  # type: ignore[no-untyped-call]
    return content
