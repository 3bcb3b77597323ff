"""What a recogniser of camera trials answered while a trial ran, in numbers.

Knows nothing about models, images or screens.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True, slots=True, kw_only=True)
class TrialCourse:
    """The verdicts so far of one trial, one for each look at a crop."""

    time_s: NDArray[np.float64]
    """Since the trial's first image, seconds, shape (looks,), ascending."""
    labels: tuple[str, ...]
    """A class, or UNKNOWN for a touch unlike what was learned or a camera that failed."""
    probabilities: NDArray[np.float64]
    """Shape (looks, classes); NaN where there is no verdict."""
    length_s: float
    """Of the trial, seconds."""

    @property
    def confidences(self) -> NDArray[np.float64]:
        """Probability of the likeliest class, 0…1, shape (looks,)."""
        largest: NDArray[np.float64] = self.probabilities.max(axis=1, initial=0.0)
        return largest
