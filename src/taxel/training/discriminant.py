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

    With more features than windows the logits themselves would be thousands. Outside of what was
    seen the covariance is even and no class's mean differs, so that all is solved inside.

    Args:
        data: Shape (n, features), of like scale and about 0.
        y: Class numbers, shape (n,).
        shrink: 0, the covariance as found, to 1, an even one.
    """
    known, own, count = np.unique(y, return_inverse=True, return_counts=True)
    features = data.shape[1]
    basis = np.linalg.qr(data.T)[0] if len(data) < features else np.eye(features)
    inside = data @ basis
    means = np.stack([inside[own == number].mean(axis=0) for number in range(len(known))])
    apart = inside - means[own]
    scatter = apart.T @ apart / len(apart)
    even = shrink * np.trace(scatter) / features + _NO_SPREAD
    weight = np.linalg.solve((1 - shrink) * scatter + even * np.eye(len(scatter)), means.T).T
    bias = np.log(count / len(y)) - 0.5 * (weight * means).sum(axis=1)
    logits = inside @ weight.T + bias
    spread = max(float((logits - logits.mean(axis=1, keepdims=True)).std()), 1.0)
    return Discriminant(known.astype(np.intp), weight @ basis.T / spread, bias / spread)
