"""What `taxel bench closed-loop` learns before it measures: a bundle and when to raise.

Simulates training cups, trains a head on their gel features, and tunes on probabilities of
training cups that the head had not seen. No test cup comes near it. Knows nothing about rows.

Source: docs/decisions/0017.
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from taxel import __version__
from taxel.actions.grip_policy import GripPolicyConfig, PixelDifferenceConfig
from taxel.bench.closed_loop_tuning import (
    CurvePoint,
    PixelPoint,
    RunProbabilities,
    tune_loop,
    tune_pixels,
)
from taxel.bundles.grasp import GEL, GraspContract, write_grasp_bundle
from taxel.decisions.stability import StabilityConfig
from taxel.evaluation.splits import TrialFold
from taxel.evaluation.transitions.data import CameraSet, judge_fold, load_camera_set
from taxel.jobs.running import side_by_side
from taxel.models.counting import keras_parameters
from taxel.models.export_onnx import export_head
from taxel.recordings.reader import list_recordings
from taxel.sim.cup_pour import CupPourConfig, list_runs
from taxel.sim.cups import Kind, PourRun
from taxel.sim.pour_state import TRUTH_CHANNELS
from taxel.sources.pour_folder import write_pours
from taxel.training.extractors import SlipExtractor
from taxel.training.features import FrameFeatures, extract
from taxel.training.frame_labels import change_signals, rate_of, truth_of
from taxel.training.heads import HeadConfig, TrainedHead, fit_head, tracks_of
from taxel.windows.camera_recordings import CameraRecording, read_camera_recording
from taxel.windows.rest import SETTLE
from taxel.windows.sequence import sequence_windows

TRAINING = CupPourConfig(cups=20, first_cup=200, negatives=0.25)
"""Cups to learn from and to tune on. Source: our choice."""
POURS: tuple[Kind, ...] = ("pour", "still", "no-slip pour")
"""What is tuned and promised. The other kinds are pushes and failing grips: a push lasts 80 ms
and drops a cup within two images of the camera."""
UNSTABLE_UM = 600.0
"""Slip that the head learns to recognise, micrometres: twice what still counts as holding, and well
before a drop. Source: docs/decisions/0017."""
FRAMES = 30
"""k: half a second."""
FOLDS = 4
"""Groups of training cups that are held out in turn. Source: our choice, docs/decisions/0013."""
_CHECKED = 32
"""Windows that a bundle is checked on."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Learnt:
    """What is needed to close the loop, and the curves it was chosen on."""

    bundle: Path
    stability: StabilityConfig
    curve: list[CurvePoint]
    pixels: PixelDifferenceConfig
    pixel_curve: list[PixelPoint]
    digest: str
    """Of the training images."""


def learn(
    folder: Path,
    cache: Path,
    data: Path | None = None,
    on_step: Callable[[str], None] = lambda _: None,
    workers: int | None = None,
) -> Learnt:
    """Simulate training cups unless they are there, train, tune, and write a bundle.

    Args:
        folder: Where cups and bundle go.
        cache: Where features go.
        data: Recordings of `TRAINING`, if there are any yet.
        on_step: Called with a line before each part.
        workers: Processes side by side.
    """
    if data is None:
        on_step("simulating training cups")
        data = folder / "cups"
        write_pours(data, TRAINING, workers=workers)
    on_step("gel features")
    files = list_recordings(data)
    side_by_side(keep_features, [(file, cache) for file in files], workers=workers)
    pours = load_camera_set(data, "gross-slip", cache)
    features = extract(pours.pours, SlipExtractor(SETTLE), cache)
    labels = [label_slip(pour) for pour in pours.pours]
    config = HeadConfig(tare="change", frames=FRAMES)
    found = _held_out(pours, features, labels, config, on_step)
    on_step("all training cups")
    head = fit_head(tracks_of(features, labels), config)
    on_step("tuning")
    runs = {run.name: run for run in list_runs(TRAINING) if raisable(run)}
    chosen = [i for i, pour in enumerate(pours.pours) if pour.name in runs]
    tracks = [
        RunProbabilities(
            run=runs[pours.pours[i].name],
            time_s=pours.pours[i].time_s[FRAMES - 1 :] - pours.pours[i].time_s[0],
            probabilities=found[i],
        )
        for i in chosen
    ]
    changes = [
        RunProbabilities(
            run=runs[pours.pours[i].name],
            time_s=pours.pours[i].time_s - pours.pours[i].time_s[0],
            probabilities=pours.signals[i].max(axis=1),
        )
        for i in chosen
    ]
    stability, curve = tune_loop(tracks, workers=workers)
    pixels, pixel_curve = tune_pixels(changes, workers=workers)
    bundle, digest = _write(folder / "grip.taxel", pours, features, head, stability)
    return Learnt(
        bundle=bundle,
        stability=stability,
        curve=curve,
        pixels=pixels,
        pixel_curve=pixel_curve,
        digest=digest,
    )


def raisable(run: PourRun) -> bool:
    """Return whether a run is one that is tuned and promised, and its grip can be raised."""
    return run.kind in POURS and run.force_n < GripPolicyConfig().most_n


def keep_features(file: Path, cache: Path) -> None:
    """Compute a recording's features and change signal into the cache."""
    pour = read_camera_recording(file)
    extract([pour], SlipExtractor(SETTLE), cache)
    change_signals([pour], cache)


def label_slip(pour: CameraRecording) -> NDArray[np.int8]:
    """Return 1 for each frame whose slip exceeds `UNSTABLE_UM`, or whose cup is lost."""
    truth = truth_of(pour)
    slip, lost = (truth[:, TRUTH_CHANNELS.index(name)] for name in ("slip", "dropped"))
    return np.asarray((slip > UNSTABLE_UM) | (lost > 0), np.int8)


def _held_out(
    pours: CameraSet,
    features: Sequence[FrameFeatures],
    labels: Sequence[NDArray[np.int8]],
    config: HeadConfig,
    on_step: Callable[[str], None],
) -> dict[int, NDArray[np.float32]]:
    """Return each pour's probabilities from a head that had not seen its cup."""
    cups = pours.groups("cup")
    found: dict[int, NDArray[np.float32]] = {}
    for part in np.array_split(np.array(sorted(set(cups.tolist()))), FOLDS):
        on_step(f"without cups {', '.join(part)}")
        held = np.isin(cups, part)
        fold = TrialFold.of("+".join(part), np.flatnonzero(~held), np.flatnonzero(held))
        judged, _ = judge_fold(features, labels, fold, config)
        found |= dict(zip(fold.test_rows.tolist(), judged.probabilities, strict=True))
    return found


def _write(
    path: Path,
    pours: CameraSet,
    features: Sequence[FrameFeatures],
    head: TrainedHead,
    stability: StabilityConfig,
) -> tuple[Path, str]:
    """Write the bundle; return it and the digest of what it learned from."""
    first = pours.pours[0]
    digest = hashlib.sha256("".join(pour.digest for pour in pours.pours).encode()).hexdigest()
    contract = GraspContract(
        features=GEL,
        weights="",
        head=head.config.head,
        frames=FRAMES,
        tare=head.config.tare,
        settle=(SETTLE.start, SETTLE.stop),
        cameras=len(first.cameras),
        width=first.cameras[0].width,
        height=first.cameras[0].height,
        rate_hz=rate_of(first),
        rule=f"slip > {UNSTABLE_UM:g} um",
        offset=tuple(tuple(map(float, row)) for row in head.offset),
        factor=tuple(tuple(map(float, row)) for row in head.factor),
        stability=stability,
        parameters=keras_parameters(head.module),
        data_digest=digest,
        measured={},
        software=f"taxel {__version__}",
    )
    own = features[0].all()
    windows = sequence_windows(head.scale(own), FRAMES)
    part = np.linspace(0, len(windows) - 1, min(_CHECKED, len(windows))).astype(int)
    model = export_head(head.module, FRAMES, windows.shape[3])
    expected = head.probabilities(own)[part]
    write_grasp_bundle(path, contract, model, None, np.ascontiguousarray(windows[part]), expected)
    return path, digest
