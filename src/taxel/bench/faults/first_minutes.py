"""What a person sees in the first minutes on simulated cups, for `taxel bench faults`.

`taxel live cup-pour sim://cup-pour --page` as it runs, in real processes: nothing is wrong, so
that every camera that is called gone, frozen or late is a false alarm. Knows nothing about goals
of other faults.
"""

from __future__ import annotations

import os
from collections import Counter
from typing import Any

import numpy as np

from taxel.bench.rows import Row, row
from taxel.bundles.shipped import CUP_POUR, shipped_bundle
from taxel.decisions.reasons import kind_of
from taxel.live.station.guard import STOP
from taxel.live.station.station import Station
from taxel.live.station.wiring import StationConfig

MINUTES = 10.0
_URL = "sim://cup-pour"


class MinuteSeen:
    """Counts what the monitor and the station reported."""

    def __init__(self) -> None:
        self.why: Counter[str | None] = Counter()
        """Reason's name → times it began; None: words that stand in no table."""
        self.example = ""
        self.late = 0
        self.grasps = 0
        self.waits_s: list[float] = []
        """How long each grasp was UNKNOWN before its first state."""
        self._before: tuple[str, str | None] = ("", None)
        self._began_s: float | None = None

    def note(self, note: dict[str, Any]) -> None:
        """Take in a monitor's note."""
        if note.get("kind") == "new grasp":
            self.grasps, self._began_s = self.grasps + 1, None
        if note.get("kind") != "grasp":
            return
        self.late += bool(note.get("late"))
        state, reason = note["state"], note["reason"]
        shown = state, kind_of(reason)
        if state in ("UNKNOWN", "NO_GRASP") and shown != self._before:
            self.why[shown[1]] += 1
            self.example = self.example or (reason if shown[1] is None else "")
        self._before = shown
        self._wait(state, note.get("time_s"))

    def rows(self, what: str) -> list[Row]:
        """Return what was reported although nothing is wrong, as rows.

        Args:
            what: What ran, and how long.
        """
        words = ", ".join(f"{name or 'not in the table'} {n}" for name, n in self.why.most_common())
        busy = f"load {os.getloadavg()[0]:.1f} on {os.cpu_count()} cores at the end"
        note = f"{self.grasps} grasps ended; UNKNOWN and NO GRASP by reason: {words}; {busy}"
        return [
            *(
                row(f"{what}: false “{name}”", self.why[name], "times", "<=", 0.0, note)
                for name in ("gone", "frozen")
            ),
            row(f"{what}: false “late”", self.late, "notes", "<=", 0.0),
            row(f"{what}: UNKNOWN for a reason that stands in no table", self.why[None], "times",
                "<=", 0.0, self.example),
        ]  # fmt: skip

    def _wait(self, state: str, time_s: float | None) -> None:
        if time_s is None:
            return
        if self._began_s is None:
            self._began_s = time_s
        elif state != "UNKNOWN" and self._began_s < np.inf:
            self.waits_s.append(time_s - self._began_s)
            self._began_s = np.inf


class Stops:
    """Counts how often a station showed STOP, by what it said.

    Args:
        station: The station.
    """

    def __init__(self, station: Station) -> None:
        self._station = station
        self._word = ""
        self.why: Counter[str] = Counter()

    def look(self, _: float) -> None:
        """Look at what is shown, in each tick."""
        word, reason, _ = self._station.guard.shown
        if word == STOP != self._word:
            self.why[reason] += 1
        self._word = word

    def row(self, name: str) -> Row:
        """Return the count as a row, whose goal is none."""
        words = ", ".join(f"{reason} {n}" for reason, n in self.why.most_common(4))
        return row(name, self.why.total(), "times", "<=", 0.0, words)


def first_minutes_rows(seconds: float) -> list[Row]:
    """Run a station with `cup-pour`; count what is reported although nothing is wrong.

    Args:
        seconds: How long.
    """
    from taxel.views.page.station_page import StationPage, show

    how_long = f"{seconds / 60:g} minutes" if seconds >= 60 else f"{seconds:g} s"
    minute = MinuteSeen()
    config = StationConfig(sources=(_URL,), bundles=(shipped_bundle(CUP_POUR),))
    with Station(config, minute.note) as station:
        view = station.view_config()
        station.add_process("page", show, lambda place: StationPage(place=place, view=view))
        stops = Stops(station)
        station.run(seconds, on_tick=stops.look)
    what = f"{how_long} of {_URL} with the page"
    waits = minute.waits_s or [float("nan")]
    return [
        *minute.rows(what),
        stops.row(f"{what}: STOP shown without a cause"),
        Row(name=f"{what}: a grasp's first frame to its first state", value=float(np.median(waits)),
            unit="s",
            note=f"median of {len(minute.waits_s)}, longest {max(waits):.2f} s: UNKNOWN, and says "
                 "what is left"),
    ]  # fmt: skip
