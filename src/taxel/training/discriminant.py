"""A linear discriminant whose within-class covariance is shrunk towards an even one.

What varies within a class (drift, gain, place) hardly counts, so that it goes on better than
other sums where touch is unlike what was learned. Knows nothing about features or files.

Source: Friedman, "Regularized discriminant analysis", JASA 84(405), 1989; docs/decisions/0039.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

_NO_SPREAD = 1e-9
"""Added to a covariance of standardised features: windows without any spread have one, too."""


@dataclass(frozen=True, slots=True)
class Discriminant:
    """Logits are `features @ weight.T + bias`."""

    classes: NDArray[np.intp]
    """Class numbers that were learned, shape (known,), ascending."""
    weight: NDArray[np.float64]
    """Shape (known, features)."""
    bias: NDArray[np.float64]
    """Shape (known,)."""


def fit_discriminant(data: NDArray[np.float64], y: NDArray[np.intp], shrink: float) -> Discriminant:
    """Fit a discriminant; its logits have unit spread over what it learned from.

    With more features than windows the logits themselves would be thousands.

    Args:
        data: Shape (n, features), of like scale and about 0.
        y: Class numbers, shape (n,).
        shrink: 0, the covariance as found, to 1, an even one.
    """
    known, own, count = np.unique(y, return_inverse=True, return_counts=True)
    means = np.stack([data[own == number].mean(axis=0) for number in range(len(known))])
    apart = data - means[own]
    share = (1 - shrink) / len(apart)
    even = shrink * float((apart**2).sum()) / len(apart) / data.shape[1] + _NO_SPREAD
    weight = _solve(apart, share, even, means.T).T
    bias = np.log(count / len(y)) - 0.5 * (weight * means).sum(axis=1)
    logits = data @ weight.T + bias
    spread = max(float((logits - logits.mean(axis=1, keepdims=True)).std()), 1.0)
    return Discriminant(known.astype(np.intp), weight / spread, bias / spread)


def _solve(
    apart: NDArray[np.float64], share: float, even: float, right: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Return the inverse of `share · apartᵀ apart + even · 1`, times `right`.

    With more features than windows by the Woodbury identity, whose matrix is of the windows' size.

    Args:
        apart: Shape (n, features).
        share: Of the scatter.
        even: On the diagonal, above 0.
        right: Shape (features, columns).

    Source:
        Hager, "Updating the inverse of a matrix", SIAM Review 31(2), 1989.
    """
    windows, features = apart.shape
    if features <= windows:
        whole = share * (apart.T @ apart) + even * np.eye(features)
        return np.asarray(np.linalg.solve(whole, right))
    inner = share * (apart @ apart.T) + even * np.eye(windows)
    return np.asarray((right - share * apart.T @ np.linalg.solve(inner, apart @ right)) / even)
