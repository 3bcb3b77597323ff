"""Fit how the windows of a trial are joined, out of fold. Knows nothing about models.

Source: docs/decisions/0039.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from taxel.decisions.joining import Joining
from taxel.training.choose.blending import LEAST, fit_sharpness, softmax

POWERS = (0.0, 0.25, 0.5, 0.75, 1.0)
"""Of `Joining`."""


def join(
    joining: Joining, unit: NDArray[np.intp], probabilities: NDArray[np.float64]
) -> tuple[NDArray[np.intp], NDArray[np.float64]]:
    """Return units' numbers (m,) and joined probabilities (m, classes).

    Args:
        joining: How.
        unit: Which windows belong together, shape (n,).
        probabilities: Shape (n, classes).
    """
    numbers, mean, count = _means(unit, probabilities)
    return numbers, joining.of_means(mean, count)


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
