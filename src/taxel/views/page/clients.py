"""One open page: pushes what is newest, takes commands; slow pages get fewer pushes, never a queue.

A push (new images, then one JSON message) is composed when it is sent, and the next is sent only
once the page says that it has seen this one. So at most one push is under way to each page,
however slow it is, and what it shows is never older than the time between two pushes. Knows
nothing about tokens and addresses.

Background of our choices: docs/decisions/0018.
"""

from __future__ import annotations

import asyncio
import json
import logging
import math
from contextlib import suppress
from dataclasses import dataclass, field
from typing import Any

from starlette.websockets import WebSocket, WebSocketDisconnect

from taxel.errors import TaxelError
from taxel.plain_text import MOST_NAME, visible, visible_line
from taxel.views.page.link import PersonLog, PlanSteps, ReplayControls, StationLink
from taxel.views.page.messages import (
    Acknowledge,
    Command,
    Disarm,
    Pause,
    Play,
    React,
    Record,
    RefusedMessage,
    Seek,
    Seen,
    Step,
    read_command,
)

PUSH_HZ = 20.0
"""Pushes a second to each page. Source: our choice, docs/decisions/0018."""
MOST_CLIENTS = 8
"""Pages open at once. Source: as above."""
MESSAGES_HZ = 60.0
"""Messages a second that one page may send, and how many at once; more closes it."""
UNSEEN_S = 10.0
"""A page that has not taken a push and said "seen" for so long is closed; it opens again by
itself."""
MOST_UNDER_WAY = 16
"""Commands of one page that are carried out or wait for their turn; further ones are read later.
Source: our choice."""
MOST_CAMERAS = 16
"""Cameras whose images are pushed."""

_UNSEEN = "an alarm came that this page had not shown yet: look at it, then acknowledge"

_Alarms = frozenset[int]
"""Keys of alarms: what they mean, while their words may change each moment."""
_log = logging.getLogger("taxel.page")


@dataclass(slots=True)
class Ledger:
    """What the server did, counted since its start."""

    pushes: int = 0
    skipped: int = 0
    """Pushes that were due and left out, as a page had not yet seen the one before."""
    refused_messages: int = 0
    refused_clients: int = 0
    slow_closed: int = 0


@dataclass(slots=True, eq=False)
class _Client:
    """What the server remembers of one page: a few numbers, never data."""

    socket: WebSocket
    number: int = 0
    since_s: float = -math.inf
    frames: dict[int, int] = field(default_factory=dict)
    seen: asyncio.Event = field(default_factory=asyncio.Event)
    under_way: set[asyncio.Task[None]] = field(default_factory=set)
    """Commands that are being carried out."""
    pushed: _Alarms = frozenset()
    """Alarms in the newest push that nobody has acknowledged."""
    shown: _Alarms = frozenset()
    """Those of the newest push that the page has seen."""
    failed: str = ""
    """Why the newest push holds nothing; empty where it does."""
    allowance: float = MESSAGES_HZ
    heard_s: float = 0.0


class Clients:
    """All open pages of one station.

    Args:
        link: The station.
        most: Pages open at once.
        push_hz: Pushes a second to each.
    """

    def __init__(
        self, link: StationLink, most: int = MOST_CLIENTS, push_hz: float = PUSH_HZ
    ) -> None:
        self.ledger = Ledger()
        self._link = link
        self._replay = link if isinstance(link, ReplayControls) else None
        self._most = most
        self._period_s = 1 / push_hz
        self._open: set[_Client] = set()
        self._work = asyncio.Lock()

    async def serve(self, socket: WebSocket) -> None:
        """Serve one page until it goes."""
        await socket.accept()
        if len(self._open) >= self._most:
            self.ledger.refused_clients += 1
            await socket.close(1013, f"{self._most} pages are open already")
            return
        client = _Client(socket)
        self._open.add(client)
        push = asyncio.create_task(self._push_on(client))
        try:
            await self._listen(client)
        except (WebSocketDisconnect, RuntimeError):  # gone, or closed by the pushing side
            pass
        finally:
            self._open.discard(client)
            under_way = [push, *client.under_way]
            for task in under_way:
                task.cancel()
            await asyncio.gather(*under_way, return_exceptions=True)

    async def _push_on(self, client: _Client) -> None:
        loop = asyncio.get_running_loop()
        due_s = loop.time()
        try:
            if self._replay is not None:
                overview = await asyncio.to_thread(self._replay.overview)
                await client.socket.send_text(to_json({"overview": overview}))
            while True:
                await self._push(client)
                due_s += self._period_s
                late = int((loop.time() - due_s) / self._period_s)
                if late > 0:
                    self.ledger.skipped += late
                    due_s += late * self._period_s
                await asyncio.sleep(max(0.0, due_s - loop.time()))
        except TimeoutError:
            self.ledger.slow_closed += 1
            self._open.discard(client)  # at once: one that reads nothing does not take the end
            await client.socket.close(1013, f"nothing was seen for {UNSEEN_S:g} s")
        except (WebSocketDisconnect, RuntimeError):
            return  # the page has gone

    async def _push(self, client: _Client) -> None:
        images, text = self._compose(client)
        client.seen.clear()
        async with asyncio.timeout(UNSEEN_S):
            for image in images:
                await client.socket.send_bytes(image)
            await client.socket.send_text(text)
            self.ledger.pushes += 1
            await client.seen.wait()

    def _compose(self, client: _Client) -> tuple[list[bytes], str]:
        """Return the newest images that this page lacks, and the message that follows them."""
        client.number += 1
        try:
            snapshot = self._link.snapshot()
            traces = self._link.traces(client.since_s)
            images = self._images(client, len(snapshot.get("cameras") or ()))
            push = {"number": client.number, "snapshot": snapshot, "traces": traces}
            text = to_json(push)
            client.pushed = _unacknowledged(snapshot)
            client.since_s = float(traces.get("time_s", client.since_s))
        except Exception as error:  # a link that fails must show on the page, not end it
            reason = f"{type(error).__name__}: {error}"[:200]
            if reason != client.failed:  # not with each push: a page may stay open for days
                _log.error("the page cannot be drawn: %s", reason, exc_info=_unforeseen(error))
            client.failed = reason
            return [], to_json({"number": client.number, "failed": reason})
        client.failed = ""
        return images, text

    def _images(self, client: _Client, cameras: int) -> list[bytes]:
        images = []
        for camera in range(min(cameras, MOST_CAMERAS)):
            frame = self._link.frame(camera)
            if frame is not None and client.frames.get(camera) != frame[0]:
                client.frames[camera] = frame[0]
                images.append(bytes((camera,)) + frame[1])
        return images

    async def _listen(self, client: _Client) -> None:
        loop = asyncio.get_running_loop()
        client.heard_s = loop.time()
        while True:
            message = await client.socket.receive()
            if message["type"] == "websocket.disconnect":
                return
            earned = (loop.time() - client.heard_s) * MESSAGES_HZ
            client.heard_s = loop.time()
            client.allowance = min(MESSAGES_HZ, client.allowance + earned) - 1
            if client.allowance < 0:
                self.ledger.refused_messages += 1
                await client.socket.close(1008, "too many messages")
                return
            content = message.get("text")
            try:
                command = read_command(message["bytes"] if content is None else content)
            except RefusedMessage as refused:
                self.ledger.refused_messages += 1
                await client.socket.send_text(to_json({"refused": str(refused)}))
                continue
            if isinstance(command, Seen | Disarm):
                await self._obey(client, command)
            else:
                await self._begin(client, command)

    async def _begin(self, client: _Client, command: Command) -> None:
        """Carry out a command beside what is listened to: a recording may take seconds to start,
        and whoever disarms meanwhile must not wait for that.
        """
        while len(client.under_way) >= MOST_UNDER_WAY:
            await asyncio.wait(client.under_way, return_when=asyncio.FIRST_COMPLETED)
        task = asyncio.create_task(self._obey(client, command, client.shown))
        client.under_way.add(task)
        task.add_done_callback(client.under_way.discard)

    async def _obey(self, client: _Client, command: Command, shown: _Alarms = frozenset()) -> None:
        if isinstance(command, Seen):
            if command.number == client.number:
                client.shown = client.pushed
                client.seen.set()
            return
        name = type(command).__name__.lower()
        try:
            reason = await self._do(command, shown)
        except Exception as error:  # as in _compose: the person must see it
            _log.exception("%s failed", name)
            reason = f"{type(error).__name__}: {error}"[:200]
        with suppress(WebSocketDisconnect, RuntimeError):  # gone meanwhile: the listener sees it
            await client.socket.send_text(to_json({"done": name, "reason": reason}))

    async def _do(self, command: Command, shown: _Alarms) -> str:
        """Hand a command to the link; return "" or why it could not be done.

        In turn, but for the one that waits for nobody: to disarm.

        Args:
            command: It.
            shown: The alarms that the page had shown when the command came: a person acknowledges
                what they saw, and a word that was long on its way says nothing of later ones.
        """
        replay = self._replay
        if isinstance(command, Disarm):
            return await asyncio.to_thread(self._link.disarm) or ""
        async with self._work:
            match command:
                case Acknowledge() if _unacknowledged(self._link.snapshot()) - shown:
                    return _UNSEEN
                case Acknowledge():
                    await asyncio.to_thread(self._link.acknowledge, shown)
                case Record(on, labels):
                    return await asyncio.to_thread(self._link.record, on, labels)
                case React(what) if isinstance(self._link, PersonLog):
                    return await asyncio.to_thread(self._link.react, what)
                case Step(what) if isinstance(self._link, PlanSteps):
                    return await asyncio.to_thread(self._link.step, what)
                case React() | Step():
                    return "nothing here takes that"
                case Seek(time_s) if replay is not None:
                    await asyncio.to_thread(replay.seek, time_s)
                case Play(speed) if replay is not None:
                    await asyncio.to_thread(replay.play, speed)
                case Pause() if replay is not None:
                    await asyncio.to_thread(replay.pause)
                case _:
                    return "only a recording can be wound"
        return ""


def _unacknowledged(snapshot: dict[str, Any]) -> _Alarms:
    alarms = snapshot.get("alarms") or ()
    return frozenset(alarm["key"] for alarm in alarms if not alarm.get("acknowledged"))


def _unforeseen(error: Exception) -> Exception | None:
    """Return an error whose trace a developer needs; none for those that say how to mend them."""
    return None if isinstance(error, TaxelError) else error


def to_json(value: object) -> str:
    """Return a value as JSON; what is not finite becomes null, arrays become lists.

    All text in it is for people: it is made visible here, once for the whole page.

    Raises:
        TypeError: It holds something that is no plain value.
    """
    try:
        text = json.dumps(value, allow_nan=False, separators=(",", ":"))
    except (ValueError, TypeError):
        text = "\\"
    if "\\" not in text:  # plain ASCII, nearly always: nothing to make visible
        return text
    return json.dumps(_plain(value), allow_nan=False, separators=(",", ":"))


def _plain(value: Any) -> Any:
    if hasattr(value, "tolist"):  # numpy's arrays and numbers
        value = value.tolist()
    if isinstance(value, dict):
        return {visible(key): _plain(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(item) for item in value]
    if isinstance(value, str):
        return visible(value) if len(value) <= MOST_NAME else visible_line(value)
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return value
