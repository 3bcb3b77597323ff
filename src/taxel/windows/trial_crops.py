"""Crops of fixed length of camera trials, and what each shows, as a row of numbers.

Every trial has as many crops, at the same places, so that neither their number nor where they lie
shows how long it is. All that is seen of movement in a crop is relative to the crop's own first
frames: a crop gives the same row wherever it was cut, offline and live. Knows nothing about
labels, models or files.

Background of our choices: docs/decisions/0041.
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Final

import cv2
import numpy as np
from numpy.typing import NDArray

from taxel.gel.slip_signal import TREND_FEATURES, GelSlip
from taxel.gel.touch_poses import TouchFollower
from taxel.windows import trial_miniature as miniature
from taxel.windows import trial_network as network
from taxel.windows import trial_picture as picture
from taxel.windows.touch_view import FEATURES as TOUCH_FEATURES
from taxel.windows.touch_view import VERSION as TOUCH_VERSION
from taxel.windows.touch_view import look_through_touch, touch_courses

Image = NDArray[np.uint8]
LEAST_CROP: Final = 8
"""Frames in which movement is summed up; of a shorter crop the last frame stands still to them.
Source: our choice, docs/decisions/0041."""
PLACES: Final[tuple[str, ...]] = ("first", "middle", "last")
"""The crops of each trial, or of its part in which something moves; a set whose trials all have a
crop's length has the first alone."""
REFERENCE_FRAMES: Final = 3
"""Frames at a crop's start whose median is its reference: 0.12 s at 25 frames a second."""
LAG: Final = 5
"""Frames of the slower difference: 0.2 s at 25 frames a second. Source: our choice."""
_WIDTH: Final = 160
"""Pixels of a row in which grey differences and flow are taken. Source: our choice."""
GRID: Final = (3, 4)
"""Rows and columns of the places where differences and edges are taken apart."""
THUMB: Final = (6, 8)
"""Rows and columns of the small grey image that the first-frame control sees."""
EDGES: Final = 8
"""Directions of edges in each place."""
_BANDS: Final = ((1, 3), (3, 8), (8, 1000))
"""Cycles a crop: 0.5 to 1.5, 1.5 to 4 and above 4 Hz for 48 frames at 25 frames a second."""
STATISTICS: Final = 9 + len(_BANDS)
"""Numbers that a column's course is summed up in."""
LARGEST_RATIO: Final = 100
"""Of an image's longer side to its shorter: far beyond it what is seen, 160 pixels wide, has no row
of pixels or fills memory. Source: our choice, docs/decisions/0041."""
_FURTHEST: Final = 1e6
"""What a row may hold; nothing that is measured here comes near. Source: our choice."""

PIXELS: Final[tuple[str, ...]] = (
    "step", "since", "step_p95", "since_p95", "lagged",
    "flow_x", "flow_y", "flow", "flow_p90", "flow_spread", "flow_turn", "flow_growth",
    *(f"step_{place}" for place in range(GRID[0] * GRID[1])),
    *(f"since_{place}" for place in range(GRID[0] * GRID[1])),
)  # fmt: skip
"""Of each frame: absolute difference of grey to the frame before (step), to the crop's first
(since) and to the one 0.2 s before (lagged), means and 95th percentiles, 0…255; optical flow since
the frame before, pixels of a 160-pixel row; the differences by place."""
BAR: Final = ("step", "since")
"""What the bar's forest sees of `PIXELS`."""
SLIP: Final[tuple[str, ...]] = ("slip_mm", "slip_rate_mm_s", "slip_seen", *TREND_FEATURES)
"""Of each frame: the slip signal of `taxel.gel.slip_signal` and its features."""
MOVES: Final[tuple[str, ...]] = (
    "object_x_mm", "object_y_mm", "object_turn", "gel_x_mm", "gel_y_mm", "gel_turn", "seen",
)  # fmt: skip
"""Of each frame: how object and gel have moved since the crop's first frames, turns in radians."""
STILLS: Final = THUMB[0] * THUMB[1] + GRID[0] * GRID[1] * (EDGES + 3)
"""Columns of a still: grey thumb, edges by direction and place, colour by place."""
CHANGES: Final = ("grey since the first frame",)
"""Of stills: how the grey thumbs of the middle and the last frame differ from the first's, with
sign."""


@dataclass(frozen=True, slots=True)
class Scene:
    """One camera's images of one crop, and what must be known of the camera."""

    images: Sequence[Image]
    """Shape (height, width, 3) each, red first."""
    rate_hz: float
    """Of these images, a second."""
    mm_per_px: float
    """Of a 320-pixel row."""
    network: network.Network | None = None
    """What the view of that name looks through."""


@dataclass(frozen=True, slots=True)
class Family:
    """A kind of quantities: frame by frame, or of some stills."""

    columns: int
    look: Callable[[Scene], NDArray[np.float32]]
    """One camera's crop → shape (rows, columns), a row a frame or a still."""
    sum_up: Callable[[NDArray[np.float32]], NDArray[np.float32]]
    """Shape (rows, cameras, columns) → (cameras, numbers)."""
    version: str

    @property
    def key(self) -> str:
        """Name for the cache."""
        return f"{self.version}-{self.columns}-{REFERENCE_FRAMES}"


def look_at(families: Sequence[str], scenes: Sequence[Scene]) -> dict[str, NDArray[np.float32]]:
    """Return what one crop shows, family → shape (rows, cameras, columns).

    Args:
        families: Names in `FAMILIES`.
        scenes: One a camera.
    """
    return {name: np.stack([_shown(name, own) for own in scenes], axis=1) for name in families}


def _shown(name: str, scene: Scene) -> NDArray[np.float32]:
    """Return what a family sees; of fewer images than `LEAST_CROP` the last one stands still."""
    lacking = LEAST_CROP - len(scene.images)
    if len(scene.images) == 1 and name in MOVEMENT:  # nothing can have moved, be it noise
        return np.zeros((LEAST_CROP, FAMILIES[name].columns), np.float32)
    held = [*scene.images, *[scene.images[-1]] * lacking]
    return FAMILIES[name].look(replace(scene, images=held) if lacking > 0 else scene)


def row_of(shown: Mapping[str, NDArray[np.float32]]) -> dict[str, NDArray[np.float32]]:
    """Return one crop as numbers, family → shape (numbers,).

    Several cameras give the largest and the least of each number over them, so that which of two
    fingers is left does not matter.

    Args:
        shown: As `look_at` gives it.
    """
    rows = {}
    for name, values in shown.items():
        each = FAMILIES[name].sum_up(values)
        both = each if len(each) == 1 else np.stack([each.max(axis=0), each.min(axis=0)])
        rows[name] = np.nan_to_num(
            both.ravel(), nan=0.0, posinf=_FURTHEST, neginf=-_FURTHEST
        ).clip(-_FURTHEST, _FURTHEST).astype(np.float32)  # fmt: skip
    return rows


def rows_alone(shown: Mapping[str, NDArray[np.float32]]) -> list[dict[str, NDArray[np.float32]]]:
    """Return one crop as numbers, as if every camera saw what one does, for each of several.

    Args:
        shown: As `look_at` gives it.
    """
    cameras = next(iter(shown.values())).shape[1]
    if cameras == 1:
        return []
    return [
        row_of({name: values[:, [camera] * cameras] for name, values in shown.items()})
        for camera in range(cameras)
    ]


def numbers_of(view: str, names: Sequence[str], cameras: int) -> NDArray[np.intp]:
    """Return which numbers of a view sum up some of its columns.

    Args:
        view: "pixels" or "slip", or "stills", of which only `CHANGES` are parted.
        names: In `PIXELS` or `SLIP`, or `CHANGES`.
        cameras: How many there are.

    Returns:
        Indices into a crop's row, shape (numbers,).
    """
    blocks = np.arange(2 if cameras > 1 else 1)
    if view == "stills":
        starts = (blocks[:, None] * 3 + np.array([1, 2])).ravel() * STILLS
        grey = np.arange(THUMB[0] * THUMB[1])
        return np.asarray((starts[:, None] + grey).ravel(), np.intp)
    columns = {"pixels": PIXELS, "slip": SLIP}[view]
    chosen = [columns.index(name) for name in names]
    blocks = np.arange(STATISTICS * len(blocks))
    return np.asarray((blocks[:, None] * len(columns) + np.array(chosen)).ravel(), np.intp)


def _pixels(scene: Scene) -> NDArray[np.float32]:
    flow = cv2.DISOpticalFlow.create(cv2.DISOPTICAL_FLOW_PRESET_ULTRAFAST)
    greys = [small_grey(image) for image in scene.images]
    rows = []
    for index, grey in enumerate(greys):
        before = greys[max(0, index - 1)]
        step, since = (cv2.absdiff(grey, other) for other in (before, greys[0]))
        lagged = cv2.absdiff(grey, greys[max(0, index - LAG)])
        moved = np.zeros((*grey.shape, 2), np.float32)
        if index:
            moved = np.asarray(flow.calc(before, grey, moved), np.float32)
        rows.append(
            np.concatenate(
                [
                    [step.mean(), since.mean(), _p95(step), _p95(since), lagged.mean()],
                    _flow_columns(moved),
                    _by_place(step),
                    _by_place(since),
                ]
            )
        )
    return np.stack(rows).astype(np.float32)


def _slip(scene: Scene) -> NDArray[np.float32]:
    follower = TouchFollower(scene.images[:REFERENCE_FRAMES])
    to_mm = np.array([scene.mm_per_px, scene.mm_per_px, 1.0])
    gel, rows = GelSlip(), []
    for index, image in enumerate(scene.images):
        pose = follower.follow(image)
        gel.push(
            pose.object * to_mm, pose.gel * to_mm, pose.spread * to_mm, index / scene.rate_hz,
            pose.seen,
        )  # fmt: skip
        slip = gel.slip
        rows.append([slip.distance_mm, slip.rate_mm_s, float(slip.seen), *gel.features])
    return np.nan_to_num(np.array(rows, np.float32))


def _moves(scene: Scene) -> NDArray[np.float32]:
    follower = TouchFollower(scene.images[:REFERENCE_FRAMES])
    to_mm = np.array([scene.mm_per_px, scene.mm_per_px, 1.0])
    rows = []
    for image in scene.images:
        pose = follower.follow(image)
        rows.append(np.concatenate([pose.object * to_mm, pose.gel * to_mm, [float(pose.seen)]]))
    return np.stack(rows).astype(np.float32)


def _stills(scene: Scene) -> NDArray[np.float32]:
    """Return the look of the first, the middle and the last frame."""
    last = len(scene.images) - 1
    return np.stack([_look_of(scene.images[at]) for at in (0, last // 2, last)])


def _look_of(image: Image) -> NDArray[np.float32]:
    grey = small_grey(image)
    colour = cv2.resize(image.astype(np.float32), (GRID[1], GRID[0]), interpolation=cv2.INTER_AREA)
    found = np.concatenate([_thumb(grey), _edges(grey), colour.ravel()])
    return np.asarray(found, np.float32)


def thumb_of(image: Image) -> NDArray[np.float32]:
    """Return an image as the first-frame control sees it, 8×6 grey, shape (48,)."""
    return _thumb(small_grey(image))


def _thumb(grey: Image) -> NDArray[np.float32]:
    size = THUMB[1], THUMB[0]
    small = cv2.resize(grey.astype(np.float32), size, interpolation=cv2.INTER_AREA)
    return np.asarray(small, np.float32).ravel()


def _edges(grey: Image) -> NDArray[np.float32]:
    """Return how much edge there is by direction, of each place, shape (places · directions,).

    Source: histograms of oriented gradients, Dalal and Triggs, CVPR 2005, without blocks.
    """
    across, down = (cv2.Sobel(grey, cv2.CV_32F, *order, ksize=3) for order in ((1, 0), (0, 1)))
    strength, direction = cv2.cartToPolar(across, down)
    sector = np.floor((direction % np.pi) / (np.pi / EDGES)).astype(np.intp) % EDGES
    rows, columns = (np.arange(n) * g // n for n, g in zip(grey.shape, GRID, strict=True))
    place = rows[:, None] * GRID[1] + columns[None]
    found = np.bincount(
        (place * EDGES + sector).ravel(), strength.ravel().astype(np.float64),
        GRID[0] * GRID[1] * EDGES,
    )  # fmt: skip
    return np.sqrt(found / grey.size).astype(np.float32)


def small_grey(image: Image) -> Image:
    """Return an image in grey, 160 pixels wide."""
    grey = cv2.cvtColor(image, cv2.COLOR_RGB2GRAY)
    height = max(8, round(_WIDTH * grey.shape[0] / grey.shape[1]))
    return np.asarray(cv2.resize(grey, (_WIDTH, height), interpolation=cv2.INTER_AREA), np.uint8)


def _p95(difference: NDArray[np.generic]) -> float:
    counts = np.cumsum(np.bincount(np.asarray(difference, np.uint8).ravel(), minlength=256))
    return float(np.searchsorted(counts, 0.95 * counts[-1]))


def _by_place(difference: NDArray[np.generic]) -> NDArray[np.float32]:
    small = cv2.resize(
        np.asarray(difference, np.float32), (GRID[1], GRID[0]), interpolation=cv2.INTER_AREA
    )
    return np.asarray(small, np.float32).ravel()


def _flow_columns(moved: NDArray[np.float32]) -> NDArray[np.float32]:
    length = np.hypot(moved[..., 0], moved[..., 1])
    mean = moved.reshape(-1, 2).mean(axis=0)
    parted = moved - mean
    turn = np.diff(moved[..., 1], axis=1).mean() - np.diff(moved[..., 0], axis=0).mean()
    growth = np.diff(moved[..., 0], axis=1).mean() + np.diff(moved[..., 1], axis=0).mean()
    spread = np.sqrt((parted**2).sum(axis=2).mean())
    return np.array(
        [*mean, length.mean(), np.percentile(length, 90), spread, turn, growth], np.float32
    )


def _courses(values: NDArray[np.float32]) -> NDArray[np.float32]:
    """Return the statistics of courses, shape (cameras, statistics · columns).

    Args:
        values: Shape (frames, cameras, columns).
    """
    steps = np.diff(values, axis=0)
    power = np.abs(np.fft.rfft(steps, axis=0)) ** 2 / len(steps)
    bands = [np.log1p(power[low:high].sum(axis=0)) for low, high in _BANDS]
    found = [
        values.mean(axis=0),
        values.std(axis=0),
        values.min(axis=0),
        values.max(axis=0),
        values[-1],
        *np.percentile(values, (10, 50, 90), axis=0),
        (steps**2).mean(axis=0),
        *bands,
    ]
    return np.asarray(np.concatenate(found, axis=1), np.float32)


def _looks(values: NDArray[np.float32]) -> NDArray[np.float32]:
    """Return the first look and how the middle and the last differ, a row a camera."""
    first, middle, last = values
    return np.concatenate([first, middle - first, last - first], axis=1)


FAMILIES: Final[dict[str, Family]] = {
    "pixels": Family(len(PIXELS), _pixels, _courses, "pixels-1"),
    "slip": Family(
        len(SLIP), _slip, _courses,
        "slip-2-" + hashlib.sha256(",".join(SLIP).encode()).hexdigest()[:8],
    ),
    "stills": Family(STILLS, _stills, _looks, "stills-1"),
    "moves": Family(len(MOVES), _moves, _courses, "moves-2"),
    "touch": Family(TOUCH_FEATURES, lambda scene: look_through_touch(scene.images), touch_courses,
                    TOUCH_VERSION),
    "picture": Family(picture.COLUMNS, lambda scene: picture.look_at_picture(scene.images),
                      picture.sum_up_picture, picture.VERSION),
    "miniature": Family(miniature.COLUMNS,
                        lambda scene: miniature.look_at_miniature(scene.images),
                        network.as_it_is, miniature.VERSION),
    "network": Family(network.FEATURES,
                      lambda scene: network.look_through_network(scene.images, scene.network),
                      network.as_it_is, network.VERSION),
}  # fmt: skip
"""Name → what is looked at: grey differences and flow, the slip signal, how first, middle and last
frame look, where object and gel went; touch, only where asked for, is the touch encoder; picture is
a coarse grid of colour and its spread, miniature the middle frame in 32×32 pixels; network is an
image network, only where one is at hand."""
USUAL: Final = ("pixels", "slip", "stills", "picture", "miniature")
"""The families that every recogniser learns from."""
MOVEMENT: Final = ("pixels", "slip", "moves")
"""The families that see how a crop differs from its own first frames, and nothing else."""
