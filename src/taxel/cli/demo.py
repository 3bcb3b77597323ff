"""`taxel demo`: the TENG hand end to end on the simulator, then both systems live on a page."""

from __future__ import annotations

import shutil
import time
from dataclasses import dataclass, replace
from pathlib import Path

from taxel.bundles.shipped import DEFAULT_WARNING, shipped_bundle
from taxel.cli.extras import need_extra
from taxel.cli.printing import command, console, progress, say
from taxel.errors import BadInput

_MARK = "made-by-taxel-demo"
"""A file of this name marks a folder that the demo may replace."""
_TOUCHES_S = 15.0
"""Seconds in which the simulated hand grasps three times, with rests between."""


@dataclass(frozen=True, kw_only=True)
class Demo:
    """Simulate, train, compare with the thesis, predict live, offline, in a few minutes.

    It ends with the operator's page on a simulated cup and the simulated hand.
    """

    output: Path = Path("demo")
    """Folder to write to; an earlier demo's is replaced."""
    scans_per_class: int = 160_000
    """Scans of each shape and of each material (the thesis: about 160,000)."""
    live_seconds: float = 60.0
    """Seconds of live prediction, on the simulator's own clock."""
    seconds: float | None = None
    """How long the operator's page stays open, seconds; 0 leaves it out. Without this it stays
    until q or Ctrl-C, where there is a terminal."""
    seed: int = 0
    """Seed of everything random."""

    def run(self) -> None:
        """Run all steps."""
        if self.seconds is not None and not self.seconds >= 0:
            raise BadInput("--seconds of at least 0", f"{self.seconds:g}", "give a longer time")
        need_extra("train", "taxel demo")
        if self.seconds != 0:
            need_extra("page", "taxel demo's page (--seconds 0 leaves it out)")
        started = time.monotonic()
        self._clear()
        self._say(1, "simulate", "sim://teng: six sessions of grasps, recorded as MCAP")
        from taxel.sources.simulated.data_sets import simulate_presets

        simulate_presets(self.output, ("honest",), self.scans_per_class, self.seed)
        self._say(2, "train and compare", "Table 4.1 of the thesis, on both splits")
        self._table()
        self._say(3, "bundle", "one file per recogniser, checked against PyTorch")
        bundles = [self._bundle(task) for task in ("shape", "material")]
        self._say(4, "live", f"{self.live_seconds:g} s of grasps, in a session it has never seen")
        self._live(bundles)
        self._say(
            5, "three touches of a known object", "the same grasps, each channel scaled by them"
        )
        self._touch(bundles)
        self._live(bundles)
        self._what_to_look_at(time.monotonic() - started)
        seconds = self.seconds
        if seconds is None and not console.is_terminal:
            seconds = 0.0
        if seconds is None or seconds > 0:
            how_long = "until q or Ctrl-C" if seconds is None else f"for {seconds:g} s"
            self._say(6, "the operator's page", f"a cup that is filled, and the hand, {how_long}")
            self._page(bundles, seconds)

    def _page(self, bundles: list[Path], seconds: float | None) -> None:
        from taxel.cli.live.station import SIMULATED, StationOptions, live_station

        options = StationOptions(
            bundles=(shipped_bundle(DEFAULT_WARNING), *bundles),
            sources=(f"sim://cup-pour?seed={self.seed}", f"sim://teng?seed={self.seed + 1}"),
            seconds=seconds,
            least_confidence=0.5,
            page=True,
            gripper=SIMULATED,
            arm=True,
            recordings=self.output / "recordings",
        )
        live_station(options)

    def _clear(self) -> None:
        if self.output.exists():
            if not (self.output / _MARK).exists():
                raise BadInput(
                    "a folder that does not exist yet, or an earlier demo's, for --output",
                    f"{self.output}, which holds something else",
                    "choose another with --output",
                )
            shutil.rmtree(self.output)
        self.output.mkdir(parents=True)
        (self.output / _MARK).touch()

    def _table(self) -> None:
        from taxel.evaluation.teng.table_4_1 import TengTableConfig, section_plan, teng_table
        from taxel.views.report import write_teng_report
        from taxel.views.tables.results import teng_sections

        config = TengTableConfig(models=("cnn1d", "cnn2d"), seed=self.seed)
        folders = {"honest": self.output / "honest"}
        with progress() as bar:
            task = bar.add_task("starting", total=len(section_plan(("honest",))))
            sections = teng_table(
                folders, config, lambda line: bar.update(task, description=line, advance=1)
            )
        write_teng_report(self.output / "report.html", sections, folders)
        console.print(teng_sections(sections))

    def _bundle(self, target: str) -> Path:
        from taxel.training.final import train_bundle
        from taxel.training.recipes import find_recipe

        recipe = replace(find_recipe("teng-referenced"), target=target)
        path = self.output / f"{target}.taxel"
        contract = train_bundle(self.output / "honest", recipe, path, self.output / target)
        say(
            f"  {path}: {path.stat().st_size:,} bytes, {contract.parameters:,} parameters, "
            f"differs from PyTorch by at most {contract.parity:.0e}"
        )
        return path

    def _touch(self, bundles: list[Path]) -> None:
        """Record a glass cylinder in the new session; bring the bundles to its level."""
        from taxel.bundles.files import bundle_at_level
        from taxel.bundles.levels import measure_level
        from taxel.bundles.reader import read_contract
        from taxel.cli.recordings.record import Record
        from taxel.recordings.whole import write_whole

        touches = self.output / "touches.mcap"
        source = (
            f"sim://teng?seed={self.seed + 1}&rate_hz=500&shape=cylinder&material=glass&speed=max"
        )
        Record(source=source, output=touches, seconds=_TOUCHES_S).run()
        for bundle in bundles:
            found = measure_level(touches, read_contract(bundle), count=3)
            write_whole(bundle, bundle_at_level(bundle, found.level)[1])
        low, high = found.change.min(), found.change.max()
        say(f"  today's channel gain is {low:.2f}–{high:.2f} × training; both models rescaled")

    def _live(self, bundles: list[Path]) -> None:
        from taxel.cli.live.live import Live

        speed = "4" if console.is_terminal else "max"
        source = f"sim://teng?seed={self.seed + 1}&rate_hz=500&speed={speed}"
        Live(
            bundle=bundles[0], also=tuple(bundles[1:]), source=source, seconds=self.live_seconds
        ).run()

    def _what_to_look_at(self, seconds: float) -> None:
        out = self.output
        console.print()
        say(f"done in {seconds:.0f} s. What to look at:", style="bold")
        for what, words in (
            ("the report, in a browser", (out / "report.html",)),
            ("raw touch, no model", ("taxel", "view", "sim://teng", "--seconds", "20")),
            ("one session's recording", ("taxel", "info", out / "honest/session-1.mcap")),
            ("such touches, by hand",
             ("taxel", "adapt", out / "shape.taxel", "--touches", out / "touches.mcap")),
            ("are the recordings sound?", ("taxel", "audit", out / "honest")),
            ("the same live, in your time",
             ("taxel", "live", out / "shape.taxel", "--also", out / "material.taxel",
              f"sim://teng?seed={self.seed + 1}", "--seconds", "60")),
            ("a cup, a gripper, a page",
             ("taxel", "live", DEFAULT_WARNING, "sim://cup-pour", "--page", "--gripper", "sim",
              "--arm")),
            ("your own sensor", ("docs/how-to/own-array.md",)),
        ):  # fmt: skip
            say(f"  {what:<30} {command(*words)}")

    def _say(self, number: int, title: str, text: str) -> None:
        console.print()
        say(f"{number}. {title} · {text}", style="bold")
