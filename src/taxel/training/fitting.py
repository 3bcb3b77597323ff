"""Prepare windows and fit a model on them: for a fold, and for use.

Scaling is fitted on the windows that are learned from, and on nothing else. Knows nothing about
folds, recordings or screens.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from torch import nn

from taxel.models.catalogue import Baseline, find_model
from taxel.models.library import Estimator
from taxel.training.curves import Epoch
from taxel.training.loop import Checkpoint, Labelled, TrainConfig, fit, new_network, predict
from taxel.training.recipes import Recipe
from taxel.windows.dataset import Dataset
from taxel.windows.recut import recut
from taxel.windows.scaling import Scaling, ScalingKind, fit_scaling
from taxel.windows.windower import Windows


@dataclass(frozen=True, slots=True, kw_only=True)
class Job:
    """What to fit: a model by name, its target, and how."""

    model: str
    target: str
    train: TrainConfig = field(default_factory=TrainConfig)
    scaling: ScalingKind | None = None
    """None takes the model's own."""
    members: int = 1
    """Networks trained with different seeds whose probabilities are averaged."""

    @staticmethod
    def of(recipe: Recipe, model: str | None = None) -> Job:
        """Return what a recipe fits, or what another model of the same training is."""
        return Job(
            model=model or recipe.model, target=recipe.target,
            train=recipe.train, members=recipe.members,
        )  # fmt: skip


@dataclass(frozen=True, slots=True)
class TrainingSet:
    """Windows to learn from, with their classes."""

    windows: Windows
    """Unscaled, n of them."""
    y: NDArray[np.intp]
    """Class numbers, shape (n,)."""
    classes: int
    full_scale: float | None
    """The sensor's largest value, in its own unit; None where unknown."""

    @staticmethod
    def of(dataset: Dataset, target: str, index: NDArray[np.intp] | None = None) -> TrainingSet:
        """Return windows of a data set by their indices, shape (n,); all of them unless given."""
        windows, y = dataset.windows, dataset.class_numbers(target)
        if index is not None:
            windows, y = windows[index], y[index]
        return TrainingSet(windows, y, len(dataset.classes(target)), dataset.sensor.full_scale)


@dataclass(frozen=True, slots=True)
class Fitted:
    """A model with the scaling that was fitted beside it."""

    model: tuple[nn.Module, ...] | Estimator
    scaling: Scaling
    history: list[Epoch]
    """Of the last network; empty for a library's model."""

    @property
    def networks(self) -> tuple[nn.Module, ...]:
        """The networks; none where it is a library's model."""
        return self.model if isinstance(self.model, tuple) else ()

    def probabilities(
        self, values: NDArray[np.float32], mask: NDArray[np.bool_]
    ) -> NDArray[np.float64]:
        """Return class probabilities, shape (n, classes), of unscaled windows."""
        scaled = self.scaling.apply(values, mask)
        if isinstance(self.model, tuple):
            members = [predict(member, scaled, mask) for member in self.model]
            return np.asarray(np.mean(members, axis=0))
        return self.model.predict_proba(scaled, mask)


def fit_model(
    training: TrainingSet,
    job: Job,
    *,
    steps: int | None = None,
    validation: tuple[Windows, NDArray[np.intp]] | None = None,
    checkpoint: Callable[[int], Checkpoint] | None = None,
    on_epoch: Callable[[Epoch], None] | None = None,
) -> Fitted:
    """Fit a model on training windows.

    Args:
        training: The training side only.
        job: What to fit.
        steps: Rows that the network takes, where the training windows are longer.
        validation: Windows to watch while training, and their class numbers.
        checkpoint: Where the network of this number is kept while it is trained.
        on_epoch: Called after each epoch.

    Raises:
        BadInput: A checkpoint is damaged or of another configuration.
    """
    model, windows = find_model(job.model), training.windows
    kind = job.scaling or model.scaling
    if kind == "full-scale" and training.full_scale is None:
        kind = "standard"
    scaling = fit_scaling(kind, windows.values, windows.mask, training.full_scale)
    data = Labelled(scaling.apply(windows.values, windows.mask), windows.mask, training.y)
    if isinstance(model, Baseline):
        return Fitted(_fitted_library(model, data, training.classes, job.train.seed), scaling, [])
    rows, channels = steps or data.values.shape[1], data.values.shape[2]
    watched = None
    if validation is not None:
        held_out, own_y = validation
        watched = Labelled(scaling.apply(held_out.values, held_out.mask), held_out.mask, own_y)
    networks: list[nn.Module] = []
    history: list[Epoch] = []
    for member in range(job.members):
        config = replace(job.train, seed=job.train.seed + member)
        network = new_network(lambda: model.build(rows, channels, training.classes), config.seed)
        history = fit(
            network,
            data,
            config,
            steps=rows,
            validation=watched,
            checkpoint=checkpoint(member) if checkpoint is not None else None,
            on_epoch=on_epoch,
        )
        networks.append(network)
    return Fitted(tuple(networks), scaling, history)


def _fitted_library(model: Baseline, data: Labelled, classes: int, seed: int) -> Estimator:
    """Return a library's model, fitted; a class without a training window has probability 0."""
    present = np.unique(data.y)
    estimator = model.build(seed)
    estimator.fit(data.values, data.mask, np.searchsorted(present, data.y))
    return estimator if len(present) == classes else _OfSomeClasses(estimator, present, classes)


@dataclass(frozen=True, slots=True)
class _OfSomeClasses:
    """A library's model that has seen some of the classes only: it numbers those it has seen."""

    seen: Estimator
    present: NDArray[np.intp]
    """Class numbers of its columns, ascending."""
    classes: int

    def fit(
        self, values: NDArray[np.float32], mask: NDArray[np.bool_], y: NDArray[np.intp]
    ) -> None:
        self.seen.fit(values, mask, y)

    def predict_proba(
        self, values: NDArray[np.float32], mask: NDArray[np.bool_]
    ) -> NDArray[np.float64]:
        found = np.zeros((len(values), self.classes))
        found[:, self.present] = self.seen.predict_proba(values, mask)
        return found


def training_windows(path: Path, dataset: Dataset, recipe: Recipe) -> Dataset:
    """Return the same trials cut as a recipe trains on them: with its own stride and rows.

    Args:
        path: Where `dataset` was loaded from.
        dataset: Windows of the recipe's window.
        recipe: What says so; without a stride of its own the data set is returned as it is.
    """
    if recipe.train_stride is None:
        return dataset
    return recut(path, dataset, recipe.train_stride, recipe.train_steps or recipe.window.steps)
