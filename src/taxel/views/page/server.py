"""Serve the operator's page: on this machine only unless told otherwise, by a token always.

`PageServer` runs in a thread; `run_page` blocks, for a process of its own, until SIGTERM, SIGINT
or SIGHUP. Knows nothing about sensors and models: a `StationLink` tells all.
"""

from __future__ import annotations

import asyncio
import logging
import signal
import socket
import threading
import time
from collections.abc import Callable
from types import FrameType, TracebackType
from typing import Self, cast

from taxel.errors import BadInput, MissingExtra
from taxel.views.page.link import StationLink

try:
    import uvicorn
    import websockets  # noqa: F401  # uvicorn's WebSockets need it, and say so only later
    from starlette.applications import Starlette
    from starlette.middleware import Middleware
    from starlette.requests import Request
    from starlette.responses import PlainTextResponse, Response
    from starlette.routing import Route, WebSocketRoute
except ModuleNotFoundError as error:
    raise MissingExtra(error.name or "starlette", "page", "the operator's page") from error

from taxel.views.page.assets import load_assets
from taxel.views.page.clients import Clients, Ledger
from taxel.views.page.connections import PATIENCE_S, Hall
from taxel.views.page.guard import Guard, Pass, cookie_name, is_loopback

LOOPBACK = "127.0.0.1"
_START_S = 10.0
_END_S = 5.0
_LARGEST_FRAME = 64 * 1024
"""Bytes; a longer WebSocket message ends the connection before it is held in memory."""
_LARGEST_TOKEN = 512
_BACKLOG = 1024
"""Connections that the system holds before this process takes them: above it, it drops what
would open one, and a browser tries again after a second only."""
_AT_ONCE = 16
"""Connections taken in one turn of the loop, so that what was sent on them is read in between.
Source: our choice, docs/decisions/0035."""
_ANY = ("0.0.0.0", "::")


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
        self._socket = _listen(host, port)
        try:
            self._port = int(self._socket.getsockname()[1])
            self._clients = Clients(link)
            self._hall = Hall(patience_s=PATIENCE_S)
            self._server = uvicorn.Server(_settings(self._application(), self._hall))
        except BaseException:
            self._socket.close()
            raise
        self._thread = threading.Thread(target=self._run, name="taxel page", daemon=True)
        self._server_error: BaseException | None = None

    @property
    def url(self) -> str:
        """The address to open; its part behind the # is the key, which no request line carries."""
        return f"{self.origin}/#{self._entry.token}"

    @property
    def origin(self) -> str:
        """The address without the key."""
        name = socket.gethostname() if self._host in _ANY else self._host
        return f"http://{f'[{name}]' if ':' in name else name}:{self._port}"

    @property
    def ledger(self) -> Ledger:
        """What the server did, counted since its start."""
        return self._clients.ledger

    @property
    def turned_out(self) -> int:
        """Connections that were closed since no request came on them, since the start."""
        return self._hall.turned_out

    @property
    def running(self) -> bool:
        """True from `start` to `stop`, unless the server failed."""
        return self._thread.is_alive()

    def start(self) -> Self:
        """Serve from now on; a server that runs already goes on.

        Raises:
            BadInput: The server did not come up within 10 s.
        """
        if self._thread.ident is not None:
            return self
        self._thread.start()
        until_s = time.monotonic() + _START_S
        while not self._server.started and self._thread.is_alive() and time.monotonic() < until_s:
            time.sleep(0.005)
        if self._server.started:
            self._socket.listen(_BACKLOG)  # asyncio made it as short as what is taken at once
        else:
            self.stop()
            raise BadInput(
                f"a page server on {self.origin}", repr(self._server_error), "try another port"
            )
        return self

    def stop(self) -> None:
        """End all connections and the thread; once is enough, more do no harm."""
        self._server.should_exit = True
        if self._thread.ident is not None:
            self._thread.join(_END_S)
            if self._thread.is_alive():
                self._server.force_exit = True
                self._thread.join(_END_S)
        self._socket.close()

    def __enter__(self) -> Self:
        return self.start()

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.stop()

    def _run(self) -> None:
        try:
            self._server.run(sockets=[self._socket])
        except BaseException as error:  # told by start(); nobody sees this thread
            self._server_error = error
            logging.getLogger("taxel.page").exception("the page's server failed")

    def _application(self) -> Starlette:
        assets = load_assets()
        port, entry = self._port, self._entry

        async def page(_: Request) -> Response:
            return Response(assets["page.html"].content, media_type=assets["page.html"].media_type)

        async def static(request: Request) -> Response:
            asset = assets.get(request.path_params["name"])
            if asset is None:
                return PlainTextResponse("not found\n", 404)
            return Response(asset.content, media_type=asset.media_type)

        async def enter(request: Request) -> Response:
            given = await _short_body(request)
            if given is None or not entry.admits(given):
                return PlainTextResponse("that is not the key.\n", 403)
            return Response(
                status_code=204, headers={"set-cookie": entry.set_cookie(cookie_name(port))}
            )

        async def session(_: Request) -> Response:
            return Response(status_code=204)  # the guard has seen the cookie

        routes = [
            Route("/", page),
            Route("/static/{name}", static),
            Route("/enter", enter, methods=["POST"]),
            Route("/session", session),
            WebSocketRoute("/live", self._clients.serve),
        ]
        names = ["localhost", LOOPBACK] if is_loopback(self._host) else []
        names += [socket.gethostname()] if self._host in _ANY else [self._host]
        guard = Middleware(
            Guard,
            entry=entry,
            names=names,
            port=port,
            any_address=self._host in _ANY,
            open_paths=frozenset(["/", "/enter", *(f"/static/{name}" for name in assets)]),
        )

        return Starlette(routes=routes, middleware=[guard])


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


def _listen(host: str, port: int) -> socket.socket:
    try:
        family = socket.AF_INET6 if ":" in host else socket.AF_INET
        listening = socket.socket(family, socket.SOCK_STREAM)
        try:
            listening.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            listening.bind((host, port))
            listening.listen(_BACKLOG)
        except BaseException:
            listening.close()
            raise
    except (OSError, OverflowError) as error:
        raise BadInput(
            "an address and a free port to serve the page on",
            f"{host}:{port}: {getattr(error, 'strerror', None) or error}",
            "choose another port, or 0 for a free one",
        ) from error
    return listening


def _settings(app: Starlette, hall: Hall) -> uvicorn.Config:
    return uvicorn.Config(
        app,
        loop="asyncio",
        http=cast(type[asyncio.Protocol], hall.protocol),
        ws="websockets-sansio",
        ws_max_size=_LARGEST_FRAME,
        ws_max_queue=4,
        ws_ping_interval=5.0,
        ws_ping_timeout=10.0,
        ws_per_message_deflate=False,
        lifespan="off",
        log_config=None,
        access_log=False,
        log_level="critical",
        server_header=False,
        date_header=False,
        proxy_headers=False,
        backlog=_AT_ONCE,
        timeout_keep_alive=5,
        timeout_graceful_shutdown=1,
    )


async def _short_body(request: Request) -> str | None:
    """Return a request's body as text; None where it is longer than any token."""
    body = b""
    async for part in request.stream():
        body += part
        if len(body) > _LARGEST_TOKEN:
            return None
    try:
        return body.decode("ascii")
    except UnicodeDecodeError:
        return None
