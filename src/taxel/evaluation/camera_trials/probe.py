"""A linear probe by trial: what a frozen image network's features are worth for a label.

Every network has the same probe: mean, deviation and mean absolute difference in time of its
features over a crop, the largest and the least of the cameras, columns as ranks, a logistic
regression whose penalty inner folds over the groups choose. Knows nothing about images.

Background of our choices: docs/decisions/0058.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray
from sklearn.linear_model import LogisticRegression

from taxel.evaluation.camera_trials.sides import TrialSplit
from taxel.evaluation.paired import sign_flip
from taxel.training.camera_trials.blend import mean_of_crops, proba_of
from taxel.training.camera_trials.inner_folds import inner_folds
from taxel.training.camera_trials.learning import Learning
from taxel.training.camera_trials.member_weights import log_loss
from taxel.training.camera_trials.ranked import Ranked

Rows = NDArray[np.float32]
PENALTIES: Final = (1e-5, 1e-4, 1e-3, 1e-2, 1e-1)
"""C of the logistic regression; inner folds choose. Source: our choice, before any score."""
_MIDDLE: Final = 1e-3
"""Where there are too few groups for inner folds."""


@dataclass(frozen=True, slots=True)
class Labelled:
    """What rows are of."""

    trial: NDArray[np.intp]
    """Shape (rows,): each row's trial."""
    y: NDArray[np.intp]
    """Shape (trials,): class."""
    groups: NDArray[np.str_]
    """Shape (trials,): what is held out whole."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ProbeResult:
    """A linear probe's predictions for trials held out of its fit."""

    name: str
    probabilities: NDArray[np.float64]
    """Shape (trials, classes)."""
    inner: tuple[float, ...]
    """Log-loss on inner folds of each fold's training side, nats; NaN where there were none."""


@dataclass(frozen=True, slots=True)
class LessThan:
    """Ours less another's over whole groups."""

    accuracy: float
    p_accuracy: float
    """Two-sided sign-flip test over groups."""
    loss: float
    """Log-loss, nats: below 0 is better."""
    p_loss: float


def pooled(features: NDArray[np.floating]) -> Rows:
    """Return crops as rows, shape (trials · crops, 6 · columns).

    Args:
        features: Shape (trials, cameras, crops, images, columns).
    """
    each = np.concatenate(
        [
            features.mean(axis=3),
            features.std(axis=3),
            np.abs(np.diff(features, axis=3)).mean(axis=3),
        ],
        axis=3,
    )
    both = np.concatenate([each.max(axis=1), each.min(axis=1)], axis=2)
    return np.ascontiguousarray(both.reshape(-1, both.shape[-1]), np.float32)


def probe(
    name: str,
    rows: Sequence[Rows],
    labelled: Labelled,
    split: TrialSplit,
    seed: int = 0,
) -> ProbeResult:
    """Return a probe's predictions for each fold's test trials.

    Args:
        name: Of what is probed.
        rows: Of each fold (`pooled`): a network pretrained fold by fold has others in each.
        labelled: What the rows are of.
        split: The folds.
        seed: Of inner folds.
    """
    trial, y, groups = labelled.trial, labelled.y, labelled.groups
    classes = int(y.max()) + 1
    probabilities, inner = np.full((len(y), classes), np.nan), []
    for own, fold in zip(rows, split.folds, strict=True):
        learning = Learning(own, trial, y, groups, classes)
        probabilities[fold.test_rows], loss = probe_once(
            learning.part(fold.train_rows), learning.part(fold.test_rows), seed
        )
        inner.append(loss)
    return ProbeResult(name=name, probabilities=probabilities, inner=tuple(inner))


def commonest(labelled: Labelled, split: TrialSplit) -> ProbeResult:
    """Return what naming each fold's shares of classes in training says: the least of all bars."""
    y = labelled.y
    classes = int(y.max()) + 1
    found = np.full((len(y), classes), np.nan)
    for fold in split.folds:
        counts = np.bincount(y[fold.train_rows], minlength=classes)
        found[fold.test_rows] = counts / counts.sum()
    return ProbeResult(name="commonest class", probabilities=found, inner=())


def probe_once(learning: Learning, test: Learning, seed: int) -> tuple[NDArray[np.float64], float]:
    """Fit on some trials; return the others' probabilities and the log-loss of inner folds.

    Ranks and directions are those of all that is learned from; labels enter by fold.

    Args:
        learning: What is learned from.
        test: What is predicted; its labels are not looked at.
        seed: Of the inner folds.

    Returns:
        Probabilities, shape (test trials, classes), and the loss, nats; NaN without inner folds.
    """
    ranked = Ranked.of(learning.rows)
    learned, tested = (ranked.apply(part.rows).astype(np.float64) for part in (learning, test))
    middle = learned.mean(axis=0)
    # No more directions than rows: the regression's answer lies in them, so that nothing is lost.
    turned = np.linalg.svd(learned - middle, full_matrices=False)[2].T
    learned, tested = (learned - middle) @ turned, (tested - middle) @ turned
    own = Learning(learned, learning.trial, learning.y, learning.groups, learning.classes)
    losses = _inner_losses(own, seed)
    best = min(losses, key=lambda penalty: losses[penalty]) if losses else _MIDDLE
    crops = _fitted(own, best, tested)
    return mean_of_crops(crops, test.trial), losses.get(best, float("nan"))


def _inner_losses(own: Learning, seed: int) -> dict[float, float]:
    parts = inner_folds(own.y, own.groups, seed)
    if not parts:
        return {}
    losses = {}
    for penalty in PENALTIES:
        held = np.full((len(own.y), own.classes), np.nan)
        for train, test in parts:
            inside, outside = own.part(train), own.part(test)
            held[test] = mean_of_crops(_fitted(inside, penalty, outside.rows), outside.trial)
        seen = np.isfinite(held[:, 0])
        losses[penalty] = log_loss(held[seen], own.y[seen])
    return losses


def _fitted(own: Learning, penalty: float, rows: NDArray[np.floating]) -> NDArray[np.float64]:
    model = LogisticRegression(C=penalty, max_iter=300).fit(own.rows, own.y[own.trial])
    return proba_of(model, rows, own.classes)


def less_than(
    ours: ProbeResult, other: ProbeResult, y: NDArray[np.intp], groups: NDArray[np.str_]
) -> LessThan:
    """Return how much better ours is, tested over whole groups.

    Args:
        ours: A probe.
        other: Another of the same trials.
        y: True class numbers, shape (trials,).
        groups: What each trial is of, such as its object, shape (trials,).
    """
    names, index = np.unique(groups, return_inverse=True)
    right = _right(ours, y).astype(float) - _right(other, y)
    loss = _losses(ours, y) - _losses(other, y)
    by_group = [
        np.bincount(index, weights=values, minlength=len(names)).astype(np.float64)
        for values in (right, loss)
    ]
    return LessThan(
        float(right.mean()), sign_flip(by_group[0]), float(loss.mean()), sign_flip(by_group[1])
    )


def _right(found: ProbeResult, y: NDArray[np.intp]) -> NDArray[np.bool_]:
    return np.asarray(found.probabilities.argmax(axis=1) == y)


def _losses(found: ProbeResult, y: NDArray[np.intp]) -> NDArray[np.float64]:
    own = found.probabilities[np.arange(len(y)), y]
    return np.asarray(-np.log(np.maximum(own, 1e-6)), np.float64)
