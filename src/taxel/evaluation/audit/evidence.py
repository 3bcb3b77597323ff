"""How well something predicts the label: cross-validated, and against labels dealt out anew.

Predictions are made once, by a model that never saw the test trials. Then the trials' labels are
dealt out anew, within the groups that were held out where a group has several classes and
between whole groups otherwise, and the figure is compared with those. Knows nothing about
where features or folds come from.

Source: permutation of labels within exchangeability blocks, A. Winkler et al., NeuroImage 2014;
rule and margins: docs/decisions/0023.
"""

from __future__ import annotations

import warnings
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.stats import binom, norm
from sklearn.ensemble import ExtraTreesClassifier
from sklearn.model_selection import StratifiedGroupKFold, StratifiedKFold

from taxel.models.tiny_values import enlarged, enlarging

TREES = 50
FOLDS = 5
DRAWS = 4999
"""Labels dealt out anew: the least p is 1/5000, and 50 corrected tests can still reach 0.01."""
_BLOCK = 100
"""Draws in memory at once: 20,000 trials take 16 MB, not 800."""
SPREAD = 1.5
"""How much wider a cross-validated figure scatters by chance than labels dealt out anew show, since
folds share their training trials. Source: C. Nadeau, Y. Bengio, "Inference for the generalization
error", 2003: sqrt((1/5 + 1/4) / (1/5)) for five folds; checked in docs/decisions/0023."""
SURE = 0.01
"""Largest p, after Holm's correction, at which something counts. Our choice, decision 23."""
MARGIN = 0.05
"""Accuracy above the majority class from which something counts. Our choice, decision 23."""
AUC = 0.75
"""Area from which something counts though classes are unequal. Our choice, decision 23."""

Fold = tuple[NDArray[np.intp], NDArray[np.intp]]
"""Indices of training and test trials."""
Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True, kw_only=True)
class LabelEvidence:
    """How well something alone predicts the label."""

    accuracy: float
    majority: float
    auc: float | None
    """None with more than two classes."""
    p: float
    """Before any correction."""
    by_chance: tuple[float, float] = (0.0, 0.0)
    """Mean and deviation, widened by `SPREAD`, of the accuracy of the true labels themselves where
    labels are dealt out anew: what so many trials let chance reach."""

    def could_count(self, tests: int) -> bool:
        """Return whether something that goes half of the way to certainty would have counted.

        Args:
            tests: Among how many tests it stands, the strictest share of `SURE` being its own.
        """
        mean, spread = self.by_chance
        half = max(self.majority + MARGIN, (1.0 + self.majority) / 2)
        return spread > 0 and mean + float(norm.isf(SURE / tests)) * spread <= half

    def counts(self, p: float) -> bool:
        """Return whether it is a finding, given p after correction."""
        enough = self.accuracy >= self.majority + MARGIN or (self.auc or 0.0) >= AUC
        return p < SURE and enough


_MANY_CLASSES = "The number of unique classes is greater than 50% of the number of samples"
"""What scikit-learn warns of at each of many trees; `audit` says it once, in a note."""


def trial_folds(y: NDArray[np.intp], groups: NDArray[np.str_] | None, seed: int) -> list[Fold]:
    """Return folds that hold out whole groups, or whole trials where there are none.

    Args:
        y: Each trial's class, shape (trials,).
        groups: Each trial's group, shape (trials,); None holds out single trials.
        seed: Of the folds.
    """
    count = min(FOLDS, int(np.bincount(y).max()), len(y if groups is None else set(groups)))
    kind = StratifiedKFold if groups is None else StratifiedGroupKFold
    splitter = kind(count, shuffle=True, random_state=seed)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)  # a class with fewer trials than folds
        return [(train, test) for train, test in splitter.split(y, y, groups) if len(test)]


def trees(seed: int) -> ExtraTreesClassifier:
    """Return the model that reads nuisances and touch alike."""
    return ExtraTreesClassifier(TREES, min_samples_leaf=2, random_state=seed, n_jobs=1)


def predict(
    features: NDArray[np.floating], y: NDArray[np.intp], folds: Sequence[Fold], seed: int = 0
) -> Array:
    """Return each row's probabilities by a model that never saw its fold, shape (n, classes).

    Rows that no fold tests stay NaN.

    Args:
        features: Shape (n, columns).
        y: Each row's class, shape (n,).
        folds: Rows to train on and rows to test.
        seed: Of the trees.
    """
    classes = int(y.max()) + 1
    found = np.full((len(y), classes), np.nan)
    for train, test in folds:
        with warnings.catch_warnings():
            warnings.filterwarnings("ignore", _MANY_CLASSES, UserWarning)
            factors = enlarging(features[train])
            model = trees(seed).fit(enlarged(features[train], factors), y[train])
        found[test] = 0.0
        shares = model.predict_proba(enlarged(features[test], factors))
        found[np.ix_(test, model.classes_)] = shares
    return found


def look_up(names: NDArray[np.str_], y: NDArray[np.intp], folds: Sequence[Fold]) -> Array:
    """Return shares of the classes among training rows of the same name, shape (n, classes).

    A name that training never saw gets the shares of all training rows.

    Args:
        names: Each row's, shape (n,).
        y: Each row's class, shape (n,).
        folds: Rows to train on and rows to test.
    """
    classes = int(y.max()) + 1
    found = np.full((len(y), classes), np.nan)
    for train, test in folds:
        every = np.bincount(y[train], minlength=classes) / len(train)
        known = {name: np.bincount(y[train][names[train] == name], minlength=classes)
                 for name in set(names[train])}  # fmt: skip
        for row in test:
            own = known.get(names[row])
            found[row] = every if own is None else own / own.sum() + 1e-6 * every
    return found


def majority(y: NDArray[np.intp], folds: Sequence[Fold]) -> float:
    """Return the share of the commonest class in all test parts: the best single answer.

    Args:
        y: Each row's class, shape (n,).
        folds: Rows to train on and rows to test.
    """
    tested = np.concatenate([y[test] for _, test in folds])
    return float(np.bincount(tested).max() / len(tested))


def evidence_of(
    probability: Array,
    y: NDArray[np.intp],
    units: NDArray[np.intp],
    groups: NDArray[np.str_] | None,
    folds: Sequence[Fold],
    seed: int = 0,
) -> LabelEvidence:
    """Return how well probabilities predict the label, and by what chance.

    Args:
        probability: Shape (n, classes), from `predict` or `look_up`.
        y: Shape (n,), each row's class.
        units: Shape (n,): the trial of each row, which has one label.
        groups: Shape (trials,): what was held out whole; None where trials were.
        folds: Those that the probabilities are from.
        seed: Of the labels dealt out.
    """
    tested = np.isfinite(probability[:, 0])
    classes = probability.shape[1]
    trials = int(units.max()) + 1
    label = np.zeros(trials, np.intp)
    label[units] = y
    named = probability[tested].argmax(axis=1)
    votes = np.zeros((trials, classes))
    np.add.at(votes, (units[tested], named), 1.0)
    used = np.flatnonzero(votes.sum(axis=1))
    binary = classes == 2
    score = np.zeros(trials)
    if binary:
        np.add.at(score, units[tested], probability[tested, 1])
        score /= np.maximum(votes.sum(axis=1), 1.0)
    labels, own_votes = label[used], votes[used]
    rank = _ranks(score[used])
    by_chance, alike, positive, below = (np.zeros(DRAWS) for _ in range(4))
    for part, at, drawn in deal_out(labels, None if groups is None else groups[used], DRAWS, seed):
        by_chance[part] += own_votes[at, drawn].sum(axis=1)
        alike[part] += (drawn == labels[at]) @ own_votes[at].sum(axis=1)
        if binary:
            positive[part] += drawn.sum(axis=1)
            below[part] += drawn @ rank[at]
    wider = SPREAD if len(folds) > 1 else 1.0
    right, total = own_votes[np.arange(len(labels)), labels].sum(), own_votes.sum()
    p = _p(right, by_chance, wider)
    auc = None
    if binary and 0 < labels.sum() < len(labels):
        auc = float(_auc(labels[None], score[used])[0])
        p = min(1.0, 2 * min(p, _p(auc, _area(below, positive, len(labels)), wider)))
    return LabelEvidence(
        accuracy=float(right / total), majority=majority(y, folds), auc=auc, p=p,
        by_chance=(float(alike.mean() / total), wider * float(alike.std() / total)),
    )  # fmt: skip


def deal_out(
    label: NDArray[np.intp], groups: NDArray[np.str_] | None, draws: int, seed: int
) -> Iterator[tuple[slice, NDArray[np.intp], NDArray[np.intp]]]:
    """Yield labels dealt out anew, part by part, so that memory stays small.

    Without groups: among all trials. With groups of which at least half of the trials lie in
    ones that hold several classes: within each group. Otherwise whole groups swap their
    labels: each trial gets the commonest class of the group that its own was given.

    Yields:
        Draws, trials, and their labels of shape (draws, trials), or (1, trials) where all draws
        are alike. All parts together hold each trial of each draw once.
    """
    rng = np.random.default_rng(seed)
    every = np.arange(len(label))
    if groups is None:
        for part, drawn in _permuted(rng, label, draws, _BLOCK):
            yield part, every, drawn
        return
    names, index = np.unique(groups, return_inverse=True)
    members = [np.flatnonzero(index == number) for number in range(len(names))]
    mixed = [own for own in members if len(set(label[own])) > 1]
    if sum(map(len, mixed)) >= len(label) / 2:
        for own in mixed:  # a small group's draws at once: as much memory, fewer parts
            for part, drawn in _permuted(rng, label[own], draws, _BLOCK * len(label) // len(own)):
                yield part, own, drawn
        rest = np.setdiff1d(every, np.concatenate(mixed))
        yield slice(0, draws), rest, label[rest][None]
        return
    of_group = np.array([np.bincount(label[own]).argmax() for own in members], np.intp)
    for part, drawn in _permuted(rng, of_group, draws, _BLOCK):
        yield part, every, drawn[:, index]


def _permuted(
    rng: np.random.Generator, label: NDArray[np.intp], draws: int, block: int
) -> Iterator[tuple[slice, NDArray[np.intp]]]:
    """Yield labels in another order for each draw: the same, however large the blocks."""
    for start in range(0, draws, block):
        part = slice(start, min(draws, start + block))
        yield part, rng.permuted(np.tile(label, (part.stop - start, 1)), axis=1)


def gap_p(difference: Array, seed: int = 0) -> float:
    """Return the chance of so high a mean where each unit's sign is drawn: a sign-flip test.

    Args:
        difference: Shape (units,): accuracy one way less accuracy the other.
        seed: Of the signs.
    """
    rng = np.random.default_rng(seed)
    by_chance = np.empty(DRAWS)
    for start in range(0, DRAWS, _BLOCK):
        part = by_chance[start : start + _BLOCK]
        signs = rng.choice((-1.0, 1.0), (len(part), len(difference)))
        part[:] = (signs * difference).mean(axis=1)
    return _p(float(difference.mean()), by_chance, 1.0)


def sign_p(better: int, worse: int) -> float:
    """Return the chance that so many or more of all cases that differ are better: a sign test."""
    return float(binom.sf(better - 1, better + worse, 0.5))


def _p(value: float, by_chance: Array, wider: float) -> float:
    """Return the larger of the share drawn by chance and of a normal tail, `wider` as wide."""
    share = float((1 + (by_chance >= value - 1e-12).sum()) / (1 + len(by_chance)))
    spread = float(by_chance.std()) * wider
    if spread == 0.0:
        return 1.0
    return max(share, float(norm.sf((value - by_chance.mean()) / spread)))


def _auc(label: NDArray[np.intp], score: Array) -> Array:
    """Return the area for each row of labels, shape (draws,)."""
    positive = label.sum(axis=1).astype(float)
    return _area((label * _ranks(score)).sum(axis=1), positive, label.shape[1])


def _ranks(score: Array) -> Array:
    """Return each score's rank from 1, the mean where several are equal."""
    _, index, count = np.unique(score, return_inverse=True, return_counts=True)
    return np.asarray((np.cumsum(count) - (count - 1) / 2)[index])


def _area(below: Array, positive: Array, trials: int) -> Array:
    """Return the area from the sum of the positive trials' ranks and their number."""
    below = below - positive * (positive + 1) / 2
    return np.asarray(below / np.maximum(positive * (trials - positive), 1))
