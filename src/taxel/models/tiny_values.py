"""Features of tiny size for scikit-learn's trees, which take a range below 1e-7 for constant.

Charges in coulombs, currents in amperes and capacities in farads are as small as that. Factors are
powers of two; features of usual size stay what they are, bit for bit. Knows nothing about trees.

Source: docs/decisions/0024.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

_TINY = 1e-3
"""Features that nowhere exceed it are enlarged. Source: our choice, docs/decisions/0024."""
_MOST = 100
"""Largest exponent of a factor: 1e-30 becomes 1. Source: our choice, docs/decisions/0024."""
_LARGEST = 1e38
"""What a feature is cut at, so that it stays a float32. Source: numpy.finfo(numpy.float32)."""


def enlarging(learned: NDArray[np.floating]) -> NDArray[np.float64]:
    """Return what each feature is multiplied by, shape (features,).

    Args:
        learned: Of the rows to learn from alone, shape (n, features); NaN is left out.
    """
    size = np.nanmax(np.abs(learned), axis=0, initial=0.0)
    tiny = (size > 0) & (size < _TINY)
    exponent = -np.floor(np.log2(np.where(tiny, size, 1.0)))
    return np.asarray(2.0 ** np.minimum(exponent, _MOST), np.float64)


def enlarged(features: NDArray[np.floating], factors: NDArray[np.float64]) -> NDArray[np.floating]:
    """Return features times their factors, of the same type; as they are where all are 1.

    Args:
        features: Shape (n, features).
        factors: Shape (features,), as `enlarging` gives them.
    """
    if (factors == 1.0).all():
        return features
    found = np.clip(features.astype(np.float64) * factors, -_LARGEST, _LARGEST)
    return np.asarray(found, features.dtype)
