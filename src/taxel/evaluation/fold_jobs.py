"""A fold of a cross-validation as a job: paths and a configuration in, predictions out.

A worker reads the recordings itself, once for all of its folds, and refuses where they are not
those that were parted into folds. Knows nothing about engines, or what is kept.

Source: docs/decisions/0050.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path

from taxel.errors import BadDataset
from taxel.evaluation.crossval import FoldPredictions, run_fold
from taxel.evaluation.kept_folds import content_digest
from taxel.evaluation.splits import Split, WindowFold
from taxel.evaluation.table_split import GivenSplit, split_elsewhere
from taxel.evaluation.usual_split import recipe_split
from taxel.training.final import check_gate
from taxel.training.fitting import Job, training_windows
from taxel.training.recipes import Recipe
from taxel.windows.dataset import Dataset, load_dataset


@dataclass(frozen=True, slots=True, kw_only=True)
class Source:
    """Which windows and folds: everything a worker needs to make them again."""

    path: Path
    """A folder of recordings."""
    recipe: Recipe
    folds: int
    given: GivenSplit
    """A split that came from elsewhere, in place of the recipe's own."""


@dataclass(frozen=True, slots=True)
class Opened:
    """A data set with its folds."""

    dataset: Dataset
    split: Split
    training: Dataset | None
    """The same trials cut with the recipe's training stride; None where it has none."""


@dataclass(frozen=True, slots=True, kw_only=True)
class FoldJob:
    """One fold of one model."""

    source: Source
    content: str
    """Digest of windows and labels that the worker must find, too."""
    recipe: Recipe
    """How to train: the source's, or another with the same window and target."""
    model: str
    """The recipe's own, or a library model's name."""
    number: int
    """Which fold, 0 for the first."""
    watch: bool = False
    """Whether some test windows are looked at after each epoch, for a curve."""


def open_source(source: Source) -> Opened:
    """Read the recordings, cut them and part them.

    Raises:
        BadDataset: The recordings do not make such a data set.
        BadSplit: They cannot be split so.
        BadTable: The table of folds cannot be used.
    """
    recipe = source.recipe
    dataset = load_dataset(source.path, recipe.window, target=recipe.target)
    check_gate(dataset, own=recipe.own_gate)
    if source.given:
        dataset, split = split_elsewhere(source.path, dataset, recipe.target, source.given)
    else:
        split = recipe_split(recipe.split, dataset, recipe.target, source.folds, recipe.train.seed)
        dataset = replace(dataset, notes=(*dataset.notes, *split.notes))
    overlaps = recipe.train_stride is not None and not isinstance(split.folds[0], WindowFold)
    training = training_windows(source.path, dataset, recipe) if overlaps else None
    return Opened(dataset, split, training)


def travelling(source: Source) -> Source:
    """Return a source that means the same in another process's folder."""
    given = source.given
    table, test = (path and path.absolute() for path in (given.table, given.test))
    return replace(
        source, path=source.path.absolute(), given=replace(given, table=table, test=test)
    )


def fit_fold(job: FoldJob) -> FoldPredictions:
    """Fit a model on a fold's training part and predict its test part; a job for any worker.

    Raises:
        BadDataset: The recordings are not those that were parted.
    """
    opened = opened_once(job.source, job.content)
    result = fold_of(opened, job.recipe, job.model, job.number, watch=job.watch)
    return FoldPredictions(
        result.name, result.test, result.y, result.probabilities, history=result.history
    )


def fold_of(
    opened: Opened, recipe: Recipe, model: str, number: int, *, watch: bool = False
) -> FoldPredictions:
    """Fit a model on one fold of an open data set and predict its test part; watch it there."""
    job = Job.of(recipe, model)
    training = opened.training if model == recipe.model else None
    return run_fold(opened.dataset, opened.split.folds[number], job, training=training, watch=watch)


@lru_cache(maxsize=2)
def opened_once(source: Source, content: str) -> Opened:
    """Read recordings that must be those of `content`; once for all jobs of a worker.

    Raises:
        BadDataset: They are others.
    """
    opened = open_source(source)
    if content_digest(opened.dataset, source.recipe.target) != content:
        raise BadDataset(
            f"the recordings that were parted into folds in {source.path}", "others",
            "let all workers read the same folder, and leave it as it is meanwhile",
        )  # fmt: skip
    return opened
