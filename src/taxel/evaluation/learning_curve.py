"""Accuracy against the amount of data: the same test parts, more and more groups to learn from.

Each fold's training part is given group by group, whole groups only, each amount holding the one
before (nested), in an order drawn by a seed. Beside each amount stand baselines that learned from
the same groups. Knows nothing about screens or pages.

Background of our choices: docs/decisions/0046.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from taxel.errors import BadSplit
from taxel.evaluation.baselines import trivial_accuracies
from taxel.evaluation.crossval import FoldPredictions, pool, run_fold
from taxel.evaluation.splits import Split, TrialFold
from taxel.evaluation.usual_split import recipe_split
from taxel.labels.trials import coarsest_group
from taxel.plain_text import several
from taxel.training.final import check_gate
from taxel.training.fitting import Job, training_windows
from taxel.training.recipes import Recipe
from taxel.windows.dataset import Dataset, load_dataset


@dataclass(frozen=True, slots=True, kw_only=True)
class Amount:
    """One point of a learning curve: the accuracy with so many training groups."""

    groups: int
    """Whole groups in each training part: the median over folds where they differ."""
    windows: int
    """Training windows, mean over folds."""
    accuracy: float
    """Over all test windows, 0…1."""
    low: float
    """95 % of the accuracy, whole test groups drawn again, 0…1; NaN with one group."""
    high: float
    fold_accuracies: tuple[float, ...]
    trivial: dict[str, float]
    """Baseline that learned from the same groups → accuracy, 0…1."""


@dataclass(frozen=True, slots=True, kw_only=True)
class LearningCurve:
    """Accuracy against amount of data."""

    target: str
    model: str
    split: str
    group: str
    """What was given whole."""
    seed: int
    """Of the order in which groups were given."""
    amounts: tuple[Amount, ...]


def learning_curve(
    path: Path,
    recipe: Recipe,
    *,
    folds: int = 5,
    steps: int = 6,
    on_step: Callable[[str], None] = lambda _: None,
) -> LearningCurve:
    """Measure a recipe on more and more groups, trained as it is in a cross-validation.

    Args:
        path: A folder of recordings.
        recipe: Window, model, target, split and training; its seed also draws the order.
        folds: How many folds.
        steps: How many amounts, the whole training part being the last.
        on_step: Called with a line before each fit.

    Raises:
        BadDataset: The recordings do not make such a data set.
        BadSplit: They cannot be split so, not into whole trials, or a training part has
            fewer than two groups.
    """
    dataset = load_dataset(path, recipe.window, target=recipe.target)
    check_gate(dataset, own=recipe.own_gate)
    split = recipe_split(recipe.split, dataset, recipe.target, folds, recipe.train.seed)
    key = coarsest_group(dataset.trials, split.name)
    whole = split.whole_trials("to take some away", "choose another with --split group:KEY")
    orders = [_order(dataset, fold, key, recipe) for fold in whole]
    most = max(map(len, orders))
    if most < 2:
        raise BadSplit(
            f"at least two {several(key)} to learn from in a fold", f"{most}",
            f"record more {several(key)}, or choose another split",
        )  # fmt: skip
    job, training = Job.of(recipe), training_windows(path, dataset, recipe)
    amounts = []
    for share in shares(most, steps):
        part = given(dataset, split, orders, share / most, key)
        on_step(f"{recipe.model} · {share} of {most} {several(key)}")
        results = [run_fold(dataset, fold, job, training=training) for fold in part.folds]
        windows = [len(fold.windows(training)[0]) for fold in part.folds]
        amounts.append(_amount(dataset, part, results, windows, recipe.target, key))
    return LearningCurve(
        target=recipe.target, model=recipe.model, split=split.name, group=key,
        seed=recipe.train.seed, amounts=tuple(amounts),
    )  # fmt: skip


def shares(most: int, steps: int) -> list[int]:
    """Return how many groups are given at each amount: from 1 to all, in even ratios."""
    found = np.geomspace(1, most, min(steps, most))
    return sorted({round(float(value)) for value in found})


def given(
    dataset: Dataset, split: Split, orders: Sequence[Sequence[str]], share: float, key: str
) -> Split:
    """Return the split with a share of each fold's training groups, its test parts as they are.

    Args:
        dataset: The windows and their trials.
        split: Folds of whole trials.
        orders: For each fold the training groups, in the order in which they are given.
        share: Of the groups, above 0 to 1; at least one is given.
        key: What is given whole.
    """
    names = dataset.group(key)
    folds = []
    for fold, order in zip(split.trial_folds, orders, strict=True):
        count = max(1, round(share * len(order)))
        kept = frozenset(t for t in fold.train if names[t] in order[:count])
        folds.append(TrialFold(fold.name, kept, fold.test, fold.validation))
    return replace(split, folds=tuple(folds))


def _order(dataset: Dataset, fold: TrialFold, key: str, recipe: Recipe) -> list[str]:
    """Return a fold's training groups in an order of its own, drawn by the recipe's seed."""
    names = sorted({str(dataset.group(key)[trial]) for trial in fold.train})
    random = np.random.default_rng([recipe.train.seed, *fold.name.encode()])
    return [names[i] for i in random.permutation(len(names))]


def _amount(
    dataset: Dataset,
    part: Split,
    results: Sequence[FoldPredictions],
    windows: Sequence[int],
    target: str,
    key: str,
) -> Amount:
    """Return one point, `windows` being those that each fold learned from."""
    names = dataset.group(key)
    groups = [len({names[t] for t in fold.train}) for fold in part.trial_folds]
    pooled = pool(dataset, part, results)
    return Amount(
        groups=round(float(np.median(groups))),
        windows=round(float(np.mean(windows))),
        accuracy=pooled.scores.accuracy,
        low=pooled.interval[0],
        high=pooled.interval[1],
        fold_accuracies=pooled.fold_accuracies,
        trivial=trivial_accuracies(dataset, target, part.folds),
    )
