"""Who may see the page: Host, Origin, token and cookie checks, and the headers of every answer.

A page of another site that a browser has open must not reach the station (Origin), nor by a name
that it points at this machine (Host); a program of another user must not either (token). Knows
nothing about what is served.
"""

from __future__ import annotations

import hmac
import ipaddress
import secrets
from collections.abc import Iterable, MutableMapping
from http.cookies import CookieError, SimpleCookie
from typing import Any

from starlette.datastructures import Headers, MutableHeaders
from starlette.responses import PlainTextResponse
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from taxel.errors import BadInput
from taxel.foreign.addresses import bracketed
from taxel.plain_text import number_of

LEAST_TOKEN = 16
"""Characters of a token that is given instead of drawn."""
_USUAL_PORT = 80
"""Browsers leave it out of Host and Origin."""
HEADERS = {
    "content-security-policy": (
        "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' blob: data:; "
        "connect-src 'self'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
    ),
    "x-content-type-options": "nosniff",
    "x-frame-options": "DENY",
    "referrer-policy": "no-referrer",
    "cross-origin-opener-policy": "same-origin",
    "cross-origin-resource-policy": "same-origin",
    "cache-control": "no-store",
}
"""Of every answer, refusals too. Source: docs/decisions/0018."""


class Pass:
    """The token in the address, and the cookie that it is exchanged for.

    Args:
        token: At least `LEAST_TOKEN` characters; drawn at random unless given.

    Raises:
        BadInput: The token is too short, or is not plain ASCII.
    """

    def __init__(self, token: str | None = None) -> None:
        if token is not None and not (len(token) >= LEAST_TOKEN and token.isascii()):
            raise BadInput(
                f"a token of at least {LEAST_TOKEN} ASCII characters",
                number_of(len(token), "character"),
                "leave it out: one is drawn",
            )
        self.token = token or secrets.token_urlsafe(32)
        self._cookie = secrets.token_urlsafe(32)

    def admits(self, token: str) -> bool:
        """Return whether this is the token; compared in constant time."""
        return hmac.compare_digest(token.encode("utf-8", "replace"), self.token.encode())

    def set_cookie(self, name: str) -> str:
        """Return the header's value that gives a browser the cookie."""
        return f"{name}={self._cookie}; HttpOnly; SameSite=Strict; Path=/"

    def knows(self, cookie_header: str, name: str) -> bool:
        """Return whether a request's Cookie header holds the cookie."""
        try:
            found = SimpleCookie(cookie_header).get(name)
        except CookieError:
            return False
        given = "" if found is None else found.value
        return hmac.compare_digest(given.encode("utf-8", "replace"), self._cookie.encode())


class Guard:
    """Stands before the application: refuses what must not reach it, marks every answer.

    Args:
        app: What is guarded.
        entry: Token and cookie.
        names: Host names (or addresses) under which the page may be opened.
        port: The port under which it may be opened.
        any_address: True where the server listens on all addresses: then any IP address will do
            as Host, since a name that was made to point here is never one.
        open_paths: Paths that need no cookie; they hold nothing of the station.
    """

    def __init__(
        self,
        app: ASGIApp,
        *,
        entry: Pass,
        names: Iterable[str],
        port: int,
        any_address: bool,
        open_paths: frozenset[str],
    ) -> None:
        self._app = app
        self._entry = entry
        hosts = [bracketed(name).lower() for name in names]
        self._hosts = frozenset(f"{host}:{port}" for host in hosts)
        if port == _USUAL_PORT:
            self._hosts |= frozenset(hosts)
        self._port = port
        self._any_address = any_address
        self._open_paths = open_paths

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Check, then hand on; a refused WebSocket is answered 403 before it opens."""
        headers = Headers(scope=scope)
        status = self._refusal(scope, headers)
        if status == 0:
            await self._app(scope, receive, _with_headers(send))
        elif scope["type"] == "websocket":
            await receive()
            await send({"type": "websocket.close", "code": 1008})
        else:
            answer = PlainTextResponse(_REASONS[status], status)
            await answer(scope, receive, _with_headers(send))

    def _refusal(self, scope: Scope, headers: Headers) -> int:
        """Return 0, or the status of a refusal."""
        host = headers.get("host", "").lower()
        if len(headers.getlist("host")) != 1 or not self._is_ours(host):
            return 421
        socket = scope["type"] == "websocket"
        needs_origin = socket or scope.get("method") not in ("GET", "HEAD")
        origins = [origin.lower() for origin in headers.getlist("origin")]
        if (needs_origin or origins) and origins != [f"http://{host}"]:
            return 403
        if scope["path"] not in self._open_paths:
            name = cookie_name(self._port)
            if not self._entry.knows(headers.get("cookie", ""), name):
                return 401
        return 0

    def _is_ours(self, host: str) -> bool:
        if host in self._hosts:
            return True
        if self._port == _USUAL_PORT and self._any_address and _is_address(host.strip("[]")):
            return True
        name, _, port = host.rpartition(":")
        return self._any_address and port == str(self._port) and _is_address(name.strip("[]"))


_REASONS = {
    401: "needed the key: open the address that taxel printed.\n",
    403: "needed a request of this page's own; got another origin.\n",
    421: "needed this page's own host name and port; got another.\n",
}


def cookie_name(port: int) -> str:
    """Return the cookie's name; a browser shares cookies between a host's ports."""
    return f"taxel_page_{port}"


def is_loopback(host: str) -> bool:
    """Return whether an address, or the name localhost, stays on this machine."""
    return host == "localhost" or (_is_address(host) and ipaddress.ip_address(host).is_loopback)


def _with_headers(send: Send) -> Send:
    async def marked(message: Message) -> None:
        if message["type"] == "http.response.start":
            headers = MutableHeaders(raw=_raw(message))
            for name, value in HEADERS.items():
                headers[name] = value
            message["headers"] = headers.raw
        await send(message)

    return marked


def _raw(message: MutableMapping[str, Any]) -> list[tuple[bytes, bytes]]:
    return list(message.get("headers", []))


def _is_address(text: str) -> bool:
    try:
        ipaddress.ip_address(text)
    except ValueError:
        return False
    return True
