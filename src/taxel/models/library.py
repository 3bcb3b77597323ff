"""Strong baselines from well-kept libraries, behind one small interface.

MiniRocket (aeon) is the bar that every network's result is printed against;
extremely randomised trees (scikit-learn) are the bar of the tactile papers that
use forests. Knows nothing about files, splits or networks.
"""

from __future__ import annotations

from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from taxel.errors import MissingExtra
from taxel.models.tiny_values import enlarged, enlarging

MINIROCKET_KERNELS = 840
"""Random convolution features. Source: our choice (ten times the 84 base kernels of
Dempster et al., KDD 2021), docs/decisions/0007."""
RIDGE_ALPHA = 10.0
"""Ridge penalty on standardised features. Source: our choice, docs/decisions/0007."""
TREES = 400
"""Trees in the forest. Source: our choice, docs/decisions/0007."""


class Estimator(Protocol):
    """A baseline that is fitted in one call."""

    def fit(
        self, values: NDArray[np.float32], mask: NDArray[np.bool_], y: NDArray[np.intp]
    ) -> None:
        """Learn from windows (n, steps, channels), their mask (n, steps) and class numbers (n,)."""
        ...

    def predict_proba(
        self, values: NDArray[np.float32], mask: NDArray[np.bool_]
    ) -> NDArray[np.float64]:
        """Return class probabilities, shape (n, classes)."""
        ...


class MiniRocketRidge:
    """MiniRocket features and a ridge classifier.

    The ridge gives scores, not probabilities; their softmax stands in, so that
    loss and ROC-AUC can be printed. Source: Dempster et al., KDD 2021; aeon.
    """

    def __init__(self, seed: int = 0) -> None:
        try:
            from aeon.transformations.collection.convolution_based import MiniRocket
        except ImportError as error:
            raise MissingExtra("aeon", "train", "the MiniRocket baseline") from error
        from sklearn.linear_model import RidgeClassifier
        from sklearn.preprocessing import StandardScaler

        self._rocket: Any = MiniRocket(n_kernels=MINIROCKET_KERNELS, random_state=seed, n_jobs=1)
        self._scale: Any = StandardScaler()
        self._ridge: Any = RidgeClassifier(alpha=RIDGE_ALPHA)

    def fit(
        self, values: NDArray[np.float32], mask: NDArray[np.bool_], y: NDArray[np.intp]
    ) -> None:
        features = self._rocket.fit_transform(_as_series(values))
        self._ridge.fit(self._scale.fit_transform(features), y)

    def predict_proba(
        self, values: NDArray[np.float32], mask: NDArray[np.bool_]
    ) -> NDArray[np.float64]:
        features = self._scale.transform(self._rocket.transform(_as_series(values)))
        scores = np.asarray(self._ridge.decision_function(features), np.float64)
        if scores.ndim == 1:
            scores = np.stack([-scores, scores], axis=1)
        weights = np.exp(scores - scores.max(axis=1, keepdims=True))
        return np.asarray(weights / weights.sum(axis=1, keepdims=True))


class ExtraTrees:
    """Extremely randomised trees over each channel's summary statistics."""

    def __init__(self, seed: int = 0) -> None:
        from sklearn.ensemble import ExtraTreesClassifier

        self._trees: Any = ExtraTreesClassifier(TREES, random_state=seed, n_jobs=1)

    def fit(
        self, values: NDArray[np.float32], mask: NDArray[np.bool_], y: NDArray[np.intp]
    ) -> None:
        features = summary_statistics(values, mask)
        self._factors = enlarging(features)
        self._trees.fit(enlarged(features, self._factors), y)

    def predict_proba(
        self, values: NDArray[np.float32], mask: NDArray[np.bool_]
    ) -> NDArray[np.float64]:
        features = enlarged(summary_statistics(values, mask), self._factors)
        return np.asarray(self._trees.predict_proba(features))


def summary_statistics(values: NDArray[np.float32], mask: NDArray[np.bool_]) -> NDArray[np.float32]:
    """Return mean, deviation, least, largest, last and mean step of each channel.

    Args:
        values: Shape (n, steps, channels).
        mask: Shape (n, steps); padded rows do not count.

    Returns:
        Shape (n, 6 · channels + 1); the last column is the number of measured rows.
    """
    present = mask[:, :, None]
    count = np.maximum(mask.sum(axis=1), 1)[:, None].astype(np.float32)
    kept = np.where(present, values, 0.0)
    mean = kept.sum(axis=1) / count
    deviation = np.sqrt((np.where(present, values - mean[:, None], 0.0) ** 2).sum(axis=1) / count)
    least = np.where(present, values, np.inf).min(axis=1)
    largest = np.where(present, values, -np.inf).max(axis=1)
    last = values[np.arange(len(values)), mask.sum(axis=1) - 1]
    both = present[:, 1:] & present[:, :-1]
    steps = np.abs(np.where(both, np.diff(values, axis=1), 0.0)).sum(axis=1) / count
    return np.concatenate(
        [mean, deviation, least, largest, last, steps, count], axis=1, dtype=np.float32
    )


def _as_series(values: NDArray[np.float32]) -> NDArray[np.float32]:
    """Return (n, channels, steps), at least 9 steps long as MiniRocket's kernels are."""
    series = np.ascontiguousarray(np.moveaxis(values, 2, 1))
    short = 9 - series.shape[2]
    if short > 0:
        series = np.pad(series, ((0, 0), (0, 0), (0, short)), mode="edge")
    return series
