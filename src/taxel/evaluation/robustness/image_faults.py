"""Faults of tactile cameras, made on a recording's frames before anything looks at them.

Each fault takes the frames of one recording, all cameras mixed, and gives what worse cameras
would have delivered. A fault holds from the first frame on, the settled grasp included, but
for the step of exposure. Images that a camera repeats stay repeated. Knows nothing
about features, states or slip.

Source: our choice of faults and levels, docs/decisions/0029.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, replace

import cv2
import numpy as np
from numpy.typing import NDArray

from taxel.evaluation.robustness.faults import find_fault
from taxel.frame_codec import decode_jpeg, encode_jpeg
from taxel.gel.markers import MarkerTracker, brightest
from taxel.gel.scale import ROW_PX
from taxel.signals import Frame

Rgb = NDArray[np.uint8]
Change = Callable[[Rgb], Rgb]
"""What happens to each different image of one camera, in order."""
STEP_S = (0.5, 2.0)
"""When the exposure jumps, seconds after the first frame: after the settled grasp. Our choice."""
_CLOSING_PX = 29
"""Wider than a dot, narrower than the spacing of dots. Source: `taxel.gel.markers`."""
_DOT, _CLEAR = 0.72, 0.92
"""Brightness against the surroundings at which a pixel is all ink, and none."""
_LOST = 0.75
"""Radius around a lost marker in which its ink is gone, in diameters."""


@dataclass(frozen=True, slots=True)
class ImageFault:
    """One way in which tactile cameras get worse."""

    summary: str
    unit: str
    levels: tuple[float, ...]
    """The mildest first."""
    limits: tuple[float, float]
    make: Callable[[Iterable[Frame], float, np.random.Generator], Iterator[Frame]]


def exposure(image: Rgb, stops: float) -> Rgb:
    """Return an image with 2^stops of its light; what exceeds 255 is lost."""
    return np.asarray(np.clip(np.rint(image * np.float32(2.0**stops)), 0, 255), np.uint8)


def blur(image: Rgb, sigma_px: float) -> Rgb:
    """Return an image out of focus; sigma in pixels of a 320-pixel row."""
    sigma = sigma_px * image.shape[1] / ROW_PX
    return np.asarray(cv2.GaussianBlur(image, (0, 0), sigma), np.uint8) if sigma > 0 else image


def fade(image: Rgb, share: float, where: NDArray[np.float32] | None = None) -> Rgb:
    """Return an image whose markers have lost a share of their ink.

    Args:
        image: Shape (height, width, 3).
        share: 0…1; at 1 markers are gone.
        where: Shape (height, width), 0…1: where ink is lost; everywhere unless given.
    """
    size = round(_CLOSING_PX * image.shape[1] / ROW_PX) | 1
    filled = cv2.morphologyEx(image, cv2.MORPH_CLOSE, np.ones((size, size), np.uint8))
    around = cv2.blur(filled, (size, size)).astype(np.float32)
    ratio = brightest(image.astype(np.float32) / np.maximum(around, 1.0))
    ink = np.clip((_CLEAR - ratio) / (_CLEAR - _DOT), 0.0, 1.0) * np.float32(share)
    if where is not None:
        ink *= where
    return np.asarray(np.rint(image + ink[..., None] * (around - image)).clip(0, 255), np.uint8)


def _plain(change: Callable[[Rgb, float], Rgb]) -> Callable[[float, np.random.Generator], Change]:
    """Return the maker of a change that is the same for every image."""
    return lambda level, random: lambda image: change(image, level)


def _noise(level: float, random: np.random.Generator) -> Change:
    def change(image: Rgb) -> Rgb:
        grain = random.normal(0.0, level, image.shape)
        return np.asarray(np.rint(image + grain).clip(0, 255), np.uint8)

    return change


def _scratches(level: float, random: np.random.Generator) -> Change:
    """Lines on the gel's surface, fixed in the image; level: how many."""
    lines = [
        (random.random(2), random.uniform(0, np.pi), random.uniform(0.05, 0.3), light)
        for light in random.choice([-60.0, 60.0], round(level))
    ]

    def change(image: Rgb) -> Rgb:
        height, width = image.shape[:2]
        layer = np.zeros((height, width), np.float32)
        for middle, angle, length, light in lines:
            half = 0.5 * length * width * np.array([np.cos(angle), np.sin(angle)])
            at = middle * (width, height)
            start, end = ((at + sign * half).round().astype(int).tolist() for sign in (-1, 1))
            cv2.line(layer, start, end, float(light), max(1, round(width / ROW_PX)), cv2.LINE_AA)
        return np.asarray(np.rint(image + layer[..., None]).clip(0, 255), np.uint8)

    return change


def _marker_loss(level: float, random: np.random.Generator) -> Change:
    """Markers that have come off, followed as the gel moves; level: per cent of them."""
    tracker: MarkerTracker | None = None
    lost = np.zeros(0, bool)

    def change(image: Rgb) -> Rgb:
        nonlocal tracker, lost
        if tracker is None:
            tracker = MarkerTracker(image)
            lost = random.random(len(tracker)) < level / 100
        if not lost.any():
            return image
        where = np.zeros(image.shape[:2], np.float32)
        for x, y in tracker.track(image).moved[lost]:
            cv2.circle(where, (round(float(x)), round(float(y))),
                       round(_LOST * tracker.diameter_px), 1.0, -1)  # fmt: skip
        return fade(image, 1.0, where)

    return change


def _each(
    make: Callable[[float, np.random.Generator], Change],
) -> Callable[[Iterable[Frame], float, np.random.Generator], Iterator[Frame]]:
    """Return a fault that changes each different image of each camera, coded again as JPEG."""

    def fault(
        frames: Iterable[Frame], level: float, random: np.random.Generator
    ) -> Iterator[Frame]:
        changes: dict[int, Change] = {}
        last: dict[int, tuple[bytes, bytes]] = {}
        seed = int(random.integers(2**31))
        for frame in frames:
            if frame.camera not in changes:
                own = np.random.default_rng([seed, frame.camera])
                changes[frame.camera] = make(level, own)
            if frame.camera not in last or last[frame.camera][0] != frame.jpeg:
                image = changes[frame.camera](decode_jpeg(frame.jpeg, None))
                last[frame.camera] = frame.jpeg, encode_jpeg(image)
            yield replace(frame, jpeg=last[frame.camera][1])

    return fault


def _quality(frames: Iterable[Frame], level: float, random: np.random.Generator) -> Iterator[Frame]:
    """JPEG coded harder; level: quality, 0…100."""
    last: dict[int, tuple[bytes, bytes]] = {}
    for frame in frames:
        if frame.camera not in last or last[frame.camera][0] != frame.jpeg:
            coded = encode_jpeg(decode_jpeg(frame.jpeg, None), round(level))
            last[frame.camera] = frame.jpeg, coded
        yield replace(frame, jpeg=last[frame.camera][1])


def _exposure_step(
    frames: Iterable[Frame], level: float, random: np.random.Generator
) -> Iterator[Frame]:
    """All cameras' exposure jumps once while the object is held; level: stops."""
    after_s = random.uniform(*STEP_S)
    start_s: float | None = None
    coded: dict[int, tuple[bytes, bool, bytes]] = {}
    for frame in frames:
        start_s = frame.fitted_s if start_s is None else start_s
        late = frame.fitted_s - start_s >= after_s
        if frame.camera not in coded or coded[frame.camera][:2] != (frame.jpeg, late):
            image = decode_jpeg(frame.jpeg, None)
            shown = encode_jpeg(exposure(image, level) if late else image)
            coded[frame.camera] = frame.jpeg, late, shown
        yield replace(frame, jpeg=coded[frame.camera][2])


def _frame_rate(
    frames: Iterable[Frame], level: float, random: np.random.Generator
) -> Iterator[Frame]:
    """Cameras that take fewer images and repeat each for longer; level: images a second, at most.

    An image is repeated for a whole number of frames: of 25 a second, a level of 15 shows 12.5.
    """
    shown: dict[int, tuple[float, Frame]] = {}
    for frame in frames:
        before = shown.get(frame.camera)
        if before is None or frame.fitted_s - before[0] >= 1.0 / level - 1e-6:
            shown[frame.camera] = frame.fitted_s, frame
        kept = shown[frame.camera][1]
        yield replace(frame, jpeg=kept.jpeg, counter=kept.counter)


def _frame_loss(
    frames: Iterable[Frame], level: float, random: np.random.Generator
) -> Iterator[Frame]:
    """Frames that never arrive; level: per cent of all, each camera on its own."""
    return (frame for frame in frames if random.random() >= level / 100)


IMAGE_FAULTS: Mapping[str, ImageFault] = {
    "bright": ImageFault(
        "more light, or a higher gain", "stops", (0.25, 0.5, 1.0), (0, 4), _each(_plain(exposure))
    ),
    "dark": ImageFault(
        "less light",
        "stops",
        (0.5, 1.0, 2.0),
        (0, 8),
        _each(_plain(lambda image, stops: exposure(image, -stops))),
    ),
    "exposure-step": ImageFault(
        "exposure that jumps during the grasp", "stops", (0.1, 0.25, 0.5), (-4, 4), _exposure_step
    ),
    "scratches": ImageFault(
        "scratches on the gel", "scratches", (5, 20, 60), (0, 1000), _each(_scratches)
    ),
    "fading": ImageFault(
        "markers that have lost ink",
        "% of the ink",
        (25, 50, 75),
        (0, 100),
        _each(_plain(lambda image, per_cent: fade(image, per_cent / 100))),
    ),
    "marker-loss": ImageFault(
        "markers that have come off",
        "% of the markers",
        (10, 30, 60),
        (0, 100),
        _each(_marker_loss),
    ),
    "frame-rate": ImageFault(
        "fewer images a second", "images/s", (15, 10, 5), (0.5, 240), _frame_rate
    ),
    "frame-loss": ImageFault("frames lost", "%", (5, 20, 40), (0, 99), _frame_loss),
    "blur": ImageFault("out of focus", "px", (1, 2, 4), (0, 50), _each(_plain(blur))),
    "image-noise": ImageFault(
        "noise of each pixel", "grey levels", (3, 10, 20), (0, 128), _each(_noise)
    ),
    "jpeg": ImageFault("JPEG coded harder", "quality", (50, 25, 10), (1, 100), _quality),
}
"""Name → fault."""


def find_image_fault(name: str) -> ImageFault:
    """Return a fault by name.

    Raises:
        BadInput: There is none of this name.
    """
    return find_fault(IMAGE_FAULTS, name)
