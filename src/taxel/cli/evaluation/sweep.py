"""`taxel sweep`: how accurate a bundle still is when touch, sensor or surroundings get worse."""

from __future__ import annotations

import json
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, ClassVar

import tyro

from taxel.cli.figure_files import need_figures
from taxel.cli.options.rules import Only
from taxel.cli.options.work import WorkOptions
from taxel.cli.printing import console, print_json, progress, say, say_aside
from taxel.errors import BadInput
from taxel.plain_text import finite, number_of
from taxel.recordings.whole import write_whole

if TYPE_CHECKING:
    from rich.progress import Progress as Bar

    from taxel.decisions.recognition import RecogniseConfig
    from taxel.evaluation.robustness.curve import FaultPoint
    from taxel.evaluation.robustness.touches import Model

_LARGEST_SEED = 1_000_000_000


@dataclass(frozen=True, slots=True, kw_only=True)
class _ArraySweep:
    """What is measured of an array's bundle."""

    file: Path
    model: Model
    """The bundle, opened."""
    names: Sequence[str]
    """Faults or conditions; all where empty."""
    levels: Sequence[float]
    """Of the one that is named; its own where empty."""
    config: RecogniseConfig


@dataclass(frozen=True, kw_only=True)
class Sweep:
    """Measure robustness curves: accuracy and share answered, fault by fault, level by level.

    On recordings of an array or of tactile cameras, faults are made on their scans or frames; on
    the simulated hand (--simulate), whole new sessions are made at each condition.
    """

    bundle: tyro.conf.Positional[Path]
    """A bundle's file; or slip-both-gels, cup-pour or slip-rule, which come with taxel."""
    data: Path | None = None
    """Recordings that it was not trained on: a folder, or one recording."""
    simulate: bool = False
    """Instead of --data: new sessions of sim://teng at each level of a condition (see --faults),
    each with its own reference touches."""
    faults: tuple[str, ...] = ()
    """Names, with commas or spaces between them; all unless given. Arrays: noise (dB), hum, hum-60
    (% of full scale), dead, missing, stuck (channels), swapped (pairs), drift, channel-drift
    (%/min), skew (ppm), jitter (ms), loss, burst-loss (%), offset, saturation (% of full scale).
    Cameras: bright, dark, exposure-step (stops), scratches, fading, marker-loss, frame-loss (%),
    frame-rate (images/s), blur (px), image-noise (grey levels), jpeg (quality). --simulate:
    temperature (°C), humidity (% RH), dust, moisture, moving (shares, 0…1), force (N), size (mm,
    half of the width), angle (° turned in the hand), fatigue (full presses of pads that lose 20 %
    of their output in 10,000)."""
    levels: tuple[str, ...] = ()
    """Levels of the one fault named, in its unit; its own unless given."""
    least_confidence: float | None = None
    """Arrays: below this probability an answer is UNKNOWN too, 0…1; 0 unless given."""
    seed: int = 6023
    """Seed of what faults draw; of --simulate, of the sessions, which must not be the seed that
    the training sessions were simulated with."""
    sessions: int = 10
    """--simulate: sessions at each level."""
    session_s: float = 150.0
    """--simulate: length of a session, s."""
    plot: Path | None = None
    """Write the curves to this file (PNG)."""
    output: Path | None = None
    """Write what --json prints to this file too."""
    work: Annotated[WorkOptions, tyro.conf.arg(name="")] = field(default_factory=WorkOptions)
    json: bool = False
    """Print JSON: a list of {fault, level, unit, accuracy, low, high, answered, windows, grasps,
    grasps_answered, outside, draws, base}; shares 0…1, the first entry without any fault. draws:
    passes with other random choices, all windows of which are counted. base, for skew: accuracy
    without it on the first windows of each touch, as many as are left; null where all are left."""

    RULES: ClassVar = (Only(("sessions", "session-s"), "--simulate", lambda o: o.simulate),)

    def run(self) -> None:
        """Measure, print and write."""
        from taxel.bundles.envelope import is_grasp_bundle, need_bundle
        from taxel.bundles.shipped import find_bundle

        self._check()
        bundle = find_bundle(self.bundle)
        need_bundle(bundle)
        cameras = is_grasp_bundle(bundle)
        if cameras and self.simulate:
            raise BadInput(
                "--data with pours for a bundle of tactile cameras", "--simulate",
                "make some with: taxel simulate cup-pour --first-cup 900 --output pours",
            )  # fmt: skip
        if cameras and self.least_confidence is not None:
            raise BadInput(
                "a bundle of an array beside --least-confidence", "one of tactile cameras",
                "leave it out",
            )  # fmt: skip
        if self.plot is not None:
            need_figures(self.plot)
        names, levels = _words(self.faults), _numbers(self.levels)
        if levels and len(names) != 1:
            raise BadInput("one fault beside --levels", f"{len(names)}", "name it with --faults")
        with self.work.open():
            if cameras:
                points, about, chance = self._cameras(bundle, names, levels), "", 0.5
            else:
                points, about, chance = self._array(bundle, names, levels)
        self._print(points, about or f"{bundle.name} on {self.data}", chance, cameras)

    def _check(self) -> None:
        if (self.data is None) != self.simulate:
            raise BadInput(
                "recordings with --data, or --simulate",
                "both" if self.simulate else "neither", "say one of them",
            )  # fmt: skip
        if not 0 <= self.seed <= _LARGEST_SEED:
            raise BadInput(f"--seed within 0 and {_LARGEST_SEED}", str(self.seed), "choose another")
        if not 0.0 <= (self.least_confidence or 0.0) <= 1.0:
            raise BadInput(
                "--least-confidence within 0 and 1", f"{self.least_confidence:g}", "choose another"
            )
        if self.output is not None and self.output.suffix.lower() != ".json":
            raise BadInput("a name that ends in .json for --output", str(self.output),
                           "rename it; a picture is asked for with --plot NAME.png")  # fmt: skip
        if not 1 <= self.sessions <= 1000 or not 10.0 <= self.session_s <= 36_000.0:
            raise BadInput(
                "--sessions within 1 and 1000 and --session-s within 10 and 36000",
                f"{self.sessions} and {self.session_s:g}", "choose others",
            )  # fmt: skip

    def _array(
        self, file: Path, names: Sequence[str], levels: Sequence[float]
    ) -> tuple[list[FaultPoint], str, float]:
        """Return an array's points, what they are of in words, and the accuracy of chance, 0…1."""
        from taxel.bundles.reader import read_bundle
        from taxel.decisions.recognition import RecogniseConfig
        from taxel.evaluation.robustness.touches import bundle_model

        model = bundle_model(read_bundle(file))
        config = RecogniseConfig(least_confidence=self.least_confidence or 0.0)
        asked = _ArraySweep(file=file, model=model, names=names, levels=levels, config=config)
        with progress() as bar:
            if self.data is None:
                points = self._simulated(asked, bar)
                where = f"{number_of(self.sessions, 'new session')} of sim://teng each"
            else:
                points, where = self._recorded(asked, self.data, bar), str(self.data)
        contract = model.contract
        return points, f"{contract.target} · {file.name} on {where}", 1.0 / len(contract.classes)

    def _simulated(self, asked: _ArraySweep, bar: Bar) -> list[FaultPoint]:
        """Judge new sessions of the simulated hand at each level of each condition."""
        from taxel.evaluation.robustness.conditions import (
            NewSessions,
            plan_conditions,
            sweep_conditions,
        )
        from taxel.evaluation.robustness.sweep_jobs import sweep_simulated
        from taxel.jobs.running import shared_out

        plan = plan_conditions(asked.names, asked.levels)
        show = _shown_on(bar, "simulating", 1 + sum(map(len, plan.values())))
        which = NewSessions(
            seed=self.seed, sessions=self.sessions, scans=round(100 * self.session_s)
        )
        if shared_out():
            return sweep_simulated(asked.file, plan, which, asked.config, show)
        return sweep_conditions(asked.model, plan, which, asked.config, on_point=show)

    def _recorded(self, asked: _ArraySweep, data: Path, bar: Bar) -> list[FaultPoint]:
        """Judge recordings on whose scans the faults are made."""
        from taxel.evaluation.learned_recordings import recordings_trained_on
        from taxel.evaluation.robustness.array_sweep import plan_array, sweep_array
        from taxel.evaluation.robustness.sweep_jobs import sweep_recordings
        from taxel.evaluation.robustness.touches import read_touches
        from taxel.jobs.running import shared_out
        from taxel.recordings.reader import list_recordings

        contract = asked.model.contract
        known = len(contract.channels) if contract.window.channels is None else None
        plan = plan_array(asked.names, asked.levels, known)  # refused before all is read
        reading = bar.add_task("reading", total=None)
        touches, digest = read_touches(data)
        bar.remove_task(reading)
        names, channels = asked.names or plan, len(touches[0].sensor.channels)
        plan = plan_array(asked.names, asked.levels, channels)
        if left := ", ".join(name for name in names if name not in plan):
            _note(f"{left} left out: an array of {number_of(channels, 'channel')} cannot have it.")
        seen = recordings_trained_on(contract, list_recordings(data))
        _warn_if_seen(bool(seen) or digest == contract.data_digest)
        show = _shown_on(bar, "without a fault", 1 + sum(map(len, plan.values())))
        if shared_out():
            return sweep_recordings(asked.file, (data, digest), plan, asked.config, self.seed, show)
        return sweep_array(
            asked.model, touches, plan, config=asked.config, seed=self.seed, on_point=show
        )

    def _cameras(
        self, file: Path, names: Sequence[str], levels: Sequence[float]
    ) -> list[FaultPoint]:
        from taxel.bundles.grasp import read_grasp_bundle
        from taxel.evaluation.robustness.grasp_sweep import plan_images, pours_digest, sweep_grasps
        from taxel.live.grasp_monitor import GraspMonitor
        from taxel.windows.camera_recordings import read_camera_recordings

        assert self.data is not None
        plan = plan_images(names, levels)
        bundle = read_grasp_bundle(file)
        with progress() as bar:
            task = bar.add_task("reading", total=1 + sum(map(len, plan.values())))
            pours = read_camera_recordings(self.data)
            _warn_if_seen(pours_digest(pours) == bundle.contract.data_digest)
            for pour in pours:
                bundle.contract.check_cameras(pour.cameras)
            return sweep_grasps(
                file, GraspMonitor, pours, plan, seed=self.seed,
                on_point=lambda point: bar.update(task, description=point.fault, advance=1),
            )  # fmt: skip

    def _print(self, points: list[FaultPoint], about: str, chance: float, cameras: bool) -> None:
        rows = [finite(asdict(point)) for point in points]
        # Printed first: what took minutes to measure is not lost where a file cannot be written.
        if self.json:
            print_json(rows)
        else:
            from taxel.views.tables.sweep import sweep_table

            console.print(sweep_table(points, about, cameras=cameras))
        if self.output is not None:
            text = json.dumps(rows, indent=1, ensure_ascii=False) + "\n"
            write_whole(self.output, text)
        if self.plot is not None:
            from taxel.views.figures.sweep import sweep_figure

            picture = sweep_figure(points, about, chance=chance, cameras=cameras)
            write_whole(self.plot, picture)
            if not self.json:
                say(f"curves: {self.plot}")


def _warn_if_seen(seen: bool) -> None:
    if seen:
        _note(
            "the bundle was trained on these recordings: the accuracies below are too high, "
            "and only their falls mean something."
        )


def _note(text: str) -> None:
    say_aside(f"taxel: {text}")


def _shown_on(bar: Bar, first: str, total: int) -> Callable[[FaultPoint], None]:
    """Return what shows each point on a bar of so many steps."""
    task = bar.add_task(first, total=total)

    def show(point: FaultPoint) -> None:
        bar.update(task, description=point.fault, advance=1)

    return show


def _words(given: Sequence[str]) -> tuple[str, ...]:
    """Return names that commas or spaces part, each once."""
    return tuple(dict.fromkeys(word for text in given for word in text.split(",") if word))


def _numbers(given: Sequence[str]) -> tuple[float, ...]:
    try:
        return tuple(float(word) for word in _words(given))
    except ValueError as error:
        raise BadInput(
            "numbers for --levels", str(error), "for example --levels 40,30,20"
        ) from error
