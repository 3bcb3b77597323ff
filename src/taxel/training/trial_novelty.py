"""How unlike the trials it learned from a trial is: distance to the nearest crops learned.

Distances are taken along the main directions of the learned crops, each scaled to its spread. The
threshold comes from groups held out, so that objects never seen are turned away at the stated
rate only. Knows nothing about classes or images.

Background of our choices: docs/decisions/0041.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import ceil, inf
from typing import Final

import numpy as np
from numpy.typing import NDArray

from taxel.training.squeezed import Rows, Squeezed

REJECTED: Final = 0.05
"""Share of known trials that may be called unknown. Source: our choice, docs/decisions/0041."""
DIRECTIONS: Final = 12
NEAREST: Final = 5
"""Source of both: our choice, docs/decisions/0041."""


@dataclass(frozen=True, slots=True)
class Novelty:
    """Learned crops in their main directions."""

    squeezed: Squeezed
    directions: NDArray[np.float32]
    """Shape (columns, directions), scaled so that learned crops spread by 1 along each."""
    learned: NDArray[np.float32]
    """Shape (crops, directions)."""

    @staticmethod
    def of(rows: Rows) -> Novelty:
        """Return what is learned from crops, shape (n, columns)."""
        squeezed = Squeezed.of(rows)
        alike = squeezed.apply(rows).astype(np.float64)
        _, spread, axes = np.linalg.svd(alike, full_matrices=False)
        count = min(DIRECTIONS, len(rows) - 1, len(axes))
        scale = np.sqrt(len(rows)) / np.maximum(spread[:count], 1e-6)
        directions = (axes[:count].T * scale).astype(np.float32)
        return Novelty(squeezed, directions, (alike @ directions).astype(np.float32))

    @property
    def nearest(self) -> int:
        """Over how many learned crops the distance is taken."""
        return min(NEAREST, len(self.learned))

    def measure(self, rows: Rows) -> NDArray[np.float64]:
        """Return the mean distance to the nearest learned crops, shape (n,)."""
        at = self.squeezed.apply(rows).astype(np.float64) @ self.directions
        far = ((at[:, None] - self.learned[None]) ** 2).sum(axis=2)
        return np.asarray(np.sqrt(np.sort(far, axis=1)[:, : self.nearest]).mean(axis=1))


def held_out_novelty(own: Rows, other: Rows, trial: NDArray[np.intp]) -> NDArray[np.float64]:
    """Return the mean novelty of other trials, shape (trials,), to one that learned `own`."""
    novel = Novelty.of(own).measure(other)
    return np.asarray(np.bincount(trial, weights=novel) / np.bincount(trial), np.float64)


def novelty_threshold(held: NDArray[np.float64], rejected: float = REJECTED) -> float:
    """Return what a share of trials held out exceeds; infinite where they are too few.

    Source: split conformal prediction, Vovk et al. 2005: the ⌈(n + 1)(1 - share)⌉-th smallest.
    """
    rank = ceil((len(held) + 1) * (1 - rejected))
    return float(np.sort(held)[rank - 1]) if 1 <= rank <= len(held) else inf
