"""Inner folds of a search, as jobs: learn from a part of a training side, score the rest of it.

The outer test side is in neither part. Inner folds hold out what the outer split holds out, as
when models are chosen (`training.choose.inner_folds`). Knows nothing about searches.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from taxel.evaluation.crossval import run_fold
from taxel.evaluation.fold_jobs import Opened, Source, opened_once
from taxel.evaluation.splits import TrialFold
from taxel.training.choose.inner_folds import (
    inner_folds,
    learned_from,
    tested_folds,
    what_is_held,
)
from taxel.training.fitting import Job
from taxel.training.recipes import Recipe


@dataclass(frozen=True, slots=True, kw_only=True)
class InnerJob:
    """One inner fold of one trial."""

    source: Source
    content: str
    recipe: Recipe
    """With the trial's settings."""
    outer: int | None
    """The outer fold on whose training side is searched; None searches on all trials."""
    inner: int


def folds_inside(opened: Opened, target: str, outer: int | None) -> list[TrialFold]:
    """Return the inner folds of an outer fold's training side, or of all trials.

    Raises:
        BadSplit: The outer split parts windows, or the side has too few trials.
    """
    split, trials = opened.split, opened.dataset.trials
    first = split.whole_trials("to search on", "choose group:KEY")[outer or 0]
    train = range(len(trials)) if outer is None else sorted(first.train)
    names = opened.dataset.classes(target)
    y = np.array([names.index(trial.labels[target]) for trial in trials], np.intp)
    held = what_is_held(trials, y, sorted(first.train), sorted(first.test), split.key)
    place, own = inner_folds(trials, y, train, held), np.asarray(train, np.intp)
    return [
        TrialFold(
            f"inner fold {number + 1}",
            frozenset(own[learned_from(place, number, ordered=held.ordered)].tolist()),
            frozenset(own[place == number].tolist()),
        )
        for number in tested_folds(place, ordered=held.ordered)
    ]


def inner_accuracy(job: InnerJob) -> float:
    """Return a trial's accuracy in one inner fold, 0…1; a job for any worker.

    Windows of classes that the fold does not learn from are not counted.
    """
    opened, recipe = opened_once(job.source, job.content), job.recipe
    fold = folds_inside(opened, recipe.target, job.outer)[job.inner]
    how = Job.of(recipe)
    result = run_fold(opened.dataset, fold, how, training=opened.training)
    labels = [trial.labels[recipe.target] for trial in opened.dataset.trials]
    names = opened.dataset.classes(recipe.target)
    learned = [names.index(name) for name in {labels[i] for i in fold.train}]
    counted = np.isin(result.y, learned)
    right = result.probabilities.argmax(axis=1) == result.y
    return float(right[counted].mean()) if counted.any() else float("nan")
