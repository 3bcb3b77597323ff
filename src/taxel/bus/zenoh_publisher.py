"""The process that publishes a station over Zenoh. It only speaks: it takes no orders.

It reads the station's rings, whose writers never wait, and hands messages to Zenoh, which drops
what a subscriber does not take. So nobody who listens, or does not, holds up the station. Knows
nothing about sensors.

Background of our choices: docs/decisions/0052.
"""

from __future__ import annotations

from dataclasses import dataclass
from time import monotonic, sleep
from typing import Any

from taxel.bus.addresses import ZenohAddress
from taxel.bus.batches import BATCH_S, Head, encode, key_of
from taxel.bus.following import Following
from taxel.bus.zenoh_session import open_session, zenoh_module
from taxel.live.station.page_link import ViewConfig
from taxel.live.station.worker import Place, at_work, settle_memory
from taxel.signals import Frame, Samples

ABOUT = "/about"
"""Topic of what the station has, and of this program's version."""
_ABOUT_S = 1.0
"""How often it is sent: a subscriber that comes later waits so long. Source: our choice."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ZenohPublishing:
    """The job of the process that publishes a station over Zenoh."""

    place: Place
    view: ViewConfig
    address: ZenohAddress


def publish(job: ZenohPublishing) -> None:
    """Publish until asked to end; the entry point of the process."""
    with (
        at_work(job.place) as pulse,
        Following(job.view) as following,
        Bus(job.address) as bus,
    ):
        pulse.report("opened", bus.where)
        settle_memory()
        due_s = monotonic()
        while not pulse.stopping:
            bus.publish(following)
            pulse.consumed, pulse.produced = following.taken, bus.sent
            pulse.dropped = following.lost
            pulse.beat()
            due_s = max(due_s + BATCH_S, monotonic())
            sleep(max(0.0, due_s - monotonic()))
        bus.publish(following)


class Bus:
    """An open session with a publisher for each topic; use it in a `with` block.

    Args:
        address: Where.

    Raises:
        BadInput: The address cannot be used.
        MissingExtra: eclipse-zenoh is not installed.
    """

    def __init__(self, address: ZenohAddress) -> None:
        self._zenoh = zenoh_module()
        self._station = address.station
        self._session = open_session(address, listen=True)
        self._publishers: dict[str, Any] = {}
        self._numbers: dict[str, int] = {}
        self._about_s = 0.0
        self.where = (
            f"{address.endpoint if address.host else address.config}, keys taxel/{self._station}/**"
        )
        """What a person must know to subscribe."""
        self.sent = 0
        """Messages handed to Zenoh."""

    def publish(self, following: Following) -> None:
        """Send what came since the last call."""
        lost = following.lost
        for item in following.take():
            self.put(item.topic, item.value, lost)
        if monotonic() - self._about_s >= _ABOUT_S:
            self._about_s = monotonic()
            self.put(ABOUT, following.about(), following.lost)

    def put(self, topic: str, value: Samples | Frame | dict[str, Any], lost: int = 0) -> None:
        """Send one message; Zenoh drops it where a subscriber has no room.

        Args:
            topic: As a recording names it.
            value: What is sent.
            lost: Messages that were lost before they came here.
        """
        kind, payload = encode(value)
        number = self._numbers.get(topic, 0)
        self._numbers[topic] = number + 1
        head = Head(number, lost, monotonic()).pack()
        self._publisher(topic, kind).put(payload, attachment=head)
        self.sent += 1

    def _publisher(self, topic: str, kind: str) -> Any:
        if topic not in self._publishers:
            self._publishers[topic] = self._session.declare_publisher(
                key_of(self._station, topic),
                encoding=self._zenoh.Encoding(kind),
                congestion_control=self._zenoh.CongestionControl.DROP,
                express=True,  # it is a batch already
            )
        return self._publishers[topic]

    def close(self) -> None:
        """End the session."""
        self._session.close()

    def __enter__(self) -> Bus:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()
