"""Measure how much each channel changes within the windows of training.

Knows nothing about networks, files or screens.

Background of our choices: docs/decisions/0010.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from taxel.decisions.still_channels import (
    NO_CHANGE,
    Motion,
    longest_alike,
    looked_at,
    loudest_of,
    ranges_of,
)
from taxel.windows.dataset import Dataset

_QUIETEST = 25.0
"""Percentile of the windows' motion from which on they count. Source: our choice,
docs/decisions/0010."""


def measure_motion(dataset: Dataset, target: str) -> Motion | None:
    """Return how much each channel changes, by the windows of a data set.

    Args:
        dataset: Windows to learn from, cut as they are live.
        target: The label whose classes are looked at each by itself.

    Returns:
        None where windows are single rows, or no columns of channels (layout A), or no channel
        changes in any.
    """
    if dataset.config.steps < 2 or dataset.config.layout == "A":
        return None
    kept = looked_at(dataset.windows, dataset.trial)
    windows, trial = dataset.windows[kept], dataset.trial[kept]
    if not len(windows):
        return None
    ranges = ranges_of(windows.values, windows.mask).astype(np.float64)
    usual = _usual(ranges)
    if not usual.any():
        return None
    moved = (ranges[:, usual > 0] / usual[usual > 0]).max(axis=1)
    least = float(np.percentile(moved[moved > NO_CHANGE], _QUIETEST))
    counted = moved >= least
    still = (ranges <= usual * NO_CHANGE)[counted]
    worst, again = _shares(still, dataset.class_numbers(target)[kept][counted], trial[counted])
    return Motion(
        windows=len(still),
        usual=usual,
        least=least,
        still=still.mean(axis=0),
        worst=worst,
        again=np.maximum(again, worst),
        longest=longest_alike(windows.values, windows.mask, usual),
        loudest=loudest_of(ranges, usual),
    )


def _usual(ranges: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the median of each channel's ranges above 0, shape (channels,); 0 without one."""
    return np.array([np.median(own[own > 0]) if (own > 0).any() else 0.0 for own in ranges.T])


def _shares(
    still: NDArray[np.bool_], classes: NDArray[np.intp], trial: NDArray[np.intp]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the largest share of a class without change, and without change once more."""
    follows = trial[1:] == trial[:-1]
    before, after = still[:-1] & follows[:, None], still[1:]
    worst, again = [], []
    for number in np.unique(classes):
        own = classes == number
        worst.append(_share(still[own].sum(axis=0), own.sum()))
        first = before & own[:-1, None]
        again.append(_share((first & after).sum(axis=0), first.sum(axis=0)))
    return np.max(worst, axis=0), np.max(again, axis=0)


def _share(found: NDArray[np.intp], of: NDArray[np.intp] | np.intp) -> NDArray[np.float64]:
    """Return the share `found` / `of` by Laplace's rule of succession, shape as `found`, 0…1."""
    return np.asarray((found + 1.0) / (of + 2.0))
