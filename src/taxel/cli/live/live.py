"""`taxel live`: predict from a source in the terminal, without a training framework."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from math import inf
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, ClassVar

import tyro

from taxel.bundles.shipped import find_bundle
from taxel.cli.live.station import StationOptions, answers_lines
from taxel.cli.options.page_address import LOCAL_ADDRESS, PageAddress, parse_address
from taxel.cli.options.pairs import Pairs, parse_pairs
from taxel.cli.options.rules import Only
from taxel.cli.printing import console, print_json, say, say_aside
from taxel.cli.recordings.recording import SUMMARY_FOLLOWS, stop_signals
from taxel.errors import BadInput

if TYPE_CHECKING:
    from taxel.actions.rule_table import RuleTable
    from taxel.bundles.contract import Contract
    from taxel.bundles.reader import Bundle
    from taxel.bundles.signing import Trust
    from taxel.bundles.trials import TrialContract
    from taxel.calibration.live import LiveNewtons
    from taxel.live.outages import Outage
    from taxel.live.rate_watch import RateChange
    from taxel.live.recogniser import Recogniser
    from taxel.live.session import Tally
    from taxel.signals import Samples
    from taxel.sources.contract import Source


LEAST_CONFIDENCE = 0.5
"""Probability below which an answer is UNKNOWN unless another is asked for. Our choice,
docs/decisions/0010."""


@dataclass(frozen=True, kw_only=True)
class Live:
    """Predict what is in the hand, window by window, with confidence, latency and the map.

    A bundle for tactile cameras warns before the grasp turns unstable; a bundle for camera trials
    gives a verdict that is updated while a trial runs.
    """

    bundle: tyro.conf.Positional[Path]
    """A bundle, NAME.taxel; or cup-pour or slip-rule, which come with taxel. It runs on the
    processor, or on $TAXEL_DEVICE: cuda, tensorrt, rocm, migraphx, directml, coreml or openvino,
    where installed."""
    source: tyro.conf.Positional[str]
    """A source: sim://teng, serial://…, camera://…, a recording (replay://FILE), or a folder of
    recordings of an array or of camera trials, replayed one after another (as fast as possible:
    replay://FOLDER?speed=max)."""
    seconds: float | None = None
    """Stop after this many seconds of the source's own time (with --page, --record and other
    station options: of real time); unless given, at the source's end or at Ctrl-C."""
    also: Annotated[tuple[Path, ...], tyro.conf.UseAppendAction] = ()
    """Another bundle to run on the same samples, such as material beside shape; may be given
    several times."""
    least_confidence: float | None = None
    """Arrays and trials: below this probability the answer is UNKNOWN, 0…1; 0.5 unless given."""
    trust: Path | None = None
    """File of public keys; a bundle that none of them signed is refused. Unless given, no signature
    is needed."""
    beside: Annotated[tuple[str, ...], tyro.conf.UseAppendAction] = ()
    """Another source to run beside the first, such as a hand beside a pair of cameras; each
    bundle goes to the first source that it fits. May be given several times."""
    rules: Path | None = None
    """Table (CSV) with the columns class, least_confidence (0…1) and action. The action for each
    answer is shown, and with --tell sent with the class and its confidence."""
    page: PageAddress = None
    """Serve the operator's page, at HOST:PORT or else at 127.0.0.1 and a free port; the address is
    printed. Any other host than 127.0.0.1 opens the page to the network."""
    calibration: Path | None = None
    """Calibration (.json) of the array, to show newtons on the map and the page; the bundle still
    gets volts."""
    record: Path | None = None
    """Record everything to this file, ending in .mcap. A log of alarms, reactions and outcomes is
    written beside it, ending in .trials.csv."""
    label: Pairs = ()
    """With --record or --page: labels of every recording, which a model may learn, as in
    shape=sphere material=glass."""
    group: Pairs = ()
    """With --record or --page: groups of every recording, which a split must keep together, as in
    session=3 object=cup."""
    overwrite: bool = False
    """With --record: replace an existing recording."""
    gripper: str | None = None
    """Gripper whose force is raised on a warning: pge:///dev/serial/by-id/…?max_force_n=50, or sim
    for the simulated cup's."""
    arm: bool = False
    """With --gripper: arm it once the grasp is stable; otherwise a person presses the key m."""
    tell: str | None = None
    """Send state, orders, classes and actions as JSON to a program: udp://127.0.0.1:5005."""
    force_n: tuple[float, float] | None = None
    """With --gripper or --tell: grip force at the start of a grasp, and the largest, newtons;
    unless given 15 and 50, or as in the gripper's address."""
    publish: Annotated[tuple[str, ...], tyro.conf.UseAppendAction] = ()
    """Publish to other programs, read-only. zenoh://127.0.0.1:7447/bench-1:
    states, slip, scans and frames in batches of 10 ms. mqtt://127.0.0.1:1883/bench-1: a report a
    second to a fleet's broker. foxglove: a view for Foxglove or Lichtblick on this machine. rerun:
    a Rerun viewer. May be given several times."""
    json: bool = False
    """Print one JSON summary for each bundle at the end. marked: windows within finished, labelled
    grasps; right: the correct ones among them; grasps: such grasps with a window; grasps_right:
    those correct in all windows; grasps_without: grasps without a window; latencies in µs, from the
    last sample to the decision."""

    RULES: ClassVar = (
        Only(("arm",), "--gripper", lambda o: o.gripper),
        Only(("force-n",), "--gripper or --tell", lambda o: o.gripper or o.tell),
        Only(("overwrite",), "--record", lambda o: o.record),
        Only(("label", "group"), "--record or --page", lambda o: o.record or o.page is not None),
    )

    def run(self) -> None:
        """Run until the time is over, the source ends or the user stops it."""
        from taxel.actions.rule_table import RuleTable, read_rules
        from taxel.bundles.envelope import is_grasp_bundle, is_trial_bundle, need_bundle
        from taxel.bundles.reader import read_bundle
        from taxel.cli.live.station import live_station
        from taxel.decisions.recognition import RecogniseConfig
        from taxel.live.recogniser import Recogniser
        from taxel.models.devices import asked_device
        from taxel.sources.opening import open_source, recordings_of
        from taxel.windows.following import GateMove

        if self.seconds is not None and not self.seconds > 0:
            raise BadInput("--seconds above 0", str(self.seconds), "give a longer time")
        if self.least_confidence is not None and not 0 <= self.least_confidence <= 1:
            raise BadInput(
                "--least-confidence within 0 and 1", str(self.least_confidence), "choose another"
            )
        if self.force_n is not None and not 0 <= self.force_n[0] <= 0.99 * self.force_n[1] < inf:
            raise BadInput(
                "--force-n with a first force of at most 99 % of the second",
                f"{self.force_n[0]:g} and {self.force_n[1]:g} N", "name the smaller one first",
            )  # fmt: skip
        files = tuple(find_bundle(path) for path in (self.bundle, *self.also))
        for file in files:
            need_bundle(file)
        if self.least_confidence is not None and all(map(is_grasp_bundle, files)):
            raise BadInput(
                "a bundle of an array beside --least-confidence", "tactile cameras only",
                "leave it out: a monitor's threshold stands in its bundle",
            )  # fmt: skip
        trust = None
        if self.trust is not None:
            from taxel.bundles.signing import read_trust

            trust = read_trust(self.trust)
        if self.calibration is not None and not any(
            not (is_grasp_bundle(file) or is_trial_bundle(file)) for file in files
        ):
            raise BadInput(
                "a bundle of an array beside --calibration", "tactile cameras only", "leave it out"
            )
        device = asked_device()
        rules = RuleTable(())
        if self.rules is not None:
            rules = read_rules(self.rules, _known_classes(files, trust))
        if any(map(is_trial_bundle, files)) and (self._needs_station() or len(files) > 1):
            raise BadInput(
                "a bundle of camera trials alone, in the terminal", "more beside it",
                "leave the other bundles and options out",
            )  # fmt: skip
        if self._needs_station() or (len(files) > 1 and any(map(is_grasp_bundle, files))):
            live_station(self._station(files, trust, rules, device))
            return
        if is_trial_bundle(files[0]):
            from taxel.cli.live.trials import live_trials  # needs cameras' extra

            live_trials(
                files[0], self.source, self.seconds, self._least(), as_json=self.json,
                trust=trust, rules=rules, device=device,
            )  # fmt: skip
            return
        if is_grasp_bundle(files[0]):
            from taxel.cli.live.grasps import live_grasps  # needs cameras' extra

            live_grasps(files[0], self.source, self.seconds, self.json, trust, device)
            return
        bundles = [read_bundle(file, trust=trust, device=device) for file in files]
        config = RecogniseConfig(least_confidence=self._least())
        shown: list[Tally] = []
        aside = _Aside()
        with stop_signals(SUMMARY_FOLLOWS) as stopped:
            for address in recordings_of(self.source):
                with open_source(address) as source:
                    recognisers = [Recogniser(bundle, source.info, config) for bundle in bundles]
                    own = self._session(source, recognisers, rules, aside, stopped)
                for tally, more in zip(shown, own, strict=bool(shown)):
                    tally.take_in(more)
                shown = shown or own
                if stopped():
                    break
        results = [
            {"bundle": str(file)} | tally.summary()
            for file, tally in zip(files, shown, strict=True)
        ]
        for result, bundle in zip(results, bundles, strict=True):
            result["warning"] = self._seen(bundle) if result["marked"] else None
        if self.json:
            print_json(results)
            return
        for line, result in zip(answers_lines(results), results, strict=True):
            say(line)
            if result["marked"]:
                say(
                    f"  accuracy against ground truth: {result['right']}/{result['marked']} "
                    f"windows, {result['grasps_right']}/{result['grasps']} whole grasps (UNKNOWN "
                    "is correct only for touch that was never trained on)"
                )
            if result["grasps_without"]:
                say(
                    f"  warning: {result['grasps_without']} of "
                    f"{result['grasps'] + result['grasps_without']} marked grasps held no whole "
                    "window: nothing was decided of them", style="yellow",
                )  # fmt: skip
            if result["warning"] is not None:
                say(f"  warning: {result['warning']}", style="yellow")
            if result["filled"]:
                say(f"  {result['filled']} windows had short gaps filled in")
            for move in result["gate_moves"]:
                say(f"  {move['time_s']:.1f} s: {GateMove(**move).words()}")
            for still in result["still_channels"]:
                say(f"  warning: {still['time_s']:.1f} s: {still['text']}", style="yellow")
            for change in result["rate_changes"]:
                warning = "" if change["fits"] else "warning: "
                say(f"  {warning}{change['time_s']:.1f} s: {change['text']}", style="yellow")
            for outage in result["outages"]:
                say(f"  warning: {_outage_words(outage)}", style="yellow")
            if result["windows"]:
                say(
                    f"  latency from window to decision: median {result['latency_us_median']:.0f} "
                    f"µs, p99 {result['latency_us_p99']:.0f} µs"
                )

    def _session(
        self,
        source: Source,
        recognisers: list[Recogniser],
        rules: RuleTable,
        aside: _Aside,
        stopped: Callable[[], bool],
    ) -> list[Tally]:
        """Run one source until it ends or is stopped, on the screen where there is one."""
        from taxel.live.session import run_session

        newtons = self._newtons(source)
        if self.json or not console.is_terminal:
            own = run_session(source, recognisers, self.seconds, aside.show, rules, stopped)
            aside.say(own)
            return own
        from taxel.views.live import LiveView

        with LiveView(console, source.info, recognisers, newtons) as view:
            return run_session(source, recognisers, self.seconds, view.show, rules, stopped)

    def _seen(self, bundle: Bundle) -> str | None:
        """Return what must be said of an accuracy on what the bundle was trained on."""
        from taxel.evaluation.learned_recordings import recordings_trained_on
        from taxel.sources.opening import replayed_files
        from taxel.views.tables.trained_on import trained_on_line

        files = replayed_files(self.source)
        if not files:
            return None
        found = recordings_trained_on(bundle.contract, files)
        return trained_on_line(found, "recordings", known=bool(bundle.contract.learned))

    def _newtons(self, source: Source) -> LiveNewtons | None:
        """Return what shows the array in newtons, where a calibration was named."""
        if self.calibration is None:
            return None
        from taxel.calibration.live import LiveNewtons
        from taxel.calibration.stored import read_calibration

        return LiveNewtons(read_calibration(self.calibration), source.info)

    def _least(self) -> float:
        return LEAST_CONFIDENCE if self.least_confidence is None else self.least_confidence

    def _needs_station(self) -> bool:
        """True where one process is not enough."""
        asked = (self.beside, self.record, self.gripper, self.tell, self.publish)
        return self.page is not None or any(asked)

    def _station(
        self, bundles: tuple[Path, ...], trust: Trust | None, rules: RuleTable, device: str
    ) -> StationOptions:
        host, port = parse_address(LOCAL_ADDRESS if self.page is None else self.page)
        return StationOptions(
            bundles=bundles,
            sources=(self.source, *self.beside),
            seconds=self.seconds,
            least_confidence=self._least(),
            trust=trust,
            rules=rules,
            device=device,
            record=self.record,
            labels=parse_pairs(self.label, "--label"),
            groups=parse_pairs(self.group, "--group"),
            overwrite=self.overwrite,
            page=self.page is not None,
            page_host=host,
            page_port=port,
            gripper=self.gripper,
            arm=self.arm,
            tell=self.tell,
            force_n=self.force_n,
            publish=self.publish,
            calibration=self.calibration,
            json=self.json,
        )


def _outage_words(outage: dict[str, Any]) -> str:
    """Return what is said of an outage at the end."""
    until = "the end" if outage["end_s"] is None else f"{outage['end_s']:.1f} s"
    return f"{outage['start_s']:.1f} s to {until}: no usable values ({outage['reason']})"


class _Aside:
    """Says at once what befell the input, where no screen shows it: channels that have stopped
    changing, times without usable values, and another rate than in training.
    """

    def __init__(self) -> None:
        self._said: set[tuple[int, str]] = set()
        self._outages: dict[int, Outage] = {}
        self._rates: dict[int, RateChange] = {}

    def show(self, samples: Samples, tallies: list[Tally]) -> None:
        """Say it while a session runs."""
        self.say(tallies)

    def say(self, tallies: Sequence[Tally]) -> None:
        """Say on the error stream what is new in the tallies, one for each bundle."""
        for number, tally in enumerate(tallies):
            for still in tally.still_channels:
                if (number, still.channel) not in self._said:
                    self._said.add((number, still.channel))
                    say_aside(f"{tally.target}: {still.words()}")
            if tally.outages and tally.outages[-1] != self._outages.get(number):
                self._outages[number] = tally.outages[-1]
                say_aside(f"{tally.target}: {tally.outages[-1].words()}")
            if tally.rate_changes and tally.rate_changes[-1] != self._rates.get(number):
                self._rates[number] = tally.rate_changes[-1]
                say_aside(f"{tally.target}: {tally.rate_changes[-1].words()}")


def _known_classes(bundles: Sequence[Path], trust: Trust | None) -> dict[str, tuple[str, ...]]:
    """Return target → classes of every bundle that recognises something.

    Raises:
        BadInput: None does.
        BadBundle: One cannot be read, or is not signed by a key of `trust`.
    """
    from taxel.bundles.envelope import is_grasp_bundle, is_trial_bundle
    from taxel.bundles.reader import read_contract

    known: dict[str, tuple[str, ...]] = {}
    for path in bundles:
        if is_grasp_bundle(path):
            continue
        if is_trial_bundle(path):
            from taxel.bundles.trials import read_trial_contract  # needs cameras' extra

            contract: Contract | TrialContract = read_trial_contract(path, trust)
        else:
            contract = read_contract(path, trust)
        more = (name for name in contract.classes if name not in known.get(contract.target, ()))
        known[contract.target] = (*known.get(contract.target, ()), *more)
    if not known:
        raise BadInput(
            "a bundle that names classes beside --rules", "a grasp monitor alone",
            "leave --rules out: what to do about a grasp is shown without it",
        )  # fmt: skip
    return known
