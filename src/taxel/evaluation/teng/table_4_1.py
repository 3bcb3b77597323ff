"""Table 4.1 of the TENG thesis, each row, split by random windows and by whole sessions.

The thesis names no split; that its windows were split at random is inferred (decision 42).

A `Section` is one task under one split of one data set; it holds one `Column`
a model. Knows nothing about screens or pages.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from time import perf_counter
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from taxel.evaluation.baselines import trivial_accuracies
from taxel.evaluation.crossval import FoldResult, Pooled, pool, run_fold
from taxel.evaluation.metrics import score
from taxel.evaluation.splits import Fold, Split, TrialFold, by_group, random_windows
from taxel.evaluation.teng.inference_time import milliseconds_per_window
from taxel.jobs.running import side_by_side
from taxel.training.fitting import Job, TrainingSet, fit_model
from taxel.training.loop import TrainConfig
from taxel.windows.config import FULL_SCALE_V, TENG_WINDOW
from taxel.windows.dataset import Dataset, load_dataset

FOLDS = 5
"""Source: TENG thesis, Table 4.1."""
TEST_SHARE = 0.2
"""Share of random windows kept for the last test. Source: arithmetic on Table 4.1's accuracies,
which fit 1,755 test windows of 8,775, docs/decisions/0042."""
VALIDATION_SHARE = 0.2
"""Share of the rest, trials or windows, that is watched. Source: the same."""
NOISE_V = 0.05 * FULL_SCALE_V
"""Deviation of the noise in the noisy rows, volts: the thesis does not say; ours is
5 % of full scale, docs/decisions/0008."""
SplitKind = Literal["random", "session"]
TASKS = ("shape", "material")
MODELS_COMPARED = ("cnn1d", "cnn2d", "minirocket")
"""Signal-based, image-based, and the bar."""

ROWS = (
    *(f"K-Fold Acc (Fold {i})" for i in range(1, FOLDS + 1)),
    "Mean K-Fold Acc",
    "Test Accuracy",
    "Test Loss",
    "Multi-Class ROC-AUC",
    "Inference Time (ms/sample)",
    "Noisy Data Accuracy",
    "Noisy Data Loss",
    "Precision",
    "Recall",
    "F1-Score",
    "Training Accuracy",
    "Validation Accuracy",
)
"""Rows of Table 4.1, in its order and words."""

PUBLISHED: dict[str, dict[str, float]] = {
    "cnn1d": dict(
        zip(
            ROWS,
            (0.9858, 0.9836, 0.9758, 0.9850, 0.9786, 0.9818, 0.9829, 0.0641, 0.9985, 40.6897,
             0.9704, 0.0874, 0.98, 0.98, 0.98, 0.9780, 0.9808),
            strict=True,
        )
    ),
    "cnn2d": dict(
        zip(
            ROWS,
            (0.9964, 0.9986, 0.9993, 1.0000, 0.9950, 0.9979, 0.9983, 0.0161, 0.9998, 40.4603,
             0.9960, 0.0229, 1.00, 1.00, 1.00, 0.9982, 0.9964),
            strict=True,
        )
    ),
}  # fmt: skip
"""Table 4.1 of the thesis; it does not say whether for shape or for material."""


@dataclass(frozen=True, slots=True)
class Column:
    """One model's values."""

    model: str
    rows: dict[str, float]
    """Row of `ROWS` → value."""
    pooled: Pooled
    """Every window predicted once by a model that was not trained on its fold."""
    training_s: float
    """Seconds spent on fitting, all folds and the last."""


@dataclass(frozen=True, slots=True)
class Section:
    """One task under one split of one data set."""

    preset: str
    task: str
    split: str
    windows: int
    classes: tuple[str, ...]
    columns: dict[str, Column]
    trivial: dict[str, float]
    """Trivial baseline → pooled accuracy under the same folds, 0…1."""


@dataclass(frozen=True, slots=True, kw_only=True)
class TengTableConfig:
    """What to run."""

    models: tuple[str, ...] = MODELS_COMPARED
    train: TrainConfig = TrainConfig()  # noqa: RUF009  # frozen
    seed: int = 0
    """Seed of the splits."""
    workers: int | None = None
    """Processes that work side by side, a section each."""


def teng_table(
    folders: dict[str, Path],
    config: TengTableConfig,
    on_section: Callable[[str], None] = lambda _: None,
) -> list[Section]:
    """Return all sections for data sets written by `taxel simulate teng`.

    Args:
        folders: Preset ("honest", "paper") → its folder of recordings.
        config: What to run.
        on_section: Called with a line after each section.

    Raises:
        BadDataset: A folder holds no such recordings.
    """
    jobs = [
        (folders[preset], preset, task, kind, config)
        for preset, task, kind in section_plan(tuple(folders))
    ]
    return side_by_side(
        _one_section,
        jobs,
        lambda section: on_section(f"{section.preset} · {section.task} · {section.split}"),
        config.workers,
    )


def section_plan(presets: tuple[str, ...]) -> list[tuple[str, str, SplitKind]]:
    """Return (preset, task, kind of split) of each section.

    The paper's preset has one session a class, so that none can be held out.
    """
    kinds: dict[str, tuple[SplitKind, ...]] = {"paper": ("random",)}
    return [
        (preset, task, kind)
        for preset in presets
        for task in TASKS
        for kind in kinds.get(preset, ("random", "session"))
    ]


def _one_section(
    folder: Path, preset: str, task: str, kind: SplitKind, config: TengTableConfig
) -> Section:
    """Return one section; runs in a process of its own."""
    import torch

    torch.set_num_threads(1)
    where = {"task": task} if preset == "paper" else None
    dataset = load_dataset(folder, TENG_WINDOW, target=task, where=where)
    if kind == "random":
        split = random_windows(dataset, task, FOLDS, config.seed, TEST_SHARE)
    else:
        split = by_group(dataset, task, "session", FOLDS, config.seed, final=True)
    return _section(preset, task, dataset, split, config)


def _section(
    preset: str,
    task: str,
    dataset: Dataset,
    split: Split,
    config: TengTableConfig,
) -> Section:
    columns = {}
    for model in config.models:
        job = Job(model=model, target=task, train=config.train)
        columns[model] = _column(dataset, split, job)
    everything = split.folds + ((split.final,) if isinstance(split.final, TrialFold) else ())
    return Section(
        preset=preset,
        task=task,
        split=split.name,
        windows=len(dataset),
        classes=tuple(dataset.classes(task)),
        columns=columns,
        trivial=trivial_accuracies(dataset, task, everything),
    )


def _column(dataset: Dataset, split: Split, job: Job) -> Column:
    started = perf_counter()
    results: list[FoldResult] = []
    for fold in split.folds:
        results.append(run_fold(dataset, fold, job))
    assert split.final is not None
    last, history_rows = _last_fit(dataset, split.final, job)
    training_s = perf_counter() - started
    accuracies = [result.scores.accuracy for result in results]
    rows = dict(zip(ROWS, accuracies, strict=False))
    rows["Mean K-Fold Acc"] = float(np.mean(accuracies))
    scores = last.scores
    rows["Test Accuracy"], rows["Test Loss"] = scores.accuracy, scores.loss
    rows["Multi-Class ROC-AUC"] = scores.roc_auc
    rows["Inference Time (ms/sample)"] = milliseconds_per_window(
        last.fitted, dataset, last.test, job
    )
    noisy = _noisy(dataset, last)
    rows["Noisy Data Accuracy"], rows["Noisy Data Loss"] = noisy
    rows["Precision"], rows["Recall"] = scores.precision, scores.recall
    rows["F1-Score"] = scores.f1
    rows |= history_rows
    # Under a split by session the test session is one more session predicted blindly.
    all_results = [*results, last] if isinstance(split.final, TrialFold) else results
    return Column(
        model=job.model,
        rows={name: rows[name] for name in ROWS},
        pooled=pool(dataset, split, all_results),
        training_s=training_s,
    )


def _last_fit(dataset: Dataset, fold: Fold, job: Job) -> tuple[FoldResult, dict[str, float]]:
    """Fit on the development part, less a share that is watched; predict the test part."""
    y = dataset.class_numbers(job.target)
    development, test = fold.windows(dataset)
    watched = _watched(dataset, fold, development, job.train.seed)
    train = development[~watched]
    windows = dataset.windows
    fitted = fit_model(TrainingSet.of(dataset, job.target, train), job)

    def accuracy(part: NDArray[np.intp]) -> float:
        found = fitted.probabilities(windows.values[part], windows.mask[part])
        return float((found.argmax(axis=1) == y[part]).mean())

    probabilities = fitted.probabilities(windows.values[test], windows.mask[test])
    result = FoldResult(fold.name, test, y[test], probabilities, fitted)
    return result, {
        "Training Accuracy": accuracy(train),
        "Validation Accuracy": accuracy(development[watched]),
    }


def _watched(
    dataset: Dataset, fold: Fold, development: NDArray[np.intp], seed: int
) -> NDArray[np.bool_]:
    """Return which development windows are watched instead of trained on.

    Whole trials where the split moves whole trials, single windows otherwise.
    """
    rng = np.random.default_rng(seed)
    if isinstance(fold, TrialFold):
        units = dataset.trial[development]
    else:
        units = np.arange(len(development))
    names = np.unique(units)
    chosen = rng.permutation(names)[: max(1, round(VALIDATION_SHARE * len(names)))]
    return np.isin(units, chosen)


def _noisy(dataset: Dataset, last: FoldResult) -> tuple[float, float]:
    """Return accuracy and loss on the test windows with noise added, clipped by the converter."""
    values = dataset.windows.values[last.test]
    noise = np.random.default_rng(0).normal(0.0, NOISE_V, values.shape)
    noisy = np.clip(values + noise, 0.0, FULL_SCALE_V).astype(np.float32)
    probabilities = last.fitted.probabilities(noisy, dataset.windows.mask[last.test])
    scores = score(last.y, probabilities)
    return scores.accuracy, scores.loss
