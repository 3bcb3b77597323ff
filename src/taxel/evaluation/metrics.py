"""Scores of predictions: accuracy, loss, ROC-AUC, confusion, intervals by group.

scikit-learn is imported where it is used: a worker that fits folds scores none and starts sooner
without it. Knows nothing about models, splits or files.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from taxel.evaluation.intervals import ratio_interval

LEAST_PROBABILITY = 1e-7
"""Probabilities are clipped to this before the logarithm. Source: Keras' epsilon, as the
thesis's losses are Keras'."""

_NEAR = 1.1
"""Up to this times chance, a balanced accuracy is near it. Source: our choice,
docs/decisions/0025."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Scores:
    """Scores of one set of predictions; all but loss and confusion are 0…1."""

    accuracy: float
    loss: float
    """Mean cross-entropy, nats."""
    roc_auc: float
    """One class against the rest, mean over classes; NaN where a class is absent."""
    precision: float
    """Mean over classes."""
    recall: float
    """Mean over classes."""
    f1: float
    """Mean over classes."""
    confusion: list[list[int]]
    """Rows: true class; columns: predicted class."""

    @property
    def balanced(self) -> float:
        """Mean of the recalls of the classes that were tested, 0…1: balanced accuracy."""
        return float(np.mean([row[c] / sum(row) for c, row in enumerate(self.confusion)
                              if any(row)]))  # fmt: skip

    @property
    def tested(self) -> int:
        """How many classes were tested."""
        return sum(map(any, self.confusion))


def score(y: NDArray[np.intp], probabilities: NDArray[np.float64]) -> Scores:
    """Return the scores of predictions.

    Args:
        y: True class numbers, shape (n,).
        probabilities: Shape (n, classes).
    """
    from sklearn.metrics import confusion_matrix, precision_recall_fscore_support

    classes = probabilities.shape[1]
    predicted = probabilities.argmax(axis=1)
    precision, recall, f1, _ = precision_recall_fscore_support(
        y, predicted, labels=range(classes), average="macro", zero_division=0.0
    )
    return Scores(
        accuracy=float((predicted == y).mean()),
        loss=cross_entropy(y, probabilities),
        roc_auc=_roc_auc(y, probabilities),
        precision=float(precision),
        recall=float(recall),
        f1=float(f1),
        confusion=confusion_matrix(y, predicted, labels=range(classes)).tolist(),
    )


def near_chance(balanced: float, classes: int) -> bool:
    """Return whether a balanced accuracy is at most a tenth above what one answer for all gives.

    Always naming the commonest class of unequal ones gives a high accuracy, and this one the same
    as any other constant answer: 1 / classes.

    Args:
        balanced: Mean of the classes' recalls, 0…1.
        classes: How many; of a single one nothing is to be distinguished: False.
    """
    return classes > 1 and balanced <= _NEAR / classes


def cross_entropy(y: NDArray[np.intp], probabilities: NDArray[np.float64]) -> float:
    """Return the mean cross-entropy, nats.

    Args:
        y: True class numbers, shape (n,).
        probabilities: Shape (n, classes), 0…1; below `LEAST_PROBABILITY` they count as that.
    """
    likely = np.maximum(probabilities[np.arange(len(y)), y], LEAST_PROBABILITY)
    return float(-np.log(likely).mean())


def accuracy_interval(
    correct: NDArray[np.bool_], groups: NDArray[np.str_], seed: int = 0
) -> tuple[float, float]:
    """Return a 95 % interval of the accuracy by resampling whole groups.

    One group alone gives no interval: (NaN, NaN).

    Args:
        correct: Shape (n,).
        groups: Shape (n,): the session, or other group, of each prediction.
        seed: Seed of the resampling.
    """
    index = np.unique(groups, return_inverse=True)[1]
    return ratio_interval(np.bincount(index, weights=correct), np.bincount(index), seed)


def by_trial(
    trial: NDArray[np.intp], y: NDArray[np.intp], probabilities: NDArray[np.float64]
) -> tuple[NDArray[np.intp], NDArray[np.intp], NDArray[np.float64]]:
    """Join the windows of each trial: mean of the log-probabilities, normalised.

    Args:
        trial: Shape (n,).
        y: Shape (n,).
        probabilities: Shape (n, classes).

    Returns:
        Trial numbers (m,), their classes (m,) and probabilities (m, classes).
    """
    numbers, first, index = np.unique(trial, return_index=True, return_inverse=True)
    log = np.log(np.maximum(probabilities, LEAST_PROBABILITY))
    mean = np.zeros((len(numbers), probabilities.shape[1]))
    np.add.at(mean, index, log)
    mean /= np.bincount(index)[:, None]
    joined = np.exp(mean - mean.max(axis=1, keepdims=True))
    return numbers, y[first], joined / joined.sum(axis=1, keepdims=True)


def _roc_auc(y: NDArray[np.intp], probabilities: NDArray[np.float64]) -> float:
    from sklearn.metrics import roc_auc_score

    present = np.unique(y)
    if len(present) < probabilities.shape[1]:
        return float("nan")
    if probabilities.shape[1] == 2:
        return float(roc_auc_score(y, probabilities[:, 1]))
    total = probabilities.sum(axis=1, keepdims=True)
    return float(roc_auc_score(y, probabilities / total, multi_class="ovr", average="macro"))
