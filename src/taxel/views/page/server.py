"""Serve the operator's page: on this machine only unless told otherwise, by a token always.

`PageServer` runs in a thread; `run_page` blocks, for a process of its own, until SIGTERM, SIGINT
or SIGHUP. Knows nothing about sensors and models: a `StationLink` knows all.
"""

from __future__ import annotations

import signal
import threading
from collections.abc import Callable
from types import FrameType
from typing import Self

from taxel.errors import BadInput
from taxel.views.page.link import StationLink
from taxel.views.page.serving import LOOPBACK, Server, make_site

# What needs the extra comes after the module above, which names it where it is missing.
from starlette.applications import Starlette  # isort: skip
from starlette.routing import WebSocketRoute  # isort: skip

from taxel.views.page.assets import load_assets
from taxel.views.page.clients import Clients, Ledger
from taxel.views.page.guard import Pass


class PageServer:
    """The page's server, in a thread from `start` to `stop`; use it in a `with` block.

    Args:
        link: The station that is shown.
        host: Address to listen on. Anything but this machine's own is the caller's decision,
            which the command line takes from an explicit flag.
        port: 0 takes a free one.
        token: Drawn at random unless given; there is no way to go without.

    Raises:
        BadInput: The token is too short, or the address cannot be listened on.
    """

    def __init__(
        self, link: StationLink, host: str = LOOPBACK, port: int = 0, token: str | None = None
    ) -> None:
        self._entry = Pass(token)
        self._host = host
        self._clients = Clients(link)
        self._server = Server(self._application, host, port)

    @property
    def url(self) -> str:
        """The address to open; its part behind the # is the key, which no request line carries."""
        return f"{self.origin}/#{self._entry.token}"

    @property
    def origin(self) -> str:
        """The address without the key."""
        return f"http://{self._server.place}"

    @property
    def ledger(self) -> Ledger:
        """What the server did, counted since its start."""
        return self._clients.ledger

    @property
    def turned_out(self) -> int:
        """Connections that were closed since no request came on them, since the start."""
        return self._server.turned_out

    @property
    def running(self) -> bool:
        """True from `start` to `stop`, unless the server failed."""
        return self._server.running

    def start(self) -> Self:
        """Serve from now on; a server that runs already goes on.

        Raises:
            BadInput: The server did not come up within 10 s.
        """
        self._server.start()
        return self

    def stop(self) -> None:
        """End all connections and the thread; once is enough, more do no harm."""
        self._server.stop()

    def __enter__(self) -> Self:
        return self.start()

    def __exit__(self, *_: object) -> None:
        self.stop()

    def _application(self, port: int) -> Starlette:
        routes = [WebSocketRoute("/live", self._clients.serve)]
        return make_site(load_assets(), "page.html", routes, self._entry, self._host, port)


def serve_page(
    link: StationLink, host: str = LOOPBACK, port: int = 0, token: str | None = None
) -> PageServer:
    """Return a running server of the page; `stop` it, or use it in a `with` block.

    Args and errors as for `PageServer`.
    """
    return PageServer(link, host, port, token).start()


def run_page(
    link: StationLink,
    host: str = LOOPBACK,
    port: int = 0,
    token: str | None = None,
    on_open: Callable[[str], None] = lambda _: None,
    stop: threading.Event | None = None,
) -> None:
    """Serve the page until SIGTERM, SIGINT, SIGHUP or `stop`; in the main thread of a process.

    Args:
        link: The station that is shown.
        host: As for `PageServer`.
        port: As for `PageServer`.
        token: As for `PageServer`.
        on_open: Called once with the address to open.
        stop: Ends it when set, besides the signals.

    Raises:
        BadInput: The address cannot be listened on, or the server ended by itself.
    """
    ended = stop or threading.Event()

    def end(_: int, __: FrameType | None) -> None:
        ended.set()

    signals = (signal.SIGTERM, signal.SIGINT, signal.SIGHUP)
    before = {number: signal.signal(number, end) for number in signals}
    try:
        with PageServer(link, host, port, token) as server:
            on_open(server.url)
            while not ended.wait(0.2):
                if not server.running:
                    raise BadInput("a page that is served", "a server that ended", "start it again")
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
