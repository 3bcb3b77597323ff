"""Sums of columns' ranks that give classes: a logistic regression and a shrunk discriminant.

Both are fitted and asked as classifiers of scikit-learn are, like the forests beside them.
Knows nothing about trials, views or weights.

Source: docs/decisions/0041.
"""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy.special import softmax
from sklearn.linear_model import LogisticRegression

from taxel.training.camera_trials.ranked import Ranked
from taxel.training.discriminant import Discriminant, fit_discriminant

Rows = NDArray[np.float32]
CERTAINTY: Final = 3.0
"""What a discriminant's logits, of unit spread where it learned, are multiplied by; inner folds
make the blend sharper or blunter. Source: our choice, decision 41."""


class Logistic:
    """A logistic regression on each column's rank.

    Args:
        penalty: C; small where columns outnumber rows.
    """

    def __init__(self, penalty: float) -> None:
        self._model = LogisticRegression(C=penalty, max_iter=300)
        self.ranked: Ranked | None = None

    def fit(self, rows: Rows, y: NDArray[np.intp]) -> Logistic:
        self.ranked = Ranked.of(rows)
        self._model.fit(self.ranked.apply(rows), y)
        return self

    def predict_proba(self, rows: Rows) -> NDArray[np.float64]:
        """Return shape (n, classes), as scikit-learn's classifiers do."""
        assert self.ranked is not None
        return np.asarray(self._model.predict_proba(self.ranked.apply(rows)), np.float64)

    @property
    def classes_(self) -> NDArray[np.intp]:
        """Class numbers that were learned, shape (classes,), ascending."""
        return np.asarray(self._model.classes_, np.intp)

    @property
    def slopes(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Slope of each column and level, shapes (classes or 1, columns) and (classes or 1,)."""
        return self._model.coef_, self._model.intercept_


class Steady:
    """A shrunk linear discriminant on each column's rank.

    Args:
        shrink: Of the within-class covariance, 0…1.
    """

    def __init__(self, shrink: float) -> None:
        self._shrink = shrink
        self._found: Discriminant | None = None
        self._middle: NDArray[np.float64] = np.zeros(0)
        self.ranked: Ranked | None = None

    def fit(self, rows: Rows, y: NDArray[np.intp]) -> Steady:
        self.ranked = Ranked.of(rows)
        ranks = self.ranked.apply(rows).astype(np.float64)
        self._middle = ranks.mean(axis=0)
        self._found = fit_discriminant(ranks - self._middle, y, self._shrink)
        return self

    def predict_proba(self, rows: Rows) -> NDArray[np.float64]:
        """Return shape (n, classes), as scikit-learn's classifiers do."""
        assert self.ranked is not None
        slopes, levels = self.slopes
        return np.asarray(softmax(self.ranked.apply(rows) @ slopes.T + levels, axis=1), np.float64)

    @property
    def classes_(self) -> NDArray[np.intp]:
        """Class numbers that were learned, shape (classes,), ascending."""
        assert self._found is not None
        return self._found.classes

    @property
    def slopes(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Slope of each column and level, shapes (classes, columns) and (classes,)."""
        assert self._found is not None
        weight, bias = self._found.weight, self._found.bias
        return CERTAINTY * weight, CERTAINTY * (bias - weight @ self._middle)
