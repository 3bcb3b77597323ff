"""Every model on the same windows and folds, split by random windows and by sessions.

Accuracy with an interval by session, whole trials, parameters, training and
inference time, and what can be predicted without touch. Knows nothing about screens.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from pathlib import Path
from time import perf_counter
from typing import Literal

import torch

from taxel.evaluation.baselines import trivial_accuracies
from taxel.evaluation.crossval import Pooled, pool, run_fold
from taxel.evaluation.splits import Split, by_group, random_windows
from taxel.evaluation.teng.inference_time import milliseconds_per_window
from taxel.jobs.running import side_by_side
from taxel.labels.trials import coarsest_group
from taxel.models.catalogue import count_parameters
from taxel.training.final import check_gate
from taxel.training.fitting import Job
from taxel.training.loop import TrainConfig
from taxel.windows.config import TENG_WINDOW, WindowConfig
from taxel.windows.dataset import Dataset, load_dataset

COMPARED = (
    "cnn1d",
    "cnn2d",
    "touchnet",
    "lstm",
    "cnn3d",
    "conv-lstm",
    "inception-time",
    "minirocket",
    "extra-trees",
)
"""The thesis's two networks, ours, its survey's, and the strongest library models."""
LITERATURE: dict[str, str] = {
    "cnn1d": "0.82 to 0.91",
    "cnn2d": "1D + 0.05 to 0.10",
    "lstm": "above 0.95",
    "cnn3d": "above 0.95",
    "conv-lstm": "0.941 to 0.992",
}
"""Model → accuracy that the literature reports for its kind on TENG signals of other hands and
objects; the splits are not known. Source: TENG thesis, section 1 (1D: its references 17, 37 and 38;
3D LSTM: 62), 2.5.2 (2D: 26, 30) and 2.5.3 (LSTM and 3D CNN: 13, 18)."""
SplitKind = Literal["random", "held out"]


@dataclass(frozen=True, slots=True, kw_only=True)
class ComparisonConfig:
    """What to run."""

    window: WindowConfig = TENG_WINDOW
    targets: tuple[str, ...] = ("shape", "material")
    models: tuple[str, ...] = COMPARED
    train: TrainConfig = field(default_factory=TrainConfig)
    """The same for every network; its seed is the splits' too."""
    folds: int = 6
    """Parts of the held-out split, and of the random one."""
    random_folds: int = 2
    """Folds of the random split that are run: they hardly differ."""
    workers: int | None = None
    """Processes that work side by side."""
    own_gate: bool = False
    """Whether the window's gate is in the unit of the recordings' channels, not in volts."""


@dataclass(frozen=True, slots=True)
class ModelResult:
    """One model under one split."""

    target: str
    model: str
    pooled: Pooled
    parameters: int | None
    """None for a library's model."""
    fold_s: float
    """Seconds to fit one fold and predict its test part, one thread; mean over the folds."""
    inference_us: float
    """Microseconds for one window, median: ONNX Runtime for networks, one thread."""


@dataclass(frozen=True, slots=True)
class TrivialResult:
    """What can be predicted without touch under one split."""

    target: str
    split: str
    windows: int
    accuracies: dict[str, float]
    """Trivial baseline → accuracy, 0…1."""


def compare_models(
    path: Path, config: ComparisonConfig, on_step: Callable[[str], None] = lambda _: None
) -> tuple[list[ModelResult], list[TrivialResult]]:
    """Measure every model under random windows and with groups held out.

    Args:
        path: A folder of recordings of an array.
        config: What to run.
        on_step: Called with a line after each model and split.

    Raises:
        BadDataset: The recordings do not make such a data set.
        BadSplit: They cannot be split so.
    """
    for target in config.targets:
        load_windows(path, config, target)  # refuse before hours of work
    places = [(t, kind) for t in config.targets for kind in ("random", "held out")]
    jobs = [(path, config, target, kind, model) for target, kind in places
            for model in config.models]  # fmt: skip
    results = side_by_side(
        _one_model, jobs, lambda job: on_step(_progress_line(job)), config.workers
    )
    trivial = side_by_side(
        trivial_company,
        [(path, config, target, kind) for target, kind in places],
        lambda job: on_step(f"trivial baselines · {job.target} · {job.split}"),
        config.workers,
    )
    return results, trivial


def _one_model(
    path: Path, config: ComparisonConfig, target: str, kind: SplitKind, model: str
) -> ModelResult:
    """Measure one model under one split; runs in a process of its own."""
    torch.set_num_threads(1)
    dataset = load_windows(path, config, target)
    split = split_windows(dataset, config, target, kind)
    job = Job(model=model, target=target, train=config.train)
    started = perf_counter()
    results = [run_fold(dataset, fold, job) for fold in split.folds]
    fold_s = (perf_counter() - started) / len(results)
    last = results[-1]
    networks = last.fitted.model
    return ModelResult(
        target=target,
        model=model,
        pooled=pool(dataset, split, results),
        parameters=sum(map(count_parameters, networks)) if isinstance(networks, tuple) else None,
        fold_s=fold_s,
        inference_us=1000.0 * milliseconds_per_window(last.fitted, dataset, last.test, job),
    )


def trivial_company(
    path: Path, config: ComparisonConfig, target: str, kind: SplitKind
) -> TrivialResult:
    """Return what can be predicted without touch on the same windows and folds."""
    dataset = load_windows(path, config, target)
    split = split_windows(dataset, config, target, kind)
    accuracies = trivial_accuracies(dataset, target, split.folds)
    return TrivialResult(target, split.name, len(dataset), accuracies)


def load_windows(
    path: Path, config: ComparisonConfig, target: str, window: WindowConfig | None = None
) -> Dataset:
    """Return the data set of one target.

    Args:
        path: The recordings.
        config: What is compared.
        target: The label.
        window: Another window than the comparison's, with the same gate.

    Raises:
        BadDataset: The recordings do not make such a data set, or the gate is in another unit.
    """
    dataset = load_dataset(path, window or config.window, target=target)
    check_gate(dataset, own=config.own_gate)
    return dataset


def split_windows(
    dataset: Dataset, config: ComparisonConfig, target: str, kind: SplitKind
) -> Split:
    """Return the split of one kind; the random one with the folds that are run."""
    seed = config.train.seed
    if kind == "held out":
        return by_group(dataset, target, coarsest_group(dataset.trials), config.folds, seed)
    split = random_windows(dataset, target, config.folds, seed, 0.0)
    return replace(split, folds=split.folds[: config.random_folds])


def _progress_line(result: ModelResult) -> str:
    return f"{result.model} · {result.target} · {result.pooled.split}"
