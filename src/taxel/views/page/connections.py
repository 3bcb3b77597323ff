"""Connections that hold on and send nothing: each has a deadline, and a newcomer always gets in.

uvicorn waits for a request's headers without end, and counts whoever waits against its limit:
64 silent sockets would keep everybody else out. So each connection stands in a hall before
uvicorn's own protocol. The hall has a bound, and makes room for a newcomer by closing the
connection that has owed a request for longest. Knows nothing about what is served.

Source: docs/decisions/0035.
"""

from __future__ import annotations

import asyncio
from collections import Counter
from typing import Any

import h11
from uvicorn.config import Config
from uvicorn.protocols.http.h11_impl import H11Protocol
from uvicorn.server import ServerState

MOST_CONNECTIONS = 64
"""HTTP connections held at once; open pages (WebSockets) are counted by `Clients`.
Source: our choice, docs/decisions/0035."""
PATIENCE_S = 10.0
"""A connection is closed so long after it was opened, or after its last complete request,
seconds: long enough for a slow network to take the largest answer. Source: as above."""
GRACE_S = 0.1
"""Nobody is closed for a newcomer's sake sooner than this after coming in, seconds: time enough to
send a request, also where thousands a second come. Source: as above."""
MOST_EVER = 512
"""HTTP connections held at once in a flood of newcomers; then the grace is over. Source: half of
the descriptors that a process usually has."""
_FLUSH_S = 1.0
"""What a closing connection may still take to be read to its end, seconds. Our choice."""


class Hall:
    """All HTTP connections of one server: about `most` of them, and never above `MOST_EVER`.

    Args:
        most: Connections held at once.
        patience_s: How long one is held without a complete request, seconds.
    """

    def __init__(self, most: int = MOST_CONNECTIONS, patience_s: float = PATIENCE_S) -> None:
        self.patience_s = patience_s
        self.turned_out = 0
        """Connections that were closed since they owed a request for too long."""
        self._most = most
        self._held: dict[Connection, None] = {}  # the longest without a request first
        self._held_by: Counter[str] = Counter()

    def protocol(
        self,
        config: Config,
        server_state: ServerState,
        app_state: dict[str, Any],
        _loop: asyncio.AbstractEventLoop | None = None,
    ) -> asyncio.Protocol:
        """Return the protocol of a new connection; uvicorn calls this as a class."""
        inner = H11Protocol(
            config=config, server_state=server_state, app_state=app_state, _loop=_loop
        )
        return Connection(self, inner)

    def enter(self, connection: Connection) -> None:
        """Take in a connection, and close others where there is no room."""
        self._held[connection] = None
        self._held_by[connection.peer] += 1
        while len(self._held) > self._most:
            first = self._first_to_go()
            if connection.since_s - first.since_s < GRACE_S and len(self._held) <= MOST_EVER:
                return
            self.turn_out(first)

    def heard(self, connection: Connection) -> None:
        """Put a connection whose request is complete behind all others."""
        del self._held[connection]
        self._held[connection] = None

    def leave(self, connection: Connection) -> None:
        """Forget a connection that is lost, or has become a page; once is enough."""
        if connection in self._held:
            del self._held[connection]
            self._held_by[connection.peer] -= 1
            self._held_by += Counter()  # drops addresses that hold none

    def turn_out(self, connection: Connection) -> None:
        """Close a connection, whatever of its answer was not read."""
        self.turned_out += 1
        self.leave(connection)
        connection.abort()

    def _first_to_go(self) -> Connection:
        """Return, of the address that holds most, who owes a request for longest."""
        ((peer, _),) = self._held_by.most_common(1)
        theirs = [held for held in self._held if held.peer == peer]
        return next((held for held in theirs if held.owes), theirs[0])


class Connection(asyncio.Protocol):
    """One connection: hands all to uvicorn's protocol, and keeps the time.

    Args:
        hall: Where it stands.
        inner: uvicorn's protocol, which hands a WebSocket's connection on by itself.
    """

    def __init__(self, hall: Hall, inner: H11Protocol) -> None:
        self.peer = ""
        """The address at the other end, without its port."""
        self.since_s = 0.0
        """When it was opened or its last request was complete, on the loop's clock, seconds."""
        self._hall = hall
        self._inner = inner
        self._loop = asyncio.get_running_loop()

    @property
    def owes(self) -> bool:
        """True while the other end has not sent the whole of its next request."""
        return self._inner.conn.their_state in (h11.IDLE, h11.SEND_BODY)

    def abort(self) -> None:
        """Close it at once."""
        self._transport.abort()

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        """Note who came, and give it little time to ask."""
        assert isinstance(transport, asyncio.Transport)
        self._transport = transport
        self.since_s = self._loop.time()
        peer = transport.get_extra_info("peername")
        self.peer = str(peer[0]) if peer else ""
        self._inner.connection_made(transport)
        self._hall.enter(self)
        self._look_at(self.since_s + self._hall.patience_s)

    def data_received(self, data: bytes) -> None:
        """Hand the bytes on, and note that it speaks."""
        self._inner.data_received(data)
        if self._is_page:
            self._hall.leave(self)
        elif not self.owes and not self._transport.is_closing():
            self.since_s = self._loop.time()
            self._hall.heard(self)

    def eof_received(self) -> None:
        """Hand on that nothing more comes."""
        self._inner.eof_received()

    def pause_writing(self) -> None:
        """Hand on that its buffer is full."""
        self._inner.pause_writing()

    def resume_writing(self) -> None:
        """Hand on that its buffer has room again."""
        self._inner.resume_writing()

    def connection_lost(self, exc: Exception | None) -> None:
        """Forget it."""
        self._timer.cancel()
        self._hall.leave(self)
        self._inner.connection_lost(exc)

    @property
    def _is_page(self) -> bool:
        return self._transport.get_protocol() is not self

    def _look_at(self, time_s: float) -> None:
        self._timer = self._loop.call_at(time_s, self._look)

    def _look(self) -> None:
        """Close what owes for too long, and what was closed and is not read to its end."""
        now_s = self._loop.time()
        if self._transport.is_closing():
            self._timer = self._loop.call_at(now_s + _FLUSH_S, self._transport.abort)
        elif self._is_page:  # pings close it where nobody answers: look again then
            self._look_at(now_s + self._hall.patience_s)
        elif now_s >= self.since_s + self._hall.patience_s:
            self._hall.turn_out(self)
        else:
            self._look_at(self.since_s + self._hall.patience_s)
