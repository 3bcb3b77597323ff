"""The summary of a long recording: as mcap writes it, and written in few pieces (0004)."""

import io

import numpy as np
import pytest
from mcap.reader import make_reader
from mcap.records import ChunkIndex, Schema

from taxel.recordings import mcap_file
from taxel.recordings.mcap_file import McapFile, Messages


class CountedFile(io.BytesIO):
    """A file in memory that counts how often it was written to."""

    writes = 0

    def write(self, content: bytes) -> int:  # type: ignore[override]
        self.writes += 1
        return super().write(content)


def recorded(chunks: int, channels: int = 3) -> tuple[CountedFile, McapFile]:
    """Chunks in which one channel or another holds nothing, now and then."""
    raw = CountedFile()
    file = McapFile(raw, "test")
    for number in range(1, channels + 1):
        schema = Schema(id=number, name="taxel", encoding="ros2msg", data=b"")
        file.add_channel(f"/{number}", "cdr", schema)
    for number in range(chunks):
        held = [c for c in range(1, channels + 1) if (number + c) % channels]
        parts = [
            Messages(
                channel=channel, content=bytes([channel]) * (8 + number % 5),
                log_ns=np.full(1 + channel, 10**18 + number, np.uint64),
                offsets=np.arange(1 + channel, dtype=np.uint64),
            )
            for channel in held
        ]  # fmt: skip
        file.add_chunk(parts)
    return raw, file


def test_each_chunk_is_indexed_as_mcap_itself_would(monkeypatch: pytest.MonkeyPatch) -> None:
    """Also across the border of two pieces, and where a chunk has nothing of a channel."""
    monkeypatch.setattr(mcap_file, "_AT_ONCE", 4)
    raw, file = recorded(chunks=11)
    file.finish()
    raw.seek(0)
    summary = make_reader(raw, validate_crcs=True).get_summary()
    assert summary is not None
    content = raw.getvalue()
    assert len(summary.chunk_indexes) == 11
    for number, index in enumerate(summary.chunk_indexes):
        held = [c for c in (1, 2, 3) if (number + c) % 3]
        assert list(index.message_index_offsets) == held
        for channel, at in index.message_index_offsets.items():
            assert content[at] == 0x07  # a message index ...
            assert int.from_bytes(content[at + 9 : at + 11], "little") == channel  # ... of it
        assert content[index.chunk_start_offset] == 0x06
        last = max(index.message_index_offsets.values())
        end = last + 9 + int.from_bytes(content[last + 1 : last + 9], "little")
        start = index.chunk_start_offset + index.chunk_length
        assert index.message_index_length == end - start
        assert mcap_file._bytes_of(ChunkIndex(**vars(index))) in content


def test_the_summary_of_many_chunks_takes_few_writes() -> None:
    """A day of scans has 1.7 million chunks: one write each took longer than a station waits."""
    raw, file = recorded(chunks=500)
    before = raw.writes
    file.finish()
    assert raw.writes - before < 20
