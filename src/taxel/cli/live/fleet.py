"""`taxel fleet`: all stations of a broker at a glance; it only listens."""

from __future__ import annotations

from contextlib import ExitStack
from dataclasses import dataclass

import tyro

from taxel.cli.options.page_address import LOCAL_ADDRESS, PageAddress, parse_address
from taxel.cli.printing import console, print_json, say, say_aside
from taxel.cli.recordings.recording import SUMMARY_FOLLOWS, stop_signals
from taxel.errors import BadInput
from taxel.plain_text import visible_line


@dataclass(frozen=True, kw_only=True)
class Fleet:
    """Show the stations that report to a broker: state, alarms, losses, versions.

    Nothing is ever sent to a station. A station that was killed is shown as GONE, a station without
    a report for 3.5 s as SILENT.
    """

    broker: tyro.conf.Positional[str]
    """The broker: mqtt://127.0.0.1:1883, or mqtts://HOST:8883?ca=FILE&user=NAME&password_file=FILE."""
    seconds: float | None = None
    """Stop after this many seconds; at Ctrl-C unless given."""
    page: PageAddress = None
    """Serve the table as a page, at HOST:PORT or else at 127.0.0.1 and a free port; the address is
    printed. Any other host than 127.0.0.1 opens the page to the network."""
    json: bool = False
    """Print all stations as JSON at the end."""

    def run(self) -> None:
        """Show until the time is over or the user stops it."""
        from taxel.bus.addresses import parse_mqtt
        from taxel.fleet.table import fleet_line, fleet_table, show_fleet
        from taxel.fleet.watch import FleetWatch

        if self.seconds is not None and not self.seconds > 0:
            raise BadInput("--seconds above 0", f"{self.seconds:g}", "give a longer time")
        host, port = parse_address(LOCAL_ADDRESS if self.page is None else self.page)
        with ExitStack() as stack:
            stopped = stack.enter_context(stop_signals(SUMMARY_FOLLOWS))
            watch = stack.enter_context(FleetWatch(parse_mqtt(self.broker)))
            if self.page is not None:
                from taxel.fleet.page import FleetPage

                page = stack.enter_context(FleetPage(watch.snapshot, host, port))
                (say_aside if self.json else say)(f"the page: {page.url}")
            drawn = console if console.is_terminal and not self.json else None
            show_fleet(watch, drawn, self.seconds, stopped)
            found = watch.snapshot()
        if self.json:
            print_json(found)
        else:
            console.print(fleet_table(found["stations"]))
            say(fleet_line(found))
        broker = found["broker"]
        if not broker["connected"] and not found["stations"]:
            raise BadInput(
                f"a broker at {broker['address']}", visible_line(broker["why"], 200),
                "start it, or name another address",
            )  # fmt: skip
