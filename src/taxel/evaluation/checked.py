"""Cross-validate a recipe on a data set, with everything that must stand beside an accuracy.

Knows nothing about screens or pages.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import asdict, dataclass
from pathlib import Path

from taxel.evaluation.baselines import trivial_accuracies
from taxel.evaluation.crossval import (
    FoldPredictions,
    Pooled,
    pool,
    predictions_of,
    run_fold,
)
from taxel.evaluation.kept_folds import NOTHING_KEPT, Keeping, KeptFolds
from taxel.evaluation.splits import Split, TrialFold, WindowFold, parse_split
from taxel.evaluation.table_split import OWN_SPLIT, Elsewhere, split_elsewhere
from taxel.training.final import check_gate
from taxel.training.fitting import Job, training_windows
from taxel.training.predictions import Predictions
from taxel.training.recipes import Recipe
from taxel.windows.dataset import Dataset, load_dataset

BARS = ("minirocket", "extra-trees")
"""Library models that every result is printed against."""


@dataclass(frozen=True, slots=True)
class Checked:
    """An accuracy with its company."""

    dataset: Dataset
    recipe: Recipe
    pooled: Pooled
    bars: dict[str, Pooled]
    """Library model → its result on the same windows and folds."""
    trivial: dict[str, float]
    """Trivial baseline → accuracy, 0…1."""
    predictions: Predictions
    """What the recipe's own model said of each test window."""
    kept: int = 0
    """Folds that were finished by a run that was broken off."""
    cached: int = 0
    """Folds of library models that were fitted by an earlier call on the same data and split."""


def check_recipe(
    path: Path,
    recipe: Recipe,
    *,
    folds: int = 5,
    bars: tuple[str, ...] = BARS,
    given: Elsewhere = OWN_SPLIT,
    keep: Keeping = NOTHING_KEPT,
    on_step: Callable[[str], None] = lambda _: None,
) -> Checked:
    """Cross-validate a recipe.

    Args:
        path: A folder of recordings.
        recipe: Window, model, target, split and training.
        folds: How many folds.
        bars: Library models to print beside.
        given: A split that came from elsewhere, in place of the recipe's own.
        keep: Where finished folds are kept; those that are there already are not fitted again
            where recipe, data and software are the same.
        on_step: Called with a line before each fit.

    Raises:
        BadDataset: The recordings do not make such a data set.
        BadSplit: They cannot be split so.
        BadTable: The table of folds cannot be used.
        RecordingFailed: The disk refused a fold.
    """
    dataset = load_dataset(path, recipe.window, target=recipe.target)
    check_gate(dataset)
    if given:
        dataset, split = split_elsewhere(path, dataset, recipe.target, given)
    else:
        split = parse_split(recipe.split, dataset, recipe.target, folds, recipe.train.seed)
    overlaps = recipe.train_stride is not None and not isinstance(split.folds[0], WindowFold)
    training = training_windows(path, dataset, recipe) if overlaps else None
    depends_on = {"recipe": asdict(recipe), "folds": folds, "data": dataset.digest,
                  "sides": sides_of(split) if given else None}  # fmt: skip
    kept = KeptFolds(keep.folder, depends_on, dataset, recipe.target, fresh=keep.fresh)
    job = Job.of(recipe)
    results = _results(dataset, split, job, training, kept, on_step)
    library = kept
    if keep.cache is not None:
        library = _cached(keep.cache, recipe, folds, dataset, split, fresh=keep.fresh)
    beside = {
        name: pool(
            dataset,
            split,
            _results(dataset, split, Job.of(recipe, name), None, library, on_step),
            recipe.target,
        )
        for name in bars
        if name != recipe.model
    }
    on_step("trivial baselines")
    return Checked(
        dataset=dataset,
        recipe=recipe,
        pooled=pool(dataset, split, results, recipe.target),
        bars=beside,
        trivial=trivial_accuracies(dataset, recipe.target, split.folds),
        predictions=predictions_of(dataset, split, results, recipe.target),
        kept=kept.used,
        cached=0 if library is kept else library.used,
    )


def _cached(
    cache: Path, recipe: Recipe, folds: int, dataset: Dataset, split: Split, *, fresh: bool
) -> KeptFolds:
    """Return where library models' folds are kept for this data set and split."""
    depends_on = {"seed": recipe.train.seed, "split": [recipe.split, split.name], "folds": folds,
                  "sides": sides_of(split), "data": dataset.digest}  # fmt: skip
    return KeptFolds(cache / "comparators", depends_on, dataset, recipe.target, fresh=fresh,
                     shared=True)  # fmt: skip


def sides_of(split: Split) -> list[list[list[int]]]:
    """Return each fold's trials by side: train, validation, test; for folds of whole trials."""
    return [
        [sorted(side) for side in (fold.train, fold.validation, fold.test)]
        for fold in split.folds if isinstance(fold, TrialFold)
    ]  # fmt: skip


def _results(
    dataset: Dataset,
    split: Split,
    job: Job,
    training: Dataset | None,
    kept: KeptFolds,
    on_step: Callable[[str], None],
) -> list[FoldPredictions]:
    results = []
    for number, fold in enumerate(split.folds):
        on_step(f"{job.model} · {split.name} · {fold.name}")
        result = kept.find(job.model, number, fold)
        if result is None:
            result = run_fold(dataset, fold, job, training=training)
            kept.keep(job.model, number, result)
        results.append(result)
    return results
