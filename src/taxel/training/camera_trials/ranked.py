"""Columns turned into their rank among training rows, spread as a normal distribution.

Piecewise linear between quantiles, as plain arithmetic that can stand in an ONNX model. Knows
nothing about what columns mean.

Background of our choices: docs/decisions/0041.
"""

from __future__ import annotations

from dataclasses import dataclass
from statistics import NormalDist
from typing import Final

import numpy as np
from numpy.typing import NDArray

Rows = NDArray[np.float32]
KNOTS: Final = 33
"""Quantiles of each column. Source: our choice, docs/decisions/0041."""
_END: Final = 1e-4
"""Share at which the normal distribution is cut: ranks lie within 3.7 standard deviations. Source:
docs/decisions/0041."""


@dataclass(frozen=True, slots=True)
class Ranked:
    """Quantiles of training rows."""

    starts: NDArray[np.float32]
    """Shape (knots - 1, columns): where each piece begins."""
    widths: NDArray[np.float32]
    """Shape (knots - 1, columns), above 0."""
    rises: NDArray[np.float32]
    """Shape (knots - 1, 1): by how much each piece rises."""
    lowest: float

    @staticmethod
    def of(rows: Rows) -> Ranked:
        """Return the quantiles of rows, shape (n, columns)."""
        shares = np.linspace(0, 1, KNOTS)
        knots = np.quantile(rows.astype(np.float64), shares, axis=0)
        normal = NormalDist()
        heights = np.array([normal.inv_cdf(min(max(s, _END), 1 - _END)) for s in shares])
        size = np.maximum(np.abs(knots).max(axis=0), 1.0)
        widths = np.maximum(np.diff(knots, axis=0), 1e-6 * size)
        return Ranked(
            knots[:-1].astype(np.float32),
            widths.astype(np.float32),
            np.diff(heights)[:, None].astype(np.float32),
            float(heights[0]),
        )

    def apply(self, rows: Rows) -> Rows:
        """Return ranks, shape as the rows'."""
        ranks = np.full(rows.shape, self.lowest, np.float32)
        for start, width, rise in zip(self.starts, self.widths, self.rises, strict=True):
            ranks += ((rows - start) / width).clip(0, 1) * rise  # a piece at a time: memory
        return ranks
