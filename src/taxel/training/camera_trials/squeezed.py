"""Columns of very different sizes made alike: signed logarithm, standardised, cut.

Plain arithmetic, so that it can stand in an ONNX model. Knows nothing about what columns mean.

Background of our choices: docs/decisions/0041.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

Rows = NDArray[np.float32]
REACH: Final = 4.0
"""Standard deviations at which a column is cut. Source: our choice, docs/decisions/0041."""


@dataclass(frozen=True, slots=True)
class Squeezed:
    """How columns are made alike, fitted on training rows."""

    size: NDArray[np.float32]
    """Shape (columns,): each column's usual size."""
    mean: NDArray[np.float32]
    scale: NDArray[np.float32]

    @staticmethod
    def of(rows: Rows) -> Squeezed:
        """Return what makes these rows alike."""
        size = np.maximum(np.median(np.abs(rows), axis=0), 1e-6).astype(np.float32)
        logs = _signed_log(rows, size)
        deviation = logs.std(axis=0)
        scale = np.where(deviation > 1e-6, 1 / np.maximum(deviation, 1e-6), 0.0)
        return Squeezed(size, logs.mean(axis=0), scale.astype(np.float32))

    def apply(self, rows: Rows) -> Rows:
        """Return the rows, made alike."""
        alike = (_signed_log(rows, self.size) - self.mean) * self.scale
        return np.asarray(alike.clip(-REACH, REACH), np.float32)


def _signed_log(rows: Rows, size: NDArray[np.float32]) -> Rows:
    return np.asarray(np.sign(rows) * np.log1p(np.abs(rows) / size), np.float32)
