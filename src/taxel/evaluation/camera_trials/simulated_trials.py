"""Simulated camera trials cut like real ones: who slipped is the simulator's truth.

Cups that are filled, pushed, lifted, tilted, carried or hit, or whose grip gives way; two cameras
at the real rate. Plain changes of an image stand here too. Knows nothing about real trials.

Background of our choices: docs/decisions/0059.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import cv2
import numpy as np
from numpy.typing import NDArray
from torch import nn

from taxel.evaluation.camera_trials.probe import Rows, pooled
from taxel.evaluation.camera_trials.probe_features import (
    crop_features,
    crop_images,
    gel_features,
    network_features,
)
from taxel.models.backbones.touch import FEATURES as TOUCH_FEATURES
from taxel.sim.pour.cup_pour import CupPourConfig, Gel, list_runs, simulate_pour
from taxel.sim.pour.cups import Kind, Position, PourRun
from taxel.sources.simulated.pour_sets import simulate_videos
from taxel.training.camera_trials.features import trial_rows
from taxel.training.camera_trials.members import DIFFERENCES
from taxel.training.camera_trials.one_trial import Cuts
from taxel.training.encoder.fit import GAIN, GRAIN, JITTER, LEVEL
from taxel.training.encoder.videos import STRETCHES, TouchVideo, chosen_frames, small
from taxel.training.frames.features import default_cache, load_kept, save_kept
from taxel.windows.camera_trials import CameraTrial
from taxel.windows.trial_crops import FAMILIES, LAG, STATISTICS, numbers_of, small_grey
from taxel.windows.trial_layout import Layout

Image = NDArray[np.uint8]
SEED: Final = 59
"""Of cups and grasps: no other set of ours has it."""
RATE_HZ, DURATION_S, CROP = 25.0, 6.0, 48
"""Images a second, seconds of a trial and frames of a crop. Source: gelsight-slip's rate and crops;
its slip trials last 5.6 s in the median."""
_CUT: Final = Layout(CROP, STRETCHES)
SLIPPED_UM: Final = 300.0
"""How far a cup slid at some time in a trial that counts as slipped. Source: gross slip."""
POSITIONS: Final[tuple[Position, ...]] = ("upper", "middle", "lower")
FORCES_N: Final = (15.0, 25.0)
KINDS: Final[tuple[Kind, ...]] = (
    "pour", "bump", "grip drop", "lift", "tilt", "carry", "collision",
)  # fmt: skip
TOUCH, GEL, GREY = "touch encoder", "gel features", "grey differences"
WIDTHS: Final = {
    TOUCH: 6 * TOUCH_FEATURES,
    GEL: 6 * gel_features().features,
    GREY: 2 * STATISTICS * len(DIFFERENCES),
}
"""Numbers a crop."""
_BLURRED, _BLUR_PX = 0.3, 1.5
"""Share of blurred trials, and their largest deviation. Source: our choice."""
_REORDERED: Final = 0.5
"""Share of trials whose colours change places. Source: our choice."""
_SPARE_PX: Final = 64


@dataclass(frozen=True, slots=True)
class SimulatedTrial:
    """One simulated camera trial, labelled by whether the object slipped."""

    run: PourRun
    gel: Gel
    slipped: bool

    @property
    def cup(self) -> str:
        """What is held out whole."""
        return f"cup {self.run.cup.index}"

    @property
    def name(self) -> str:
        """Of its file."""
        return f"{self.run.name}_gel-{self.gel}"


def choose_trials(
    first_cup: int, cups: int, most: int, cache: Path | None = None
) -> list[SimulatedTrial]:
    """Return trials of which each cup has as many that slipped as that held.

    Even cups have gels of version 1, odd ones of version 2: a cup moves alike in both.

    Args:
        first_cup: Its number.
        cups: How many.
        most: Trials of each outcome that a cup may give.
        cache: Folder to keep in how far each candidate slipped; None keeps nothing.
    """
    chosen = []
    for index in range(first_cup, first_cup + cups):
        config = CupPourConfig(
            seed=SEED, cups=1, first_cup=index, positions=(POSITIONS[index % len(POSITIONS)],),
            forces_n=FORCES_N, kinds=KINDS, frame_hz=RATE_HZ,
        )  # fmt: skip
        runs = list_runs(config)
        order = np.random.default_rng((SEED, index)).permutation(len(runs))
        runs_by_slip: dict[bool, list[PourRun]] = {False: [], True: []}
        slip_um = _slips(runs, None if cache is None else cache / f"slip-{index}.npy")
        for at in order.tolist():
            runs_by_slip[bool(slip_um[at] > SLIPPED_UM)].append(runs[at])
        count = min(most, *(len(own) for own in runs_by_slip.values()))
        gel: Gel = 2 if index % 2 else 1
        chosen += [
            SimulatedTrial(run, gel, slipped)
            for slipped, own in runs_by_slip.items()
            for run in own[:count]
        ]
    return chosen


def _slips(runs: Sequence[PourRun], file: Path | None) -> NDArray[np.float32]:
    """Return how far the cup slid at most in each run, micrometres."""
    kept = None if file is None else load_kept(file, 1)
    if kept is None or len(kept) != len(runs):
        tracks = (simulate_pour(run, RATE_HZ, DURATION_S) for run in runs)
        kept = np.array([[track.truth[:, 0].max()] for track in tracks], np.float32)
        if file is not None:
            save_kept(file, kept)
    return kept[:, 0]


def images_of(trial: SimulatedTrial) -> list[list[Image]]:
    """Return what each camera sees, a list of 150 images (240, 320, 3) each, red first."""
    _, videos = simulate_videos(trial.run, RATE_HZ, RATE_HZ, DURATION_S, trial.gel)
    found = []
    for video in videos:
        taken = list(video.images)
        found.append([taken[at] for at in video.times.shown.tolist()])
    return found


def changed(cameras: Sequence[Sequence[Image]], seed: Sequence[int]) -> list[list[Image]]:
    """Return a plainly changed copy of a trial: another sensor in other light.

    Both cameras are mirrored alike; gain and level, colours' order and blur are each camera's own,
    and each image has a little gain and grain of its own.

    Args:
        cameras: A list of images (height, width, 3) each.
        seed: Of all draws.
    """
    random = np.random.default_rng(seed)
    flips = [axis for axis in (0, 1) if random.random() < 0.5]
    return [list(_another_sensor(images, flips, random)) for images in cameras]


def _another_sensor(
    images: Sequence[Image], flips: Sequence[int], random: np.random.Generator
) -> Iterator[Image]:
    gain = np.exp(GAIN * random.normal(size=3))
    level = LEVEL * random.normal()
    order = random.permutation(3) if random.random() < _REORDERED else np.arange(3)
    blur = random.uniform(0.3, _BLUR_PX) if random.random() < _BLURRED else 0.0
    height, width = images[0].shape[:2]
    grain = random.normal(0, GRAIN, (height + _SPARE_PX, width + _SPARE_PX, 3)).astype(np.int16)
    levels = np.arange(256)[:, None]
    for image in images:
        table = levels * gain * np.exp(JITTER * random.normal()) + level
        own = np.ascontiguousarray(np.flip(image, flips)[..., order])
        own = np.asarray(cv2.LUT(own, table.clip(0, 255).astype(np.uint8)[None]), np.uint8)
        if blur:
            own = np.asarray(cv2.GaussianBlur(own, (0, 0), blur), np.uint8)
        top, left = random.integers(0, _SPARE_PX, 2)
        noise = grain[top : top + height, left : left + width]
        yield np.asarray(cv2.add(own, noise, dtype=cv2.CV_8U), np.uint8)


def eight_moments(frames: int) -> NDArray[np.intp]:
    """Return the numbers of the images that networks see, shape (crops, 8)."""
    return chosen_frames(frames, RATE_HZ)


def eight_of(cameras: Sequence[Sequence[Image]]) -> list[list[list[Image]]]:
    """Return the images that networks see: a list a camera, in it one a crop."""
    chosen = eight_moments(len(cameras[0]))
    return [[[images[at] for at in own] for own in chosen.tolist()] for images in cameras]


def touch_rows(eight: Sequence[Sequence[Sequence[Image]]], module: nn.Module) -> Rows:
    """Return crops seen by the touch encoder, shape (crops, columns).

    Args:
        eight: As `eight_of` gives it.
        module: The encoder.
    """
    videos = [
        TouchVideo(
            folder="", trial="", groups={}, digest="",
            images=np.stack([np.stack([small(image) for image in crop]) for crop in camera]),
            slip_um=np.zeros((len(camera), len(camera[0])), np.float32),
        )
        for camera in eight
    ]  # fmt: skip
    return pooled(network_features(module, videos)[None])


def gel_rows(eight: Sequence[Sequence[Sequence[Image]]]) -> Rows:
    """Return crops as quantities of the gel, shape (crops, columns)."""
    extractor = gel_features()
    each = [[extractor.of(crop) for crop in camera] for camera in eight]
    return pooled(np.array(each, np.float32)[None])


def grey_rows(cameras: Sequence[Sequence[Image]]) -> Rows:
    """Return crops as grey differences, shape (crops, columns): what the blend's members see.

    The same numbers as `DIFFERENCES` of the view "pixels", without its flow, which takes most of
    its time.
    """
    rows = []
    for start in _CUT.starts(range(len(cameras[0]))):
        courses = [_differences(images[start : start + CROP]) for images in cameras]
        each = FAMILIES["pixels"].sum_up(np.stack(courses, axis=1))
        rows.append(np.stack([each.max(axis=0), each.min(axis=0)]).ravel())
    return np.stack(rows).astype(np.float32)


def _differences(images: Sequence[Image]) -> NDArray[np.float32]:
    """Return grey differences to the frame before, to the first and to the fifth before, shape
    (frames, 3), 0…255.
    """
    greys = [small_grey(image) for image in images]
    each = [
        [cv2.absdiff(grey, greys[max(0, other)]).mean() for other in (at - 1, 0, at - LAG)]
        for at, grey in enumerate(greys)
    ]
    return np.array(each, np.float32)


def trial_rows_of(images: Sequence[Sequence[Image]], module: nn.Module) -> Rows:
    """Return a trial's crops seen by all features side by side, in the order of `WIDTHS`.

    Args:
        images: A list a camera.
        module: The touch encoder.
    """
    eight = eight_of(images)
    return np.hstack([touch_rows(eight, module), gel_rows(eight), grey_rows(images)])


def parted(rows: Sequence[Rows]) -> dict[str, Rows]:
    """Return feature → rows of all trials, of what `trial_rows_of` gave of each."""
    ends = np.cumsum(list(WIDTHS.values()))[:-1]
    return dict(zip(WIDTHS, np.split(np.concatenate(rows), ends, axis=1), strict=True))


def simulated_rows(
    trials: Sequence[SimulatedTrial],
    module: nn.Module,
    cache: Path,
) -> tuple[dict[str, Rows], dict[str, Rows]]:
    """Return feature → rows, shape (trials · crops, columns), as they are and plainly changed.

    Args:
        trials: What to look at.
        module: The touch encoder.
        cache: Folder of this encoder, this version of the simulator and these features.
    """
    halves: tuple[list[Rows], list[Rows]] = [], []
    width = sum(WIDTHS.values())
    for trial in trials:
        file = cache / f"{trial.name}.npy"
        features = load_kept(file, width)
        if features is None:
            images = images_of(trial)
            copy = changed(images, (SEED, trial.run.seed))
            features = np.concatenate([trial_rows_of(each, module) for each in (images, copy)])
            save_kept(file, features)
        for kept, rows in zip(halves, np.split(features, 2), strict=True):
            kept.append(rows)
    return parted(halves[0]), parted(halves[1])


def real_rows(
    trials: Sequence[CameraTrial],
    features: str,
    module: nn.Module,
    cache: Path,
) -> Rows:
    """Return one kind of features of real trials at 25 images a second, as of simulated ones.

    Args:
        trials: None shorter than a crop.
        features: In `WIDTHS`.
        module: The touch encoder.
        cache: As for `simulated_rows`.
    """
    if features == GREY:
        cut = trial_rows(trials, Cuts(_CUT), ("pixels",), default_cache())
        return cut.rows["pixels"][:, numbers_of("pixels", DIFFERENCES, 2)]
    if features == GEL:
        return pooled(crop_features(trials, [gel_features()], default_cache())[0])
    all_rows = []
    for trial in trials:
        file = cache / f"{trial.digest[:32]}-touch.npy"
        rows = load_kept(file, WIDTHS[TOUCH])
        if rows is None:
            rows = touch_rows(crop_images(trial), module)
            save_kept(file, rows)
        all_rows.append(rows)
    return np.concatenate(all_rows)
