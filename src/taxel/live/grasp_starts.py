"""Moments of a stream that belong to a grasp: those since it was found to stand still.

Adds no maths of its own. Knows nothing about models or decisions.
"""

from __future__ import annotations

from collections import deque

import numpy as np
from numpy.typing import NDArray

from taxel.labels.grasp_start import GraspFinder, GraspStartConfig, Hold
from taxel.windows.pairs import FrameSet

Moment = tuple[tuple[NDArray[np.uint8], ...], list[int], FrameSet]
"""Images, one a camera; which cameras show a new one; the frames."""


class GraspStarts:
    """Lets the moments of a grasp through, and holds back what comes before.

    Args:
        cameras: How many.
        config: When a grasp counts as held.
    """

    def __init__(self, cameras: int, config: GraspStartConfig | None = None) -> None:
        self._config = config or GraspStartConfig()
        self._finder = GraspFinder(cameras, self._config)
        self._lately: deque[Moment] = deque()
        self._held = False

    def hold(self) -> None:
        """Hear from somebody that the grasp is made: it is over once the gels are untouched."""
        self._held = True
        self._lately.clear()
        self._finder.hold()

    def take(
        self, images: tuple[NDArray[np.uint8], ...], fresh: list[int], found: FrameSet
    ) -> tuple[list[Moment], bool]:
        """Take in a moment; return those that may be looked at now, and whether a grasp begins.

        At its beginning the moments in which the images stood still come at once.
        """
        held = self._finder.push(images, found.time_s) is Hold.HELD
        began, self._held = held and not self._held, held
        if held and not began:
            return [(images, fresh, found)], False
        self._lately.append((images, fresh, found))
        # One from ahead of now was taken before a clock was set back.
        while not -1e-9 <= found.time_s - self._lately[0][2].time_s <= self._config.still_s + 1e-9:
            self._lately.popleft()
        if not began:
            return [], False
        ready = list(self._lately)
        self._lately.clear()
        first, *rest = ready
        return [(first[0], list(range(len(images))), first[2]), *rest], True
