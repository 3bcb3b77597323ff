"""Claims about a port that nobody reads: what is dropped is counted, its changes are kept."""

import pytest

from taxel.clock import ManualClock
from taxel.sources.boards import port as ports
from taxel.sources.boards.port import Chunk, SerialPort


@pytest.fixture
def port(tmp_path, monkeypatch):
    """A port whose device is not there, so that only the test puts chunks."""
    monkeypatch.setattr(ports, "_KEPT_CHUNKS", 3)
    opened = SerialPort(str(tmp_path / "none"), 9600, ManualClock())
    yield opened
    opened.close()


def test_the_oldest_bytes_are_dropped_and_changes_of_the_port_are_kept(port):
    """Without them, bytes before and behind a break are read as a single stream."""
    for chunk in (Chunk(0.0, b"", opened=True), Chunk(1.0, b"a"), Chunk(2.0, b"", gone=True),
                  Chunk(3.0, b"", opened=True), Chunk(4.0, b"b"), Chunk(5.0, b"c")):  # fmt: skip
        port._put(chunk)

    taken = port.take()
    assert [(chunk.data, chunk.opened, chunk.gone) for chunk in taken if not chunk.data] == [
        (b"", True, False), (b"", False, True), (b"", True, False),
    ]  # fmt: skip
    assert (taken[-1].data, port.overrun) == (b"c", 2)
    assert port.take() == []
