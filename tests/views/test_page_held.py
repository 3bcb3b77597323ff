"""Who holds connections and sends or reads nothing keeps nobody else from the page."""

import json
import socket
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager, suppress

import httpx
import pytest
from websockets.exceptions import WebSocketException
from websockets.sync.client import connect

from taxel.views.page import clients, connections
from taxel.views.page import serving as page_server
from taxel.views.page.server import PageServer, serve_page

SHORT_S = 0.3
LONG_S = 600.0
"""A patience that no test outlasts: who is waited for is waited for in vain."""


class Station:
    """A station with one camera; `image` bytes each."""

    def __init__(self, image: int = 1000) -> None:
        self.moment = 0
        self.image = b"\xff\xd8" + bytes(image)

    def snapshot(self):
        self.moment += 1
        return {"time_s": float(self.moment), "state": "STABLE", "cameras": [{"name": "left"}]}

    def frame(self, camera):
        return self.moment, self.image

    def traces(self, since_s):
        return {"time_s": float(self.moment)}

    def acknowledge(self, seen):
        pass

    def record(self, on, labels):
        return ""


def port_of(server: PageServer) -> int:
    return int(server.origin.rpartition(":")[2])


def opened(server: PageServer, sent: bytes = b"") -> socket.socket:
    held = socket.create_connection(("127.0.0.1", port_of(server)), timeout=5)
    held.sendall(sent)
    return held


def cookie(server: PageServer) -> str:
    token = server.url.partition("#")[2]
    headers = {"Origin": server.origin}
    answer = httpx.post(f"{server.origin}/enter", content=token, headers=headers, timeout=30)
    assert answer.status_code == 204
    return answer.headers["set-cookie"].partition(";")[0]


@pytest.fixture
def patient(monkeypatch: pytest.MonkeyPatch) -> None:
    """Deadlines far behind the test's own: the page opens beside who holds on, not after them."""
    monkeypatch.setattr(page_server, "PATIENCE_S", LONG_S)
    monkeypatch.setattr(clients, "UNSEEN_S", LONG_S)


def see_the_page(server: PageServer) -> None:
    """Open the page as a browser does, to its first push."""
    assert httpx.get(server.origin, timeout=30).status_code == 200
    address = server.origin.replace("http", "ws") + "/live"
    headers = {"Cookie": cookie(server)}
    options = {"additional_headers": headers, "max_size": None, "compression": None}
    with connect(address, origin=server.origin, **options) as page:
        assert isinstance(page.recv(timeout=30), bytes)
        assert json.loads(page.recv(timeout=30))["number"] == 1


def wait_for(true: Callable[[], bool], timeout_s: float = 10.0) -> None:
    until_s = time.monotonic() + timeout_s
    while not true():
        assert time.monotonic() < until_s, "it never came about"
        time.sleep(0.005)


HALF = b"GET / HTTP/1.1\r\nHost: "
UPGRADE = b"GET /live HTTP/1.1\r\nConnection: Upgrade\r\nUpgrade: websocket\r\n"
BODY = b"POST /enter HTTP/1.1\r\nHost: %b\r\nOrigin: http://%b\r\nContent-Length: 43\r\n\r\nx"


@contextmanager
def dripping(held: list[socket.socket]) -> Iterator[None]:
    """Send one more byte of a header on every connection, again and again; reopen none."""
    ended = threading.Event()

    def drip() -> None:
        while not ended.wait(0.02):
            for connection in held:
                with suppress(OSError):  # turned out
                    connection.sendall(b"x")

    thread = threading.Thread(target=drip)
    thread.start()
    try:
        yield
    finally:
        ended.set()
        thread.join()


@pytest.mark.parametrize("count", [63, 64, 500])
@pytest.mark.parametrize("sent", [b"", HALF, UPGRADE, BODY], ids=["", "half", "upgrade", "body"])
def test_the_page_opens_whoever_holds_on(count: int, sent: bytes, patient: None):
    """Silent sockets, and headers, handshakes and bodies that never end; 63 and the page's own
    connection are as many as the server holds.
    """
    with serve_page(Station()) as server, ExitStack() as stack:
        own = f"127.0.0.1:{port_of(server)}".encode()
        sent = sent % (own, own) if b"%b" in sent else sent
        for _ in range(count):
            stack.enter_context(opened(server, sent))
        see_the_page(server)


def test_the_page_opens_while_500_drip_a_header_byte_by_byte(patient: None):
    with serve_page(Station()) as server, ExitStack() as stack:
        held = [stack.enter_context(opened(server, HALF)) for _ in range(500)]
        with dripping(held):
            see_the_page(server)


def test_a_page_that_is_open_stays_open_while_others_hold_on():
    with serve_page(Station()) as server, ExitStack() as stack:
        address = server.origin.replace("http", "ws") + "/live"
        headers = {"Cookie": cookie(server)}
        page = stack.enter_context(
            connect(address, origin=server.origin, additional_headers=headers)
        )
        for _ in range(200):
            stack.enter_context(opened(server, HALF))
        for number in range(1, 10):
            assert isinstance(page.recv(timeout=5), bytes)
            assert json.loads(page.recv(timeout=5))["number"] == number
            page.send(json.dumps({"do": "seen", "number": number}))


@pytest.mark.parametrize("sent", [b"", HALF, UPGRADE, b"GET /static/page.js HTTP/1.1\r\n"])
def test_a_request_that_does_not_come_ends_its_connection(
    sent: bytes, monkeypatch: pytest.MonkeyPatch
):
    """Where nobody else waits too: within the patience, however the bytes drip in."""
    monkeypatch.setattr(page_server, "PATIENCE_S", SHORT_S)
    with serve_page(Station()) as server, opened(server, sent) as held:
        with dripping([held]):
            began_s = time.monotonic()
            with suppress(ConnectionResetError):
                assert held.recv(100) == b""
        assert time.monotonic() - began_s < 20 * SHORT_S
        assert server.turned_out == 1


def test_answers_that_nobody_reads_end_their_connection(monkeypatch: pytest.MonkeyPatch):
    """Four thousand requests for a script, sent at once, and not one answer taken."""
    monkeypatch.setattr(page_server, "PATIENCE_S", SHORT_S)
    with serve_page(Station()) as server:
        own = f"Host: 127.0.0.1:{port_of(server)}\r\n"
        request = f"GET /static/page.js HTTP/1.1\r\n{own}\r\n".encode()
        with opened(server) as held:
            held.settimeout(0.2)
            with suppress(OSError):  # as meant: the server takes no more
                held.sendall(request * 4000)
            wait_for(lambda: not server._server.uvicorn.server_state.connections)


def test_eight_pages_that_read_nothing_are_let_go(monkeypatch: pytest.MonkeyPatch):
    """Images too large for the system's buffers: the push itself does not end."""
    monkeypatch.setattr(clients, "UNSEEN_S", SHORT_S)
    with serve_page(Station(image=8_000_000)) as server, ExitStack() as stack:
        ask = (
            f"GET /live HTTP/1.1\r\nHost: 127.0.0.1:{port_of(server)}\r\nOrigin: {server.origin}"
            f"\r\nCookie: {cookie(server)}\r\nConnection: Upgrade\r\nUpgrade: websocket\r\n"
            "Sec-WebSocket-Version: 13\r\nSec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\n\r\n"
        )
        for _ in range(8):
            stack.enter_context(opened(server, ask.encode()))
        wait_for(lambda: server.ledger.slow_closed == 8)

        def gets_in() -> bool:
            try:
                see_the_page(server)
            except WebSocketException:
                return False
            return True

        wait_for(gets_in)


def test_who_goes_first_is_of_the_address_that_holds_most_then_who_owes_for_longest():
    class Held:
        def __init__(self, peer: str, owes: bool, since_s: float) -> None:
            self.peer, self.owes, self.since_s, self.open = peer, owes, since_s, True

        def abort(self) -> None:
            self.open = False

    hall = connections.Hall(most=4)
    held = [Held("b", True, 0.0), Held("a", False, 1.0), Held("a", True, 2.0), Held("a", True, 3.0)]
    for connection in [*held, Held("b", True, 4.0), Held("c", True, 5.0)]:
        hall.enter(connection)  # type: ignore[arg-type]
    assert [connection.open for connection in held] == [False, True, False, True]
    assert hall.turned_out == 2


def test_nobody_goes_for_a_newcomer_s_sake_before_a_tenth_of_a_second_but_in_a_flood():
    class Held:
        def __init__(self, since_s: float) -> None:
            self.peer, self.owes, self.since_s, self.open = "a", True, since_s, True

        def abort(self) -> None:
            self.open = False

    hall = connections.Hall(most=4)
    held = [Held(0.0001 * number) for number in range(connections.MOST_EVER)]
    for connection in held:
        hall.enter(connection)  # type: ignore[arg-type]
    assert all(connection.open for connection in held)
    hall.enter(Held(0.09))  # type: ignore[arg-type]
    assert [connection.open for connection in held] == [False] + [True] * (len(held) - 1)
    hall.enter(Held(1.0))  # type: ignore[arg-type]
    assert sum(connection.open for connection in held) == 2
