"""Fit a model on one side of a fold and score it on the other.

Scaling is fitted on the training windows of the fold only. Knows nothing about
tables or pages.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from taxel.decisions.recognition import at_limit
from taxel.errors import BadInput, BadSplit
from taxel.evaluation.metrics import Scores, accuracy_interval, by_trial, score
from taxel.evaluation.part_scores import Parts, score_parts
from taxel.evaluation.splits import Fold, Split, TrialFold
from taxel.labels.trials import coarsest_group, lone_group
from taxel.training.curves import Curve, Epoch, thinned
from taxel.training.fitting import Fitted, Job, TrainingSet, fit_model
from taxel.training.predictions import Predictions
from taxel.windows.dataset import Dataset
from taxel.windows.windower import Windows


@dataclass(frozen=True, slots=True)
class FoldPredictions:
    """One fold's test predictions."""

    name: str
    test: NDArray[np.intp]
    """Shape (m,): test windows' indices."""
    y: NDArray[np.intp]
    """Shape (m,)."""
    probabilities: NDArray[np.float64]
    """Shape (m, classes)."""
    history: tuple[Epoch, ...] = field(default=(), kw_only=True)
    """How the last network learned, some test windows watched; none of a library's model."""

    @property
    def scores(self) -> Scores:
        """The scores of these predictions, computed each time."""
        return score(self.y, self.probabilities)


@dataclass(frozen=True, slots=True)
class FoldResult(FoldPredictions):
    """One fold's test predictions, with what was fitted for them."""

    fitted: Fitted


def run_fold(
    dataset: Dataset,
    fold: Fold,
    job: Job,
    *,
    training: Dataset | None = None,
    watch: bool = False,
) -> FoldResult:
    """Fit on a fold's training part and predict its test part.

    Args:
        dataset: Windows to test on, and to train on unless `training` is given.
        fold: Which trials or windows are on which side.
        job: What to fit.
        training: The same trials cut with a shorter stride; needs a `TrialFold`.
        watch: Look at some test windows after each epoch, for a curve: nothing is chosen by them,
            and the last epoch's network is kept, whatever they say.

    Raises:
        BadDataset: A trial lacks the label.
        BadSplit: A side has no windows.
        ValueError: `training` is given for a fold of single windows.
    """
    y = dataset.class_numbers(job.target)
    train, test = fold.windows(dataset)
    source = dataset
    if training is not None:
        if not isinstance(fold, TrialFold):
            raise ValueError("needed a fold of whole trials for overlapping windows; got windows")
        train, _ = fold.windows(training)
        source = training
    if not len(train) or not len(test):
        raise BadSplit(
            f"windows on both sides of {fold.name}", f"{len(train)} to train on and {len(test)} to "
            "test", "name trials of this data set on each side",
        )  # fmt: skip
    fitted = fit_model(
        replace(
            TrainingSet.of(source, job.target, train), classes=len(dataset.classes(job.target))
        ),
        job,
        steps=dataset.config.steps,
        validation=_watched(dataset, fold, y, test if watch else None),
    )
    windows = dataset.tested(test)
    probabilities = fitted.probabilities(windows.values, windows.mask)
    return FoldResult(
        fold.name, test, y[test], probabilities, fitted, history=tuple(fitted.history)
    )


def _watched(
    dataset: Dataset, fold: Fold, y: NDArray[np.intp], test: NDArray[np.intp] | None
) -> tuple[Windows, NDArray[np.intp]] | None:
    """Return the windows that a fold sets aside to choose by, else some of those to be tested on;
    None where it has none, or none are to be watched.
    """
    index = np.zeros(0, np.intp) if test is None else test[thinned(len(test))]
    if isinstance(fold, TrialFold) and fold.validation:
        index = fold.validation_windows(dataset)
    return (dataset.tested(index), y[index]) if len(index) else None


@dataclass(frozen=True, slots=True)
class Pooled:
    """The test predictions of all folds together."""

    split: str
    scores: Scores
    interval: tuple[float, float]
    """95 % interval of the accuracy by resampling groups; NaN where there is one only."""
    interval_group: str
    """The group that was resampled: the coarsest, or what the split holds out."""
    interval_groups: int
    """How many there are."""
    trial_accuracy: float
    """Share of trials predicted correctly when a trial's windows are joined, 0…1."""
    fold_accuracies: tuple[float, ...]
    windows: int
    """Test windows of all folds."""
    trials: int
    """Tested trials."""
    trial_majority: float
    """Share of the commonest class among them, 0…1: the best single answer by trial."""
    lone: str | None = None
    """The group of which one value only was tested, such as the session; None where there is no
    such group."""
    parts: Parts | None = None
    """The same by class and by group; None where it was not asked for."""


def pool(
    dataset: Dataset, split: Split, results: Sequence[FoldPredictions], target: str | None = None
) -> Pooled:
    """Join the folds' test predictions; part by part where the target is named.

    Raises:
        BadInput: There are none.
    """
    results = tuple(results)
    if not results:
        raise BadInput("the predictions of at least one fold", "none", "run run_fold on the folds")
    y = np.concatenate([result.y for result in results])
    probabilities = np.concatenate([result.probabilities for result in results])
    test = np.concatenate([result.test for result in results])
    trial = dataset.trial[test]
    key = coarsest_group(dataset.trials, split.name)
    groups = dataset.group(key)[trial]
    correct = probabilities.argmax(axis=1) == y
    numbers, trial_y, joined = by_trial(trial, y, probabilities)
    tested = [dataset.trials[number] for number in numbers.tolist()]
    trial_right = np.asarray(joined.argmax(axis=1) == trial_y)
    return Pooled(
        split=split.name,
        scores=score(y, probabilities),
        interval=accuracy_interval(correct, groups),
        interval_group=key,
        interval_groups=len(np.unique(groups)),
        trial_accuracy=float(trial_right.mean()),
        fold_accuracies=tuple(result.scores.accuracy for result in results),
        windows=len(y),
        trials=len(numbers),
        trial_majority=float(np.bincount(trial_y).max() / len(numbers)),
        lone=lone_group(tested, split.name),
        parts=None if target is None else
        score_parts(dataset.trials, target, trial, correct, numbers, trial_right),
    )  # fmt: skip


def curves_of(results: Sequence[FoldPredictions]) -> tuple[Curve, ...]:
    """Return how each fold's network learned; none of models without epochs."""
    return tuple(
        Curve(result.name, result.history) for result in results if len(result.history) > 1
    )


def predictions_of(
    dataset: Dataset, split: Split, results: Sequence[FoldPredictions], target: str
) -> Predictions:
    """Return the folds' test predictions with the trials that they belong to, for a run."""
    test = np.concatenate([result.test for result in results])
    trained = [
        np.bincount(dataset.trial[fold.windows(dataset)[0]], minlength=len(dataset.trials))
        for fold in split.folds
    ]
    return Predictions(
        split=split.name,
        classes=tuple(dataset.classes(target)),
        trials=dataset.trials,
        folds=tuple(result.name for result in results),
        trained=np.array(trained, np.intp),
        trial=dataset.trial[test],
        start_s=dataset.windows.start_s[test],
        fold=np.repeat(np.arange(len(results)), [len(result.test) for result in results]),
        y=np.concatenate([result.y for result in results]),
        probabilities=np.concatenate([result.probabilities for result in results]),
        at_limit=at_limit(dataset.windows)[test],
    )
