"""Sliding windows of k frames over per-frame values: for whole videos and for live streams.

A window's label is the largest among its frames. Where times are given no window spans a gap in
time: grasp monitors give them, in training as live, so that no window joins frames from before and
after an outage. A ring is reset between recordings. Knows nothing about files, images, splits or
models.

Source: Zhao et al., Sensors 2024, 24, 5080, section 4.1.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray

from taxel.errors import BadInput

LARGEST_GAP_S = 0.2
"""Frames further apart never share a window, seconds: as long as the state of a grasp outlasts its
newest input (`StabilityConfig.largest_age_s`). Source: our choice, docs/decisions/0012."""
LARGEST_GAP_PERIODS = 3.0
"""Or so many periods of slower cameras, so that two images lost in a row leave no window out.
Source: as above."""
_ROUNDED_S = 1e-6
"""By which a time between frames may exceed the largest gap, seconds: recordings round both."""


def largest_gap_s(rate_hz: float) -> float:
    """Return how far apart two successive frames of one window may lie, seconds.

    Args:
        rate_hz: Frames a second that the cameras state; 0 where they state none.
    """
    return max(LARGEST_GAP_S, LARGEST_GAP_PERIODS / rate_hz if rate_hz > 0 else 0.0)


def window_starts(
    n: int,
    k: int,
    stride: int = 1,
    time_s: NDArray[np.float64] | None = None,
    largest_gap_s: float = float("inf"),
) -> NDArray[np.intp]:
    """Return the first frame of each window of one recording, oldest first, shape (m,).

    A recording shorter than k gives none.

    Args:
        n: Frames of the recording.
        k: Frames a window.
        stride: Frames from one window to the next.
        time_s: Shape (n,), seconds: windows over a gap, or over a step back in time, are left
            out. None: frames are taken to follow each other.
        largest_gap_s: Longest time between two frames of one window, seconds.

    Raises:
        BadInput: k or stride is below 1.
    """
    if k < 1 or stride < 1:
        raise BadInput("windows and strides of at least 1 frame", f"{k} and {stride}", "raise them")
    starts = np.arange(0, max(n - k + 1, 0), stride)
    if time_s is None or k == 1 or len(starts) == 0:
        return starts
    broken = np.concatenate([[0], np.cumsum(_broken(np.diff(time_s), largest_gap_s))])
    return np.asarray(starts[broken[starts + k - 1] == broken[starts]])


def whole_windows(
    n: int, k: int, time_s: NDArray[np.float64] | None, largest_gap_s: float
) -> NDArray[np.bool_]:
    """Return whether each window of one recording lies between two gaps, shape (n - k + 1,).

    Args:
        n: Frames of the recording.
        k: Frames a window.
        time_s: As for `window_starts`.
        largest_gap_s: As for `window_starts`.
    """
    whole = np.zeros(max(n - k + 1, 0), bool)
    whole[window_starts(n, k, 1, time_s, largest_gap_s)] = True
    return whole


def label_windows(labels: NDArray[np.int8], k: int) -> NDArray[np.int8]:
    """Return each window's label: the largest among its k frames, shape (n - k + 1,).

    Index the result with `window_starts` where a stride or gaps leave windows out.

    Args:
        labels: Shape (n,): 0 stable, 1 unstable.
        k: Frames a window.
    """
    if len(labels) < k:
        return np.zeros(0, np.int8)
    return np.asarray(sliding_window_view(labels, k).max(axis=1), np.int8)


def labels_ahead(
    labels: NDArray[np.int8],
    frames: int,
    time_s: NDArray[np.float64] | None = None,
    largest_gap_s: float = float("inf"),
) -> NDArray[np.int8]:
    """Return the largest of each frame's label and those of the next frames, shape (n,).

    Frames behind a gap are no next ones: they may come any time later.

    Args:
        labels: Shape (n,): 0 stable, 1 unstable.
        frames: How many next ones.
        time_s: As for `window_starts`.
        largest_gap_s: As for `window_starts`.
    """
    gaps: Sequence[int] = []
    if time_s is not None:
        gaps = (np.flatnonzero(_broken(np.diff(time_s), largest_gap_s)) + 1).tolist()
    padded = [
        np.concatenate([part, np.repeat(part[-1:], frames)]) for part in np.split(labels, gaps)
    ]
    return np.concatenate([label_windows(part, frames + 1) for part in padded])


def sequence_windows(
    features: NDArray[np.float32], k: int, starts: NDArray[np.intp] | None = None
) -> NDArray[np.float32]:
    """Return windows of features, oldest first, shape (m, k, sensors, features).

    Without `starts` it is a read-only view that takes no memory; with them a copy.

    Args:
        features: Shape (n, sensors, features), one recording.
        k: Frames a window.
        starts: First frame of each window wanted; all by default.
    """
    if len(features) < k:
        return np.zeros((0, k, *features.shape[1:]), features.dtype)
    view = np.moveaxis(sliding_window_view(features, k, axis=0), -1, 1)
    return view if starts is None else np.ascontiguousarray(view[starts])


class FeatureRing:
    """The last k frames' features, so that a new frame costs one backbone pass only.

    Each row is kept twice, k rows apart, so that the window is always one
    contiguous stretch and nothing is moved.

    Args:
        k: Frames a window.
        sensors: Cameras.
        features: Numbers a frame and camera.
        largest_gap_s: Longest time between two frames of one window, seconds.
    """

    def __init__(
        self, k: int, sensors: int, features: int, largest_gap_s: float = float("inf")
    ) -> None:
        if k < 1:
            raise BadInput("windows of at least 1 frame", f"{k}", "raise k")
        self._k = k
        self._gap_s = largest_gap_s
        self._rows = np.zeros((2 * k, sensors, features), np.float32)
        self._count = 0
        self._last_s: float | None = None

    def __len__(self) -> int:
        """Return how many frames of the next window are there, at most k."""
        return min(self._count, self._k)

    def reset(self) -> None:
        """Forget all frames: a new recording, a new grasp."""
        self._count, self._last_s = 0, None

    def push(
        self, features: NDArray[np.float32], time_s: float | None = None
    ) -> NDArray[np.float32] | None:
        """Take in a frame's features; return the window that ends with it, or None.

        The window is a view, shape (k, sensors, features), oldest first, that holds
        until the next push.

        Args:
            features: Shape (sensors, features).
            time_s: When the frames were taken, seconds; a gap or a step back resets the ring.

        Raises:
            BadInput: The features are of another shape.
        """
        if features.shape != self._rows.shape[1:]:
            raise BadInput(
                f"features of shape {self._rows.shape[1:]}",
                f"{features.shape}",
                "give those of all cameras, from the backbone the ring was made for",
            )
        if time_s is not None:
            if self._last_s is not None and _broken(time_s - self._last_s, self._gap_s):
                self._count = 0
            self._last_s = time_s
        place = self._count % self._k
        self._rows[place] = self._rows[place + self._k] = features
        self._count += 1
        return self._rows[place + 1 : place + 1 + self._k] if self._count >= self._k else None


def _broken(step_s: NDArray[np.float64] | float, largest_gap_s: float) -> NDArray[np.bool_]:
    """Return where frames do not follow each other: a gap, a step back, or a time of NaN."""
    return ~((np.asarray(step_s) >= 0) & (np.asarray(step_s) <= largest_gap_s + _ROUNDED_S))
