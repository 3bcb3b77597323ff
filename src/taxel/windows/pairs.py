"""Frames of several cameras joined into sets: one moment, one frame a camera.

The same code offline and live. Knows nothing about pixels, features or labels.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass

from taxel.signals import Frame

LARGEST_SKEW_S = 0.050
"""Frames further apart never make a set, seconds: three frames at 60 Hz, more than one at
25 Hz. Source: our choice, docs/decisions/0012."""
_ROUNDED_S = 1e-6
"""By which times of a mark and of a frame may differ, seconds: recordings round both."""


@dataclass(frozen=True, slots=True)
class FrameSet:
    """One frame of each camera, taken at about the same moment."""

    frames: tuple[Frame, ...]
    """In the order of the source's cameras."""

    @property
    def time_s(self) -> float:
        """When the latest of the frames was taken, fitted clock, seconds."""
        return max(frame.fitted_s for frame in self.frames)


def within(time_s: float, start_s: float, end_s: float) -> bool:
    """Return whether a moment belongs to a labelled stretch; all in seconds, one clock."""
    return start_s - _ROUNDED_S <= time_s <= end_s + _ROUNDED_S


class FramePairer:
    """Join frames as they come: each is used at most once, and the newest wins.

    A set is complete when each camera has delivered a frame since the last set and
    they lie within `skew_s` of each other; of a camera that is ahead, older frames
    are let go.

    Args:
        cameras: How many cameras there are.
        skew_s: Largest time between the frames of a set, seconds.
    """

    def __init__(self, cameras: int, skew_s: float = LARGEST_SKEW_S) -> None:
        self._waiting: list[Frame | None] = [None] * cameras
        self._skew_s = skew_s
        self.dropped = 0
        """Frames that found no partner so far."""

    def push(self, frame: Frame) -> FrameSet | None:
        """Take in a frame; return the set that it completes, if it does."""
        if self._waiting[frame.camera] is not None:
            self.dropped += 1
        self._waiting[frame.camera] = frame
        frames = tuple(frame for frame in self._waiting if frame is not None)
        if len(frames) < len(self._waiting):
            return None
        newest_s = max(frame.fitted_s for frame in frames)
        for camera, current in enumerate(frames):
            if newest_s - current.fitted_s > self._skew_s:
                self._waiting[camera] = None
                self.dropped += 1
        if any(frame is None for frame in self._waiting):
            return None
        self._waiting = [None] * len(frames)
        return FrameSet(frames)


def join_frames(
    frames: Iterable[Frame], cameras: int, skew_s: float = LARGEST_SKEW_S
) -> Iterator[FrameSet]:
    """Yield the sets of a whole recording.

    Args:
        frames: Oldest first, cameras mixed.
        cameras: How many cameras there are.
        skew_s: Largest time between the frames of a set, seconds.
    """
    pairer = FramePairer(cameras, skew_s)
    for frame in frames:
        found = pairer.push(frame)
        if found is not None:
            yield found
