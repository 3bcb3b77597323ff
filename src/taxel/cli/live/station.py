"""What `taxel live` does with several sources, a page, a recording or a gripper: a station.

Background of our choices: docs/decisions/0019.
"""

from __future__ import annotations

import queue
import socket
import threading
from collections import Counter
from contextlib import ExitStack, suppress
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from secrets import token_urlsafe
from typing import TYPE_CHECKING, Any

from rich.text import Text

from taxel.cli.printing import console, print_json, say, say_aside
from taxel.cli.recordings.recording import SUMMARY_FOLLOWS, stop_signals
from taxel.errors import BadInput
from taxel.plain_text import visible, visible_line

if TYPE_CHECKING:
    from taxel.actions.actuators import Actuator
    from taxel.actions.gripper import ForceRange
    from taxel.actions.interlock import InterlockConfig
    from taxel.actions.rule_table import RuleTable
    from taxel.bundles.signing import Trust
    from taxel.live.station.station import Station

COLOURS = {
    "STABLE": "green", "WARNING": "yellow", "UNSTABLE": "red", "UNKNOWN": "magenta",
    "NO GRASP": "dim", "STOP": "bold white on red", "NONE": "dim",
    "NOT RECORDING": "bold white on red",
}  # fmt: skip
_KEYS = "keys: q end · a acknowledge · n new grasp"
_PERSON_KEYS = (
    "what you did: s stopped pouring · p put down · g grip changed; "
    "what came of it: h held · l slipped · x dropped"
)
_SAID = {"s": "pour stopped", "p": "put down", "g": "grip changed", "h": "held", "l": "slipped",
         "x": "dropped"}  # fmt: skip
"""Key → what a person says of the grasp."""
_GRIP_KEYS = " · m arm · d disarm"
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
    from taxel.actions.rule_table import RuleTable
    from taxel.cli.live.bus import check_bus, open_bus
    from taxel.live.station.guard import GuardConfig
    from taxel.live.station.station import Station
    from taxel.live.station.wiring import StationConfig
    from taxel.recordings.part_file import check_output
    from taxel.views.keys import Keys

    check_bus(options.publish)
    if options.arm and options.gripper is None:
        raise BadInput("--gripper with --arm", "no gripper", "name one, or leave --arm out")
    if options.record is not None:
        check_output(options.record, options.overwrite)
    with ExitStack() as stack:
        printer = _Printer()
        stack.callback(printer.close)
        said = _Said(options, printer)
        actuators = _open_actuators(options)
        for actuator in actuators:
            stack.callback(actuator.close)
            actuator.connect()
        force = next(
            (actuator.force for actuator in actuators if actuator.force is not None),
            _range(options),
        )
        simulated = options.gripper == SIMULATED
        interlock = _interlock(options, force)
        config = StationConfig(
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
        stopped = stack.enter_context(
            stop_signals("completing the file" if options.record else SUMMARY_FOLLOWS)
        )
        station = stack.enter_context(Station(config))
        keys = stack.enter_context(Keys())
        for actuator in actuators:
            station.drive(actuator)
        if simulated:
            _drive_simulated(options, station)
        _open_page(options, station)
        for line in open_bus(station, options.publish):
            _note(options, line)
        if options.record is not None:
            if station.wiring.not_recorded:
                left = station.wiring.not_recorded
                _note(options, f"a recording holds one array: {left} is left out")
            station.record(
                options.record, options.labels, options.groups, overwrite=options.overwrite
            )
        for url in station.wiring.unwatched:
            _note(options, f"nothing watches {url}: name one more bundle with --also")
        to_arm = options.arm

        def on_tick(_: float) -> None:
            nonlocal to_arm
            to_arm = to_arm and _still_to_arm(station)
            for key in keys.typed():
                _press(key, station)
            said.show(station)

        if console.is_terminal and not options.json:
            acts = options.gripper or options.tell
            say(_KEYS + (_GRIP_KEYS if acts else ""), style="dim")
            if station.wiring.watches:
                say(_PERSON_KEYS, style="dim")
        station.run(options.seconds, stopped, on_tick)
    result = _summary(station)
    if options.json:
        print_json(result)
    else:
        _print_summary(result)
    if station.failed or station.recording.get("error"):
        raise SystemExit(1)
    return result


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

    station.drive(SimulatedGrip(send, _range(options)))


def _note(options: StationOptions, text: str) -> None:
    """Say what a person must know, beside the JSON where that is asked for."""
    (say_aside if options.json else say)(text)


class _Printer:
    """Prints in a thread of its own: a terminal that stands still must not stop the supervisor."""

    def __init__(self) -> None:
        self._lines: queue.Queue[Text | None] = queue.Queue(maxsize=256)
        self._thread = threading.Thread(target=self._run, name="taxel printer", daemon=True)
        self._thread.start()

    def say(self, line: Text) -> None:
        """Print a line soon; drop it where too many wait."""
        with suppress(queue.Full):
            self._lines.put_nowait(line)

    def close(self) -> None:
        """Print what waits, for a second at most."""
        with suppress(queue.Full):
            self._lines.put(None, timeout=1.0)
        self._thread.join(1.0)

    def _run(self) -> None:
        while (line := self._lines.get()) is not None:
            console.print(line, soft_wrap=True)


class _Said:
    """Prints what has changed, once."""

    def __init__(self, options: StationOptions, printer: _Printer) -> None:
        self._silent = options.json
        self._shown = 0
        self._began_s: float | None = None
        self._printer = printer

    def show(self, station: Station) -> None:
        newest = station.events[-1][0] if station.events else 0
        if self._silent or newest == self._shown:
            return
        for number, time_s, text in station.events:
            if number <= self._shown:
                continue
            self._began_s = time_s if self._began_s is None else self._began_s
            colour = COLOURS.get(text.partition(":")[0], "cyan")
            when = f"{time_s - self._began_s:8.2f} s  "
            self._printer.say(Text.assemble(when, (visible_line(text), colour)))
        self._shown = newest


def _still_to_arm(station: Station) -> bool:
    """Arm once the grasp is stable, as --arm asks; return whether that is still to be done.

    Whoever disarms before it was armed wants no orders: then it is never armed by itself.
    """
    if station.guard.interlock.disarms:
        return False
    return station.guard.shown[0] != "STABLE" or bool(station.arm())


def _press(key: str, station: Station) -> None:
    if key == "q":
        station.stop()
    elif key == "a":
        station.acknowledge()
    elif key == "n":
        station.new_grasp()
    elif key in _SAID:
        station.react(_SAID[key])
    elif key == "d":
        station.disarm()
    elif key == "m":
        causes = station.arm()
        words = f"not armed: {causes[0]}" if causes else "armed"
        station.say(words)


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


def answers_lines(results: list[dict[str, Any]]) -> list[str]:
    """Return how many windows of each recogniser had which answer."""
    from taxel.live.station.answers import titles

    lines = []
    for title, result in zip(titles(results), results, strict=True):
        each = ", ".join(f"{visible(name)} {count}" for name, count in result["answers"].items())
        done = ", ".join(f"{visible(name)} {n}" for name, n in result["actions"].items())
        to_do = f"; to do: {done}" if done else ""
        lines.append(f"{title}: {result['windows']} windows: {each or 'none'}{to_do}")
    return lines


def trials_line(trials: list[dict[str, Any]]) -> str:
    """Return in how many grasps an alarm came, the person did something, and what came of them."""
    warned = sum(trial["alarm_s"] is not None for trial in trials)
    done = sum(bool(trial["reaction"]) for trial in trials)
    came = Counter(trial["outcome"] or "unknown" for trial in trials)
    each = ", ".join(f"{count} {name}" for name, count in came.most_common())
    many = f"{len(trials)} grasp{'' if len(trials) == 1 else 's'}"
    return f"{many}: {warned} with an alarm, {done} with a reaction; {each}"


def _summary(station: Station) -> dict[str, Any]:
    alarms = station.guard.alarms
    return {
        "state": station.guard.shown[0],
        "events": [{"time_s": time_s, "text": text} for _, time_s, text in station.events],
        "given_up": station.failed,
        "answers": station.answers.summary(),
        "alarms": alarms.as_json(),
        "trials": [asdict(trial) for trial in station.person.trials],
        "latency_ms": {
            stage: dict(zip(("p50", "p95", "p99"), values, strict=True))
            for stage, values in station.latencies.percentiles_ms().items()
        },
        "processes": station.ledger(),
        "recording": station.recording,
    }


def _print_summary(result: dict[str, Any]) -> None:
    from taxel.live.station.guard import NO_GRASP

    for line in answers_lines(result["answers"]):
        say(line)
    counts = result["alarms"]["counts"]
    if result["state"] != NO_GRASP or counts["raised"]:
        say(f"alarms: {counts['raised']} raised, {counts['acknowledged']} acknowledged")
    if result["trials"]:
        say(trials_line(result["trials"]))
    for name, process in result["processes"].items():
        again = f", started {process['starts']} times" if process["starts"] > 1 else ""
        if name == "recorder" and result["recording"].get("not_written"):
            again = f", not written {result['recording']['not_written']}{again}"
        say(
            f"  {name}: {process['produced']} messages produced, {process['consumed']} received, "
            f"{process['dropped']} lost{again}"
        )
    if result["latency_ms"]:
        parts = [
            f"{stage} {quantiles['p50']:.1f}" for stage, quantiles in result["latency_ms"].items()
        ]
        say(f"  median latency, ms: {' · '.join(parts)}")
    recording = result["recording"]
    if recording.get("error"):
        say(recording["error"], style="red")
    if recording.get("ledger"):
        ledger = recording["ledger"]
        parts = [f"{ledger['scans']} scans"] if ledger["scans"] else []
        parts += [
            f"{name} {camera['frames']} frames"
            for name, camera in ledger.get("cameras", {}).items()
        ]
        what = "taken in" if recording.get("error") else f"recorded: {recording['path']}"
        say(f"  {what}: {', '.join(parts)}")
