"""What the studies of adapting share: a run trained on all sessions but one, and that session.

Each session of each data set is held out once, in a process of its own. Knows nothing about what
is then learned from it, or about screens.

Background of our choices: docs/decisions/0028.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from taxel.errors import BadDataset
from taxel.jobs.running import side_by_side
from taxel.training.exemplars import Exemplars, all_exemplars, thin_out
from taxel.training.fitting import Fitted, Job, TrainingSet, fit_model
from taxel.training.recipes import Recipe, find_recipe
from taxel.training.run import Run, contract_of
from taxel.windows.dataset import Dataset, load_dataset
from taxel.windows.windower import Windows

_Point = TypeVar("_Point")
CHOSEN = "taxel adapt"
BODY = "body's features, shared covariance"
STATISTICS = "with channels' statistics, shared covariance"
SOFTMAX = "last layer alone, softmax (thesis)"
NEAREST = "nearest class mean"
ALL_LAYERS = "all layers, rehearsing"
METHODS = (CHOSEN, BODY, STATISTICS, SOFTMAX, NEAREST, ALL_LAYERS)
GRASPS = (1, 2, 5, 10, 20)
"""Grasps of the new class. Source: our choice, docs/decisions/0028."""


@dataclass(frozen=True, slots=True, kw_only=True)
class AdaptConfig:
    """What to measure."""

    recipe: Recipe
    targets: tuple[str, ...] = ("shape", "material")
    grasps: tuple[int, ...] = GRASPS
    methods: tuple[str, ...] = METHODS
    """All are measured at five grasps; `CHOSEN` at each number."""
    new_classes: tuple[str, ...] = ()
    """Only these are learned anew; each class in turn unless given."""
    sessions: int | None = None
    """How many sessions to hold out, one at a time; all unless given."""
    workers: int | None = None


def default_config() -> AdaptConfig:
    """Return what the reported figures are measured with."""
    return AdaptConfig(recipe=find_recipe("teng-referenced"))


def by_session(
    work: Callable[[Path, AdaptConfig, str, str], list[_Point]],
    paths: Sequence[Path],
    config: AdaptConfig,
    what: str,
    on_step: Callable[[str], None],
    classes: int = 2,
) -> list[_Point]:
    """Return the points of all sessions, each held out once, in a process of its own.

    Args:
        work: Returns the points of a data set, a target and the session held out.
        paths: The data sets.
        config: What to measure.
        what: Said to `on_step` after each session.
        on_step: Called with a line.
        classes: How many a target must have.

    Raises:
        BadDataset: A data set has fewer than two sessions, or a target fewer classes.
    """
    jobs = []
    for path in paths:
        for target in config.targets:
            dataset = load_dataset(path, config.recipe.window, target=target)
            names = sorted(set(dataset.group("session")))
            if len(names) < 2 or len(dataset.classes(target)) < classes:
                raise BadDataset(
                    f"two sessions, to hold one out, and {classes} classes of {target}",
                    f"{len(names)} and {len(dataset.classes(target))} in {path}",
                    "record more",
                )
            jobs += [(path, config, target, name) for name in names[: config.sessions]]

    def report(points: list[Any]) -> None:
        on_step(f"{what} · {points[0].target} · {points[0].session} held out")

    by_job = side_by_side(work, jobs, report, config.workers)
    return [point for points in by_job for point in points]


@dataclass(frozen=True, slots=True)
class HeldSession:
    """A data set of which one session is held out."""

    dataset: Dataset
    classes: Sequence[str]
    """Of the target, sorted."""
    train: Exemplars
    """Windows of all other sessions."""
    windows: Exemplars
    """Those of the session."""
    number: int
    """Of the session among all, sorted, from 0: the seed of what is drawn for it."""


def hold_out(path: Path, config: AdaptConfig, target: str, session: str) -> HeldSession:
    """Return a data set with one session held out.

    Raises:
        BadDataset: The recordings do not make such a data set.
    """
    dataset = load_dataset(path, config.recipe.window, target=target)
    classes = dataset.classes(target)
    everything = all_exemplars(dataset, classes, target)
    own = everything.session == session
    number = sorted(set(everything.session)).index(session)
    return HeldSession(dataset, classes, everything[~own], everything[own], number)


def run_of(
    dataset: Dataset, train: Exemplars, classes: Sequence[str], target: str, recipe: Recipe
) -> Run:
    """Return a run trained on some windows of a data set, with its exemplars.

    Args:
        dataset: Whose sensor, window and level hold.
        train: Windows with class numbers as in `dataset.classes(target)`.
        classes: The classes that occur, sorted.
        target: What is predicted.
        recipe: The model and its training.
    """
    own = renumbered(train, dataset.classes(target), classes)
    training = TrainingSet(windows_of(own), own.y, len(classes), dataset.sensor.full_scale)
    fitted = fit_model(training, replace(Job.of(recipe), target=target))
    contract = contract_of(dataset, target, recipe.model, fitted.networks, fitted.scaling, {})
    return Run(
        networks=fitted.networks,
        contract=replace(contract, classes=tuple(classes)),
        train=recipe.train,
        history=(),
        data="",
        exemplars=thin_out(own),
    )


def windows_of(own: Exemplars) -> Windows:
    """Return exemplars as windows whose times are not known."""
    n = len(own)
    none = np.zeros(n)
    return Windows(
        own.values, own.mask, np.ones(n, np.float32), none.astype(np.float32), none, none
    )


def predicted(run: Run, windows: Exemplars) -> NDArray[np.intp]:
    """Return the class number that a run predicts for each window, shape (n,)."""
    fitted = Fitted(run.networks, run.contract.scaling, [])
    found: NDArray[np.intp] = fitted.probabilities(windows.values, windows.mask).argmax(axis=1)
    return found


def renumbered(windows: Exemplars, before: Sequence[str], after: Sequence[str]) -> Exemplars:
    """Return windows with other class numbers; −1 where the class is not among those after.

    Args:
        windows: Their class numbers are indices into `before`.
        before: Names of classes.
        after: Names of classes in their new order.
    """
    number = np.array([list(after).index(n) if n in after else -1 for n in before], np.intp)
    return replace(windows, y=number[windows.y])
