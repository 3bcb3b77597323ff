"""A recipe's settings searched inside each outer fold, and once on all trials for use.

The outer score is of the search, not of the settings that it ends with: no trial of an outer
fold's search has seen that fold's test side. What is trained in the end comes from a search of its
own on all trials. Knows nothing about screens or folders of runs.

Source: Cawley and Talbot, "On over-fitting in model selection", JMLR 2010; docs/decisions/0050.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from taxel.evaluation.baselines import trivial_accuracies
from taxel.evaluation.crossval import FoldPredictions, Pooled, pool, predictions_of
from taxel.evaluation.fold_jobs import FoldJob, Opened, Source, fit_fold, open_source, travelling
from taxel.evaluation.kept_folds import content_digest
from taxel.evaluation.table_split import OWN_SPLIT
from taxel.evaluation.tune.inner import InnerJob, folds_inside, inner_accuracy
from taxel.evaluation.tune.space import Space
from taxel.evaluation.tune.study import BestSettings, Search, Store
from taxel.jobs.call import code_digest
from taxel.jobs.running import as_done
from taxel.training.predictions import Predictions
from taxel.training.recipes import Recipe
from taxel.windows.dataset import Dataset


@dataclass(frozen=True, slots=True, kw_only=True)
class Outer:
    """The nested score: every fold predicted with settings found without it."""

    tuned: Pooled
    as_is: Pooled
    """The recipe as it is, on the same folds."""
    found: tuple[BestSettings, ...]
    """One an outer fold."""
    predictions: Predictions
    trivial: dict[str, float]


@dataclass(frozen=True, slots=True, kw_only=True)
class Tuned:
    """What a tune found."""

    dataset: Dataset
    recipe: Recipe
    """With the settings found on all trials."""
    found: BestSettings
    outer: Outer | None
    """None where no outer score was asked for."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Extent:
    """Size of a nested search: trials, outer folds, and whether it is scored."""

    trials: int
    """Finished trials of each search."""
    folds: int = 5
    """Outer folds."""
    nested: bool = True
    """False leaves the outer score out."""


def tune(
    store: Store,
    path: Path,
    recipe: Recipe,
    space: Space,
    extent: Extent,
    *,
    on_step: Callable[[str], None] = lambda _: None,
) -> Tuned:
    """Search a recipe's settings.

    Args:
        store: Where trials are kept.
        path: A folder of recordings.
        recipe: Where the search starts; window, target and split stay.
        space: What is searched.
        extent: How much is searched and judged.
        on_step: Called with a line after each trial and outer fold.

    Raises:
        BadDataset: The recordings do not make such a data set.
        BadSplit: They cannot be split so, or not into inner folds.
        BadInput: A setting or network does not exist.
    """
    space.check()
    source = travelling(Source(path=path, recipe=recipe, folds=extent.folds, given=OWN_SPLIT))
    opened = open_source(source)
    content = content_digest(opened.dataset, recipe.target)
    work = _Work(store, source, content, opened, space, extent.trials)
    outer = _outer(work, on_step) if extent.nested else None
    best = work.search(None, on_step)
    return Tuned(
        dataset=opened.dataset,
        recipe=space.apply(recipe, best.values),
        found=best,
        outer=outer,
    )


@dataclass(frozen=True, slots=True)
class _Work:
    store: Store
    source: Source
    content: str
    opened: Opened
    space: Space
    trials: int

    def search(self, outer: int | None, on_step: Callable[[str], None]) -> BestSettings:
        """Search on an outer fold's training side, or on all trials."""
        recipe = self.source.recipe

        def job(values: dict[str, Any], inner: int) -> InnerJob:
            tried = self.space.apply(recipe, values)
            return InnerJob(source=self.source, content=self.content, recipe=tried, outer=outer,
                            inner=inner)  # fmt: skip

        what = Search(
            name=f"{'all' if outer is None else f'fold-{outer + 1}'}-{self._key()[:12]}",
            trials=self.trials,
            folds=len(folds_inside(self.opened, recipe.target, outer)),
            seed=recipe.train.seed + (0 if outer is None else outer + 1),
            propose=self.space.propose,
            work=inner_accuracy,
            job=job,
        )
        return self.store.search(what, on_step)

    def _key(self) -> str:
        """Return what all scores depend on, but for the settings, as a digest."""
        about = {"content": self.content, "recipe": asdict(self.source.recipe),
                 "folds": self.source.folds, "space": asdict(self.space),
                 "code": code_digest()}  # fmt: skip
        text = json.dumps(about, sort_keys=True, default=str)
        return hashlib.sha256(text.encode()).hexdigest()


def _outer(work: _Work, on_step: Callable[[str], None]) -> Outer:
    dataset, split, recipe = work.opened.dataset, work.opened.split, work.source.recipe
    numbers = range(len(split.folds))
    found = [work.search(number, on_step) for number in numbers]
    recipes = [work.space.apply(recipe, own.values) for own in found]
    as_is = work.space.apply(recipe, {})
    tuned = _fitted(work, recipes, "tuned", on_step)
    plain = _fitted(work, [as_is for _ in numbers], "as it is", on_step)
    return Outer(
        tuned=pool(dataset, split, tuned, recipe.target),
        as_is=pool(dataset, split, plain, recipe.target),
        found=tuple(found),
        predictions=predictions_of(dataset, split, tuned, recipe.target),
        trivial=trivial_accuracies(dataset, recipe.target, split.folds),
    )


def _fitted(
    work: _Work, recipes: list[Recipe], what: str, on_step: Callable[[str], None]
) -> list[FoldPredictions]:
    """Fit each outer fold's training side with its own recipe and predict its test side."""
    names = [f"{what} · {fold.name}" for fold in work.opened.split.folds]
    jobs = [
        (FoldJob(source=work.source, content=work.content, recipe=own, model=own.model,
                 number=number),)
        for number, own in enumerate(recipes)
    ]  # fmt: skip
    found: dict[int, FoldPredictions] = {}
    for number, result in as_done(fit_fold, jobs, names=names):
        on_step(names[number])
        found[number] = result
    return [found[number] for number in range(len(jobs))]
