"""All stations of a fleet as their reports say, and which of them have gone. It only listens.

Background of our choices: docs/decisions/0052.
"""

from __future__ import annotations

import threading
import time
from dataclasses import dataclass
from secrets import token_hex
from typing import Any

from taxel.bus.addresses import MqttAddress
from taxel.fleet.broker import Broker
from taxel.fleet.reports import ALIVE, REPORT, ROOT, Report, read_alive, read_report

SILENT_S = 3.5
"""A station that has not reported for so long is silent, seconds: three reports and their delay.
Source: our choice, docs/decisions/0052."""
MOST_STATIONS = 1000
"""Source: our choice: twenty times what is measured."""
_TWICE_S = 10.0
"""How long two stations under one name are shown after the last sign of it, seconds. Our choice."""
RANKS = ("DANGER", "GONE", "SILENT", "WARNING", "NAME TWICE", "LIVE", "ENDED")
"""What a station's presence may be, in the order in which a person must see it."""


@dataclass(slots=True)
class _Seen:
    """What is known of one station."""

    report: Report | None = None
    heard_s: float = float("-inf")
    """When it last reported, the fleet's own monotonic clock; a retained report says nothing."""
    boot: str = ""
    """The start that the newest sign of life speaks of."""
    alive: bool = True
    ended: bool = False
    changed_s: float = 0.0
    """When it came, went or ended."""
    former: str = ""
    """The start before the newest report's."""
    twice_s: float = float("-inf")
    """When the name was last used by two."""


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
        self._stations: dict[str, _Seen] = {}
        self._began_s = now_s
        self.refused = 0
        """Messages that were none."""

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
            if what == REPORT:
                report = read_report(payload)
                if report.station != station:
                    raise ValueError("needed a report of this station")
                self._take_report(self._of(station), report, retained, now_s)
            elif what == ALIVE:
                self._take_alive(self._of(station), *read_alive(payload), now_s)
            else:
                raise ValueError("needed a topic of stations")
        except ValueError:
            self.refused += 1

    def _of(self, station: str) -> _Seen:
        if station not in self._stations and len(self._stations) >= MOST_STATIONS:
            raise ValueError(f"needed at most {MOST_STATIONS} stations")
        return self._stations.setdefault(station, _Seen(changed_s=self._began_s))

    def _take_report(self, seen: _Seen, report: Report, retained: bool, now_s: float) -> None:
        before = seen.report.boot if seen.report is not None else report.boot
        if report.boot != before:
            if report.boot == seen.former:
                seen.twice_s = now_s
            seen.former = before
        seen.report = report
        if not retained:
            seen.heard_s = now_s

    def _take_alive(
        self, seen: _Seen, boot: str, alive: bool, ended: bool, now_s: float
    ) -> None:  # fmt: skip
        newest = seen.boot or (seen.report.boot if seen.report is not None else "")
        if not alive and newest not in ("", boot):
            return  # the will of a start before this
        seen.boot, seen.alive, seen.ended, seen.changed_s = boot, alive, ended, now_s

    def rows(self, now_s: float) -> list[FleetRow]:
        """Return all stations, what a person must see first on top.

        Args:
            now_s: This moment, monotonic seconds.
        """
        found = [
            FleetRow(
                station=name, presence=self._presence(seen, now_s), report=seen.report,
                age_s=now_s - seen.heard_s if seen.heard_s > float("-inf") else None,
            )
            for name, seen in self._stations.items()
        ]  # fmt: skip
        return sorted(found, key=lambda row: (RANKS.index(row.presence), row.station))

    def _presence(self, seen: _Seen, now_s: float) -> str:
        # A report that follows a last will comes from one that is there again.
        if not seen.alive and (seen.heard_s <= seen.changed_s or seen.ended):
            return "ENDED" if seen.ended else "GONE"
        if now_s - max(seen.heard_s, self._began_s) > SILENT_S:
            return "SILENT"
        levels = {a.level for a in seen.report.alarms} if seen.report is not None else set()
        if "danger" in levels:
            return "DANGER"
        if now_s - seen.twice_s < _TWICE_S:
            return "NAME TWICE"
        return "WARNING" if "warning" in levels else "LIVE"


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
            "refused": self.state.refused,
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
