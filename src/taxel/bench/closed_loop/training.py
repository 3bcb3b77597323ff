"""What `taxel bench closed-loop` learns before it measures: a bundle and when to raise.

Simulates training cups, learns to forecast slip from the poses of object and gel, and tunes on
scores of training cups that the head had not seen. No test cup comes near it. Knows nothing about
rows.

Source: docs/decisions/0017, 0036.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from taxel.actions.grip_policy import GripPolicyConfig, PixelDifferenceConfig
from taxel.bench.closed_loop.tuning import (
    CurvePoint,
    PixelPoint,
    RunProbabilities,
    tune_loop,
    tune_pixels,
)
from taxel.decisions.stability import StabilityConfig
from taxel.evaluation.early_warning.learn_slip_warning import (
    PER_MIN,
    ReadyWarning,
    learn_warning,
    training_features,
    write_warning,
)
from taxel.jobs.running import side_by_side
from taxel.recordings.reader import list_recordings
from taxel.sim.pour.cup_pour import CupPourConfig, list_runs
from taxel.sim.pour.cups import Kind, PourRun
from taxel.sources.simulated.pour_folder import write_pours
from taxel.training.frames.features import default_cache
from taxel.training.frames.labels import change_signals
from taxel.windows.camera_recordings import read_camera_recording, read_camera_recordings

PIXEL_CUPS = CupPourConfig(cups=20, first_cup=200, negatives=0.25)
"""Cups whose images tune the difference of pixels. Source: our choice."""
TUNED_CUPS = 40
"""Training cups, held out from the head, on which its thresholds are tuned: each threshold plays
every dropped pour again. Source: our choice."""
POURS: tuple[Kind, ...] = ("pour", "still", "no-slip pour")
"""What is tuned and promised. The other kinds are pushes, sudden slips and failing grips."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Learnt:
    """What is needed to close the loop, and the curves it was chosen on."""

    bundle: Path
    stability: StabilityConfig
    curve: list[CurvePoint]
    pixels: PixelDifferenceConfig
    pixel_curve: list[PixelPoint]


def learn(
    folder: Path,
    cache: Path | None = None,
    on_step: Callable[[str], None] = lambda _: None,
) -> Learnt:
    """Simulate training cups unless they are there, train, tune, and write a bundle.

    Args:
        folder: Where images and bundle go.
        cache: Where poses and signals are kept; beside the other features unless given.
        on_step: Called with a line before each part.
    """
    cache = cache or default_cache()
    pours = training_features(cache / "slip-poses", on_step=on_step)
    learnt = learn_warning(pours, "forecast", PER_MIN, on_step=on_step)
    on_step("tuning")
    first = sorted({found.cup for found in pours})[:TUNED_CUPS]
    tracks = [
        RunProbabilities(run=found.pour.run, time_s=track.time_s, probabilities=track.drive)
        for found, track in zip(pours, learnt.tracks, strict=True)
        if found.cup in first and raisable(found.pour.run)
    ]
    stability, curve = tune_loop(tracks)
    bundle = folder / "grip.taxel"
    check = pours[0].rows[:64]
    ready = ReadyWarning(
        model=learnt.head.to_onnx(), threshold=stability.warn, check=check,
        expected=learnt.head.probability(check),
    )  # fmt: skip
    write_warning(bundle, "forecast", ready, {})
    pixels, pixel_curve = tune_pixels(_changes(folder / "cups", cache, on_step))
    return Learnt(
        bundle=bundle,
        stability=stability,
        curve=curve,
        pixels=pixels,
        pixel_curve=pixel_curve,
    )


def raisable(run: PourRun) -> bool:
    """Return whether a run is one that is tuned and promised, and its grip can be raised."""
    return run.kind in POURS and run.force_n < GripPolicyConfig().most_n


def keep_signals(file: Path, cache: Path) -> None:
    """Compute a recording's change signal into the cache."""
    change_signals([read_camera_recording(file)], cache)


def _changes(data: Path, cache: Path, on_step: Callable[[str], None]) -> list[RunProbabilities]:
    """Return how far images of training cups differ from the settled ones, per cent."""
    on_step("images of training cups, for the difference of pixels")
    write_pours(data, PIXEL_CUPS)
    files = list_recordings(data)
    side_by_side(keep_signals, [(file, cache) for file in files])
    pours = read_camera_recordings(data)
    runs = {run.name: run for run in list_runs(PIXEL_CUPS) if raisable(run)}
    return [
        RunProbabilities(
            run=runs[pour.name],
            time_s=pour.time_s - pour.time_s[0],
            probabilities=signal.max(axis=1),
        )
        for pour, signal in zip(pours, change_signals(pours, cache), strict=True)
        if pour.name in runs
    ]
