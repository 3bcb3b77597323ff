"""Scale window values for a network; fitted inside the training fold, stored in the bundle.

Knows nothing about models or files.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from numpy.typing import NDArray

ScalingKind = Literal["full-scale", "standard", "none"]
"""full-scale: divide by the sensor's largest value, as the thesis does (section 3.6.1);
standard: each channel to mean 0 and deviation 1 over the training windows; none: as measured."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Scaling:
    """value → (value − offset) × factor, a channel at a time."""

    kind: ScalingKind
    offset: NDArray[np.float32]
    """Shape (channels,), in the channels' units."""
    factor: NDArray[np.float32]
    """Shape (channels,), one over the channels' units."""

    def apply(self, values: NDArray[np.float32], mask: NDArray[np.bool_]) -> NDArray[np.float32]:
        """Return scaled values, shape (n, steps, channels) float32; padding stays 0.

        Args:
            values: Shape (n, steps, channels).
            mask: Shape (n, steps), False where a row is padding.
        """
        scaled: NDArray[np.float32] = (values - self.offset) * self.factor
        if not mask.all():
            scaled *= mask[:, :, None]
        return scaled

    def at_level(self, old: NDArray[np.float32], new: NDArray[np.float32]) -> Scaling:
        """Return the scaling that gives of values at a new level what this one gives of the old.

        Args:
            old: The level that this scaling holds for, shape (channels,).
            new: The level of what will be scaled, shape (channels,).
        """
        change = (new / old).astype(np.float32)
        return replace(self, offset=self.offset * change, factor=self.factor / change)


def fit_scaling(
    kind: ScalingKind,
    values: NDArray[np.float32],
    mask: NDArray[np.bool_],
    full_scale: float | None,
) -> Scaling:
    """Return a scaling fitted on training windows only.

    Args:
        kind: See `ScalingKind`.
        values: Training windows, shape (n, steps, channels).
        mask: Shape (n, steps), False where a row is padding.
        full_scale: The sensor's largest value; needed for "full-scale".

    Raises:
        ValueError: "full-scale" without a full scale.
    """
    channels = values.shape[2]
    offset = np.zeros(channels, np.float32)
    factor = np.ones(channels, np.float32)
    if kind == "full-scale":
        if full_scale is None:
            raise ValueError("needed the sensor's full scale for this scaling; got none")
        factor /= np.float32(full_scale)
    elif kind == "standard":
        rows = values[mask].astype(np.float64)
        offset = rows.mean(axis=0).astype(np.float32)
        deviation = rows.std(axis=0)
        factor = (1.0 / np.where(deviation > 0, deviation, 1.0)).astype(np.float32)
    return Scaling(kind=kind, offset=offset, factor=factor)
