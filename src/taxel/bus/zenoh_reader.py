"""Listen to a station over Zenoh, from any program, and count what was lost on the way.

    with BusReader("zenoh://127.0.0.1:7447/bench-1") as bus:
        for message in bus.take(wait_s=1.0):
            print(message.topic, message.value)

It only listens. Knows nothing about what is done with the messages.

Background of our choices: docs/decisions/0052.
"""

from __future__ import annotations

import threading
from collections import deque
from dataclasses import dataclass
from time import monotonic
from typing import Any, Self

from taxel.bus.addresses import parse_zenoh
from taxel.bus.batches import Head, decode
from taxel.bus.zenoh_session import open_session
from taxel.live.station.packets import Packet

_KEPT = 4096
"""Messages that wait to be taken; the oldest make room. Source: our choice: ten seconds of a hand
and two cameras."""


@dataclass(frozen=True, slots=True)
class Received:
    """One message."""

    topic: str
    """Such as touch/teng, camera/left, state."""
    value: Packet
    """Samples, a Frame, or a dict."""
    head: Head
    came_s: float
    """When it came here, host monotonic, seconds; comparable to `head.sent_s` on one machine."""


class BusReader:
    """A subscriber of one station; use it in a `with` block.

    Args:
        url: The station's address; its part ?config=FILE names Zenoh's own configuration.
        topic: Only what matches, as Zenoh writes it: touch/*, camera/left; all by default.

    Raises:
        BadInput: The address is wrong, or nobody listens there.
        MissingExtra: eclipse-zenoh is not installed.
    """

    def __init__(self, url: str, topic: str = "**") -> None:
        address = parse_zenoh(url)
        self._prefix = f"taxel/{address.station}/"
        self._waiting: deque[Received] = deque(maxlen=_KEPT)
        self._came = threading.Condition()
        self._next: dict[str, int] = {}
        self.lost = 0
        """Messages that went out and did not come here, or were not taken in time."""
        self.lost_before = 0
        """Messages that the publisher itself had to let go, as it says."""
        self.bad = 0
        """Messages that are none of taxel's."""
        self._session = open_session(address, listen=False)
        self._subscriber = self._session.declare_subscriber(self._prefix + topic, self._take_in)

    def take(self, wait_s: float = 0.0) -> list[Received]:
        """Return what came since the last call, oldest first.

        Args:
            wait_s: How long to wait for the first, seconds.
        """
        with self._came:
            if not self._waiting:
                self._came.wait(wait_s)
            found = list(self._waiting)
            self._waiting.clear()
            return found

    def _take_in(self, sample: Any) -> None:
        came_s = monotonic()
        try:
            topic = str(sample.key_expr).removeprefix(self._prefix)
            attached = sample.attachment
            head = Head.unpack(attached.to_bytes() if attached is not None else b"")
            value = decode(str(sample.encoding), sample.payload.to_bytes())
        except (ValueError, RecursionError):
            self.bad += 1
            return
        with self._came:
            expected = self._next.get(topic, head.number)
            # A smaller number: the publisher was started again.
            self.lost += max(0, head.number - expected)
            self._next[topic] = head.number + 1
            self.lost_before = head.lost
            self.lost += len(self._waiting) == _KEPT
            self._waiting.append(Received(topic, value, head, came_s))
            self._came.notify()

    def close(self) -> None:
        """End the session."""
        self._session.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()
