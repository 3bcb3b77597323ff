"""What unknown senders on a wire or a port cost: frames sent again, hellos, held connections.

Boards are emulated on simulated time; the page is a real server on this machine. Knows nothing
about cameras.
"""

from __future__ import annotations

import dataclasses
import http.client
import json
import socket
import time
from collections.abc import Collection
from contextlib import ExitStack
from typing import Any

from websockets.sync.client import connect
from websockets.typing import Origin

from taxel.bench.rows import Row, row
from taxel.sources.boards.emulation import EmulatedBoard
from taxel.sources.boards.port import Chunk
from taxel.sources.boards.stream import BoardStream
from taxel.views.page.server import PageServer, serve_page
from taxel.wire.framing import FrameDecoder, frame_of
from taxel.wire.messages import Hello, pack, unpack

_SCANS = 2000
_EVERY = 50
"""Scans between two foreign messages."""
_OPENS_S = 1.0
"""How soon the page is open, whoever holds connections, seconds. Source: issue of hostile input."""
_HALF = b"GET / HTTP/1.1\r\nHost: "


def stream_rows() -> list[Row]:
    """Measure all of them; a few seconds."""
    return [_sent_again(), _foreign_hello(), _held(64), _held(500)]


def _sent_again() -> Row:
    stream, sent, again = _greeted(EmulatedBoard()), [], 0
    board = EmulatedBoard()
    for number in range(_SCANS):
        sent.append(board.scan())
        frames = [sent[-1]]
        if number % _EVERY == _EVERY - 1:
            frames += sent[-_EVERY:]
            again += _EVERY
        stream.feed([Chunk(0.001 * number, b"".join(frames))])
    ledger = stream.ledger
    return row(
        "frames sent again byte for byte: counted as new scans", ledger.scans - _SCANS, "scans",
        "<=", 0, f"{again} of {_SCANS} scans sent twice; {ledger.reboots} reboots, "
        f"{ledger.lost} lost",
    )  # fmt: skip


def _foreign_hello() -> Row:
    board = EmulatedBoard()
    stream, count = _greeted(board), 0
    for number in range(_SCANS):
        frames = board.scan()
        if number % _EVERY == _EVERY - 1:
            frames += _changed_hello(board, count)
            count += 1
        stream.feed([Chunk(0.001 * number, frames)])
    ledger = stream.ledger
    return row(
        "a hello of another boot or board among the frames: scans lost", _SCANS - ledger.scans,
        "scans", "<=", 0, f"{count} hellos of four kinds among {_SCANS} scans; "
        f"{ledger.reboots} reboots, state {ledger.state}",
    )  # fmt: skip


def _greeted(board: EmulatedBoard) -> BoardStream:
    stream = BoardStream("emulated")
    stream.feed([Chunk(0.0, b"", opened=True), Chunk(0.0, board.hello())])
    stream.settle()
    return stream


def _changed_hello(board: EmulatedBoard, number: int) -> bytes:
    """Return a hello that is the board's own but for one thing."""
    (payload,) = FrameDecoder().feed(board.hello())
    own = unpack(payload)
    assert isinstance(own, Hello)
    changed: dict[str, Any] = (
        {"boot_id": 7}, {"channels": 7}, {"board_id": "another"}, {"rate_hz": 500},
    )[number % 4]  # fmt: skip
    return frame_of(pack(dataclasses.replace(own, **changed)))


class _Still:
    """A station in which nothing happens."""

    def snapshot(self) -> dict[str, Any]:
        return {"time_s": 1.0, "state": "STABLE"}

    def frame(self, camera: int) -> None:
        return None

    def traces(self, since_s: float) -> dict[str, Any]:
        return {"time_s": 1.0}

    def acknowledge(self, seen: Collection[int]) -> None:
        return None

    def disarm(self) -> None:
        return None

    def record(self, on: bool, labels: dict[str, str]) -> str:
        return ""


def _held(count: int) -> Row:
    with serve_page(_Still()) as server, ExitStack() as stack:
        port = int(server.origin.rpartition(":")[2])
        for number in range(count):
            line = stack.enter_context(socket.create_connection(("127.0.0.1", port)))
            line.sendall(_HALF if number % 2 else b"")
        took_s = _open_page(server, port)
        turned_out = server.turned_out
    return row(
        f"{count} connections held without a request: the page is open after", took_s, "s", "<=",
        _OPENS_S, f"half of them silent, half within a header; {turned_out} closed to make room; "
        "page, key, and the first push",
    )  # fmt: skip


def _open_page(server: PageServer, port: int) -> float:
    """Open the page as a browser does; return what that took, seconds."""
    began_s = time.monotonic()
    line = http.client.HTTPConnection("127.0.0.1", port, timeout=10)
    line.request("GET", "/")
    line.getresponse().read()
    line.request("POST", "/enter", server.url.partition("#")[2], {"Origin": server.origin})
    cookie = (line.getresponse().getheader("set-cookie") or "").partition(";")[0]
    line.close()
    address = server.origin.replace("http", "ws") + "/live"
    origin, headers = Origin(server.origin), {"Cookie": cookie}
    with connect(address, origin=origin, additional_headers=headers) as page:
        assert json.loads(page.recv(timeout=10))["number"] == 1
    return time.monotonic() - began_s
