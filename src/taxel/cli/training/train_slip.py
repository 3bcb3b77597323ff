"""`taxel train-slip`: learn a warning of slip from simulated cups, and write its bundle."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass
from itertools import chain
from pathlib import Path
from typing import TYPE_CHECKING, ClassVar, Literal

import tyro

from taxel.cli.options.rules import Only
from taxel.cli.printing import command, console, print_json, progress
from taxel.errors import BadInput

if TYPE_CHECKING:
    from taxel.evaluation.early_warning.slip_warnings import (
        Promise,
        WarningScores,
        WarningTrack,
    )
    from taxel.training.slip.heads import Goal, PourFeatures

_MOST_PER_MIN = 60.0
_FEWEST_CUPS = 8
"""Four groups of cups are held out in turn."""


@dataclass(frozen=True, kw_only=True)
class TrainSlip:
    """Train a slip warning on simulated cups; its threshold is set for a rate of false alarms.

    It writes the bundle that runs live. The threshold is set on training cups that are held out.
    """

    poses: tyro.conf.Positional[Path]
    """Folder where simulated poses are kept; what is missing is simulated."""
    output: Path
    """The bundle to write, NAME.taxel; an older one there is replaced."""
    head: Literal["forecast", "boosting", "logistic", "rule"] = "forecast"
    """What is learned. forecast: how far the object will slip within 0.5 s and 1 s (with --gel 2,
    0.75 s). boosting and logistic: whether it slips within 1 s. rule: only the threshold for slip
    and its rate."""
    gel: Literal["1", "2", "both"] = "1"
    """How the simulated gels shear: 1, as rigid pieces; 2, as elastic layers; both: some of each,
    and the rate of false alarms is kept on either, on cups held out."""
    cups: int | None = None
    """Simulated cups to learn from, 8 to 480; unless given 480, which takes 25 minutes of one core
    from an empty folder; with --gel 2 128, whose images take 15 minutes of one core; with --gel
    both 240, two and a half hours. Fewer cups make a worse warning."""
    false_alarms: float = 0.3
    """Largest accepted number of false alarms per minute of grasps that hold (median over held-out
    cups)."""
    false_alarms_shear: float | None = None
    """The same for gels that shear; unless given, as --false-alarms."""
    seed: int = 0
    """Seed of learning."""
    json: bool = False
    """Print JSON."""

    RULES: ClassVar = (
        Only(("seed",), "--head forecast, boosting or logistic", lambda o: o.head != "rule"),
        Only(("false-alarms-shear",), "--gel both", lambda o: o.gel == "both"),
    )

    def run(self) -> None:
        """Learn, write the bundle and print what it is worth."""
        from taxel.evaluation.early_warning import learn_slip_warning as learn

        self._check()
        with progress() as bar:
            task = bar.add_task("poses", total=None)

            def on_step(line: str) -> None:
                bar.update(task, description=line, advance=1)

            pours, goal, learned_on = self._pours(on_step)
            warning, promise, tracks = learn.make_warning(
                pours, self.head, self.false_alarms, self.false_alarms_shear, goal=goal,
                seed=self.seed, on_step=on_step,
            )  # fmt: skip
        scores = _by_gel(learn.promised(tracks), promise.threshold)
        measured: dict[str, float] = {}
        for version, own in scores.items():
            where = f" on gel {version}" if len(scores) > 1 else ""
            measured |= {
                f"median lead (s){where}": own.events.lead_median_s,
                f"missed{where}": own.events.missed_share,
                f"false alarms a minute{where}": own.events.false_alarms_per_min,
            }
        parity = learn.write_warning(self.output, self.head, warning, measured, learned_on)
        if self.json:
            found = {
                version: {
                    "leads": own.leads, "near": own.near,
                    "alarms_by_slip": own.alarms_by_slip, "events": own.events.as_dict(),
                }
                for version, own in scores.items()
            }  # fmt: skip
            gel = self.gel if self.gel == "both" else int(self.gel)
            alone = next(iter(found.values())) if len(found) == 1 else {"by_gel": found}
            print_json({"bundle": str(self.output), "head": self.head, "gel": gel,
                        "parity": parity, "promise": asdict(promise), **alone})  # fmt: skip
            return
        _print(self, promise, scores, parity)

    def _pours(self, on_step: Callable[[str], None]) -> tuple[list[PourFeatures], Goal | None, str]:
        """Return training pours, what rows are labelled by, and what the bundle says of them."""
        from taxel.evaluation.early_warning import learn_layer_warning as layers
        from taxel.evaluation.early_warning import learn_slip_warning as learn

        if self.gel == "1":
            cups = self.cups or learn.LEARNED_CUPS
            return learn.training_features(self.poses, cups, on_step), None, learn.LEARNED_ON
        if self.gel == "both":
            cups = self.cups or layers.BOTH_CUPS
            return layers.both_features(self.poses, cups, on_step), None, layers.LEARNED_ON_BOTH
        pours = layers.layer_features(self.poses, self.cups or layers.LAYER_CUPS, on_step)
        return pours, layers.GOAL if self.head == "forecast" else None, layers.LEARNED_ON

    def _check(self) -> None:
        """Refuse, before anything is simulated, what cannot be meant."""
        from taxel.training.slip.cups import TRAINING_CUPS

        if self.output.is_dir() or not self.output.name.endswith(".taxel"):
            raise BadInput(
                "--output NAME.taxel: a monitor is written as the bundle that runs live",
                str(self.output), "name a file such as slip.taxel",
            )  # fmt: skip
        asked = {"--false-alarms": self.false_alarms}
        if self.false_alarms_shear is not None:
            asked["--false-alarms-shear"] = self.false_alarms_shear
        for option, value in asked.items():
            if not (math.isfinite(value) and 0 < value <= _MOST_PER_MIN):
                raise BadInput(f"{option} above 0 and at most 60 a minute", f"{value:g}",
                               "such as 0.3")  # fmt: skip
        if self.cups is not None and not _FEWEST_CUPS <= self.cups <= len(TRAINING_CUPS):
            raise BadInput(f"--cups from {_FEWEST_CUPS} to {len(TRAINING_CUPS)}",
                           str(self.cups), "leave it out to take the usual number")  # fmt: skip
        if self.poses.exists() and not self.poses.is_dir():
            raise BadInput("a folder to keep simulated poses in", str(self.poses), "name another")
        if recorded := _recorded_in(self.poses):
            raise BadInput(
                "a new folder, or one of simulated poses, which alone are learned from",
                f"{self.poses}, which holds {recorded.name}",
                "name a new one; recordings are learned from with: taxel train-monitor; "
                "labelled videos with: taxel train-trials",
            )  # fmt: skip


def _recorded_in(folder: Path) -> Path | None:
    """Return a recording, table, video or image that a folder holds; None where there is none."""
    from taxel.recordings.footage_files import IMAGES, VIDEOS

    endings = (".mcap", ".csv", *VIDEOS, *IMAGES)
    inside = chain(folder.glob("*"), folder.glob("*/*"))
    return next((path for path in sorted(inside) if path.suffix.lower() in endings), None)


def _by_gel(tracks: Sequence[WarningTrack], threshold: float) -> dict[str, WarningScores]:
    """Return what a threshold gives on each version of the gels."""
    from taxel.evaluation.early_warning.slip_warnings import score_warnings

    return {
        gel: score_warnings([t for t in tracks if t.groups["gel"] == gel], threshold)[0]
        for gel in sorted({track.groups["gel"] for track in tracks})
    }


def _print(
    verb: TrainSlip, promise: Promise, scores: Mapping[str, WarningScores], parity: float
) -> None:
    output = verb.output
    clusters = max(own.events.clusters for own in scores.values())
    low, high = promise.found_interval
    console.print(
        f"{output}: slip + {verb.head}, warns of slip above 0.3 mm; the bundle's "
        f"probabilities differ from the trained head's by at most {parity:.1e}",
        soft_wrap=True,
    )
    console.print(
        f"training cups held out, {clusters} of them: threshold {promise.threshold:.3f} "
        f"(95 % CI {promise.interval[0]:.3f} … {promise.interval[1]:.3f}) gives "
        f"{promise.found_per_min:.2f} false alarms a minute ({low:.2f} … {high:.2f}) in "
        f"{promise.hold_min:.0f} minutes that hold; {promise.asked_per_min:g} were asked",
        soft_wrap=True,
    )
    if len(scores) > 1:
        console.print("  (of the two gels, the one that needs the higher threshold sets it)")
    for gel, own in scores.items():
        if len(scores) > 1:
            rate = own.events.false_alarms_per_min
            console.print(f"  on gel {gel}: {rate:.2f} false alarms a minute")
        _print_scores(own)
    source = "sim://cup-pour" if verb.gel == "1" else "sim://cup-pour?gel=2"
    watch = command("taxel", "live", output, source, "--seconds", "20")
    console.print(f"next: {watch}", markup=False, soft_wrap=True)


def _print_scores(scores: WarningScores) -> None:
    for loss, found in scores.leads.items():
        console.print(
            f"  warning before {loss}: median {found['median_s']:.2f} s, 5 % "
            f"{found['p5_s']:.2f} s, missed {found['missed']:.1%} of {found['n']:.0f}"
        )
    near = ", ".join(f"{what} {rate:.2f}" for what, rate in scores.near.items())
    alarms = ", ".join(f"{what}: {count}" for what, count in scores.alarms_by_slip.items())
    console.print(f"  grasps that hold but slip, a minute: {near}", soft_wrap=True)
    console.print(f"  false alarms by how far their grasp slipped: {alarms}", soft_wrap=True)
