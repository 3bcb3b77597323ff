"""What differs from one tactile camera to the next: light, crop, wear, exposure, clock.

Figures are those of real GelSight Mini recordings (docs/decisions/0012). Knows nothing about
what is pressed into the gel, nor about how markers move.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from taxel.errors import MissingExtra

try:
    import cv2 as cv2
except ModuleNotFoundError as error:
    raise MissingExtra("opencv-python-headless", "camera", "tactile cameras") from error

Image = NDArray[np.float32]
Pair = tuple[float, float]

WIDTH_PX, HEIGHT_PX = 320, 240
"""Source: the pour paper, and real recordings of the sensor."""

_LAMPS_AT_PX = ((20.0, 160.0, 300.0), (20.0, 120.0, 220.0))
_LAMPS_RGB = np.array(
    [
        [[27, 97, 93], [42, 107, 138], [25, 89, 95]],
        [[55, 107, 117], [119, 113, 158], [66, 97, 122]],
        [[41, 91, 77], [86, 96, 96], [47, 78, 71]],
    ]
)
"""Colour of an untouched gel at 3 × 3 places, grey levels. Source: medians over 50 real
videos of 20 × 20 px, markers included."""
_WITHOUT_MARKERS = 1 / 0.94
"""Markers cover 12 % of those pixels and take half of their light."""
_FIXED_GRAIN = 0.6
"""Grey levels, of the gel's coat: the same in each frame. Source: real σ 0.7…1.7 within one
frame, most of which repeats in the next."""
_FLEETING_GRAIN = 0.65
"""Grey levels, of the image sensor: new in each frame."""
_CHROMA_SHARE = 0.4
"""Share of the grain that the three colours do not have in common (the stream is 4:2:0)."""
_POOL, _SPARE_PX = 4, 64
"""Images of grain that are drawn once, and how far each may be shifted: new grain at no cost."""


@dataclass(frozen=True, slots=True, kw_only=True)
class SensorNuisance:
    """One sensor on one run: drawn independently of what it will see."""

    gain: tuple[float, float, float]
    """Factor on red, green, blue, 0.85…1.15."""
    tilt: tuple[Pair, Pair, Pair]
    """Per colour: relative change of light from the middle to the right and lower edge, ±0.12."""
    crop_px: Pair
    """Shift (x, y) of the lamps' pattern, pixels."""
    mm_per_px: float
    """Millimetres of gel that a pixel covers, 0.059…0.071."""
    marker_spacing_px: float
    """About 31.5 or 43.5 pixels."""
    marker_diameter_px: float
    """10…18 pixels."""
    marker_offset_px: Pair
    """Where the marker nearest to the middle stands, pixels from the middle (x, y)."""
    marker_tilt_rad: float
    """Rotation of the grid of markers."""
    marker_darkness: float
    """Brightness of a marker over its background, 0.3…0.5."""
    marker_relief: float
    """Slope of a marker's rim, 0.02…0.1: how much the lamps colour it."""
    noise: float
    """Factor on all grain, 0.7…1.6."""
    scratches: int
    """How many."""
    dust: int
    """How many specks."""
    transient: float
    """Relative brightness at t = 0 beyond the settled one; 0 where the exposure is settled."""
    transient_s: float
    """Time constant in which it settles, seconds."""
    drift: float
    """Change of brightness in 6 s, grey levels, ±1…4."""
    flicker: float
    """Standard deviation of a frame's brightness, relative, 0.0002…0.0006."""


def draw_sensor(seed: int, index: int) -> SensorNuisance:
    """Return sensor number `index` of a run with this seed; the same each time."""
    random = np.random.default_rng((seed, index, 0x6E15))
    wide = bool(random.random() < 0.5)
    spacing = (43.5 if wide else 31.5) * random.uniform(0.97, 1.03)

    def pair(reach: float) -> Pair:
        x, y = random.uniform(-reach, reach, 2)
        return float(x), float(y)

    overall = random.uniform(0.9, 1.1)
    red, green, blue = overall * random.uniform(0.95, 1.05, 3)
    return SensorNuisance(
        gain=(float(red), float(green), float(blue)),
        tilt=(pair(0.12), pair(0.12), pair(0.12)),
        crop_px=pair(12.0),
        mm_per_px=float(random.uniform(0.059, 0.071)),
        marker_spacing_px=float(spacing),
        marker_diameter_px=float(random.uniform(13, 18) if wide else random.uniform(10, 14.5)),
        marker_offset_px=pair(spacing / 2),
        marker_tilt_rad=float(random.normal(0, 0.015)),
        marker_darkness=float(random.uniform(0.3, 0.5)),
        marker_relief=float(random.uniform(0.02, 0.1)),
        noise=float(random.uniform(0.7, 1.6)),
        scratches=int(random.poisson(1.5)),
        dust=int(random.poisson(3.0)),
        transient=float(random.normal(0, 0.08)) if random.random() < 0.25 else 0.0,
        transient_s=float(random.uniform(0.08, 0.3)),
        drift=float(random.choice((-1.0, 1.0)) * random.uniform(1.0, 4.0)),
        flicker=float(random.uniform(0.0002, 0.0006)),
    )


def lamp_light(sensor: SensorNuisance) -> Image:
    """Return the untouched gel without markers, grain or wear, shape (240, 320, 3)."""
    x = np.arange(WIDTH_PX, dtype=np.float64) - sensor.crop_px[0]
    y = np.arange(HEIGHT_PX, dtype=np.float64) - sensor.crop_px[1]
    along_x = _through_three(x, _LAMPS_AT_PX[0])
    along_y = _through_three(y, _LAMPS_AT_PX[1])
    light = np.einsum("yj,jic,xi->yxc", along_y, np.log(_LAMPS_RGB * _WITHOUT_MARKERS), along_x)
    light = np.exp(light) * np.asarray(sensor.gain)
    right = np.linspace(-1, 1, WIDTH_PX)[None, :, None]
    down = np.linspace(-1, 1, HEIGHT_PX)[:, None, None]
    tilt = np.asarray(sensor.tilt)
    return np.asarray(light * (1 + tilt[:, 0] * right + tilt[:, 1] * down), dtype=np.float32)


def wear(sensor: SensorNuisance, random: np.random.Generator) -> Image:
    """Return what scratches, dust and the coat's grain add to each frame, grey levels."""
    canvas = np.zeros((HEIGHT_PX, WIDTH_PX, 3), np.float32)
    for _ in range(sensor.scratches):
        start = random.uniform((0, 0), (WIDTH_PX, HEIGHT_PX))
        end = start + random.normal(0, 50, 2)
        bend = (start + end) / 2 + random.normal(0, 5, 2)
        colour = random.uniform(-8, 12) + random.normal(0, 4, 3)
        points = np.array([start, bend, end]) * 16
        cv2.polylines(canvas, [points.astype(np.int32)], False, colour.tolist(), 1, cv2.LINE_AA, 4)
    for _ in range(sensor.dust):
        middle = random.uniform((0, 0), (WIDTH_PX, HEIGHT_PX)) * 16
        radius = int(random.uniform(0.8, 2.5) * 16)
        colour = random.uniform(-25, 8) + random.normal(0, 4, 3)
        place = (int(middle[0]), int(middle[1]))
        cv2.circle(canvas, place, radius, colour.tolist(), -1, cv2.LINE_AA, 4)
    worn = cv2.GaussianBlur(canvas, (0, 0), 0.8)
    return np.asarray(worn + grain(sensor.noise * _FIXED_GRAIN, worn.shape, random), np.float32)


def grain(sigma: float, shape: tuple[int, ...], random: np.random.Generator) -> Image:
    """Return noise of a colour camera with this standard deviation, grey levels."""
    height, width, colours = shape
    common = random.normal(0, np.sqrt(1 - _CHROMA_SHARE), (height, width, 1))
    own = random.normal(0, np.sqrt(_CHROMA_SHARE), (height, width, colours))
    return np.asarray(sigma * (common + own), dtype=np.float32)


class NoisePool:
    """Grain for any frame, cut from a few large images at random places: fast and repeatable."""

    def __init__(self, sensor: SensorNuisance, seed: int) -> None:
        self._seed = seed
        random = np.random.default_rng((seed, 0x9015E))
        shape = (HEIGHT_PX + _SPARE_PX, WIDTH_PX + _SPARE_PX, 3)
        sigma = sensor.noise * _FLEETING_GRAIN
        self._images = [grain(sigma, shape, random) for _ in range(_POOL)]

    def at(self, index: int) -> tuple[Image, float]:
        """Return frame `index`'s grain, shape (240, 320, 3), and a standard normal number."""
        random = np.random.default_rng((self._seed, index))
        which, top, left = random.integers(0, (_POOL, _SPARE_PX, _SPARE_PX))
        image = self._images[which][top : top + HEIGHT_PX, left : left + WIDTH_PX]
        return image, float(random.standard_normal())


def exposure(sensor: SensorNuisance, time_s: float, flicker: float) -> Pair:
    """Return the (factor, offset in grey levels) of a frame taken at `time_s`.

    Args:
        sensor: Whose exposure.
        time_s: Seconds since the recording began.
        flicker: A standard normal number, the frame's own.
    """
    settling = sensor.transient * np.exp(-max(time_s, 0.0) / sensor.transient_s)
    return float((1 + settling) * (1 + sensor.flicker * flicker)), sensor.drift * time_s / 6.0


@dataclass(frozen=True, slots=True)
class CameraTimes:
    """Which images a camera took, and which of them each video frame shows."""

    taken_s: NDArray[np.float64]
    """Shape (images,): when each was taken, seconds since the recording began; the first ones
    may be slightly negative."""
    shown: NDArray[np.int64]
    """Shape (frames,): the image that each video frame shows; repeats are identical frames."""


def camera_times(
    camera_hz: float,
    frame_hz: float,
    duration_s: float,
    seed: int,
    *,
    jitter: float = 0.03,
    skew_frames: int | None = None,
    most_lost: int | None = None,
) -> CameraTimes:
    """Return how a free-running camera fills a video of fixed rate.

    Args:
        camera_hz: Images a second; 25 as sold, 60 as in the pour paper.
        frame_hz: Frames a second of the video.
        duration_s: Length of the video, seconds.
        seed: Of phase, jitter, lost images and skew.
        jitter: Standard deviation of the interval between images, relative to it.
        skew_frames: How many video frames the camera lags; None draws 0, 1 or 2.
        most_lost: Images that may be lost in a row; None sets no limit, so that a bad draw
            (40 % lost) now and then repeats an image for as long as a camera that is frozen.

    Raises:
        ValueError: A rate or the duration is not above 0.
    """
    if min(camera_hz, frame_hz, duration_s) <= 0:
        raise ValueError("needed rates and a duration above 0")
    random = np.random.default_rng((seed, 0xC10C))
    skew = int(random.integers(0, 3)) if skew_frames is None else skew_frames
    lag_s = skew / frame_hz
    interval_s = 1.0 / camera_hz
    count = int(np.ceil((duration_s + lag_s) * camera_hz)) + 3
    taken = (np.arange(count) - 1 - random.random()) * interval_s - lag_s
    taken += random.normal(0, jitter, count).clip(-0.3, 0.3) * interval_s
    lost = random.random(count) < min(float(np.exp(random.normal(np.log(0.002), 2.9))), 0.4)
    lost[:2] = False
    if most_lost is not None:
        row = 0
        for index in range(count):
            row = row + 1 if lost[index] and row < most_lost else 0
            lost[index] = row > 0
    moments = np.arange(round(duration_s * frame_hz)) / frame_hz - lag_s
    newest = np.searchsorted(taken, moments, side="right") - 1
    kept = np.maximum.accumulate(np.where(lost, 0, np.arange(count)))
    images, shown = np.unique(kept[np.maximum(newest, 0)], return_inverse=True)
    return CameraTimes(taken[images], shown.astype(np.int64))


def _through_three(
    at: NDArray[np.float64], places: tuple[float, float, float]
) -> NDArray[np.float64]:
    """Return the weights (n, 3) of the parabola through values at three places."""
    a, b, c = places
    return np.stack(
        [
            (at - b) * (at - c) / ((a - b) * (a - c)),
            (at - a) * (at - c) / ((b - a) * (b - c)),
            (at - a) * (at - b) / ((c - a) * (c - b)),
        ],
        axis=-1,
    )
