"""A real server on this machine: who gets in, what gets through; slow pages hurt nobody."""

import json
import socket
import threading
import time
import tracemalloc
from contextlib import contextmanager

import httpx
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from page_socket import answer, enter, page, push, say_all
from websockets.exceptions import ConnectionClosed, InvalidStatus

from taxel.errors import BadInput
from taxel.views.page.clients import MESSAGES_HZ, Clients
from taxel.views.page.guard import cookie_name
from taxel.views.page.plan_link import PlanLink
from taxel.views.page.server import PageServer, serve_page

IMAGE = b"\xff\xd8" + b"\x55" * 40_000 + b"\xff\xd9"
ALARM = {"key": 1, "kind": "grasp", "text": "", "level": "warning", "since_s": 1.0,
         "acknowledged": False}  # fmt: skip


class Station:
    """A station whose moment is counted; every image is a new one."""

    def __init__(self) -> None:
        self.moment = 0
        self.commands: list[object] = []
        self.fails = ""
        self.alarms: list[dict[str, object]] = []
        self.heard = threading.Event()

    def snapshot(self):
        if self.fails:
            raise RuntimeError(self.fails)
        self.moment += 1
        return {
            "time_s": float(self.moment), "state": "STABLE", "reason": "", "since_s": 0.0,
            "probability": float("nan"), "alarms": self.alarms, "cameras": [{"name": "left"}],
        }  # fmt: skip

    def frame(self, camera):
        return self.moment, IMAGE

    def traces(self, since_s):
        return {"time_s": float(self.moment), "since_s": since_s}

    def acknowledge(self, seen):
        self.commands.append(("acknowledge", *seen))
        self.heard.set()

    def disarm(self):
        self.commands.append("disarm")
        self.heard.set()

    def record(self, on, labels):
        self.commands.append((on, labels))
        self.heard.set()
        return "the disk is full" if on else ""


@pytest.fixture(scope="module")
def served():
    station = Station()
    with serve_page(station) as server:
        yield server, station


@pytest.fixture
def server(served):
    return served[0]


@pytest.fixture
def station(served):
    served[1].fails, served[1].alarms = "", []
    served[1].heard.clear()
    return served[1]


def test_the_key_stands_behind_the_hash_and_the_cookie_is_another_secret(server):
    origin, _, token = server.url.partition("/#")
    answer = httpx.post(f"{origin}/enter", content=token, headers={"Origin": origin})

    cookie = answer.headers["set-cookie"]
    assert origin.startswith("http://127.0.0.1:")
    assert len(token) >= 43
    assert token not in cookie
    assert "HttpOnly" in cookie
    assert "SameSite=Strict" in cookie


@pytest.mark.parametrize("token", ["", "x", "x" * 43, "ü" * 20, "x" * 10_000])
def test_a_wrong_key_gets_no_cookie(server, token):
    answer = httpx.post(
        f"{server.origin}/enter", content=token.encode(), headers={"Origin": server.origin}
    )

    assert answer.status_code == 403
    assert "set-cookie" not in answer.headers


@pytest.mark.parametrize("cookie", [None, "taxel_page=1", "broken=;;=,", "{name}=x", "{name}="])
def test_nothing_of_the_station_is_shown_without_the_cookie(server, cookie):
    port = int(server.origin.rpartition(":")[2])
    headers = {} if cookie is None else {"Cookie": cookie.format(name=cookie_name(port))}

    assert httpx.get(f"{server.origin}/session", headers=headers).status_code == 401
    with pytest.raises(InvalidStatus, match="403"), page(server, additional_headers=headers):
        pass


@pytest.mark.parametrize(
    "host", ["evil.example", "evil.example:{port}", "127.0.0.1:1", "127.0.0.1"]
)
def test_a_name_that_was_pointed_at_this_machine_is_refused(server, host):
    port = server.origin.rpartition(":")[2]
    host = host.format(port=port)

    answer = httpx.get(f"{server.origin}/", headers={"Host": host})

    assert answer.status_code == 421
    assert answer.headers["content-security-policy"].startswith("default-src 'none'")


@pytest.mark.parametrize("origin", [None, "null", "http://evil.example", "https://127.0.0.1:{port}",
                                    "http://127.0.0.1:{port}.evil.example"])  # fmt: skip
def test_another_site_s_page_reaches_neither_the_socket_nor_the_entry(server, origin):
    origin = origin and origin.format(port=server.origin.rpartition(":")[2])
    headers = {} if origin is None else {"Origin": origin}
    token = server.url.partition("#")[2]

    assert httpx.post(f"{server.origin}/enter", content=token, headers=headers).status_code == 403
    with pytest.raises(InvalidStatus, match="403"), page(server, origin=origin):
        pass


@pytest.mark.parametrize("path", ["/", "/static/page.js", "/static/uPlot.iife.js", "/session",
                                  "/static/..%2fserver.py", "/nothing"])  # fmt: skip
def test_every_answer_forbids_foreign_content_frames_guessing_and_keeping(server, path):
    answer = httpx.get(f"{server.origin}{path}", headers={"Cookie": enter(server)})

    policy = answer.headers["content-security-policy"]
    assert answer.status_code == (404 if ".." in path or path == "/nothing" else
                                  204 if path == "/session" else 200)  # fmt: skip
    assert "script-src 'self';" in policy
    assert "frame-ancestors 'none'" in policy
    assert "unsafe" not in policy
    assert answer.headers["x-content-type-options"] == "nosniff"
    assert answer.headers["cache-control"] == "no-store"


def test_a_push_is_the_image_then_the_snapshot_and_nan_is_null(server, station):
    with page(server) as socket:
        image, text = socket.recv(timeout=5), socket.recv(timeout=5)

    given = json.loads(text)
    assert image == b"\x00" + IMAGE
    assert given["snapshot"]["state"] == "STABLE"
    assert given["snapshot"]["probability"] is None
    assert given["traces"]["since_s"] is None  # minus infinity: all that is kept


def test_each_push_asks_for_the_traces_since_the_last_one_of_that_page(server, station):
    with page(server) as socket:
        first, second = push(socket), push(socket)

    assert second["traces"]["since_s"] == first["traces"]["time_s"]


def test_a_person_s_word_and_request_reach_the_station_and_its_refusal_comes_back(server, station):
    with page(server) as socket:
        socket.send('{"do":"acknowledge"}')
        assert answer(socket) == {"done": "acknowledge", "reason": ""}
        socket.send('{"do":"record","on":true,"labels":{"object":"cup 3"}}')
        assert answer(socket) == {"done": "record", "reason": "the disk is full"}
        socket.send('{"do":"seek","time_s":1}')
        assert answer(socket)["reason"] == "only a recording can be wound"

    assert station.commands[-2:] == [("acknowledge",), (True, {"object": "cup 3"})]


def test_an_alarm_that_a_page_has_not_shown_is_not_acknowledged_by_it(server, station):
    """A key pressed while the network stood still arrived after alarms that nobody had seen."""
    station.commands.clear()
    with page(server) as socket:
        push(socket)  # without an alarm
        station.alarms = [ALARM]
        socket.send('{"do":"acknowledge"}')
        assert "had not shown yet" in answer(socket)["reason"]
        while not push(socket)["snapshot"]["alarms"]:
            pass
        station.alarms = [{**ALARM, "key": 2}]  # went and came on again, with all else the same
        socket.send('{"do":"acknowledge"}')
        assert "had not shown yet" in answer(socket)["reason"]
        while push(socket)["snapshot"]["alarms"][0]["key"] != 2:
            pass
        socket.send('{"do":"acknowledge"}')
        assert answer(socket) == {"done": "acknowledge", "reason": ""}
    assert station.commands == [("acknowledge", 2)]


def test_a_station_that_fails_is_reported_on_the_page_and_comes_back(server, station):
    with page(server) as socket:
        push(socket)
        station.fails = "the shared memory is gone"
        while "failed" not in (pushed := push(socket)):
            pass
        station.fails = ""
        while "snapshot" not in push(socket):
            pass

    assert pushed["failed"] == "RuntimeError: the shared memory is gone"


@pytest.mark.slow
@settings(max_examples=40, deadline=None,
          suppress_health_check=[HealthCheck.function_scoped_fixture])  # fmt: skip
@given(message=st.text(max_size=300) | st.binary(max_size=300) | st.just("x" * 5000))
def test_nonsense_is_counted_and_answered_and_the_page_lives_on(server, station, message):
    """A page that was just opened: 40 messages on one would be too many a second."""
    before = server.ledger.refused_messages
    with page(server) as socket:
        socket.send(message)
        assert answer(socket)["refused"].startswith("needed")
        push(socket)

    assert server.ledger.refused_messages == before + 1


def test_a_message_too_long_to_hold_and_a_flood_each_close_the_page(server, station):
    for send in (["x" * 100_000], ['{"do":"nothing"}'] * (int(MESSAGES_HZ) + 100)):
        with page(server) as socket, pytest.raises(ConnectionClosed) as closed:
            say_all(socket, send)
        assert closed.value.rcvd is None or closed.value.rcvd.code in (1008, 1009)

    with page(server) as socket:
        assert push(socket)["number"] == 1


def test_a_page_that_stands_still_gets_one_push_and_slows_no_other(server, station):
    """One reads and never says "seen", one does not even read; a third gets its 15 a second."""
    with page(server) as silent, page(server) as deaf, page(server) as quick:
        push(quick)
        moment, skipped = time.monotonic(), server.ledger.skipped
        tracemalloc.start()
        for _ in range(15):
            push(quick)
        took_s = time.monotonic() - moment
        _, peak = tracemalloc.get_traced_memory()
        tracemalloc.stop()
        silent.recv(timeout=5)
        assert json.loads(silent.recv(timeout=5))["number"] == 1
        with pytest.raises(TimeoutError):
            silent.recv(timeout=0.3)
        assert deaf.recv(timeout=5)

    assert took_s < 3
    assert peak < 40 * len(IMAGE)
    assert server.ledger.skipped >= skipped


def test_what_a_slow_page_gets_is_the_newest_not_the_next(server, station):
    with page(server) as socket:
        first = push(socket)["snapshot"]["time_s"]
        held = None
        while held is None or "number" not in held:
            message = socket.recv(timeout=5)
            held = json.loads(message) if isinstance(message, str) else None
        station.moment += 1000
        socket.send(json.dumps({"do": "seen", "number": held["number"]}))
        newest = push(socket)["snapshot"]["time_s"]

    assert newest > first + 1000


def test_the_ninth_page_learns_that_eight_are_open():
    station = Station()
    with serve_page(station) as server:
        pages = [page(server) for _ in range(8)]
        sockets = [page.__enter__() for page in pages]
        try:
            assert all(push(socket)["number"] == 1 for socket in sockets)
            with page(server) as ninth, pytest.raises(ConnectionClosed, match="8 pages are open"):
                ninth.recv(timeout=5)
        finally:
            for page_ in pages:
                page_.__exit__(None, None, None)
        assert server.ledger.refused_clients == 1


def test_stopping_ends_open_pages_and_the_thread_and_frees_the_port():
    server = serve_page(Station())
    port = int(server.origin.rpartition(":")[2])
    with page(server) as socket:
        push(socket)
        server.stop()
        with pytest.raises(ConnectionClosed):
            say_all(socket, [])

    assert not server.running
    with socket_at(port):
        server.stop()  # once more does no harm


def test_a_port_that_is_taken_and_a_short_token_are_one_plain_line():
    with socket_at(0) as taken:
        port = taken.getsockname()[1]
        with pytest.raises(BadInput, match="choose another port"):
            PageServer(Station(), port=port)
    with pytest.raises(BadInput, match="at least 16 ASCII characters"):
        PageServer(Station(), token="secret")
    with pytest.raises(BadInput, match="choose another port"):
        PageServer(Station(), port=70_000)


def test_on_all_addresses_any_number_will_do_as_host_but_no_foreign_name():
    with serve_page(Station(), host="0.0.0.0") as server:
        port = server.origin.rpartition(":")[2]
        there = f"http://127.0.0.1:{port}"
        assert httpx.get(there).status_code == 200
        assert httpx.get(there, headers={"Host": f"192.0.2.7:{port}"}).status_code == 200
        assert httpx.get(there, headers={"Host": f"evil.example:{port}"}).status_code == 421
        assert httpx.get(f"{there}/session").status_code == 401


@pytest.mark.parametrize("same_page", [True, False])
def test_who_disarms_does_not_wait_for_a_recording_that_is_slow_to_start(same_page: bool):
    """The recorder has 3 s to answer; no more orders must be possible at once, and pushes go on."""
    may_start, asked, disarmed = threading.Event(), threading.Event(), threading.Event()

    class Slow(Station):
        def record(self, on, labels):
            asked.set()
            assert may_start.wait(30)
            return ""

        def disarm(self):
            disarmed.set()

    with serve_page(Slow()) as server, page(server) as first, page(server) as second:
        first.send('{"do":"record","on":true,"labels":{}}')
        assert asked.wait(10)
        other = first if same_page else second
        other.send('{"do":"disarm"}')
        assert disarmed.wait(5)
        assert answer(other) == {"done": "disarm", "reason": ""}
        number = push(first)["number"]
        assert push(first)["number"] > number
        may_start.set()
        assert answer(first) == {"done": "record", "reason": ""}


def test_a_link_with_no_cursor_is_not_taken_for_a_recording():
    assert Clients(Station())._replay is None


@contextmanager
def socket_at(port):
    with socket.socket() as taken:
        taken.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        taken.bind(("127.0.0.1", port))
        taken.listen()
        yield taken


def test_a_link_that_cannot_disarm_says_why():
    with serve_page(PlanLink(3, asks=True)) as server, page(server) as first:
        first.send('{"do":"disarm"}')
        assert answer(first)["reason"].startswith("nothing is armed while a plan is recorded")
