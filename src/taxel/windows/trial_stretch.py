"""The part of a camera trial in which something moves: its crops are taken from there.

Recordings begin before the touch and end after it, for as long as whoever recorded them liked. What
lies before and behind shows nothing of what was touched, and how much of it there is differs from
trial to trial. Labels are not looked at. Knows nothing about crops, models or files.

Background of our choices: docs/decisions/0041.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterable, Sequence
from typing import Final

import cv2
import numpy as np
from numpy.typing import ArrayLike, NDArray

from taxel.windows.trial_crops import small_grey
from taxel.windows.trial_layout import Layout

Image = NDArray[np.uint8]
VERSION: Final = "changes-3"
"""Of what `Changes` measures and of how a part is found by it, for names in a cache."""
SMOOTHED: Final = 5
"""Steps of the running mean of changes. Source: our choice, docs/decisions/0041."""
AT_REST: Final = 0.25
"""Quantile of the changes that counts as noise: a trial in which something moves for more than
three quarters of its time loses little by it. Source: our choice, docs/decisions/0041."""
OUTSIDE: Final = 0.03
"""Share of all change before the part, and behind it. Source: our choice, docs/decisions/0041."""
ALIKE: Final = 0.5
"""Of the largest difference to the first image: below it, the last images look as the first did.
Source: our choice, docs/decisions/0041."""
SETTLED: Final = 3
"""Steps at a trial's start that are not looked at: a camera's first images may be black or of
another exposure. Source: our choice, docs/decisions/0041."""
_LAST: Final = 3
"""Images at a trial's end whose median is compared with the first."""


class Changes:
    """How much each moment's images differ from those of moments before, and from the first.

    Args:
        step: How many frames before.
    """

    def __init__(self, step: int = 1) -> None:
        self.values: list[tuple[float, float, float]] = []
        """A moment each: mean absolute grey differences, summed over the cameras, to the moment
        `step` frames before, to that of twice as many, and to the first that counts, the one
        behind `SETTLED` steps; 0 where there is none."""
        self._step = step
        self._before: deque[list[Image]] = deque(maxlen=2 * step)
        self._first: list[Image] = []

    def push(self, images: Sequence[Image]) -> None:
        """Take in the next moment.

        Args:
            images: One a camera, shape (height, width, 3), red first.
        """
        greys = [small_grey(image) for image in images]
        held, step = self._before, self._step
        if len(self.values) == SETTLED * step:
            self._first = greys
        others = (
            held[-step] if len(held) >= step else greys,
            held[0] if len(held) == 2 * step else greys,
            self._first or greys,
        )
        near, far, first = (_difference(greys, other) for other in others)
        self.values.append((near, far, first))
        held.append(greys)


def changes_of(
    moments: Iterable[Sequence[Image]], step: int = 1
) -> list[tuple[float, float, float]]:
    """Return the changes of a whole trial, as `Changes` measures them.

    Args:
        moments: The images of all cameras, a moment after another.
        step: Frames between the two that are compared.
    """
    found = Changes(step)
    for images in moments:
        found.push(images)
    return found.values


def part_of(layout: Layout, frames: int, changes: Callable[[], ArrayLike]) -> range:
    """Return the frames of a trial that its crops are taken from.

    Args:
        layout: How trials are cut.
        frames: The trial's.
        changes: As `Changes` measures them, shape (frames, 3); not asked for where all frames
            count.
    """
    if not layout.moving or layout.places == 1:
        return range(frames)
    return moving_part(changes(), layout.span, layout.step)


def moving_part(changes: ArrayLike, least: int, step: int = 1) -> range:
    """Return the frames between which all but a little of the change lies.

    Where the last images look as the first did, the touch has come and gone, and what lies before
    and behind it is left out. Else either end may show what was touched: of both, `least` frames
    are kept.

    Args:
        changes: Shape (frames, 3): as `Changes` measures them.
        least: Frames that the part has at least; a shorter one grows on both sides.
        step: Of `Changes`.

    Returns:
        Numbers of frames; all of them where nothing changes.
    """
    found = np.array(changes, np.float32).astype(np.float64)  # as a cache keeps them
    if len(found) <= max(least, (SETTLED + 1) * step):
        return range(len(found))
    steps, since = _without_flashes(found, step), found[SETTLED * step + 1 :, 2]
    steps[: SETTLED * step] = steps[SETTLED * step]
    ends = SMOOTHED * step // 2
    smooth = np.convolve(np.pad(steps, ends, "edge"), np.full(2 * ends + 1, 1.0), "valid")
    passed = np.cumsum(np.maximum(smooth - np.quantile(smooth, AT_REST), 0.0))
    if passed[-1] <= 0.0:
        return range(len(found))
    first, last = np.searchsorted(passed / passed[-1], (OUTSIDE, 1.0 - OUTSIDE)).tolist()
    beside = 0 if _ends_as_it_began(since) else least
    beside = max(beside, -(-(least - (last + 1 - first)) // 2))
    start = min(max(0, first - beside), len(found) - least)
    return range(start, min(len(found), max(last + 1 + beside, start + least)))


def _without_flashes(changes: NDArray[np.float64], step: int) -> NDArray[np.float64]:
    """Return the changes from step to step, shape (frames,), of which images that differ from both
    neighbours are no part: a flash, or a frame that was lost on its way.
    """
    near, far = changes[:, 0], changes[:, 1]
    behind = np.concatenate([far[step:], np.full(step, np.inf)])
    found = np.minimum(near, np.minimum(far, behind))
    found[-step:] = found[-step - 1]  # nobody knows what would have followed
    return np.asarray(found, np.float64)


def _ends_as_it_began(since: NDArray[np.float64]) -> bool:
    """Return whether the last images differ little from the first, of which noise is no part.

    Args:
        since: Differences to the first image, of all that follow it.
    """
    noise = since.min()
    return bool(np.median(since[-_LAST:]) - noise < ALIKE * (since.max() - noise))


def _difference(images: Sequence[Image], others: Sequence[Image]) -> float:
    pairs = zip(images, others, strict=True)
    return float(sum(cv2.absdiff(new, old).mean() for new, old in pairs))
