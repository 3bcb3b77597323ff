"""Any bytes on the page's port, and any header, cookie or key: refused, and the page lives on."""

import logging
import socket
from collections.abc import Iterator

import httpx
import pytest
from hypothesis import HealthCheck, example, given, settings
from hypothesis import strategies as st

from taxel.views.page.guard import Guard, Pass, cookie_name
from taxel.views.page.server import PageServer, serve_page

pytestmark = pytest.mark.data
FUZZ = settings(
    settings.get_profile("fuzz"),
    suppress_health_check=[HealthCheck.function_scoped_fixture, HealthCheck.too_slow],
)


class Station:
    """A station that shows one number."""

    def snapshot(self):
        return {"time_s": 1.0, "state": "STABLE"}

    def frame(self, camera):
        return None

    def traces(self, since_s):
        return {"time_s": 1.0}

    def acknowledge(self, seen):
        pass

    def record(self, on, labels):
        return ""


@pytest.fixture(scope="module")
def server() -> Iterator[PageServer]:
    with serve_page(Station()) as running:
        yield running


@pytest.fixture(scope="module")
def cookie(server: PageServer) -> str:
    token = server.url.partition("#")[2]
    answer = httpx.post(f"{server.origin}/enter", content=token, headers={"Origin": server.origin})
    return answer.headers["set-cookie"].partition(";")[0]


def answer_to(server: PageServer, sent: bytes) -> bytes:
    """Send bytes and the end of them; return all that comes back until the server closes."""
    port = int(server.origin.rpartition(":")[2])
    with socket.create_connection(("127.0.0.1", port), timeout=5) as line:
        heard = b""
        try:
            line.sendall(sent)
            line.shutdown(socket.SHUT_WR)
            while part := line.recv(65536):
                heard += part
        except (ConnectionResetError, BrokenPipeError):
            pass
        return heard


texts = st.text(st.characters(max_codepoint=255, exclude_characters="\r\n"), max_size=60)
names = st.sampled_from(
    ["Host", "Origin", "Cookie", "Content-Length", "Transfer-Encoding", "Connection", "Upgrade",
     "Expect", "Sec-WebSocket-Key", "Sec-WebSocket-Version", "X"]
)  # fmt: skip
values = texts | st.sampled_from(
    ["{host}", "http://{host}", "{cookie}", "chunked", "upgrade", "websocket", "13", "close", "5",
     "-1", "9" * 30, "100-continue", "dGhlIHNhbXBsZSBub25jZQ=="]
)  # fmt: skip
requests = st.builds(
    lambda method, path, version, headers, body: (method, path, version, headers, body),
    st.sampled_from(["GET", "POST", "HEAD", "OPTIONS", "PUT", "get", ""]),
    st.sampled_from(["/", "/enter", "/session", "/live", "/static/page.js", "/static/..", "*", "//",
                     "http://evil/", "/%00", "/static/%ff"]) | texts,
    st.sampled_from(["HTTP/1.1", "HTTP/1.0", "HTTP/2.0", "HTTP/9", ""]),
    st.lists(st.tuples(names, values), max_size=8),
    st.binary(max_size=100),
)  # fmt: skip


@FUZZ
@given(sent=st.binary(max_size=300) | requests)
def test_any_bytes_on_the_port_leave_the_page_as_it_was(server, cookie, caplog, sent):
    caplog.set_level(logging.ERROR)
    if not isinstance(sent, bytes):
        method, path, version, headers, body = sent
        lines = "".join(f"{name}: {value}\r\n" for name, value in headers)
        for sign, true in (
            ("{host}", server.origin.removeprefix("http://")),
            ("{cookie}", cookie),
        ):
            lines = lines.replace(sign, true)
        sent = f"{method} {path} {version}\r\n{lines}\r\n".encode("latin-1") + body
    heard = answer_to(server, sent)
    assert heard == b"" or heard.startswith(b"HTTP/1.1 ")
    assert b" 500 " not in heard[:20]
    assert [record.getMessage() for record in caplog.records] == []
    assert server.running


@FUZZ
@given(frames=st.lists(st.binary(max_size=80), max_size=4).map(b"".join))
@example(frames=b"\x81\xfe\xff\xff")
def test_any_bytes_behind_a_handshake_close_that_page_alone(server, cookie, caplog, frames):
    caplog.set_level(logging.ERROR)
    head = (
        f"GET /live HTTP/1.1\r\nHost: {server.origin.removeprefix('http://')}\r\n"
        f"Origin: {server.origin}\r\nCookie: {cookie}\r\nConnection: Upgrade\r\n"
        "Upgrade: websocket\r\nSec-WebSocket-Version: 13\r\n"
        "Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\n\r\n"
    )
    heard = answer_to(server, head.encode() + frames)
    assert heard == b"" or heard.startswith(b"HTTP/1.1 101 ")
    assert [record.getMessage() for record in caplog.records] == []
    assert server.running


@FUZZ
@given(
    kind=st.sampled_from(["http", "websocket"]),
    method=st.sampled_from(["GET", "POST", "HEAD"]),
    path=st.sampled_from(["/", "/session", "/live"]) | st.text(max_size=10),
    headers=st.lists(
        st.tuples(st.sampled_from([b"host", b"origin", b"cookie", b"x"]), st.binary(max_size=60)),
        max_size=6,
    ),
    any_address=st.booleans(),
)
def test_the_guard_lets_nobody_by_who_lacks_the_cookie(kind, method, path, headers, any_address):
    async def app(*_: object) -> None:
        raise AssertionError("never called here")

    guard = Guard(
        app, entry=Pass(), names=["localhost"], port=80, any_address=any_address,
        open_paths=frozenset(["/"]),
    )  # fmt: skip
    scope = {"type": kind, "method": method, "path": path, "headers": headers}
    from starlette.datastructures import Headers

    refused = guard._refusal(scope, Headers(scope=scope))
    assert refused in (0, 401, 403, 421)
    assert refused or path == "/"


@FUZZ
@given(st.text(max_size=200) | st.text(max_size=50).map(lambda text: f"{cookie_name(80)}={text}"))
def test_no_cookie_and_no_key_is_right_by_chance(text):
    entry = Pass()
    assert not entry.knows(text, cookie_name(80))
    assert not entry.admits(text)


def test_what_the_answers_are_is_what_the_page_gives(server, cookie):
    """The fuzzers above would pass a server that closes everything: this one answers."""
    host = server.origin.removeprefix("http://")
    heard = answer_to(
        server, f"GET /session HTTP/1.1\r\nHost: {host}\r\nCookie: {cookie}\r\n\r\n".encode()
    )
    assert heard.startswith(b"HTTP/1.1 204 ")


@pytest.mark.parametrize(
    ("port", "host", "refused"),
    [(80, b"127.0.0.1", 0), (80, b"127.0.0.1:80", 0), (80, b"192.0.2.7", 0), (80, b"[::1]", 0),
     (80, b"evil.example", 421), (8080, b"127.0.0.1", 421)],
)  # fmt: skip
def test_a_browser_leaves_port_80_out(port, host, refused):
    """A page at HOST:80 was refused to every browser: needed this page's own host name and port."""
    from starlette.datastructures import Headers

    guard = Guard(
        None, entry=Pass(), names=["127.0.0.1"], port=port, any_address=True,
        open_paths=frozenset(["/enter"]),
    )  # fmt: skip
    scope = {"type": "http", "method": "POST", "path": "/enter",
             "headers": [(b"host", host), (b"origin", b"http://" + host)]}  # fmt: skip
    assert guard._refusal(scope, Headers(scope=scope)) == refused
