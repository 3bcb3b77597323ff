"""Simulated camera trials cut like real ones: who slipped is the simulator's truth.

Cups that are filled, pushed, lifted, tilted, carried or hit, or whose grip gives way; two cameras
at the real rate. Plain changes of an image stand here too. Knows nothing about real trials.

Background of our choices: docs/decisions/0059.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import cv2
import numpy as np
from numpy.typing import NDArray
from torch import nn

from taxel.evaluation.camera_trials.probe import Rows, pooled
from taxel.evaluation.camera_trials.probe_features import gel_features, network_features
from taxel.gel.slip_signal import USUAL_MM_PER_PX
from taxel.models.backbones.touch import FEATURES as TOUCH_FEATURES
from taxel.sim.cup_pour import CupPourConfig, Gel, list_runs, simulate_pour
from taxel.sim.cups import Kind, Position, PourRun
from taxel.sources.pour_sets import simulate_videos
from taxel.training.encoder.videos import STRETCHES, TouchVideo, chosen_frames, small
from taxel.training.features import load_kept, save_kept
from taxel.training.trial_blend import DIFFERENCES
from taxel.windows.trial_crops import STATISTICS, Layout, Scene, look_at, numbers_of, row_of

Image = NDArray[np.uint8]
SEED: Final = 59
"""Of cups and grasps: no other set of ours has it."""
RATE_HZ, DURATION_S, CROP = 25.0, 6.0, 48
"""Images a second, seconds of a trial and frames of a crop. Source: gelsight-slip's rate and crops;
its slip trials last 5.6 s in the median."""
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
_GAIN, _LEVEL, _JITTER, _NOISE = 0.15, 12.0, 0.02, 2.0
"""Spread of the gain by colour, level (grey levels), each image's own gain and grain. Source: as
the touch encoder is pretrained, decision 58."""
_BLURRED, _BLUR_PX = 0.3, 1.5
"""Share of blurred trials, and their largest deviation. Source: our choice."""
_REORDERED: Final = 0.5
"""Share of trials whose colours change places. Source: our choice."""
_SPARE_PX: Final = 64


@dataclass(frozen=True, slots=True)
class SimulatedTrial:
    """A grasp and what became of it."""

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


def choose_trials(first_cup: int, cups: int, most: int) -> list[SimulatedTrial]:
    """Return trials of which each cup has as many that slipped as that held.

    Even cups have gels of version 1, odd ones of version 2: a cup moves alike in both.

    Args:
        first_cup: Its number.
        cups: How many.
        most: Trials of each outcome that a cup may give.
    """
    chosen = []
    for index in range(first_cup, first_cup + cups):
        config = CupPourConfig(
            seed=SEED, cups=1, first_cup=index, positions=(POSITIONS[index % len(POSITIONS)],),
            forces_n=FORCES_N, kinds=KINDS, frame_hz=RATE_HZ,
        )  # fmt: skip
        runs = list_runs(config)
        order = np.random.default_rng((SEED, index)).permutation(len(runs))
        found: dict[bool, list[PourRun]] = {False: [], True: []}
        for at in order.tolist():
            truth = simulate_pour(runs[at], RATE_HZ, DURATION_S).truth
            found[bool(truth[:, 0].max() > SLIPPED_UM)].append(runs[at])
        count = min(most, *(len(own) for own in found.values()))
        gel: Gel = 2 if index % 2 else 1
        chosen += [
            SimulatedTrial(run, gel, slipped)
            for slipped, own in found.items()
            for run in own[:count]
        ]
    return chosen


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
    gain = np.exp(_GAIN * random.normal(size=3))
    level = _LEVEL * random.normal()
    order = random.permutation(3) if random.random() < _REORDERED else np.arange(3)
    blur = random.uniform(0.3, _BLUR_PX) if random.random() < _BLURRED else 0.0
    height, width = images[0].shape[:2]
    grain = random.normal(0, _NOISE, (height + _SPARE_PX, width + _SPARE_PX, 3)).astype(np.float32)
    for image in images:
        own = np.flip(image, flips)[..., order].astype(np.float32)
        own *= (gain * np.exp(_JITTER * random.normal())).astype(np.float32)
        if blur:
            own = np.asarray(cv2.GaussianBlur(own, (0, 0), blur), np.float32)
        top, left = random.integers(0, _SPARE_PX, 2)
        own += grain[top : top + height, left : left + width] + np.float32(level)
        yield np.asarray(own.clip(0, 255), np.uint8)


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
    """Return crops as grey differences, shape (crops, columns): what the blend's members see."""
    layout = Layout(CROP, STRETCHES)
    rows = []
    for start in layout.starts(len(cameras[0])):
        scenes = [
            Scene(images[start : start + CROP], RATE_HZ, USUAL_MM_PER_PX) for images in cameras
        ]
        rows.append(row_of(look_at(["pixels"], scenes))["pixels"])
    return grey_part(np.stack(rows))


def grey_part(pixels: Rows) -> Rows:
    """Return the grey differences among the numbers of the view "pixels" of two cameras."""
    return pixels[:, numbers_of("pixels", DIFFERENCES, 2)]


def simulated_rows(
    trials: Sequence[SimulatedTrial],
    module: nn.Module,
    cache: Path,
    change: int = 0,
    on_trial: Callable[[int, int], None] = lambda done, of: None,
) -> dict[str, Rows]:
    """Return feature → rows, shape (trials · crops, columns), kept on disk.

    Args:
        trials: What to look at.
        module: The touch encoder.
        cache: Folder of this encoder, this version of the simulator and these features.
        change: Number of the plainly changed copy; 0 leaves images as they are.
        on_trial: Called with trials done and in all.
    """
    found = []
    for done, trial in enumerate(trials, start=1):
        file = cache / f"{trial.name}-{change}.npy"
        rows = load_kept(file, sum(WIDTHS.values()))
        if rows is None:
            images = images_of(trial)
            if change:
                images = changed(images, (SEED, trial.run.seed, change))
            eight = eight_of(images)
            rows = np.hstack([touch_rows(eight, module), gel_rows(eight), grey_rows(images)])
            save_kept(file, rows)
        found.append(rows)
        on_trial(done, len(trials))
    ends = np.cumsum(list(WIDTHS.values()))[:-1]
    parts = np.split(np.concatenate(found), ends, axis=1)
    return dict(zip(WIDTHS, parts, strict=True))
