"""Show a station in Foxglove or Lichtblick: a WebSocket on this machine, for those with the key.

It only shows: no service, parameter or message of a viewer reaches anything. A viewer that is slow
misses the oldest, counted; one that stands still is closed. Knows nothing about sensors.

Background of our choices: docs/decisions/0052.
"""

from __future__ import annotations

import asyncio
import json
import re
import threading
import time
from collections import deque
from contextlib import suppress
from dataclasses import dataclass, field
from typing import Any

from taxel.bus.batches import json_bytes
from taxel.bus.following import Following, Item
from taxel.bus.foxglove_wire import (
    SUBPROTOCOLS,
    Channel,
    Rows,
    item_name,
    message,
    read_request,
)
from taxel.live.station.page_link import ViewConfig
from taxel.live.station.worker import Place, at_work
from taxel.recordings.frame_layout import image_message
from taxel.signals import Frame, Samples
from taxel.views.page.guard import Pass
from taxel.views.page.serving import LOOPBACK, Server, host_names

from starlette.applications import Starlette  # isort: skip
from starlette.routing import WebSocketRoute  # isort: skip
from starlette.websockets import WebSocket, WebSocketDisconnect  # isort: skip

PORT = 8765
"""Where viewers look first. Source: Foxglove's default."""
MOST_VIEWERS = 8
"""Source: our choice, as for pages (docs/decisions/0018)."""
MOST_WAITING = 256
"""Messages that wait for one viewer; the oldest make room. Source: our choice: a second of two
cameras and a hand."""
_LOOK_S = 0.01
_ORIGINS = ("https://app.foxglove.dev", "https://studio.foxglove.dev", "file://", "null")
"""Pages that may connect beside those of this machine: Foxglove's own, and desktop programs."""
_HERE = re.compile(r"http://(127\.0\.0\.1|localhost)(:[0-9]{1,5})?|app://[a-z.-]*")


@dataclass(slots=True, eq=False)
class _Viewer:
    """One connection."""

    wants: dict[int, set[int]] = field(default_factory=dict)
    """Channel → the viewer's own numbers for it."""
    waiting: deque[bytes] = field(default_factory=lambda: deque(maxlen=MOST_WAITING))
    news: asyncio.Event = field(default_factory=asyncio.Event)
    known: int = 0
    """Channels that were advertised to it."""


class FoxgloveServer:
    """Serves viewers from a thread; use it in a `with` block, and call `show` with what came.

    Args:
        following: The station, for its cameras' and channels' names.
        port: 0 takes a free one.
        token: Drawn at random unless given.

    Raises:
        BadInput: The port cannot be listened on.
    """

    def __init__(self, following: Following, port: int = 0, token: str | None = None) -> None:
        self._entry = Pass(token)
        self._rows = {
            source["topic"]: Rows(tuple(source["sensor"]["channels"]))
            for source in following.about()["sources"]
            if source["sensor"]
        }
        self._channels: dict[str, Channel] = {}
        self._viewers: set[_Viewer] = set()
        self._anchor_ns = time.time_ns() - time.monotonic_ns()
        self._loop: asyncio.AbstractEventLoop | None = None
        self.dropped = 0
        """Messages that a slow viewer missed."""
        self.refused = 0
        """Connections and requests that were refused."""
        self._server = Server(self._application, LOOPBACK, port)

    @property
    def url(self) -> str:
        """The address to give to a viewer; its last part is the key."""
        return f"ws://{self._server.place}/{self._entry.token}"

    @property
    def running(self) -> bool:
        """True while it serves."""
        return self._server.running

    def show(self, items: list[Item]) -> None:
        """Hand on what came; never waits."""
        if self._loop is not None and items:
            with suppress(RuntimeError):  # the loop has ended
                self._loop.call_soon_threadsafe(self._spread, items)

    def _spread(self, items: list[Item]) -> None:
        for item in items:
            channel = self._channel(item)
            viewers = [viewer for viewer in self._viewers if channel.number in viewer.wants]
            if viewers:
                for time_s, payload in self._payloads(item):
                    self._put(viewers, channel.number, self._wall_ns(time_s), payload)
        for viewer in self._viewers:
            viewer.news.set()

    def _put(self, viewers: list[_Viewer], channel: int, wall_ns: int, payload: bytes) -> None:
        for viewer in viewers:
            for number in viewer.wants[channel]:
                self.dropped += len(viewer.waiting) == MOST_WAITING
                viewer.waiting.append(message(number, wall_ns, payload))

    def _channel(self, item: Item) -> Channel:
        if item.topic not in self._channels:
            value, number = item.value, len(self._channels) + 1
            rows = self._rows.get(item.topic)
            fields = tuple(rows.channels) if rows is not None else ()
            self._channels[item.topic] = Channel(
                number, item.topic, isinstance(value, Frame), item_name(item), fields
            )
        return self._channels[item.topic]

    def _payloads(self, item: Item) -> list[tuple[float, bytes]]:
        value = item.value
        if isinstance(value, Samples):
            return self._rows[item.topic].of(value)
        if isinstance(value, Frame):
            name = item.topic.rpartition("/")[2]
            return [(item.time_s, b"".join(image_message(value, name, self._anchor_ns)[1]))]
        return [(item.time_s, json_bytes(value))]

    def _wall_ns(self, time_s: float) -> int:
        return max(0, round(time_s * 1e9) + self._anchor_ns)

    # The connections.

    def _application(self, port: int) -> Starlette:
        self._hosts = {f"{name}:{port}" for name in host_names(LOOPBACK)}
        return Starlette(routes=[WebSocketRoute("/{token}", self._serve)])

    def _admits(self, socket: WebSocket) -> bool:
        """True for this machine's own name, an origin that is known, and the key."""
        origin = socket.headers.get("origin", "null").lower()
        known = origin in _ORIGINS or _HERE.fullmatch(origin) is not None
        named = socket.headers.get("host", "").lower() in self._hosts
        return named and known and self._entry.admits(socket.path_params["token"])

    async def _serve(self, socket: WebSocket) -> None:
        offered = [name for name in SUBPROTOCOLS if name in socket.scope["subprotocols"]]
        if not self._admits(socket) or not offered or len(self._viewers) >= MOST_VIEWERS:
            self.refused += 1
            await socket.close(1008)
            return
        await socket.accept(subprotocol=offered[0])
        viewer = _Viewer()
        self._viewers.add(viewer)
        sending = asyncio.create_task(self._send_on(socket, viewer))
        try:
            while True:
                self._take_request(viewer, await socket.receive_text())
        except (WebSocketDisconnect, RuntimeError, KeyError):  # gone, or it sent bytes
            pass
        finally:
            self._viewers.discard(viewer)
            sending.cancel()
            await asyncio.gather(sending, return_exceptions=True)

    def _take_request(self, viewer: _Viewer, text: str) -> None:
        try:
            _, given = read_request(text)
        except (ValueError, RecursionError):
            self.refused += 1
            return
        if isinstance(given, dict):
            known = {channel.number for channel in self._channels.values()}
            for number, channel in given.items():
                if channel in known and sum(map(len, viewer.wants.values())) < MOST_WAITING:
                    viewer.wants.setdefault(channel, set()).add(number)
        else:
            for channel, numbers in list(viewer.wants.items()):
                numbers.difference_update(given)
                if not numbers:
                    del viewer.wants[channel]

    async def _send_on(self, socket: WebSocket, viewer: _Viewer) -> None:
        info: dict[str, Any] = {"op": "serverInfo", "name": "taxel", "capabilities": [],
                                "metadata": {}, "sessionId": str(self._anchor_ns)}  # fmt: skip
        with suppress(WebSocketDisconnect, RuntimeError):
            await socket.send_text(json.dumps(info))
            while True:
                new = list(self._channels.values())[viewer.known :]
                if new:
                    viewer.known += len(new)
                    note = {"op": "advertise", "channels": [channel.as_json() for channel in new]}
                    await socket.send_text(json.dumps(note))
                while viewer.waiting:
                    await socket.send_bytes(viewer.waiting.popleft())
                viewer.news.clear()
                await viewer.news.wait()

    def __enter__(self) -> FoxgloveServer:
        self._server.start()
        self._loop = self._server.loop
        return self

    def __exit__(self, *_: object) -> None:
        self._loop = None
        self._server.stop()


@dataclass(frozen=True, slots=True, kw_only=True)
class FoxgloveView:
    """The job of the process that serves a station to Foxglove."""

    place: Place
    view: ViewConfig
    port: int = 0
    token: str | None = None


def show(job: FoxgloveView) -> None:
    """Serve viewers until asked to end; the entry point of the process."""
    with (
        at_work(job.place) as pulse,
        Following(job.view) as following,
        FoxgloveServer(following, job.port, job.token) as server,
    ):
        pulse.report("opened", server.url)
        waiting = threading.Event()
        while not pulse.stopping and server.running:
            server.show(following.take())
            pulse.consumed = following.taken
            pulse.dropped = following.lost + server.dropped
            pulse.beat()
            waiting.wait(_LOOK_S)
