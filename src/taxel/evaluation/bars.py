"""Library models on plain features, fitted with their defaults: the bars that a default must clear.

Knows nothing about choosing.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from taxel.models.library import TREES, Estimator, ExtraTrees, MiniRocketRidge, summary_statistics
from taxel.models.tiny_values import enlarged, enlarging

Table = Callable[[NDArray[np.float32], NDArray[np.bool_]], NDArray[np.float32]]


class OnTable:
    """A scikit-learn classifier on a table of features.

    Args:
        build: Makes the classifier.
        table: (values, mask) → features.
    """

    def __init__(self, build: Callable[[], Any], table: Table) -> None:
        self._model, self._table = build(), table

    def fit(
        self, values: NDArray[np.float32], mask: NDArray[np.bool_], y: NDArray[np.intp]
    ) -> None:
        features = self._table(values, mask)
        self._factors = enlarging(features)
        self._model.fit(enlarged(features, self._factors), y)

    def predict_proba(
        self, values: NDArray[np.float32], mask: NDArray[np.bool_]
    ) -> NDArray[np.float64]:
        features = enlarged(self._table(values, mask), self._factors)
        return np.asarray(self._model.predict_proba(features))


def channel_means(values: NDArray[np.float32], mask: NDArray[np.bool_]) -> NDArray[np.float32]:
    """Return each channel's mean over the measured rows, shape (n, channels)."""
    count = np.maximum(mask.sum(axis=1), 1)[:, None]
    return np.asarray((values * mask[:, :, None]).sum(axis=1) / count, np.float32)


def _forest(seed: int) -> Any:
    from sklearn.ensemble import RandomForestClassifier

    return RandomForestClassifier(TREES, random_state=seed, n_jobs=1)


def _logistic() -> Any:
    from sklearn.linear_model import LogisticRegression
    from sklearn.pipeline import make_pipeline
    from sklearn.preprocessing import StandardScaler

    return make_pipeline(StandardScaler(), LogisticRegression(max_iter=1000, tol=1e-3))


BARS: dict[str, Callable[[int], Estimator]] = {
    "extra-trees": ExtraTrees,
    "random forest": lambda seed: OnTable(lambda: _forest(seed), summary_statistics),
    "minirocket": MiniRocketRidge,
    "logistic regression": lambda seed: OnTable(_logistic, summary_statistics),
    "channel means": lambda seed: OnTable(_logistic, channel_means),
}
"""Bar → seed → estimator; all see statistics of each channel but MiniRocket, which sees rows, and
the last, which sees means alone."""
FEWEST_ROWS = {"minirocket": 9}
"""Rows that a window must have for a bar."""


def bar_probabilities(
    name: str,
    train: tuple[NDArray[np.float32], NDArray[np.bool_], NDArray[np.intp]],
    test: tuple[NDArray[np.float32], NDArray[np.bool_]],
    classes: int,
    seed: int = 0,
) -> NDArray[np.float64]:
    """Fit a bar and return its probabilities of test windows, shape (n, classes).

    Args:
        name: A key of `BARS`.
        train: Values, mask and classes of the training windows.
        test: Values and mask of the test windows.
        classes: How many there are.
        seed: Of the estimator.
    """
    if not len(test[0]):
        return np.zeros((0, classes))
    estimator = BARS[name](seed)
    known = np.unique(train[2])
    estimator.fit(train[0], train[1], np.searchsorted(known, train[2]).astype(np.intp))
    found = np.zeros((len(test[0]), classes))
    found[:, known] = estimator.predict_proba(*test)
    return found
