"""A page as a browser would be: it gets in by the token, sees pushes, and hears answers."""

import json
from contextlib import contextmanager

import httpx
from websockets.sync.client import connect


@contextmanager
def page(server, **changed):
    """A page that got in by the token, as a browser would."""
    headers = {"Cookie": enter(server)} | changed.pop("headers", {})
    address = server.origin.replace("http", "ws") + "/live"
    given = {"origin": server.origin, "additional_headers": headers, "compression": None} | changed
    with connect(address, **given) as socket:
        yield socket


def enter(server) -> str:
    token = server.url.partition("#")[2]
    answer = httpx.post(f"{server.origin}/enter", content=token, headers={"Origin": server.origin})
    assert answer.status_code == 204
    return answer.headers["set-cookie"].partition(";")[0]


def push(socket) -> dict:
    """Return the next push, and say that it was seen."""
    while True:
        message = socket.recv(timeout=5)
        if isinstance(message, str) and "number" in (given := json.loads(message)):
            socket.send(json.dumps({"do": "seen", "number": given["number"]}))
            return given


def say_all(socket, messages: list[str]) -> None:
    """Send messages, then look on until the server ends it."""
    for message in messages:
        socket.send(message)
    while True:
        push(socket)


def answer(socket) -> dict:
    """Return the next answer to a command; pushes on the way are seen."""
    while True:
        message = socket.recv(timeout=5)
        if isinstance(message, bytes):
            continue
        given = json.loads(message)
        if "number" not in given:
            return given
        socket.send(json.dumps({"do": "seen", "number": given["number"]}))
