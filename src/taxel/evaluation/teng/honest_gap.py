"""The distance between a split by random windows and held-out sessions, and what closes it.

Each rung changes one thing against the thesis's network on windows as measured, on
the same recordings and folds. What a rung may use is what a user has before a
new session begins, or in its first touches; never the test windows' labels, nor their
statistics over the session. Knows nothing about screens.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Literal

import numpy as np
import torch

from taxel.evaluation.crossval import pool, run_fold
from taxel.evaluation.splits import by_group, random_windows
from taxel.jobs.running import side_by_side
from taxel.training.augment import Augment
from taxel.training.fitting import Job
from taxel.training.loop import TrainConfig
from taxel.windows.config import TENG_WINDOW, WindowConfig
from taxel.windows.dataset import Dataset, load_dataset

TARGETS = ("shape", "material", "shape+material")
_FOLDS = 5
"""Folds of the random split."""
_RANDOM_FOLDS_RUN = 2
"""Folds of the random split that are run: they hardly differ."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Rung:
    """One way to train, under one split."""

    name: str
    split: Literal["random", "session"]
    window: WindowConfig = TENG_WINDOW
    model: str = "cnn2d"
    augment: Augment = field(default_factory=Augment)
    own_level: bool = False
    """Each window is divided by its own level: a normalisation that needs no touches."""


def with_touches(count: int) -> WindowConfig:
    """Return the thesis's window with each session brought to the level of known touches."""
    return replace(TENG_WINDOW, reference=f"object=cylinder-glass:{count}")


RUNGS = (
    Rung(name="as measured", split="random"),
    Rung(name="as measured", split="session"),
    Rung(name="each window by its own level", split="session", own_level=True),
    Rung(name="augmented gains", split="session", augment=Augment(gain=0.3, channel_gain=0.12)),
    Rung(name="1 reference touch", split="session", window=with_touches(1)),
    Rung(name="3 reference touches", split="session", window=with_touches(3)),
    Rung(name="3 reference touches, windows of 36 rows", split="session",
         window=replace(with_touches(3), steps=36)),
    Rung(name="3 reference touches", split="random", window=with_touches(3)),
)  # fmt: skip
"""From the thesis's way to ours; each differs from one before it in one thing."""


@dataclass(frozen=True, slots=True)
class Step:
    """What one rung gives on one target, over all sets."""

    rung: Rung
    target: str
    by_set: tuple[float, ...]
    """Accuracy over the windows of each set, 0…1."""
    trials_by_set: tuple[float, ...]
    """Accuracy over the whole grasps of each set, 0…1."""

    @property
    def accuracy(self) -> float:
        """Mean over the sets."""
        return float(np.mean(self.by_set))

    @property
    def trial_accuracy(self) -> float:
        """Mean over the sets, windows of a grasp joined."""
        return float(np.mean(self.trials_by_set))


def honest_gap(
    folders: Sequence[Path],
    *,
    rungs: Sequence[Rung] = RUNGS,
    targets: Sequence[str] = TARGETS,
    train: TrainConfig | None = None,
    workers: int | None = None,
    on_step: Callable[[str], None] = lambda _: None,
) -> list[Step]:
    """Measure each rung on each target over several sets of recordings.

    Args:
        folders: Sets of recordings with sessions, such as sim://teng with several seeds.
        rungs: What to measure.
        targets: What to predict.
        train: How; the thesis's way unless given.
        workers: Processes at a time.
        on_step: Called with a line after each rung and set.

    Raises:
        BadDataset: The recordings do not make such a data set.
        BadSplit: They cannot be split so.
    """
    train = train or TrainConfig()
    jobs = [(folder, rung, target, train) for target in targets for rung in rungs
            for folder in folders]  # fmt: skip
    done = side_by_side(_measure, jobs, lambda job: on_step(job[2]), workers)
    steps = []
    for index in range(0, len(jobs), len(folders)):
        _, rung, target, _ = jobs[index]
        own = done[index : index + len(folders)]
        accuracies, trials = (
            tuple(measured[0] for measured in own),
            tuple(measured[1] for measured in own),
        )
        steps.append(Step(rung, target, accuracies, trials))
    return steps


def closed(steps: Sequence[Step], target: str, name: str) -> float:
    """Return the share of the gap between the splits that a rung closes, as measured = 0.

    Above 1 a rung under held-out sessions is better than random windows as measured.
    """
    found = {
        (step.rung.name, step.rung.split): step.accuracy for step in steps if step.target == target
    }
    high, low = found["as measured", "random"], found["as measured", "session"]
    return (found[name, "session"] - low) / (high - low)


def _measure(folder: Path, rung: Rung, target: str, train: TrainConfig) -> tuple[float, float, str]:
    """Measure one rung on one set; runs in a process of its own."""
    torch.set_num_threads(1)
    dataset = load_dataset(folder, rung.window, target=target)
    if rung.own_level:
        dataset = _at_own_level(dataset)
    job = Job(model=rung.model, target=target, train=replace(train, augment=rung.augment))
    if rung.split == "random":
        split = random_windows(dataset, target, _FOLDS, train.seed, 0.0)
        split = replace(split, folds=split.folds[:_RANDOM_FOLDS_RUN])
    else:
        sessions = len(set(dataset.group("session")))
        split = by_group(dataset, target, "session", sessions, train.seed)
    pooled = pool(dataset, split, [run_fold(dataset, fold, job) for fold in split.folds])
    message = f"{target} · {rung.name} · {split.name}: {pooled.scores.accuracy:.3f}"
    return pooled.scores.accuracy, pooled.trial_accuracy, message


def _at_own_level(dataset: Dataset) -> Dataset:
    """Divide each window by the root of its mean square; levels vanish, their ratios stay."""
    values = dataset.windows.values
    level = np.sqrt(np.square(values).mean(axis=(1, 2), keepdims=True))
    full = dataset.sensor.full_scale or 1.0
    scaled = values / np.where(level > 0, level, 1.0) * np.float32(full / 2)
    return replace(dataset, windows=replace(dataset.windows, values=scaled.astype(np.float32)))
