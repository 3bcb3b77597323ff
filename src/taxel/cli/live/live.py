"""`taxel live`: predict from a source in the terminal, without a training framework."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import inf
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, ClassVar

import tyro

from taxel.bundles.shipped import find_bundle
from taxel.cli.live.station import StationOptions
from taxel.cli.options.page_address import LOCAL_ADDRESS, PageAddress, parse_address
from taxel.cli.options.pairs import Pairs, parse_pairs
from taxel.cli.options.rules import Only
from taxel.errors import BadInput

if TYPE_CHECKING:
    from taxel.actions.rule_table import RuleTable
    from taxel.bundles.contract import Contract
    from taxel.bundles.signing import Trust
    from taxel.bundles.trials import TrialContract


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
    """A bundle, NAME.taxel; or slip-both-gels, cup-pour or slip-rule, which come with taxel. It
    runs on the processor, or on $TAXEL_DEVICE: cuda, tensorrt, rocm, migraphx, directml, coreml or
    openvino, where installed."""
    source: tyro.conf.Positional[str]
    """A source: sim://teng, serial://…, camera://…, a recording (replay://FILE), or a folder of
    recordings of an array or of camera trials, replayed one after another (as fast as possible:
    replay://FOLDER?speed=max)."""
    seconds: float | None = None
    """Stop after this many seconds of the source's own time, of a folder's recordings each (with
    --page, --record and other station options: of real time); unless given, at the source's end or
    at Ctrl-C."""
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
    """Table (CSV) with the columns class, least_confidence (0…1) and action, where wanted also
    target and alarm (warning or danger). The action for each answer is shown, and with --tell sent
    with the class and its confidence; its alarm is on while it is the newest."""
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
    those that all their windows together predict correctly; grasps_without: grasps without a
    window; latencies in µs, from the last sample to the decision; time_s, start_s and end_s:
    seconds from the first scan of the recording or source."""

    RULES: ClassVar = (
        Only(("arm",), "--gripper", lambda o: o.gripper),
        Only(("force-n",), "--gripper or --tell", lambda o: o.gripper or o.tell),
        Only(("overwrite",), "--record", lambda o: o.record),
        Only(("calibration",), "--page, or the terminal's screen", lambda o: o._shows_map()),
        Only(("label", "group"), "--record or --page", lambda o: o.record or o.page is not None),
    )

    def run(self) -> None:
        """Run until the time is over, the source ends or the user stops it."""
        from taxel.actions.rule_table import RuleTable, read_rules
        from taxel.bundles.envelope import is_grasp_bundle, is_trial_bundle
        from taxel.models.devices import asked_device

        self._check_numbers()
        files = self._checked_bundles()
        trust = None
        if self.trust is not None:
            from taxel.bundles.signing import read_trust

            trust = read_trust(self.trust)
        device = asked_device()
        rules = RuleTable(())
        if self.rules is not None:
            rules = read_rules(self.rules, _known_classes(files, trust))
        cameras = any(is_grasp_bundle(file) or is_trial_bundle(file) for file in files)
        station = self._needs_station() or rules.alarms or (len(files) > 1 and cameras)
        if any(map(is_grasp_bundle, files)) or (station and cameras):
            self._refuse_footage()
        if station:
            from taxel.cli.live.station import live_station

            live_station(self._station(files, trust, rules, device))
        elif is_trial_bundle(files[0]):
            from taxel.cli.live.trials import live_trials  # needs cameras' extra

            live_trials(
                files[0], self.source, self.seconds, self._least(), as_json=self.json,
                trust=trust, rules=rules, device=device,
            )  # fmt: skip
        elif is_grasp_bundle(files[0]):
            from taxel.cli.live.grasps import live_grasps  # needs cameras' extra

            live_grasps(files[0], self.source, self.seconds, self.json, trust, device)
        else:
            from taxel.cli.live.arrays import ArrayOptions, live_arrays

            live_arrays(
                ArrayOptions(
                    files=files, source=self.source, seconds=self.seconds,
                    least_confidence=self._least(), trust=trust, rules=rules, device=device,
                    calibration=self.calibration, json=self.json,
                )
            )  # fmt: skip

    def _refuse_footage(self) -> None:
        """Refuse videos, which a monitor can watch as recordings alone.

        Raises:
            BadTable: A source is a video, an image, or a folder of them.
        """
        from taxel.windows.camera_trials import refuse_footage  # needs cameras' extra

        for source in (self.source, *self.beside):
            path = Path(source.removeprefix("replay://").partition("?")[0])
            if path.exists():
                refuse_footage(path, imported=True)

    def _check_numbers(self) -> None:
        """Raise BadInput where a number is out of its limits."""
        if self.seconds is not None and not self.seconds > 0:
            raise BadInput("--seconds above 0", str(self.seconds), "give a longer time")
        if self.least_confidence is not None and not 0 <= self.least_confidence <= 1:
            raise BadInput(
                "--least-confidence within 0 and 1", str(self.least_confidence), "choose another"
            )
        if self.force_n is not None and not 0 <= self.force_n[0] <= 0.99 * self.force_n[1] < inf:
            raise BadInput(
                "--force-n with a first force of 0 N or more and at most 99 % of the second",
                f"{self.force_n[0]:g} and {self.force_n[1]:g} N", "name the smaller one first",
            )  # fmt: skip

    def _checked_bundles(self) -> tuple[Path, ...]:
        """Return the bundles' files.

        Raises:
            BadBundle: One is no bundle.
            BadInput: An option does not fit the kinds of these bundles.
        """
        from taxel.bundles.envelope import is_grasp_bundle, is_trial_bundle, need_bundle

        files = tuple(find_bundle(path) for path in (self.bundle, *self.also))
        for file in files:
            need_bundle(file)
        grasps = [file for file in files if is_grasp_bundle(file)]
        trials = [file for file in files if is_trial_bundle(file)]
        if self.least_confidence is not None and len(grasps) == len(files):
            raise BadInput(
                "a bundle of an array beside --least-confidence", "tactile cameras only",
                "leave it out: a monitor's threshold stands in its bundle",
            )  # fmt: skip
        if self.calibration is not None and len(grasps) + len(trials) == len(files):
            raise BadInput(
                "a bundle of an array beside --calibration", "tactile cameras only", "leave it out"
            )
        return files

    def _least(self) -> float:
        return LEAST_CONFIDENCE if self.least_confidence is None else self.least_confidence

    def _shows_map(self) -> bool:
        """True where a page, or the screen of a terminal, shows an array's map."""
        return self.page is not None or not (self.json or self._needs_station())

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


def _known_classes(bundles: Sequence[Path], trust: Trust | None) -> dict[str, tuple[str, ...]]:
    """Return target → classes of every bundle that recognises something.

    Raises:
        BadInput: None does.
        BadBundle: One cannot be read, or is not signed by a key of `trust`.
    """
    from taxel.bundles.envelope import is_grasp_bundle, is_trial_bundle
    from taxel.bundles.reader import read_contract

    classes: dict[str, tuple[str, ...]] = {}
    for path in bundles:
        if is_grasp_bundle(path):
            continue
        if is_trial_bundle(path):
            from taxel.bundles.trials import read_trial_contract  # needs cameras' extra

            contract: Contract | TrialContract = read_trial_contract(path, trust)
        else:
            contract = read_contract(path, trust)
        more = (name for name in contract.classes if name not in classes.get(contract.target, ()))
        classes[contract.target] = (*classes.get(contract.target, ()), *more)
    if not classes:
        raise BadInput(
            "a bundle that names classes beside --rules", "a grasp monitor alone",
            "leave --rules out: what to do about a grasp is shown without it",
        )  # fmt: skip
    return classes
