"""When a grasp begins, by the images alone: open, touched, held.

Gels that nothing touches are the reference. A grasp is held once every camera's image differs
from that by more than a brush does, and has stood still for a moment; it is over once one of
them looks untouched again. Causal: the same class runs live and over recordings. Knows nothing
about files, screens, forces or models.

It must begin with untouched gels. Source: our choice, docs/decisions/0045.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from enum import StrEnum

import numpy as np
from numpy.typing import NDArray

from taxel.errors import BadInput
from taxel.labels.change import normalised_blocks

Rgb = NDArray[np.uint8]
Small = NDArray[np.float32]


class Hold(StrEnum):
    """How far a grasp is, as far as images show."""

    OPEN = "open"
    TOUCHED = "touched"
    HELD = "held"


@dataclass(frozen=True, slots=True, kw_only=True)
class GraspStartConfig:
    """When a grasp counts as held. Source: our choice on training cups, docs/decisions/0045."""

    touch: float = 3.0
    """Change against the untouched gel, per cent of the brightness, that a touch exceeds: a brush
    of up to 1 N gives 1.6 at most, a grasp of 15 N 6.6 at least."""
    clear_share: float = 0.5
    """A touch is over below this share of it, 0…1."""
    still_s: float = 0.16
    """How long images must stand still, seconds: four images of 25 a second."""
    least_still: float = 0.8
    """Change within that time that is still none, per cent; or twice the noise of two images."""
    rest_images: int = 5
    """Images of each camera at the beginning whose median is the untouched gel."""
    follow_s: float = 5.0
    """Time constant in which the untouched reference follows drift, seconds."""
    block_px: int = 8
    """Images are averaged over blocks of this many pixels squared."""

    def __post_init__(self) -> None:
        if not (self.touch > 0 and self.still_s > 0 and self.rest_images >= 3):
            raise BadInput(
                "a touch and a time above 0 and at least 3 images at rest",
                f"{self.touch}, {self.still_s} and {self.rest_images}",
                "mend them",
            )


class _Gel:
    """What one camera has shown."""

    def __init__(self, config: GraspStartConfig) -> None:
        self._config = config
        self._first: list[Small] = []
        self._reference: Small | None = None
        self._last: tuple[float, Small] | None = None
        self._lately: deque[tuple[float, Small]] = deque()
        self._noise = 0.0
        self.change = 0.0
        """Against the untouched gel, per cent."""

    @property
    def known(self) -> bool:
        """True once the untouched gel is."""
        return self._reference is not None

    def see(self, rgb: Rgb, time_s: float, is_open: bool) -> None:
        """Take in a new image."""
        config, small = self._config, normalised_blocks(rgb, self._config.block_px)
        since_s = 0.0 if self._last is None else time_s - self._last[0]
        if since_s < 0.0:  # a clock was set back: nothing is known of how long ago images came
            since_s = 0.0
            self._lately.clear()
        noise = 0.0 if self._last is None else _difference(small, self._last[1])
        self._last = (time_s, small)
        self._lately.append((time_s, small))
        while len(self._lately) > 1 and self._lately[1][0] <= time_s - config.still_s + 1e-9:
            self._lately.popleft()
        if self._reference is None:
            self._first.append(small)
            if len(self._first) == config.rest_images:
                self._reference = np.median(np.stack(self._first), axis=0).astype(np.float32)
                pairs = zip(self._first[1:], self._first[:-1], strict=True)
                self._noise = float(np.median([_difference(*pair) for pair in pairs]))
                self._first = []
            return
        self.change = _difference(small, self._reference)
        if is_open and self.change < config.touch * config.clear_share:
            share = np.float32(-np.expm1(-since_s / config.follow_s))
            self._reference += share * (small - self._reference)
            self._noise += float(share) * (noise - self._noise)

    def still(self, now_s: float) -> bool:
        """Return whether its images of the last moments differ by no more than noise."""
        config = self._config
        if len(self._lately) < 3 or now_s - self._lately[-1][0] > config.still_s:
            return False  # a camera that gives nothing new says nothing
        newest = self._lately[-1]
        if newest[0] - self._lately[0][0] < config.still_s - 1e-9:
            return False
        most = max(config.least_still, 2.0 * self._noise)
        return all(_difference(newest[1], small) <= most for _, small in self._lately)


class GraspFinder:
    """Follows the images of all cameras that hold one object.

    Args:
        cameras: How many.
        config: When a grasp counts as held.
    """

    def __init__(self, cameras: int, config: GraspStartConfig | None = None) -> None:
        self._config = config or GraspStartConfig()
        self._gels = tuple(_Gel(self._config) for _ in range(cameras))
        self._shown: list[Rgb | None] = [None] * cameras
        self._given = False
        self.state = Hold.OPEN
        """After the last images."""

    def push(self, images: Sequence[Rgb], time_s: float) -> Hold:
        """Take in what each camera shows now; return how far the grasp is.

        Args:
            images: One a camera, shape (height, width, 3); the very same object again is no new
                image.
            time_s: When the newest was taken, seconds; where it falls, a clock was set back.

        Raises:
            BadInput: An image is not RGB.
        """
        for camera, (gel, image) in enumerate(zip(self._gels, images, strict=True)):
            if image is not self._shown[camera]:
                gel.see(image, time_s, self.state is Hold.OPEN)
                self._shown[camera] = image
        if not self._given and all(gel.known for gel in self._gels):
            self.state = self._next(time_s)
        return self.state

    def hold(self) -> None:
        """Hear from somebody that a grasp is made; without an untouched gel to compare with, for
        as long as this is used.
        """
        self.state, self._given = Hold.HELD, not all(gel.known for gel in self._gels)

    def _next(self, time_s: float) -> Hold:
        touch = self._config.touch
        changes = [gel.change for gel in self._gels]
        if min(changes) < touch * self._config.clear_share:
            return Hold.OPEN if max(changes) < touch else Hold.TOUCHED
        if self.state is Hold.HELD:
            return Hold.HELD
        if min(changes) > touch and all(gel.still(time_s) for gel in self._gels):
            return Hold.HELD
        return Hold.TOUCHED


def find_starts(
    shown: Iterable[tuple[Sequence[Rgb], float]],
    cameras: int,
    config: GraspStartConfig | None = None,
) -> Iterator[tuple[float, float | None]]:
    """Yield each grasp of a recording: when it begins and when it is over (None: never), seconds.

    Args:
        shown: Images of all cameras and when they were taken, oldest first; the very same object
            again is no new image.
        cameras: How many there are.
        config: When a grasp counts as held.
    """
    finder = GraspFinder(cameras, config)
    began_s: float | None = None
    for images, time_s in shown:
        state = finder.push(images, time_s)
        if began_s is None and state is Hold.HELD:
            began_s = time_s
        elif began_s is not None and state is not Hold.HELD:
            yield began_s, time_s
            began_s = None
    if began_s is not None:
        yield began_s, None


def _difference(small: Small, other: Small) -> float:
    return float(np.abs(small - other).mean(dtype=np.float64))
