"""How unlike the trials it learned from a trial is: distance to the nearest crops learned.

Distances are taken along the main directions of the learned crops, each scaled to its spread. The
threshold comes from groups held out, so that objects never seen are turned away at the stated
rate only. Knows nothing about classes or images.

Background of our choices: docs/decisions/0041.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from math import ceil, inf
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import svd

from taxel.training.camera_trials.squeezed import Rows, Squeezed

REJECTED: Final = 0.05
"""Share of known trials that may be called unknown. Source: our choice, docs/decisions/0041."""
DIRECTIONS: Final = 12
NEAREST: Final = 5
"""Source of both: our choice, docs/decisions/0041."""
NARROWEST: Final = 1e-3
"""Share of the widest direction's spread below which crops hardly differ along one: scaled to 1,
rounding errors alone would be seen there. Source: our choice, docs/decisions/0041."""
UNSEEN: Final = ("picture", "miniature", "network")
"""Views that are not looked at: their many columns would outweigh all others. Source: our
choice, docs/decisions/0041."""


@dataclass(frozen=True, slots=True)
class Novelty:
    """Learned crops in their main directions."""

    columns: NDArray[np.intp]
    """Which columns of a crop are looked at, shape (seen,)."""
    squeezed: Squeezed
    directions: NDArray[np.float32]
    """Shape (seen, directions), scaled so that learned crops spread by 1 along each."""
    learned: NDArray[np.float32]
    """Shape (crops, directions)."""

    @staticmethod
    def of(rows: Rows, columns: NDArray[np.intp] | None = None) -> Novelty:
        """Return what is learned from crops, shape (n, all columns).

        Args:
            rows: The crops.
            columns: Which are looked at, shape (seen,); all unless given.
        """
        columns = np.arange(rows.shape[1]) if columns is None else columns
        squeezed = Squeezed.of(rows[:, columns])
        alike = squeezed.apply(rows[:, columns]).astype(np.float64)
        spread, axes = _main_axes(alike)
        wide = int((spread > NARROWEST * spread.max(initial=0.0)).sum())  # fewer of equal crops
        count = min(DIRECTIONS, len(rows) - 1, len(axes), max(1, wide))
        scale = np.sqrt(len(rows)) / np.maximum(spread[:count], 1e-6)
        directions = (axes[:count].T * scale).astype(np.float32)
        return Novelty(columns, squeezed, directions, (alike @ directions).astype(np.float32))

    @property
    def nearest(self) -> int:
        """Over how many learned crops the distance is taken."""
        return min(NEAREST, len(self.learned))

    def measure(self, rows: Rows) -> NDArray[np.float64]:
        """Return the mean distance to the nearest learned crops, shape (n,)."""
        at = self.squeezed.apply(rows[:, self.columns]).astype(np.float64) @ self.directions
        far = ((at[:, None] - self.learned[None]) ** 2).sum(axis=2)
        return np.asarray(np.sqrt(np.sort(far, axis=1)[:, : self.nearest]).mean(axis=1))


def _main_axes(rows: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return singular values and the axes that belong to them, largest first.

    LAPACK's quick way now and then does not converge where its older, slower one does.
    """
    try:
        _, spread, axes = np.linalg.svd(rows, full_matrices=False)
    except np.linalg.LinAlgError:
        _, spread, axes = svd(rows, full_matrices=False, lapack_driver="gesvd")
    return spread, axes


def novelty_columns(widths: Mapping[str, int]) -> NDArray[np.intp]:
    """Return which columns of a crop are looked at: those of all views but `UNSEEN`.

    Args:
        widths: View → numbers a crop, in the order in which they stand side by side.
    """
    seen = [np.full(width, view not in UNSEEN) for view, width in widths.items()]
    return np.flatnonzero(np.concatenate(seen))


def held_out_novelty(
    own: Rows, other: Rows, trial: NDArray[np.intp], columns: NDArray[np.intp]
) -> NDArray[np.float64]:
    """Return the mean novelty of other trials, shape (trials,), to one that learned `own`."""
    novel = Novelty.of(own, columns).measure(other)
    return np.asarray(np.bincount(trial, weights=novel) / np.bincount(trial), np.float64)


def novelty_threshold(held: NDArray[np.float64], rejected: float = REJECTED) -> float:
    """Return what a share of trials held out exceeds; infinite where they are too few.

    Source: split conformal prediction, Vovk et al. 2005: the ⌈(n + 1)(1 - share)⌉-th smallest.
    """
    rank = ceil((len(held) + 1) * (1 - rejected))
    return float(np.sort(held)[rank - 1]) if 1 <= rank <= len(held) else inf
