"""All stations of a fleet as their reports say, worst first. It only listens.

Background of our choices: docs/decisions/0052.
"""

from __future__ import annotations

import threading
import time
from dataclasses import dataclass
from secrets import token_hex
from typing import Any

from taxel.bus.addresses import MqttAddress, is_station_name
from taxel.fleet.broker import Broker
from taxel.fleet.presence import RANKS, Presence
from taxel.fleet.reports import ALIVE, REPORT, ROOT, Report, read_alive, read_report

MOST_STATIONS = 1000
"""Source: our choice: twenty times what is measured."""


@dataclass(frozen=True, slots=True, kw_only=True)
class FleetRow:
    """One station as a table shows it."""

    station: str
    presence: str
    """One of `RANKS`."""
    age_s: float | None
    """How long ago it last reported, seconds; None where it has not since this watch began."""
    report: Report | None


class FleetState:
    """What the messages so far say; knows nothing about connections.

    Args:
        now_s: This moment, monotonic seconds.
    """

    def __init__(self, now_s: float) -> None:
        self._stations: dict[str, Presence] = {}
        self._began_s = now_s
        self.refused = 0
        """Messages that were none."""
        self.beyond = 0
        """Messages of stations that have no place in the full table."""

    def take(self, topic: str, payload: bytes, retained: bool, now_s: float) -> None:
        """Take in one message.

        Args:
            topic: Where it was sent to.
            payload: Its bytes.
            retained: The broker had kept it: it may be old.
            now_s: When it came, monotonic seconds.
        """
        station, _, what = topic.removeprefix(f"{ROOT}/").partition("/")
        try:
            if not is_station_name(station):
                raise ValueError("needed a station's name")
            if what == REPORT:
                report = read_report(payload)
                if report.station != station:
                    raise ValueError("needed a report of this station")
                if self._has_place(station):
                    self._of(station).take_report(report, retained, now_s)
            elif what == ALIVE:
                sign = read_alive(payload)
                if self._has_place(station):
                    self._of(station).take_alive(sign, retained, now_s)
            else:
                raise ValueError("needed a topic of stations")
        except ValueError:
            self.refused += 1

    def _has_place(self, station: str) -> bool:
        """Return whether the table has room; count what it has none for."""
        found = station in self._stations or len(self._stations) < MOST_STATIONS
        self.beyond += not found
        return found

    def _of(self, station: str) -> Presence:
        return self._stations.setdefault(station, Presence(self._began_s))

    def rows(self, now_s: float) -> list[FleetRow]:
        """Return all stations, what a person must see first on top.

        Args:
            now_s: This moment, monotonic seconds.
        """
        found = [
            FleetRow(
                station=name, presence=seen.word(now_s), report=seen.report(now_s),
                age_s=seen.age_s(now_s),
            )
            for name, seen in self._stations.items()
        ]  # fmt: skip
        return sorted(found, key=lambda row: (RANKS.index(row.presence), row.station))


class FleetWatch:
    """The stations of a broker; use it in a `with` block.

    Args:
        address: The broker.
    """

    def __init__(self, address: MqttAddress) -> None:
        self.state = FleetState(time.monotonic())
        self._lock = threading.Lock()
        self.broker = Broker(
            address, f"taxel-fleet-{token_hex(8)}",
            subscribe=(f"{ROOT}/+/{REPORT}", f"{ROOT}/+/{ALIVE}"), on_message=self._take,
        )  # fmt: skip

    def _take(self, topic: str, payload: bytes, retained: bool) -> None:
        with self._lock:
            self.state.take(topic, payload, retained, time.monotonic())

    def rows(self) -> list[FleetRow]:
        """Return all stations as they are now."""
        with self._lock:
            return self.state.rows(time.monotonic())

    def snapshot(self) -> dict[str, Any]:
        """Return everything as plain values."""
        return {
            "broker": {"connected": self.broker.connected, "why": self.broker.why,
                       "address": f"{self.broker.address.host}:{self.broker.address.port}"},
            "refused": self.state.refused, "beyond": self.state.beyond,
            "stations": [row_values(row) for row in self.rows()],
        }  # fmt: skip

    def __enter__(self) -> FleetWatch:
        self.broker.__enter__()
        return self

    def __exit__(self, *_: object) -> None:
        self.broker.__exit__()


def row_values(row: FleetRow) -> dict[str, Any]:
    """Return a station as plain values, as the page and --json have it."""
    report = row.report
    values: dict[str, Any] = {
        "station": row.station, "presence": row.presence,
        "age_s": None if row.age_s is None else round(row.age_s, 3),
    }  # fmt: skip
    if report is not None:
        values |= {
            "state": report.state, "reason": report.reason, "state_s": round(report.age_s, 1),
            "alarms": [{"level": a.level, "text": a.text, "acknowledged": a.acknowledged}
                       for a in report.alarms],
            "lost": report.lost, "recording": report.recording, "version": report.version,
            "bundles": list(report.bundles),
            "sources": [{"name": s.name, "state": s.state, "lost": s.lost}
                        for s in report.sources],
        }  # fmt: skip
    return values
