"""What `taxel live` does with several sources, a page, a recording or a gripper: a station.

Background of our choices: docs/decisions/0019.
"""

from __future__ import annotations

import socket
from collections.abc import Sequence
from contextlib import ExitStack
from dataclasses import dataclass, field, replace
from pathlib import Path
from secrets import token_urlsafe
from typing import TYPE_CHECKING, Any

from taxel.cli.live.station_screen import EventLines, PrinterThread, press, print_keys
from taxel.cli.live.summaries import print_station_summary, station_summary
from taxel.cli.printing import console, print_json, say, say_aside
from taxel.cli.recordings.recording import SUMMARY_FOLLOWS, stop_signals
from taxel.errors import BadInput, TaxelError

if TYPE_CHECKING:
    from taxel.actions.actuators import Actuator
    from taxel.actions.gripper import ForceRange
    from taxel.actions.interlock import InterlockConfig
    from taxel.actions.rule_table import RuleTable
    from taxel.bundles.signing import Trust
    from taxel.live.station.station import Station
    from taxel.live.station.wiring import StationConfig

_PATIENT_S = 0.3
"""Silence that a monitor is allowed where only a simulated cup can drop: the simulator itself
takes most of a core, and a shared machine is late at times. Our choice."""
_PATIENCE = {"watchdog_s": _PATIENT_S, "decision_s": _PATIENT_S + 0.2, "stall_s": 0.12}
"""What follows from it for the interlock, seconds; the alarm of a stall still sounds in 0.15 s."""
FORCE_N = (15.0, 50.0)
"""Forces of the simulated cup's gripper, newtons. Source: grasp-transition paper, section 3."""
SIMULATED = "sim"
"""Names the gripper of the simulated cup."""


@dataclass(frozen=True, kw_only=True)
class StationOptions:
    """What `taxel live` was asked for, where it needs a station."""

    bundles: tuple[Path, ...]
    sources: tuple[str, ...]
    seconds: float | None
    least_confidence: float
    trust: Trust | None = None
    rules: RuleTable | None = None
    device: str = "cpu"
    record: Path | None = None
    labels: dict[str, str] = field(default_factory=dict)
    groups: dict[str, str] = field(default_factory=dict)
    overwrite: bool = False
    recordings: Path = Path("recordings")
    """Folder of recordings that are started from the page."""
    page: bool = False
    page_host: str = "127.0.0.1"
    page_port: int = 0
    gripper: str | None = None
    arm: bool = False
    tell: str | None = None
    force_n: tuple[float, float] | None = None
    """Force at which a grasp begins and largest force, newtons; `FORCE_N` unless given."""
    publish: tuple[str, ...] = ()
    calibration: Path | None = None
    """Of the array that the page shows, which is then in newtons."""
    json: bool = False


def live_station(options: StationOptions) -> dict[str, Any]:
    """Run a station until its time is over, its sources have ended, or the user stops it."""
    from taxel.live.station.station import Station
    from taxel.views.keys import Keys

    _check(options)
    with ExitStack() as stack:
        printer = PrinterThread()
        stack.callback(printer.close)
        actuators = _open_actuators(options)
        for actuator in actuators:
            stack.callback(actuator.close)
            actuator.connect()
        config = _station_config(options, actuators)
        stopped = stack.enter_context(
            stop_signals("completing the file" if options.record else SUMMARY_FOLLOWS)
        )
        try:
            station = stack.enter_context(Station(config))
            keys = stack.enter_context(Keys())
            _open_outputs(options, station, actuators)
        except TaxelError:
            if not stopped():
                raise
            # The signal went to its processes, too: that they ended is no fault of theirs.
            say_aside("stopped before the station had started")
            raise SystemExit(0) from None
        for url in station.wiring.unwatched:
            _note(options, f"nothing watches {url}: name one more bundle with --also")
        events = EventLines(printer)
        to_arm = options.arm

        def on_tick(_: float) -> None:
            nonlocal to_arm
            to_arm = to_arm and _still_to_arm(station)
            for key in keys.typed():
                press(key, station, printer.shown)
            if options.json or events.print_new(station):
                printer.note(frozenset(alarm.key for alarm in station.guard.alarms.alarms))

        if console.is_terminal and not options.json:
            acts = bool(options.gripper or options.tell)
            print_keys(acts=acts, watches=bool(station.wiring.watches))
        station.run(options.seconds, stopped, on_tick)
        station.close()  # what its processes say at their end is an event, too
        if not options.json:
            events.print_new(station)
    summary = station_summary(station)
    if options.json:
        print_json(summary)
    else:
        print_station_summary(summary)
    if station.failed or station.recording.get("error"):
        raise SystemExit(1)
    return summary


def _check(options: StationOptions) -> None:
    """Refuse options that cannot work, before anything is opened."""
    from taxel.cli.live.bus import check_bus
    from taxel.recordings.part_file import check_output
    from taxel.sources.opening import refuse_replayed

    check_bus(options.publish)
    if options.arm and options.gripper is None:
        raise BadInput("--gripper with --arm", "no gripper", "name one, or leave --arm out")
    if options.record is not None:
        check_output(options.record, options.overwrite)
        refuse_replayed(options.record, options.sources)


def _station_config(options: StationOptions, actuators: Sequence[Actuator]) -> StationConfig:
    """Return what the station runs, with force limits that suit the first gripper among them."""
    from taxel.actions.rule_table import RuleTable
    from taxel.live.station.guard import GuardConfig
    from taxel.live.station.wiring import StationConfig

    forces = [actuator.force for actuator in actuators if actuator.force is not None]
    interlock = _interlock(options, forces[0] if forces else _range(options))
    simulated = options.gripper == SIMULATED
    return StationConfig(
        sources=options.sources,
        bundles=options.bundles,
        trust=options.trust,
        rules=options.rules or RuleTable(()),
        device=options.device,
        least_confidence=options.least_confidence,
        recordings=options.recordings,
        labels=options.labels,
        groups=options.groups,
        calibration=options.calibration,
        guard=GuardConfig(silent_s=_PATIENT_S) if simulated else GuardConfig(),
        interlock=replace(interlock, **_PATIENCE) if simulated else interlock,
    )


def _open_outputs(options: StationOptions, station: Station, actuators: Sequence[Actuator]) -> None:
    """Connect what a station drives and feeds: grippers, page, publishers and the recording."""
    from taxel.cli.live.bus import open_bus

    for actuator in actuators:
        station.drive(actuator)
    if options.gripper == SIMULATED:
        _drive_simulated(options, station)
    _open_page(options, station)
    for line in open_bus(station, options.publish):
        _note(options, line)
    _start_recording(options, station)


def _start_recording(options: StationOptions, station: Station) -> None:
    """Record the sources to --record, where it is given."""
    if options.record is None:
        return
    if left := station.wiring.not_recorded:
        _note(options, f"not recorded: {left}, as a recording holds one array")
    station.record(options.record, options.labels, options.groups, overwrite=options.overwrite)


def _range(options: StationOptions) -> ForceRange:
    """Return the forces asked for; what the simulated cup's gripper can do."""
    from taxel.actions.gripper import ForceRange

    least_n, most_n = options.force_n or FORCE_N
    return ForceRange(max_n=most_n, min_pct=100 * least_n / most_n)


def _interlock(options: StationOptions, force: ForceRange) -> InterlockConfig:
    """Return limits within both what a gripper can do and what was asked for."""
    from taxel.actions.interlock import InterlockConfig

    asked = _range(options)
    least_n = force.least_n if options.force_n is None else max(force.least_n, asked.least_n)
    least_n = min(least_n, force.max_n)
    return InterlockConfig(min_n=least_n, max_n=max(least_n, min(force.max_n, asked.max_n)))


def _open_actuators(options: StationOptions) -> list[Actuator]:
    """Open what was named, without connecting it."""
    from taxel.actions.opening import open_actuator

    named = [url for url in (options.gripper, options.tell) if url not in (None, SIMULATED)]
    return [open_actuator(url) for url in named if url is not None]


def _drive_simulated(options: StationOptions, station: Station) -> None:
    """Let the interlock's orders reach the simulated cup."""
    from taxel.live.station.acting import SimulatedGrip

    feeds = [feed for feed in station.wiring.feeds if feed.url.startswith("sim://cup-pour")]
    if not feeds:
        raise BadInput(f"a source sim://cup-pour with --gripper {SIMULATED}", "none", "name one")
    name = feeds[0].worker.name

    def send(force_n: float, expires_s: float) -> None:
        station.order(name, {"grip_n": force_n, "expires_s": expires_s})

    monitors = [monitor for monitor in station.wiring.monitors if monitor.feed is feeds[0]]
    watchers = {who for monitor in monitors for who in monitor.watchers}
    station.drive(SimulatedGrip(send, _range(options), watchers=watchers))


def _note(options: StationOptions, text: str) -> None:
    """Say what a person must know, beside the JSON where that is asked for."""
    (say_aside if options.json else say)(text)


def _still_to_arm(station: Station) -> bool:
    """Arm once the grasp is stable, as --arm asks; return whether that is still to be done.

    Whoever disarms before it was armed wants no orders: then it is never armed by itself.
    """
    if station.guard.interlock.disarms:
        return False
    return station.guard.shown[0] != "STABLE" or bool(station.arm())


def _open_page(options: StationOptions, station: Station) -> None:
    if not options.page:
        return
    from taxel.views.page.station_page import StationPage, show

    view = station.view_config()
    # Drawn once: a page that is started again is found under the same address.
    token, port = token_urlsafe(32), options.page_port or _free_port(options.page_host)
    (url,) = station.add_process(
        "page", show,
        lambda place: StationPage(
            place=place, view=view, host=options.page_host, port=port, token=token
        ),
    )  # fmt: skip
    _note(options, f"the page: {url}")


def _free_port(host: str) -> int:
    family = socket.AF_INET6 if ":" in host else socket.AF_INET
    with socket.socket(family, socket.SOCK_STREAM) as probe:
        try:
            probe.bind((host, 0))
        except OSError:
            return 0  # the page itself says what is wrong with the address
        return int(probe.getsockname()[1])
