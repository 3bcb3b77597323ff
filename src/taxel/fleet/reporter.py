"""The process that reports a station to its fleet. It subscribes to nothing: it takes no orders.

A broker that is away, slow or stopped changes nothing here: what cannot be sent is left out, and
the next report holds everything anew. Knows nothing about other stations.

Background of our choices: docs/decisions/0052.
"""

from __future__ import annotations

import hashlib
import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from secrets import token_hex
from typing import Any

from taxel import __version__
from taxel.bus.addresses import MqttAddress
from taxel.bus.following import SOURCES, STATE, Following
from taxel.fleet.broker import Broker
from taxel.fleet.reports import (
    ALIVE,
    PERIOD_S,
    REPORT,
    Identity,
    alive_bytes,
    make_report,
    topic_of,
)
from taxel.foreign.addresses import bracketed
from taxel.live.station.page_link import ViewConfig, how_it_does
from taxel.live.station.worker import Place, at_work, settle_memory

_LOOK_S = 0.05
"""How often the rings are looked at. Source: our choice."""
_CONNECTS_S = 1.0
"""How long the start waits for the broker, so that it can say that none answers. Source: our
choice, docs/decisions/0052."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Reporting:
    """The job of the process that reports a station to its fleet's broker."""

    place: Place
    view: ViewConfig
    address: MqttAddress
    bundles: tuple[str, ...] = ()
    """Names of what runs, as `bundle_names` gave them when the station began."""


def report(job: Reporting) -> None:
    """Report until asked to end; the entry point of the process."""
    with (
        at_work(job.place) as pulse,
        Following(job.view) as following,
        Reporter(job.address, job.bundles) as reporter,
    ):
        pulse.report("opened", reporter.where(_CONNECTS_S))
        settle_memory()
        while not pulse.stopping:
            for item in following.take():
                if isinstance(item.value, dict):
                    reporter.take_in(item.topic, item.value, item.time_s)
            reporter.report(time.monotonic())
            pulse.consumed, pulse.produced = following.taken, reporter.sent
            pulse.beat()
            time.sleep(_LOOK_S)
        reporter.killed = pulse.orphaned


class Reporter:
    """A station's end of the connection; use it in a `with` block.

    Args:
        address: The broker, and the station's name.
        bundles: Names of what runs.
    """

    def __init__(self, address: MqttAddress, bundles: tuple[str, ...] = ()) -> None:
        self.station, boot = address.station, token_hex(8)
        self._identity = Identity(
            station=address.station, boot=boot, version=__version__, bundles=bundles
        )
        self._state: dict[str, Any] = {}
        self._sources: dict[int, tuple[dict[str, Any], float]] = {}
        """Number of a source → its newest report, and when that came, monotonic seconds."""
        self._reported_s = float("-inf")
        self._alive = topic_of(self.station, ALIVE)
        self._broker = Broker(
            address, f"taxel-{self.station}-{boot}",
            will=(self._alive, alive_bytes(boot, alive=False)),
            on_connect=lambda broker: self._say_alive(broker),
        )  # fmt: skip
        self.killed = False
        """True once the station has not ended by itself: then it is gone when this ends."""
        self.sent = 0
        """Reports that went out."""

    def where(self, wait_s: float) -> str:
        """Return where it reports to, and that nobody answers there, where that is so.

        Args:
            wait_s: How long to wait for the connection, seconds.
        """
        address, broker = self._broker.address, self._broker
        until_s = time.monotonic() + wait_s
        while not broker.connected and time.monotonic() < until_s:
            time.sleep(_LOOK_S)
        own = f"{bracketed(address.host)}:{address.port} as {self.station}"
        return own if broker.connected else f"{own}; no broker yet: {broker.why}; it is tried again"

    def take_in(self, topic: str, note: dict[str, Any], time_s: float) -> None:
        """Take in what came through the station's rings.

        Args:
            topic: As `following` names it.
            note: The state, or how a source does.
            time_s: When that was so, monotonic seconds.
        """
        if topic == STATE:
            self._state = note
        elif topic == SOURCES:
            self._sources[note["source"]] = note, time_s

    def report(self, now_s: float) -> None:
        """Report, once a second at most; never waits.

        Args:
            now_s: This moment, monotonic seconds.
        """
        if now_s - self._reported_s < PERIOD_S:
            return
        self._reported_s = now_s
        sources = [how_it_does(note, now_s - time_s) for note, time_s in self._sources.values()]
        made = make_report(self._identity, self.sent, self._state, sources, time.time())
        self.sent += self._broker.publish(topic_of(self.station, REPORT), made.as_bytes())

    def _say_alive(self, broker: Broker) -> None:
        broker.publish(self._alive, alive_bytes(self._identity.boot, alive=True), surely=True)

    def __enter__(self) -> Reporter:
        self._broker.__enter__()
        return self

    def __exit__(self, kind: type[BaseException] | None, *_: object) -> None:
        ended = kind is None and not self.killed  # after an error the station may run on, unseen
        last = alive_bytes(self._identity.boot, alive=False, ended=ended)
        self._broker.finish(self._alive, last)
        self._broker.__exit__()


def bundle_names(paths: Sequence[str]) -> tuple[str, ...]:
    """Return each bundle's file name with the beginning of its SHA-256."""
    return tuple(
        f"{Path(path).name} {hashlib.sha256(Path(path).read_bytes()).hexdigest()[:12]}"
        for path in paths
    )
