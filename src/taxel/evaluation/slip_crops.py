"""Three crops of fixed length of each trial, and what each shows of movement.

A trial's first, middle and last crop: every trial has all three, at the same places, and
those of a short trial overlap. So neither how many crops there are nor where they lie tells
how long the trial is, which tells slip (it ends trials). All of a crop's quantities of
movement are relative to its own first frames. Knows nothing about folds, models or scores.
"""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import cv2
import numpy as np
from numpy.typing import NDArray

from taxel.errors import BadDataset
from taxel.gel.slip_features import SLIP_FEATURES, SlipFeatures
from taxel.training.features import FrameFeatures
from taxel.windows.pours import Pour

REFERENCE_FRAMES: Final = 3
"""Frames at a crop's start whose median is its reference: 0.12 s at 25 frames a second."""
LEAST_CROP: Final = 12
"""Shortest crop, frames: a shorter one has no slow band."""
MOTION: Final[tuple[str, ...]] = ("difference", "since_start")
"""Mean absolute difference of grey to the frame before and to the crop's first one, 0…255."""
FLOW: Final[tuple[str, ...]] = (
    "flow_x",
    "flow_y",
    "flow",
    "flow_p90",
    "flow_spread",
    "flow_turn",
    "flow_growth",
)
"""Dense optical flow since the frame before, pixels of a 160-pixel row: mean, mean length and
its 90th percentile, deviation from the mean, mean curl and divergence."""
GRID: Final = (3, 4)
"""Rows and columns of the places where differences of grey are taken apart."""
THUMB: Final = (6, 8)
"""Rows and columns of the grey frame that a control sees."""
_PLACES: Final = GRID[0] * GRID[1]
PLACES: Final[tuple[str, ...]] = ("first", "middle", "last")
"""The crops of each trial."""
_WIDTH: Final = len(SLIP_FEATURES) + len(MOTION) + len(FLOW) + 2 * _PLACES
"""Columns of movement; the thumb follows them."""
_BANDS: Final = ((1, 3), (3, 8), (8, 1000))
"""Cycles a crop: 0.5 to 1.5, 1.5 to 4 and above 4 Hz for 48 frames at 25 frames a second."""
_STATISTICS: Final = 9 + len(_BANDS)
_ROW: Final = _WIDTH + THUMB[0] * THUMB[1]
"""Columns of a crop's frame."""
GREY_COLUMNS: Final = (
    np.arange(2 * _STATISTICS)[:, None] * _WIDTH + len(SLIP_FEATURES) + np.arange(len(MOTION))
).ravel()
"""Which columns of `SlipCrops.movement` sum up mean grey differences: what the bar sees."""


def crop_starts(frames: int, crop: int) -> list[int]:
    """Return the first frames of a trial's crops, in the order of `PLACES`."""
    last = frames - crop
    return [0, last // 2, last]


@dataclass(frozen=True, slots=True)
class CropExtractor:
    """Quantities of the gel, of grey differences and of flow, started anew in each crop."""

    crop: int
    """Frames in a crop."""
    features: int = len(PLACES) * _ROW
    in_order: bool = True

    @property
    def key(self) -> str:
        """Name for the cache."""
        names = hashlib.sha256(",".join(SLIP_FEATURES + MOTION + FLOW).encode()).hexdigest()[:8]
        return f"slip-crops-2-{names}-{self.crop}-{REFERENCE_FRAMES}"

    def of(self, images: Sequence[NDArray[np.uint8]]) -> NDArray[np.float32]:
        """Return shape (n, features): row i holds frame i of all three crops; then zeros."""
        rows = np.zeros((len(images), self.features), np.float32)
        if len(images) >= self.crop:
            starts = crop_starts(len(images), self.crop)
            each = [_crop_rows(images[start : start + self.crop]) for start in starts]
            rows[: self.crop] = np.concatenate(each, axis=1)
        return rows


def _crop_rows(images: Sequence[NDArray[np.uint8]]) -> NDArray[np.float32]:
    gel = SlipFeatures(images[:REFERENCE_FRAMES])
    flow = cv2.DISOpticalFlow.create(cv2.DISOPTICAL_FLOW_PRESET_ULTRAFAST)
    greys = [_small_grey(image) for image in images]
    rows = []
    for index, (image, grey) in enumerate(zip(images, greys, strict=True)):
        before = greys[max(0, index - 1)]
        step = cv2.absdiff(grey, before).astype(np.float32)
        since = cv2.absdiff(grey, greys[0]).astype(np.float32)
        moved = np.zeros((*grey.shape, 2), np.float32)
        if index:
            moved = np.asarray(flow.calc(before, grey, moved), np.float32)
        rows.append(
            np.concatenate(
                [
                    gel.push(image),
                    [step.mean(), since.mean()],
                    _flow_columns(moved),
                    _shrink(step, GRID),
                    _shrink(since, GRID),
                    _shrink(grey.astype(np.float32), THUMB),
                ]
            )
        )
    return np.stack(rows).astype(np.float32)


def _small_grey(image: NDArray[np.uint8]) -> NDArray[np.uint8]:
    grey = cv2.cvtColor(image, cv2.COLOR_RGB2GRAY)
    return np.asarray(cv2.resize(grey, (160, 120), interpolation=cv2.INTER_AREA), np.uint8)


def _shrink(grey: NDArray[np.float32], shape: tuple[int, int]) -> NDArray[np.float32]:
    """Return means over places, shape (rows · columns,)."""
    small = cv2.resize(grey, (shape[1], shape[0]), interpolation=cv2.INTER_AREA)
    return np.asarray(small, np.float32).ravel()


def _flow_columns(moved: NDArray[np.float32]) -> NDArray[np.float32]:
    length = np.hypot(moved[..., 0], moved[..., 1])
    mean = moved.reshape(-1, 2).mean(axis=0)
    parted = moved - mean
    turn = np.gradient(moved[..., 1], axis=1) - np.gradient(moved[..., 0], axis=0)
    growth = np.gradient(moved[..., 0], axis=1) + np.gradient(moved[..., 1], axis=0)
    spread = np.sqrt((parted**2).sum(axis=2).mean())
    return np.array(
        [*mean, length.mean(), np.percentile(length, 90), spread, turn.mean(), growth.mean()],
        np.float32,
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class SlipCrops:
    """All trials' crops as rows of numbers, a trial's three together."""

    movement: NDArray[np.float32]
    """Shape (n, columns): what the strong model sees."""
    first_frame: NDArray[np.float32]
    """Shape (n, cameras · 48): the crop's first frame, 8×6 grey."""
    trial: NDArray[np.intp]
    """Shape (n,): index of the trial."""
    place: NDArray[np.intp]
    """Shape (n,): index in `PLACES`."""
    slipped: NDArray[np.intp]
    """Shape (trials,): 1 where the object slipped."""
    objects: NDArray[np.str_]
    """Shape (trials,): what is held out whole."""
    length: NDArray[np.intp]
    """Shape (trials,): frames."""
    crop: int

    @property
    def y(self) -> NDArray[np.intp]:
        """Shape (n,): each crop has its trial's label."""
        return self.slipped[self.trial]

    @property
    def groups(self) -> NDArray[np.str_]:
        """Shape (n,): each crop's object."""
        return self.objects[self.trial]


def check_trials(pours: Sequence[Pour], crop: int) -> None:
    """Refuse trials that cannot be cut or judged.

    Raises:
        BadDataset: One is shorter than a crop, or lacks its object or outcome.
    """
    for pour in pours:
        if len(pour) < crop:
            raise BadDataset(
                f"at least one crop of {crop} frames in each trial",
                f"{len(pour)} frames in {pour.path.name}",
                "choose a shorter --crop",
            )
        if "object" not in pour.groups or pour.labels.get("outcome") not in ("slip", "hold"):
            raise BadDataset(
                "the group object and the label outcome=slip or hold in each recording",
                f"{dict(pour.groups)} and {dict(pour.labels)} in {pour.path.name}",
                "import with: taxel import gelsight-slip",
            )
    if len({len(pour.cameras) for pour in pours}) > 1:
        raise BadDataset("as many cameras in each trial", "several numbers", "split the folder")


def cut_crops(
    features: Sequence[FrameFeatures],
    slipped: Sequence[bool],
    objects: Sequence[str],
    crop: int,
) -> SlipCrops:
    """Sum up the three crops of each trial.

    Args:
        features: Of `CropExtractor`, one a trial, shape (frames, cameras, features).
        slipped: Whether the object slipped, one a trial.
        objects: What was held, one a trial.
        crop: Frames in a crop.

    Raises:
        BadDataset: A trial is shorter than one crop.
    """
    movement, first, lengths = [], [], []
    for index, one in enumerate(features):
        values = one.all()
        lengths.append(len(values))
        if len(values) < crop:
            raise BadDataset(
                f"at least {crop} frames in each trial",
                f"{len(values)} in trial {index + 1}",
                "choose a shorter --crop",
            )
        for number in range(len(PLACES)):
            part = values[:crop, :, number * _ROW : (number + 1) * _ROW]
            movement.append(_sum_up(part[..., :_WIDTH]))
            first.append(part[0, :, _WIDTH:].ravel())
    return SlipCrops(
        movement=np.stack(movement),
        first_frame=np.stack(first),
        trial=np.repeat(np.arange(len(features)), len(PLACES)),
        place=np.tile(np.arange(len(PLACES)), len(features)),
        slipped=np.array(slipped, np.intp),
        objects=np.array(objects, np.str_),
        length=np.array(lengths, np.intp),
        crop=crop,
    )


def _sum_up(part: NDArray[np.float32]) -> NDArray[np.float32]:
    """Return the statistics of one crop, the cameras' larger and smaller of each.

    Args:
        part: Shape (crop, cameras, columns).

    Returns:
        Shape (2 · statistics · columns,); which camera is left does not matter.
    """
    steps = np.diff(part, axis=0)
    power = np.abs(np.fft.rfft(steps, axis=0)) ** 2 / len(steps)
    bands = [np.log1p(power[low:high].sum(axis=0)) for low, high in _BANDS]
    per_camera = np.stack(
        [
            part.mean(axis=0),
            part.std(axis=0),
            part.min(axis=0),
            part.max(axis=0),
            part[-1],
            *np.percentile(part, (10, 50, 90), axis=0),
            (steps**2).mean(axis=0),
            *bands,
        ]
    )
    both = np.stack([per_camera.max(axis=1), per_camera.min(axis=1)])
    return np.asarray(both.reshape(-1), np.float32)
