"""A fleet as a table in the terminal. Knows nothing about brokers.

Background of our choices: docs/decisions/0052.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from contextlib import ExitStack
from typing import Any

from rich.console import Console, Group
from rich.live import Live
from rich.table import Table
from rich.text import Text

from taxel.fleet.watch import FleetWatch
from taxel.plain_text import visible, visible_line

_LOOK_S = 0.5
"""How often the table is drawn anew. Source: our choice."""

_COLOURS = {
    "DANGER": "bold white on red", "GONE": "bold red", "SILENT": "red", "WARNING": "yellow",
    "NAME TWICE": "magenta", "LIVE": "green", "ENDED": "dim",
}  # fmt: skip


def fleet_table(stations: Sequence[dict[str, Any]]) -> Table:
    """Return the stations as a table.

    Args:
        stations: As `watch.row_values` gives them.
    """
    table = Table(box=None, pad_edge=False)
    for title in ("station", "", "state", "alarm", "taxel"):
        table.add_column(title)
    for title in ("lost", "heard"):
        table.add_column(title, justify="right")
    for row in stations:
        alarms = row.get("alarms", [])
        age_s = row["age_s"]
        table.add_row(
            visible(row["station"]),
            Text(row["presence"], style=_COLOURS[row["presence"]]),
            visible_line(row.get("state", ""), 40),
            visible_line(alarms[0]["text"], 60) if alarms else "",
            visible(row.get("version", "")),
            f"{row['lost']:,}" if "lost" in row else "",
            "not yet" if age_s is None else ago(age_s),
        )
    return table


def ago(age_s: float) -> str:
    """Return how long ago something was, such as "4 s ago" or "30 h ago".

    Args:
        age_s: Seconds.
    """
    for unit, seconds in (("d", 86_400), ("h", 3600), ("min", 60)):
        if age_s >= 2 * seconds:
            return f"{age_s // seconds:.0f} {unit} ago"
    return f"{age_s:.0f} s ago"


def fleet_line(snapshot: dict[str, Any]) -> str:
    """Return how many stations there are in each state of presence, in one line."""
    stations, broker = snapshot["stations"], snapshot["broker"]
    counts: dict[str, int] = {}
    for row in stations:
        counts[row["presence"]] = counts.get(row["presence"], 0) + 1
    each = ", ".join(f"{count} {presence}" for presence, count in counts.items())
    away = "" if broker["connected"] else f"; no broker: {visible_line(broker['why'], 200)}"
    many = f"{len(stations)} station{'' if len(stations) == 1 else 's'}"
    return f"{many}{': ' + each if each else ''}{away}{_left_out(snapshot)}"


def _left_out(snapshot: dict[str, Any]) -> str:
    """Return a note on stations and messages that the table does not show; empty for none."""
    beyond, refused = snapshot.get("beyond", 0), snapshot.get("refused", 0)
    full = "; TABLE FULL: further stations are not shown" if beyond else ""
    return full + (f"; messages refused: {refused:,}" if refused else "")


def show_fleet(
    watch: FleetWatch,
    console: Console | None,
    seconds: float | None,
    stopped: Callable[[], bool],
) -> None:
    """Draw the table again and again until the time is over or `stopped` says so.

    Args:
        watch: The stations.
        console: Where to draw; None waits only.
        seconds: How long, seconds; None has no end.
        stopped: Asked before each drawing.
    """
    began_s = time.monotonic()
    with ExitStack() as stack:
        live = None
        if console is not None:
            live = stack.enter_context(Live(console=console, auto_refresh=False, transient=True))
        while not stopped():
            left_s = _LOOK_S
            if seconds is not None:
                left_s = min(left_s, began_s + seconds - time.monotonic())
            if left_s <= 0:
                return
            if live is not None:
                found = watch.snapshot()
                line = Text(fleet_line(found), style="dim")
                live.update(Group(fleet_table(found["stations"]), line), refresh=True)
            time.sleep(left_s)
