"""Did the object slip in this trial? Crops of fixed length, judged on objects never seen.

A label holds for a whole trial and slip trials are shorter, so length and position tell it
too: controls that see only those are judged in the same folds. Nothing is chosen on a test
fold. Knows nothing about images, files or screens.

Background of our choices: docs/decisions/0013.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, Final, Protocol

import numpy as np
from numpy.typing import NDArray
from sklearn.ensemble import (
    ExtraTreesClassifier,
    HistGradientBoostingClassifier,
    RandomForestClassifier,
)
from sklearn.linear_model import LogisticRegression
from sklearn.metrics import roc_auc_score
from sklearn.model_selection import StratifiedGroupKFold
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import QuantileTransformer

from taxel.errors import BadSplit
from taxel.evaluation.slip_crops import GREY_COLUMNS, PLACES, SlipCrops

RESAMPLES: Final = 1000
"""Resamples of objects for an interval. Source: our choice."""
TREES: Final = 500
PENALTY: Final = 0.002
"""C of the logistic regression: strong, as columns outnumber rows. Source: our choice."""
_TRIES = 50
Rows = NDArray[np.float32]


class Model(Protocol):
    """What learns a probability of slip from rows."""

    def fit(self, rows: Rows, y: NDArray[np.intp]) -> None:
        """Learn from shape (n, columns) and 0 or 1, shape (n,)."""
        ...

    def slip(self, rows: Rows) -> NDArray[np.float64]:
        """Return the probability of slip, shape (n,)."""
        ...


class Mean:
    """The mean of several scikit-learn classifiers' probabilities."""

    def __init__(self, *members: Any) -> None:
        self._members = members

    def fit(self, rows: Rows, y: NDArray[np.intp]) -> None:
        for member in self._members:
            member.fit(rows, y)

    def slip(self, rows: Rows) -> NDArray[np.float64]:
        each = [member.predict_proba(rows)[:, 1] for member in self._members]
        return np.asarray(np.mean(each, axis=0), np.float64)


class RankedLogistic:
    """A logistic regression on each column's rank, spread as a normal distribution."""

    def __init__(self, seed: int) -> None:
        self._seed = seed
        self._steps: Any = None

    def fit(self, rows: Rows, y: NDArray[np.intp]) -> None:
        ranks = QuantileTransformer(
            n_quantiles=min(100, len(rows)), output_distribution="normal", random_state=self._seed
        )
        self._steps = make_pipeline(ranks, LogisticRegression(C=PENALTY, max_iter=500)).fit(rows, y)

    def predict_proba(self, rows: Rows) -> NDArray[np.float64]:
        """Return shape (n, 2), as scikit-learn's classifiers do."""
        return np.asarray(self._steps.predict_proba(rows), np.float64)


class Majority:
    """Says the more frequent outcome among what it learned from, whatever it is shown."""

    def __init__(self) -> None:
        self._outcome = 0.0

    def fit(self, rows: Rows, y: NDArray[np.intp]) -> None:
        self._outcome = float(y.mean() > 0.5)

    def slip(self, rows: Rows) -> NDArray[np.float64]:
        return np.full(len(rows), self._outcome)


class OnColumns:
    """A scikit-learn classifier that sees some columns only."""

    def __init__(self, member: Any, columns: NDArray[np.intp]) -> None:
        self._member, self._columns = member, columns

    def fit(self, rows: Rows, y: NDArray[np.intp]) -> None:
        self._member.fit(rows[:, self._columns], y)

    def predict_proba(self, rows: Rows) -> NDArray[np.float64]:
        """Return shape (n, 2), as scikit-learn's classifiers do."""
        return np.asarray(self._member.predict_proba(rows[:, self._columns]), np.float64)


def strong(seed: int) -> Mean:
    """Return the mean of trees, boosting, a logistic regression on ranks, and the bar's forest.

    Settings were fixed before any fold was judged: scikit-learn's own but for the number of
    trees, smaller leaves' size and a strong penalty, as rows are few and columns many.
    """
    return Mean(
        ExtraTreesClassifier(TREES, min_samples_leaf=2, random_state=seed, n_jobs=1),
        HistGradientBoostingClassifier(
            learning_rate=0.06, max_iter=150, max_leaf_nodes=12, l2_regularization=1.0,
            max_features=0.2, early_stopping=False, random_state=seed,
        ),
        RankedLogistic(seed),
        OnColumns(
            RandomForestClassifier(TREES, min_samples_leaf=2, random_state=seed, n_jobs=1),
            GREY_COLUMNS,
        ),
    )  # fmt: skip


def forest(seed: int) -> Mean:
    """Return a random forest, the published bar's kind."""
    return Mean(RandomForestClassifier(TREES, min_samples_leaf=2, random_state=seed, n_jobs=1))


@dataclass(frozen=True, slots=True, kw_only=True)
class Contender:
    """A model and what it sees."""

    name: str
    rows: Callable[[SlipCrops], Rows]
    model: Callable[[int], Model]
    leaks: str
    """In what way it knows more than movement; empty where it does not."""


CONTENDERS: Final = (
    Contender(
        name="movement: mean of trees, boosting, logistic, forest",
        rows=lambda crops: crops.movement,
        model=strong,
        leaks="",
    ),
    Contender(
        name="grey differences: random forest (the bar)",
        rows=lambda crops: crops.movement[:, GREY_COLUMNS],
        model=forest,
        leaks="",
    ),
    Contender(
        name="control: trial's length",
        rows=lambda crops: _column(crops.length[crops.trial]),
        model=forest,
        leaks="slip trials are shorter",
    ),
    Contender(
        name="control: crop's first frame, 8×6 grey",
        rows=lambda crops: crops.first_frame,
        model=forest,
        leaks="grip and object before any movement; a slip may have begun",
    ),
    Contender(
        name="control: trial's first frame, 8×6 grey",
        rows=lambda crops: _trials_first_frame(crops),
        model=forest,
        leaks="grip and object before any movement",
    ),
    Contender(
        name="control: majority class",
        rows=lambda crops: _column(crops.place),
        model=lambda _: Majority(),
        leaks="",
    ),
)
"""What is judged; the first is ours."""


@dataclass(frozen=True, slots=True, kw_only=True)
class SlipScores:
    """Judgements pooled over the test folds; 0…1."""

    count: int
    accuracy: float
    accuracy_interval: tuple[float, float]
    """95 %, whole objects resampled."""
    balanced: float
    auc: float
    """NaN where a class is absent."""
    auc_interval: tuple[float, float]
    """95 %, whole objects resampled."""


@dataclass(frozen=True, slots=True, kw_only=True)
class SlipResult:
    """How one contender does on objects never seen."""

    name: str
    leaks: str
    crops: SlipScores
    places: tuple[SlipScores, ...]
    """One for each of `PLACES`: a crop of every trial."""
    trials: SlipScores
    """Mean over a trial's three crops."""


def judge_slips(
    crops: SlipCrops,
    folds: int,
    seed: int,
    contenders: Sequence[Contender] = CONTENDERS,
    on_step: Callable[[str], None] = lambda _: None,
) -> list[SlipResult]:
    """Judge contenders on objects that they have not seen.

    Args:
        crops: All trials' crops.
        folds: How many parts the objects are put in; each is held out once.
        seed: Seed of the folds and models.
        contenders: What to judge.
        on_step: Called with a line before each training.

    Raises:
        BadSplit: The objects cannot be put in so many parts with both outcomes to learn from.
    """
    parts = object_folds(crops, folds, seed)
    results = []
    for contender in contenders:
        rows = contender.rows(crops)
        slip = np.zeros(len(rows))
        for number, test in enumerate(parts, start=1):
            on_step(f"{contender.name}, fold {number}")
            model = contender.model(seed)
            model.fit(rows[~test], crops.y[~test])
            slip[test] = model.slip(rows[test])
        results.append(summarise_slips(contender, crops, slip))
    return results


def object_folds(crops: SlipCrops, folds: int, seed: int) -> list[NDArray[np.bool_]]:
    """Return each fold's test crops, shape (n,): all crops of some objects, each object once.

    Raises:
        BadSplit: Fewer than two folds or objects than folds, or a training part would hold
            one outcome only.
    """
    found = len(set(crops.objects.tolist()))
    if not 2 <= folds <= found:
        raise BadSplit(
            f"2 to {found} folds for {found} objects", str(folds), "choose another --fold-count"
        )
    counts = np.bincount(crops.slipped, minlength=2)
    if counts.min() < folds:
        raise BadSplit(
            f"at least {folds} trials of each outcome for {folds} folds",
            f"{counts[1]} that slipped and {counts[0]} that held",
            "choose a smaller --fold-count, or record more",
        )
    for attempt in range(_TRIES):
        splitter = StratifiedGroupKFold(folds, shuffle=True, random_state=seed + 1000 * attempt)
        trials = splitter.split(crops.slipped, crops.slipped, crops.objects)
        held = [np.asarray(np.isin(crops.trial, test)) for _, test in trials]
        if all(test.any() and len(set(crops.y[~test].tolist())) == 2 for test in held):
            return held
    raise BadSplit(
        "both outcomes in every training part",
        f"none of {_TRIES} ways to make {folds} folds gives that",
        "choose a smaller --fold-count, or record more objects",
    )


def summarise_slips(
    contender: Contender, crops: SlipCrops, slip: NDArray[np.float64]
) -> SlipResult:
    """Return the scores of probabilities of slip, shape (n,), one a crop."""
    places = [crops.place == number for number in range(len(PLACES))]
    per_trial = np.bincount(crops.trial, weights=slip) / np.bincount(crops.trial)
    return SlipResult(
        name=contender.name,
        leaks=contender.leaks,
        crops=score_slips(crops.y, slip, crops.groups),
        places=tuple(score_slips(crops.y[p], slip[p], crops.groups[p]) for p in places),
        trials=score_slips(crops.slipped, per_trial, crops.objects),
    )


def score_slips(
    y: NDArray[np.intp], slip: NDArray[np.float64], objects: NDArray[np.str_], seed: int = 0
) -> SlipScores:
    """Return scores of probabilities against 0 or 1; all of shape (n,)."""
    right = (slip >= 0.5) == (y == 1)
    recalls = [right[y == kind].mean() for kind in (0, 1) if (y == kind).any()]
    names, index = np.unique(objects, return_inverse=True)
    members = [np.flatnonzero(index == number) for number in range(len(names))]
    drawn = np.random.default_rng(seed).integers(0, len(names), (RESAMPLES, len(names)))
    accuracies, aucs = [], []
    for draw in drawn:
        chosen = np.concatenate([members[number] for number in draw])
        accuracies.append(right[chosen].mean())
        aucs.append(_auc(y[chosen], slip[chosen]))
    return SlipScores(
        count=len(y),
        accuracy=float(right.mean()),
        accuracy_interval=_interval(accuracies),
        balanced=float(np.mean(recalls)),
        auc=_auc(y, slip),
        auc_interval=_interval(aucs),
    )


def _auc(y: NDArray[np.intp], slip: NDArray[np.float64]) -> float:
    if len(np.unique(y)) < 2:
        return float("nan")
    return float(roc_auc_score(y, slip))


def _interval(values: Sequence[float]) -> tuple[float, float]:
    known = np.array(values)[np.isfinite(values)]
    if not len(known):
        return float("nan"), float("nan")
    low, high = np.percentile(known, (2.5, 97.5))
    return float(low), float(high)


def _column(values: NDArray[np.intp]) -> Rows:
    return np.asarray(values, np.float32)[:, None]


def _trials_first_frame(crops: SlipCrops) -> Rows:
    first = np.flatnonzero(crops.place == 0)
    of_trial = np.zeros(len(crops.slipped), np.intp)
    of_trial[crops.trial[first]] = first
    return crops.first_frame[of_trial[crops.trial]]
