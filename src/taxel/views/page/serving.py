"""A server in a thread of its own, and a site behind a key: what every page of taxel shares.

Connections are bounded (`connections`), requests checked (`guard`); nothing listens on another
address than this machine's own unless its caller says so. Knows nothing about what is served.
"""

from __future__ import annotations

import asyncio
import logging
import socket
import threading
import time
from collections.abc import Callable, Mapping, Sequence
from typing import cast

from taxel.errors import BadInput, MissingExtra

try:
    import uvicorn
    import websockets  # noqa: F401  # uvicorn's WebSockets need it, and say so only later
    from starlette.applications import Starlette
    from starlette.middleware import Middleware
    from starlette.requests import Request
    from starlette.responses import PlainTextResponse, Response
    from starlette.routing import BaseRoute, Route
    from starlette.types import ASGIApp
except ModuleNotFoundError as error:
    raise MissingExtra(error.name or "starlette", "page", "a page in the browser") from error

from taxel.views.page.assets import Asset
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


class Server:
    """An application served by a thread, from `start` to `stop`.

    Args:
        make: Gives the application, from the port that it is served on.
        host: Address to listen on.
        port: 0 takes a free one.

    Raises:
        BadInput: The address cannot be listened on.
    """

    def __init__(self, make: Callable[[int], ASGIApp], host: str = LOOPBACK, port: int = 0) -> None:
        self._host = host
        self._socket = _listen(host, port)
        try:
            self.port = int(self._socket.getsockname()[1])
            self._hall = Hall(patience_s=PATIENCE_S)
            self.uvicorn = uvicorn.Server(_settings(make(self.port), self._hall))
        except BaseException:
            self._socket.close()
            raise
        self._thread = threading.Thread(target=self._run, name="taxel server", daemon=True)
        self._error: BaseException | None = None
        self.loop: asyncio.AbstractEventLoop | None = None
        """The server's own, once it runs."""

    @property
    def place(self) -> str:
        """Host and port, as they stand in an address."""
        name = socket.gethostname() if self._host in _ANY else self._host
        return f"{f'[{name}]' if ':' in name else name}:{self.port}"

    @property
    def turned_out(self) -> int:
        """Connections that were closed since no request came on them, since the start."""
        return self._hall.turned_out

    @property
    def running(self) -> bool:
        """True from `start` to `stop`, unless the server failed."""
        return self._thread.is_alive()

    def start(self) -> None:
        """Serve from now on; a server that runs already goes on.

        Raises:
            BadInput: The server did not come up within 10 s.
        """
        if self._thread.ident is not None:
            return
        self._thread.start()
        until_s = time.monotonic() + _START_S
        while not self.uvicorn.started and self._thread.is_alive() and time.monotonic() < until_s:
            time.sleep(0.005)
        if self.uvicorn.started:
            self._socket.listen(_BACKLOG)  # asyncio made it as short as what is taken at once
        else:
            self.stop()
            raise BadInput(f"a server on {self.place}", repr(self._error), "try another port")

    def stop(self) -> None:
        """End all connections and the thread; once is enough, more do no harm."""
        self.uvicorn.should_exit = True
        if self._thread.ident is not None:
            self._thread.join(_END_S)
            if self._thread.is_alive():
                self.uvicorn.force_exit = True
                self._thread.join(_END_S)
        self._socket.close()

    def _run(self) -> None:
        async def serve() -> None:
            self.loop = asyncio.get_running_loop()
            await self.uvicorn.serve(sockets=[self._socket])

        try:
            asyncio.run(serve())
        except BaseException as error:  # raised by start(); nobody sees this thread
            self._error = error
            logging.getLogger("taxel.page").exception("the server failed")


def make_site(
    assets: Mapping[str, Asset],
    first: str,
    routes: Sequence[BaseRoute],
    entry: Pass,
    host: str,
    port: int,
) -> Starlette:
    """Return a site of which only the files are open; all else needs the key.

    Args:
        assets: Files by name, under /static.
        first: The file that / shows.
        routes: What else there is, for those who have the key.
        entry: The key, and the cookie that it is exchanged for.
        host: Where it is served.
        port: Where it is served.
    """

    async def page(_: Request) -> Response:
        return Response(assets[first].content, media_type=assets[first].media_type)

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

    open_routes = [
        Route("/", page),
        Route("/static/{name}", static),
        Route("/enter", enter, methods=["POST"]),
        Route("/session", session),
    ]
    guard = Middleware(
        Guard,
        entry=entry,
        names=host_names(host),
        port=port,
        any_address=host in _ANY,
        open_paths=frozenset(["/", "/enter", *(f"/static/{name}" for name in assets)]),
    )
    return Starlette(routes=[*open_routes, *routes], middleware=[guard])


def host_names(host: str) -> list[str]:
    """Return the names under which what listens on an address may be asked for."""
    names = ["localhost", LOOPBACK] if is_loopback(host) else []
    return names + ([socket.gethostname()] if host in _ANY else [host])


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
            "an address and a free port to listen on",
            f"{host}:{port}: {getattr(error, 'strerror', None) or error}",
            "choose another port, or 0 for a free one",
        ) from error
    return listening


def _settings(app: ASGIApp, hall: Hall) -> uvicorn.Config:
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
