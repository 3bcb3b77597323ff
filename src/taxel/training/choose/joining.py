"""Join the probabilities of a trial's windows, with their dependence taken into account.

Windows of one trial err together, so that their likelihoods must not be multiplied as if they
were independent, nor averaged as if a second window told nothing. The mean of the logarithms is
raised by windows^power × strength, both fitted out of fold. Which class leads stays the same; how
sure it is does not. Knows nothing about models.

Source: docs/decisions/0039.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from taxel.training.choose.blending import LEAST, fit_sharpness, softmax

POWERS = (0.0, 0.25, 0.5, 0.75, 1.0)
"""0: windows tell the same; 1: they are independent."""


@dataclass(frozen=True, slots=True)
class Joining:
    """How a trial's windows are joined."""

    power: float = 0.0
    strength: float = 1.0

    def apply(
        self, unit: NDArray[np.intp], probabilities: NDArray[np.float64]
    ) -> tuple[NDArray[np.intp], NDArray[np.float64]]:
        """Return units' numbers (m,) and joined probabilities (m, classes).

        Args:
            unit: Which windows belong together, shape (n,).
            probabilities: Shape (n, classes).
        """
        numbers, mean, count = _means(unit, probabilities)
        return numbers, softmax(self.strength * count[:, None] ** self.power * mean)


def fit_joining(
    unit: NDArray[np.intp], probabilities: NDArray[np.float64], y: NDArray[np.intp]
) -> Joining:
    """Return the joining with the least loss on windows predicted out of fold.

    Args:
        unit: Which windows belong together, shape (n,).
        probabilities: Shape (n, classes).
        y: Shape (n,).
    """
    numbers, mean, count = _means(unit, probabilities)
    truth = unit_classes(unit, y, numbers)
    found = []
    for power in POWERS:
        logits = count[:, None] ** power * mean
        strength = fit_sharpness(logits, truth)
        own = softmax(strength * logits)[np.arange(len(truth)), truth]
        found.append((-np.log(np.maximum(own, LEAST)).mean(), power, strength))
    _, power, strength = min(found)
    return Joining(power, strength)


def unit_classes(
    unit: NDArray[np.intp], y: NDArray[np.intp], numbers: NDArray[np.intp]
) -> NDArray[np.intp]:
    """Return each unit's class, shape (m,)."""
    of = np.zeros(int(numbers.max()) + 1, np.intp)
    of[unit] = y
    return of[numbers]


def _means(
    unit: NDArray[np.intp], probabilities: NDArray[np.float64]
) -> tuple[NDArray[np.intp], NDArray[np.float64], NDArray[np.float64]]:
    """Return units' numbers, mean logarithms (m, classes) and counts of windows (m,)."""
    numbers, index, count = np.unique(unit, return_inverse=True, return_counts=True)
    mean = np.zeros((len(numbers), probabilities.shape[1]))
    np.add.at(mean, index, np.log(np.maximum(probabilities, LEAST)))
    return numbers, mean / count[:, None], count.astype(np.float64)
