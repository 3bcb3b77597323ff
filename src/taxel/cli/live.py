"""`taxel live`: predict from a source in the terminal, without a training framework."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import tyro

from taxel.bundles.shipped import find_bundle
from taxel.cli.live_station import StationOptions, answers_lines
from taxel.cli.pairs import Pairs, parse_pairs
from taxel.cli.printing import console, print_json, say
from taxel.errors import BadInput

if TYPE_CHECKING:
    from taxel.bundles.signing import Trust


@dataclass(frozen=True, kw_only=True)
class Live:
    """Tell what is in the hand, window by window, with confidence, latency and the map."""

    bundle: tyro.conf.Positional[Path]
    """A bundle, as taxel bundle writes it; or one that comes with taxel: cup-pour."""
    source: tyro.conf.Positional[str]
    """A source: sim://teng, replay://FILE, or a recording's file."""
    seconds: float | None = None
    """Stop after this many seconds of the source's time, at any speed (with --page, --record and
    the like: of the clock on the wall); else at its end or at Ctrl-C."""
    also: Annotated[tuple[Path, ...], tyro.conf.UseAppendAction] = ()
    """One more bundle to run on the same samples, such as one for shape and one for material; may
    be given several times."""
    least_confidence: float = 0.5
    """Below this probability the answer is UNKNOWN, 0…1."""
    trust: Path | None = None
    """A public key, or a file of several: a bundle that none of them signed is refused. See
    taxel bundle --sign."""
    beside: Annotated[tuple[str, ...], tyro.conf.UseAppendAction] = ()
    """One more source to run beside the first, such as a hand beside a pair of cameras; each
    bundle goes to the first source that it fits. May be given several times."""
    page: bool = False
    """Open the operator's page; its address is printed."""
    page_host: str = "127.0.0.1"
    """Where the page listens; anything but this machine's own address is open to the network."""
    page_port: int = 0
    """Port of the page; 0 takes a free one."""
    record: Path | None = None
    """Record everything to this file, ending in .mcap."""
    label: Pairs = ()
    """With --record or --page: what may be learned of every recording, as in shape=sphere
    material=glass."""
    group: Pairs = ()
    """With --record or --page: what it belongs to and must not be split, as in session=3
    object=cup."""
    overwrite: bool = False
    """With --record: replace an existing recording."""
    gripper: str | None = None
    """Raise the grip on a warning: pge:///dev/serial/by-id/…?max_force_n=50, or sim for the
    simulated cup's."""
    arm: bool = False
    """With --gripper: arm once the grasp is stable; else a person arms with the key m."""
    tell: str | None = None
    """Tell another robot's program the state: udp://127.0.0.1:5005."""
    least_n: float = 15.0
    """With --gripper: the force at which a grasp begins, newtons."""
    most_n: float = 50.0
    """With --gripper: the largest force, newtons."""
    rerun: bool = False
    """Stream to a Rerun viewer, from a process of its own."""
    quiet: bool = False
    """Print the summary only."""
    json: bool = False
    """Print JSON: one summary a bundle at the end. marked: windows inside a finished, labelled
    grasp, of which right were told right; grasps: such grasps that gave a window, of which
    grasps_right by all their windows; latencies in µs, from samples in hand to decision."""

    def run(self) -> None:
        """Run until the time is over, the source ends or the user stops it."""
        from taxel.bundles.envelope import need_bundle
        from taxel.bundles.grasp import is_grasp_bundle
        from taxel.bundles.reader import read_bundle
        from taxel.cli.live_grasps import live_grasps
        from taxel.cli.live_station import live_station
        from taxel.decisions.recognition import RecogniseConfig
        from taxel.live.recogniser import Recogniser
        from taxel.live.session import run_session
        from taxel.sources.opening import open_source

        if self.seconds is not None and not self.seconds > 0:
            raise BadInput("--seconds above 0", str(self.seconds), "give a longer time")
        if not 0 <= self.least_confidence <= 1:
            raise BadInput(
                "--least-confidence within 0 and 1", str(self.least_confidence), "choose another"
            )
        about = {"--label": self.label, "--group": self.group, "--overwrite": self.overwrite}
        given = [option for option, one in about.items() if one]
        if given and not (self.record or self.page):
            raise BadInput(
                f"--record or --page with {' and '.join(given)}", "no recording",
                "name a file with --record",
            )  # fmt: skip
        files = tuple(find_bundle(path) for path in (self.bundle, *self.also))
        for file in files:
            need_bundle(file)
        trust = None
        if self.trust is not None:
            from taxel.bundles.signing import read_trust

            trust = read_trust(self.trust)
        if self._needs_station() or (len(files) > 1 and any(map(is_grasp_bundle, files))):
            live_station(self._station(files, trust))
            return
        if is_grasp_bundle(files[0]):
            live_grasps(files[0], self.source, self.seconds, self.quiet, self.json, trust)
            return
        bundles = [read_bundle(file, trust=trust) for file in files]
        config = RecogniseConfig(least_confidence=self.least_confidence)
        with open_source(self.source) as source:
            recognisers = [Recogniser(bundle, source.info, config) for bundle in bundles]
            if self.quiet or self.json or not console.is_terminal:
                shown = run_session(source, recognisers, self.seconds)
            else:
                from taxel.views.live import LiveView

                with LiveView(console, source.info, recognisers) as view:
                    shown = run_session(source, recognisers, self.seconds, view.show)
        results = [
            {"bundle": str(file)} | tally.summary()
            for file, tally in zip(files, shown, strict=True)
        ]
        if self.json:
            print_json(results)
            return
        for line, result in zip(answers_lines(results), results, strict=True):
            say(line)
            if result["marked"]:
                say(
                    f"  right by the source's own labels: {result['right']} of the "
                    f"{result['marked']} windows inside a finished grasp, {result['grasps_right']} "
                    f"of the {result['grasps']} finished grasps that gave a window (UNKNOWN is "
                    "right only for what was never learned)"
                )
            if result["windows"]:
                say(
                    f"  a window to a decision: median {result['latency_us_median']:.0f} µs, "
                    f"99 % of the windows below {result['latency_us_p99']:.0f} µs"
                )

    def _needs_station(self) -> bool:
        """True where one process is not enough."""
        return bool(
            self.beside or self.page or self.record or self.gripper or self.tell or self.rerun
        )

    def _station(self, bundles: tuple[Path, ...], trust: Trust | None) -> StationOptions:
        return StationOptions(
            bundles=bundles,
            sources=(self.source, *self.beside),
            seconds=self.seconds,
            least_confidence=self.least_confidence,
            trust=trust,
            record=self.record,
            labels=parse_pairs(self.label, "--label"),
            groups=parse_pairs(self.group, "--group"),
            overwrite=self.overwrite,
            page=self.page,
            page_host=self.page_host,
            page_port=self.page_port,
            gripper=self.gripper,
            arm=self.arm,
            tell=self.tell,
            least_n=self.least_n,
            most_n=self.most_n,
            rerun=self.rerun,
            quiet=self.quiet,
            json=self.json,
        )
