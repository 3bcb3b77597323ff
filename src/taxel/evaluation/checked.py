"""Cross-validate a recipe on a data set, with everything that must stand beside an accuracy.

Knows nothing about screens or pages.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np

from taxel.evaluation.baselines import trivial_accuracies
from taxel.evaluation.crossval import FoldPredictions, Pooled, curves_of, pool, predictions_of
from taxel.evaluation.fold_jobs import (
    FoldJob,
    Opened,
    Source,
    fit_fold,
    fold_of,
    open_source,
    travelling,
)
from taxel.evaluation.kept_folds import NOTHING_KEPT, FoldStore, KeptFolds, content_digest
from taxel.evaluation.splits import Split
from taxel.evaluation.table_split import OWN_SPLIT, GivenSplit
from taxel.jobs.running import as_done, shared_out
from taxel.plain_text import number_of
from taxel.training.curves import Curve
from taxel.training.environment import Provenance
from taxel.training.predictions import Predictions
from taxel.training.recipes import Recipe
from taxel.training.run import Run, contract_of
from taxel.windows.dataset import Dataset
from taxel.windows.scaling import Scaling

BARS = ("minirocket", "extra-trees")
"""Library models that every result is printed against."""


@dataclass(frozen=True, slots=True)
class Checked:
    """A cross-validation: the recipe's scores beside baselines on the same folds."""

    dataset: Dataset
    recipe: Recipe
    pooled: Pooled
    bars: dict[str, Pooled]
    """Library model → its result on the same windows and folds."""
    trivial: dict[str, float]
    """Trivial baseline → accuracy, 0…1."""
    predictions: Predictions
    """The recipe's own predictions for each test window."""
    curves: tuple[Curve, ...] = ()
    """How its network learned in each fold; none of a model without epochs."""
    kept: int = 0
    """Folds that were finished by a run that was interrupted."""
    cached: int = 0
    """Folds of library models that were fitted by an earlier call on the same data and split."""


def check_recipe(
    path: Path | str,
    recipe: Recipe,
    *,
    folds: int = 5,
    bars: tuple[str, ...] = BARS,
    given: GivenSplit = OWN_SPLIT,
    keep: FoldStore = NOTHING_KEPT,
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
    source = Source(path=Path(path), recipe=recipe, folds=folds, given=given)
    opened = open_source(source)
    dataset, split = opened.dataset, opened.split
    depends_on = {"recipe": asdict(recipe), "folds": folds, "data": dataset.digest,
                  "sides": sides_of(split)}  # fmt: skip
    stored_folds = KeptFolds(keep.folder, depends_on, dataset, recipe.target, fresh=keep.fresh)
    library = stored_folds
    if keep.cache is not None:
        library = _cached(keep.cache, recipe, folds, dataset, split, fresh=keep.fresh)
    models = {
        recipe.model: stored_folds,
        **{name: library for name in bars if name != recipe.model},
    }
    fitted = _fit_folds(opened, source, models, on_step)
    results = fitted.pop(recipe.model)
    beside = {name: pool(dataset, split, own, recipe.target) for name, own in fitted.items()}
    on_step("trivial baselines")
    return Checked(
        dataset=dataset,
        recipe=recipe,
        pooled=pool(dataset, split, results, recipe.target),
        bars=beside,
        trivial=trivial_accuracies(dataset, recipe.target, split.folds),
        predictions=predictions_of(dataset, split, results, recipe.target),
        curves=curves_of(results),
        kept=stored_folds.used,
        cached=0 if library is stored_folds else library.used,
    )


def _cached(
    cache: Path, recipe: Recipe, folds: int, dataset: Dataset, split: Split, *, fresh: bool
) -> KeptFolds:
    """Return where library models' folds are kept for this data set and split."""
    depends_on = {"seed": recipe.train.seed, "split": split.name, "folds": folds,
                  "sides": sides_of(split), "data": dataset.digest}  # fmt: skip
    return KeptFolds(cache / "comparators", depends_on, dataset, recipe.target, fresh=fresh,
                     shared=True)  # fmt: skip


def sides_of(split: Split) -> list[list[list[int]]]:
    """Return each fold's trials by side: train, validation, test; for folds of whole trials."""
    return [
        [sorted(side) for side in (fold.train, fold.validation, fold.test)]
        for fold in split.trial_folds
    ]


def _fit_folds(
    opened: Opened,
    source: Source,
    models: Mapping[str, KeptFolds],
    on_step: Callable[[str], None],
) -> dict[str, list[FoldPredictions]]:
    """Return each model's folds: those that are kept, and the rest fitted, side by side if asked.

    Args:
        opened: The data set with its folds.
        source: How a worker makes them again.
        models: Model → where its folds are kept.
        on_step: Called with a line before each fit; after it where folds are fitted side by side.
    """
    folds = opened.split.folds
    results = {(model, number): kept.find(model, number, fold)
               for model, kept in models.items() for number, fold in enumerate(folds)}  # fmt: skip
    missing = [place for place, result in results.items() if result is None]
    names = [f"{model} · {opened.split.name} · {folds[number].name}" for model, number in missing]
    if not shared_out():
        for (model, number), name in zip(missing, names, strict=True):
            on_step(name)
            result = fold_of(opened, source.recipe, model, number, watch=True)
            models[model].keep(model, number, result)
            results[model, number] = result
    else:
        on_step(f"{number_of(len(missing), 'fold')} side by side")
        content, source = content_digest(opened.dataset, source.recipe.target), travelling(source)
        jobs = [
            (FoldJob(source=source, content=content, recipe=source.recipe, model=model,
                     number=number, watch=True),)
            for model, number in missing
        ]  # fmt: skip
        for at, result in as_done(fit_fold, jobs, names=names):
            model, number = missing[at]
            on_step(names[at])
            models[model].keep(model, number, result)
            results[model, number] = result
    return {model: [_present(results[model, number]) for number in range(len(folds))]
            for model in models}  # fmt: skip


def _present(result: FoldPredictions | None) -> FoldPredictions:
    assert result is not None
    return result


def run_of_check(data: Path, checked: Checked) -> Run:
    """Return a cross-validation as a run without weights, to be compared and reported later.

    `save_run` can keep it and `load_run(…, weights=False)` gives it back; any model can stand in
    it, library baselines too, which have no weights.

    Args:
        data: The data set's path, as it was given.
        checked: Its cross-validation.
    """
    channels = len(checked.dataset.sensor.channels)
    unscaled = Scaling(
        kind="none", offset=np.zeros(channels, np.float32), factor=np.ones(channels, np.float32)
    )
    recipe, pooled = checked.recipe, checked.pooled
    accuracy = {pooled.split: pooled.scores.accuracy}
    return Run(
        networks=(),
        contract=contract_of(checked.dataset, recipe.target, recipe.model, (), unscaled, accuracy),
        train=recipe.train,
        history=(),
        data=str(data),
        predictions=checked.predictions,
        trivial=checked.trivial,
        curves=checked.curves,
        made=Provenance.now(),
    )
