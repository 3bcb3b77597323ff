"""Trivial baselines: what can be predicted without touch, printed beside every result.

If one of them comes near a network, the network's accuracy says little about
touch; one below the majority class is worse than guessing. Knows nothing about networks.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from sklearn.ensemble import ExtraTreesClassifier
from sklearn.preprocessing import OneHotEncoder, StandardScaler

from taxel.evaluation.splits import Fold
from taxel.models.tiny_values import enlarged, enlarging
from taxel.training.discriminant import fit_discriminant
from taxel.windows.dataset import Dataset

_TREES = 20
_LEAF = 5
"""Windows a leaf at the least, so that the trees find a rule and not the single window."""
_OF_A_CLASS = 50
"""Training windows of a class for each window of a leaf: of 40 trials, leaves of five would leave a
baseline no rule to find. Source: our choice, docs/decisions/0025."""

MANY = 24
"""Columns above which a linear discriminant is asked beside the trees: of twenty trees each column
is seen by few. Source: our choice, docs/decisions/0025."""
_SHRINK = 0.3
"""Of its covariance, as the search tries first. Source: docs/decisions/0039."""

MAJORITY = "majority"
"""The baseline that always names the commonest class."""
SEES_TOUCH = ("channel means",)
"""Baselines that see touch, though not its course in time; the others see none, or hardly any."""

Features = Callable[[Dataset], NDArray[np.float32]]


def _place_in_trial(dataset: Dataset) -> NDArray[np.float32]:
    """Return how many windows of its trial came before, and the time since the trial's start."""
    start = np.array([t.start_s for t in dataset.trials])[dataset.trial]
    since = dataset.windows.start_s - start
    order = np.zeros(len(dataset))
    for trial in np.unique(dataset.trial):
        own = np.flatnonzero(dataset.trial == trial)
        order[own] = np.arange(len(own))
    return np.stack([order, since], axis=1).astype(np.float32)


def _trial_length(dataset: Dataset) -> NDArray[np.float32]:
    """Return the trial's duration and its number of windows."""
    duration = np.array([t.duration_s for t in dataset.trials])
    count = np.bincount(dataset.trial, minlength=len(dataset.trials))
    return np.stack([duration, count], axis=1)[dataset.trial].astype(np.float32)


def _session(dataset: Dataset) -> NDArray[np.float32]:
    """Return the session as one column a session; the recording where there is none."""
    key = "session" if all("session" in t.groups for t in dataset.trials) else "recording"
    names = dataset.group(key)[dataset.trial][:, None]
    return np.asarray(OneHotEncoder(sparse_output=False).fit_transform(names), np.float32)


def _channel_means(dataset: Dataset) -> NDArray[np.float32]:
    """Return each channel's mean over the window."""
    count = np.maximum(dataset.windows.mask.sum(axis=1), 1)[:, None]
    return np.asarray(dataset.windows.values.sum(axis=1) / count, np.float32)


def _first_row(dataset: Dataset) -> NDArray[np.float32]:
    """Return the first row of the trial's first window: touch before anything happened."""
    first = np.zeros(len(dataset), np.intp)
    for trial in np.unique(dataset.trial):
        own = np.flatnonzero(dataset.trial == trial)
        first[own] = own[0]
    return np.asarray(dataset.windows.values[first, 0])


TRIVIAL: dict[str, Features] = {
    "place in the trial": _place_in_trial,
    "length of the trial": _trial_length,
    "session": _session,
    "channel means": _channel_means,
    "first row of the trial": _first_row,
}
"""Name → what the baseline sees of each window, shape (n, features)."""


def trivial_accuracies(dataset: Dataset, target: str, folds: tuple[Fold, ...]) -> dict[str, float]:
    """Return each trivial baseline's accuracy over all test windows of the folds, 0…1.

    "majority" is the share of the commonest class among them, the no-information rate: what the
    best constant answer reaches. The training part's commonest class would do for less, for
    where groups are held out it is the rarer one there; then any model would look well.
    """
    y = dataset.class_numbers(target)
    parts = [fold.windows(dataset) for fold in folds]
    tested = y[np.concatenate([test for _, test in parts])]
    right = trivial_right(dataset, y, parts)
    return {
        MAJORITY: float(np.bincount(tested).max() / len(tested)),
        **shares(right, len(tested)),
    }


def trivial_right(
    dataset: Dataset,
    y: NDArray[np.intp],
    folds: Sequence[tuple[NDArray[np.intp], NDArray[np.intp]]],
) -> Counter[tuple[str, str]]:
    """Return of each trivial baseline and its models how many test windows of all folds are right.

    Args:
        dataset: The windows.
        y: Class number of each window, shape (n,).
        folds: Windows to learn from and to test on, as indices.
    """
    right: Counter[tuple[str, str]] = Counter()
    as_tested = dataset
    if dataset.tested_level is not None:
        windows = dataset.tested(np.arange(len(dataset)))
        as_tested = replace(dataset, windows=windows, tested_level=None)
    for name, features in TRIVIAL.items():
        seen = tested = features(dataset)
        if as_tested is not dataset:
            tested = features(as_tested)
        models = {"trees": _trees}
        if seen.shape[1] > MANY:
            models["discriminant"] = _discriminant
        for model, predict in models.items():
            right[name, model] = sum(
                int((predict(seen[train], y[train], tested[test]) == y[test]).sum())
                for train, test in folds if len(test)
            )  # fmt: skip
    return right


def shares(right: Mapping[tuple[str, str], int], tested: int) -> dict[str, float]:
    """Return each trivial baseline's accuracy, 0…1: that of the better of its models.

    Over all folds: the better in each fold, where a fold is one trial, would be right wherever
    either model is, so that noise would look like touch.

    Args:
        right: Of all folds together, as `trivial_right` gives it.
        tested: Test windows of all folds.
    """
    found: dict[str, float] = {}
    for (name, _), count in right.items():
        found[name] = max(count / tested, found.get(name, 0.0))
    return found


def below_majority(trivial: Mapping[str, float]) -> str | None:
    """Return a warning on baselines that a constant answer would beat; None without any.

    Args:
        trivial: As `trivial_accuracies` gives them.
    """
    below = [name for name, value in trivial.items() if value < trivial.get(MAJORITY, 0.0)]
    return f"worse than always guessing the majority class: {', '.join(below)}" if below else None


def _discriminant(
    train: NDArray[np.float32], y: NDArray[np.intp], test: NDArray[np.float32]
) -> NDArray[np.intp]:
    scaler = StandardScaler().fit(train.astype(np.float64))
    found = fit_discriminant(scaler.transform(train.astype(np.float64)), y, _SHRINK)
    logits = scaler.transform(test.astype(np.float64)) @ found.weight.T + found.bias
    return np.asarray(found.classes[logits.argmax(axis=1)], np.intp)


def _trees(
    train: NDArray[np.float32], y: NDArray[np.intp], test: NDArray[np.float32]
) -> NDArray[np.intp]:
    leaf = max(1, min(_LEAF, len(y) // (_OF_A_CLASS * len(np.unique(y)))))
    trees = ExtraTreesClassifier(_TREES, min_samples_leaf=leaf, random_state=0, n_jobs=1)
    factors = enlarging(train)
    trees.fit(enlarged(train, factors), y)
    return np.asarray(trees.predict(enlarged(test, factors)), np.intp)
