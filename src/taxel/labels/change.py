"""The paper's rule: a frame is unstable when its image has changed since the grasp settled.

Two steps: how far each frame is from the settled first frames (`change_signal`, one number
a frame), and where that is more than noise (`label_change`). The paper compares with the
first frame; that frame may be an exposure transient, so we compare with the median of
several settled ones. Knows nothing about files, physics or models.

Source: Zhao et al., Sensors 2024, 24, 5080, section 3.2. The paper gives no threshold; ours
comes from the noise of the settled frames (our choice, docs/decisions/0013).
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from taxel.errors import BadInput
from taxel.plain_text import number_of

_MAD_TO_SIGMA = 1.4826
"""Median absolute deviation to standard deviation of a normal distribution."""
_LEAST_SETTLED = 3
"""Settled frames below which no median and no noise can be estimated."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ChangeConfig:
    """When a change of the image counts. Source: our choice, docs/decisions/0013."""

    settled_from_s: float = 0.15
    """Start of the settled stretch after the first frame, seconds: before it the camera's
    exposure may still move."""
    settled_to_s: float = 0.4
    """End of the settled stretch, seconds; no frame before it is called unstable. The
    simulated pour starts here at the earliest."""
    block_px: int = 8
    """Frames are averaged over blocks of this many pixels squared before they are compared."""
    sigmas: float = 6.0
    """Standard deviations of the settled signal that a change must exceed."""
    least_change: float = 1.5
    """Smallest change that counts whatever the noise, per cent of the image's brightness."""
    clear_share: float = 0.7
    """A change has gone again below this share of the threshold, 0…1 (hysteresis)."""
    debounce_s: float = 0.06
    """Shorter stretches of change, or of no change, are ignored, seconds."""

    def settled(self, rate_hz: float) -> slice:
        """Return which frames are the settled ones, at least three.

        Args:
            rate_hz: Frames a second.

        Raises:
            BadInput: The rate is not a positive number.
        """
        if not np.isfinite(rate_hz) or rate_hz <= 0:
            raise BadInput("a frame rate above 0 Hz", f"{rate_hz}", "give the camera's true rate")
        first = round(self.settled_from_s * rate_hz)
        return slice(first, max(round(self.settled_to_s * rate_hz), first + _LEAST_SETTLED))


class ChangeMeter:
    """The change signal of one camera, frame by frame, in constant memory.

    Until the settled stretch is complete it keeps small averaged copies of the
    frames and gives nothing; then it gives the values of all frames so far, and
    from there on one a frame.

    Args:
        settled: Which frames are the settled ones.
        block_px: Side of the averaged blocks, pixels.
    """

    def __init__(self, settled: slice, block_px: int = 8) -> None:
        self._settled = settled
        self._block_px = block_px
        self._early: list[NDArray[np.float32]] = []
        self._reference: NDArray[np.float32] | None = None
        self._shape: tuple[int, ...] | None = None

    @property
    def complete(self) -> bool:
        """True once the settled stretch has been seen."""
        return self._reference is not None

    def push(self, rgb: NDArray[np.uint8]) -> NDArray[np.float64]:
        """Take in the next frame; return the values that are now known, shape (0…n,).

        Values are mean absolute differences, per cent of the image's brightness.

        Args:
            rgb: Shape (height, width, 3), uint8.

        Raises:
            BadInput: The frame is not RGB, or not of the first frame's size.
        """
        small = self._small(rgb)
        if self._reference is not None:
            return np.array([_difference(small, self._reference)])
        self._early.append(small)
        if len(self._early) < self._settled.stop:
            return np.zeros(0)
        self._reference = np.median(np.stack(self._early[self._settled]), axis=0)
        values = [_difference(early, self._reference) for early in self._early]
        self._early = []
        return np.array(values)

    def _small(self, rgb: NDArray[np.uint8]) -> NDArray[np.float32]:
        if self._shape is None:
            self._shape = rgb.shape
        if rgb.ndim != 3 or rgb.shape[2] != 3:
            raise BadInput(
                "colour frames of shape (height, width, 3)",
                f"shape {rgb.shape}",
                "convert grey frames to RGB, or choose a camera that gives colour",
            )
        if rgb.shape != self._shape:
            raise BadInput(
                f"frames of one size, {self._shape[1]}×{self._shape[0]}",
                f"one of {rgb.shape[1]}×{rgb.shape[0]}",
                "cut the video where its size changes",
            )
        return normalised_blocks(rgb, self._block_px)


def change_signal(
    frames: Iterable[NDArray[np.uint8]], settled: slice, block_px: int = 8
) -> NDArray[np.float64]:
    """Return how far each frame is from the settled ones, shape (n,).

    Mean absolute difference of averaged, brightness-normalised frames to the
    median of the settled frames, per cent of the image's brightness. Frames are
    taken one at a time: memory does not grow with the video.

    Args:
        frames: RGB frames, uint8 (height, width, 3), oldest first.
        settled: Which frames are the settled ones, `ChangeConfig.settled(rate_hz)`.
        block_px: Side of the averaged blocks, pixels.

    Raises:
        BadInput: A frame is not RGB or of another size, or the video ends before
            the settled stretch does.
    """
    meter = ChangeMeter(settled, block_px)
    values = [meter.push(frame) for frame in frames]
    if not meter.complete:
        raise BadInput(
            f"a video of at least {number_of(settled.stop, 'frame')}",
            f"{len(values)}",
            "give a longer video or a shorter settled stretch",
        )
    return np.concatenate(values)


def thresholds(
    signal: NDArray[np.float64], rate_hz: float, config: ChangeConfig | None = None
) -> NDArray[np.float64]:
    """Return the change above which a frame is unstable, one value a camera.

    The settled stretch's median, plus the larger of `sigmas` robust standard
    deviations of that stretch and the least change.

    Args:
        signal: Shape (n,) or (n, cameras), per cent of the brightness.
        rate_hz: Frames a second.
        config: When a change counts.

    Raises:
        BadInput: The signal is shorter than the settled stretch, or not finite.
    """
    config = config or ChangeConfig()
    columns = _columns(signal)
    settled = config.settled(rate_hz)
    if len(columns) < settled.stop:
        raise BadInput(
            f"a signal of at least {number_of(settled.stop, 'frame')}",
            f"{len(columns)}",
            "give a longer video or a shorter settled stretch",
        )
    if not np.isfinite(columns).all():
        raise BadInput("a finite change signal", "NaN or infinity", "leave out broken frames")
    rest = columns[settled]
    middle = np.median(rest, axis=0)
    sigma = _MAD_TO_SIGMA * np.median(np.abs(rest - middle), axis=0)
    return np.asarray(middle + np.maximum(config.sigmas * sigma, config.least_change))


def excess_of(
    signal: NDArray[np.float64], rate_hz: float, config: ChangeConfig | None = None
) -> NDArray[np.float64]:
    """Return each camera's change over its threshold, shape (n, cameras): unstable above 1.

    Args:
        signal: Shape (n,) or (n, cameras), per cent of the brightness.
        rate_hz: Frames a second.
        config: When a change counts.

    Raises:
        BadInput: The signal is shorter than the settled stretch, or not finite.
    """
    return np.asarray(_columns(signal) / thresholds(signal, rate_hz, config))


def label_change(
    signal: NDArray[np.float64], rate_hz: float, config: ChangeConfig | None = None
) -> NDArray[np.int8]:
    """Return 1 for each frame whose image has changed, 0 for the others, shape (n,).

    Each camera is measured against its own threshold; the larger excess decides.

    Args:
        signal: Shape (n,), or (n, cameras), per cent of the brightness.
        rate_hz: Frames a second.
        config: When a change counts.

    Raises:
        BadInput: The signal is shorter than the settled stretch, or not finite.
    """
    config = config or ChangeConfig()
    excess = excess_of(signal, rate_hz, config).max(axis=1)
    above = _hysteresis(excess, 1.0, config.clear_share)
    above[: config.settled(rate_hz).stop] = False
    return debounced(above, round(config.debounce_s * rate_hz)).astype(np.int8)


def debounced(flags: NDArray[np.bool_], least: int) -> NDArray[np.bool_]:
    """Return the flags without stretches shorter than `least` frames.

    Short stretches of True go first, then short gaps between the remaining ones;
    what touches an end of the array as False stays.

    Args:
        flags: One a frame, shape (n,).
        least: Frames that a stretch must have.
    """
    kept = flags.copy()
    for start, stop in _runs(flags):
        if stop - start < least:
            kept[start:stop] = False
    for start, stop in _runs(~kept):
        if start > 0 and stop < len(kept) and stop - start < least:
            kept[start:stop] = True
    return kept


def normalised_blocks(rgb: NDArray[np.uint8], block_px: int) -> NDArray[np.float32]:
    """Return block means of a frame, per cent of each colour's median block.

    The median, as the larger part of a gel is not touched: a change of exposure or
    gain leaves the result as it was.

    Args:
        rgb: Shape (height, width, 3), uint8; rows and columns beyond whole blocks are left out.
        block_px: Side of a block, pixels.

    Returns:
        Shape (height // block_px, width // block_px, 3).

    Raises:
        BadInput: The frame is smaller than a block.
    """
    rows, columns = rgb.shape[0] // block_px, rgb.shape[1] // block_px
    if rows == 0 or columns == 0:
        raise BadInput(
            f"frames of at least {block_px}×{block_px} pixels",
            f"{rgb.shape[1]}×{rgb.shape[0]}",
            "choose smaller blocks",
        )
    whole = rgb[: rows * block_px, : columns * block_px]
    # Rows first: summing contiguous rows in integers is several times faster than a joint mean.
    tall = whole.reshape(rows, block_px, columns * block_px * 3).sum(axis=1, dtype=np.uint32)
    sums = tall.reshape(rows, columns, block_px, 3).sum(axis=2)
    means = sums.astype(np.float32) / np.float32(block_px * block_px)
    level = np.maximum(np.median(means.reshape(-1, 3), axis=0), 1.0)
    return np.asarray(means * (100.0 / level), np.float32)


def _difference(small: NDArray[np.float32], reference: NDArray[np.float32]) -> float:
    return float(np.abs(small - reference).mean(dtype=np.float64))


def _columns(signal: NDArray[np.float64]) -> NDArray[np.float64]:
    return signal[:, None] if signal.ndim == 1 else signal


def _hysteresis(values: NDArray[np.float64], high: float, clear_share: float) -> NDArray[np.bool_]:
    """Return True from a rise above `high` until a fall below its share, shape (n,)."""
    decided = np.where(values > high, 1, np.where(values < high * clear_share, 0, -1))
    last = np.maximum.accumulate(np.where(decided >= 0, np.arange(len(values)), -1))
    return np.asarray((last >= 0) & (decided[np.maximum(last, 0)] == 1))


def _runs(flags: NDArray[np.bool_]) -> Iterator[tuple[int, int]]:
    """Give start and stop of each stretch of True, in order."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], flags, [False]]).astype(np.int8)))
    return zip(edges[::2].tolist(), edges[1::2].tolist(), strict=True)
