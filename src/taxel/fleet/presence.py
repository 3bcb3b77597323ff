"""Whether a station is there, from the reports and signs of life of all that use its name.

Each start of a station draws a `boot`, so a name has several runs: those before a restart, and
those of a second station that was given the same name by mistake. One of them that ends, or is
killed, says nothing about the others. Knows nothing about brokers.

Background of our choices: docs/decisions/0052.
"""

from __future__ import annotations

from dataclasses import dataclass

from taxel.fleet.reports import Report

SILENT_S = 3.5
"""A station that has not reported for so long is silent, seconds: three reports and their delay.
Source: our choice, docs/decisions/0052."""
RANKS = ("DANGER", "GONE", "SILENT", "WARNING", "NAME TWICE", "LIVE", "ENDED")
"""What a station's presence may be, in the order in which a person must see it."""
_TWICE_S = 10.0
"""How long two stations under one name are shown after the last sign of it, seconds. Our choice."""
_MOST_RUNS = 8
"""Runs of a name that are remembered. Source: our choice, docs/decisions/0052: two stations, and
a few restarts of each."""
_NEVER_S = float("-inf")

Sign = tuple[str, bool, bool]
"""A sign of life as `reports.read_alive` gives it: boot, alive, ended."""


@dataclass(slots=True)
class _Run:
    """One start of a station."""

    boot: str
    report: Report | None = None
    heard_s: float = _NEVER_S
    """When it last reported, the fleet's own monotonic clock; a retained report says nothing."""
    heard: int = 0
    """Which message that was; 0 where there was none."""
    since_s: float = _NEVER_S
    """When it was first seen to run, the same clock."""
    began: int = 0
    """Which message showed first that it runs; 0 where only what the broker kept speaks of it."""
    sign: tuple[bool, bool] | None = None
    """The newest sign of life: alive, ended."""
    down: str = ""
    """GONE or ENDED; empty while it may be there."""

    def level(self) -> int:
        """Return how urgent its alarms are: 2 for danger."""
        levels = [alarm.level for alarm in self.report.alarms] if self.report is not None else []
        return 2 if "danger" in levels else 1 if "warning" in levels else 0


class Presence:
    """All runs of a name.

    Args:
        began_s: Since when this view listens, monotonic seconds.
    """

    def __init__(self, began_s: float) -> None:
        self._began_s = began_s
        self._runs: dict[str, _Run] = {}
        self._messages = 0
        self._twice_s = _NEVER_S

    def take_report(self, report: Report, retained: bool, now_s: float) -> None:
        """Take in a report.

        Args:
            report: It.
            retained: The broker had kept it: it may be old.
            now_s: When it came, monotonic seconds.
        """
        run = self._run(report.boot)
        if retained:
            run.report = run.report if run.heard else report
            return
        run.report, run.heard_s, run.heard = report, now_s, self._messages
        self._begin(run, now_s)
        if run.down == "GONE":  # its connection had broken, and is there again
            run.down = ""
        if any(other.heard and other.began > run.began for other in self._runs.values()):
            self._twice_s = now_s

    def take_alive(self, sign: Sign, retained: bool, now_s: float) -> None:
        """Take in a sign of life.

        Args:
            sign: It.
            retained: The broker had kept it, and gives it anew with each connection.
            now_s: When it came, monotonic seconds.
        """
        boot, alive, ended = sign
        run = self._run(boot)
        if retained and run.sign == (alive, ended):
            return
        run.sign = (alive, ended)
        run.down = "" if alive else "ENDED" if ended else "GONE"
        if alive:
            self._begin(run, now_s)

    def report(self, now_s: float) -> Report | None:
        """Return the report to show: the most urgent of those that come, else the newest."""
        live = [run for run in self._standing() if run.report and self._live(run, now_s)]
        if live:
            return max(live, key=_urgency).report
        return max(self._runs.values(), key=lambda run: (run.report is not None, run.heard)).report

    def age_s(self, now_s: float) -> float | None:
        """Return how long ago the newest report came; None where none has come."""
        heard_s = max(run.heard_s for run in self._runs.values())
        return now_s - heard_s if heard_s > _NEVER_S else None

    def word(self, now_s: float) -> str:
        """Return one of `RANKS`."""
        standing = self._standing()
        if not standing:
            return max(self._runs.values(), key=_newest).down or "SILENT"
        live = [run for run in standing if self._live(run, now_s)]
        if not live:
            return "SILENT"
        level = max(run.level() for run in live)
        if level:
            return "DANGER" if level == 2 else "WARNING"
        return "NAME TWICE" if now_s - self._twice_s < _TWICE_S else "LIVE"

    def _live(self, run: _Run, now_s: float) -> bool:
        return now_s - max(run.heard_s, run.since_s, self._began_s) <= SILENT_S

    def _begin(self, run: _Run, now_s: float) -> None:
        if not run.began:
            run.began, run.since_s = self._messages, now_s

    def _standing(self) -> list[_Run]:
        """Return the runs that may be there: neither down, nor silent since a later one began.

        What the broker alone had kept counts where nothing else is known.
        """
        newest = max(run.began for run in self._runs.values())
        return [
            run for run in self._runs.values()
            if not run.down and max(run.began, run.heard) >= newest
            and (run.began or len(self._runs) == 1)
        ]  # fmt: skip

    def _run(self, boot: str) -> _Run:
        """Return a run, the longest unheard one of too many forgotten."""
        self._messages += 1
        if boot not in self._runs and len(self._runs) >= _MOST_RUNS:
            oldest = min(self._runs.values(), key=lambda run: (not run.down, run.heard, run.began))
            del self._runs[oldest.boot]
        return self._runs.setdefault(boot, _Run(boot))


def _newest(run: _Run) -> tuple[int, int, bool]:
    return run.began, run.heard, run.sign is not None


def _urgency(run: _Run) -> tuple[int, int]:
    return run.level(), run.heard
