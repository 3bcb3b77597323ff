"""What denoising, segmentation and augmentation give, each alone, under the honest split.

Each way is paired with nothing at all on the same windows and folds, over
several runs. The sizes of all changes were fixed before any was measured
(docs/decisions/0024). Knows nothing about screens.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import torch
from numpy.typing import NDArray

from taxel.errors import BadDataset
from taxel.evaluation.crossval import FoldResult, pool, run_fold
from taxel.evaluation.intervals import ratio_interval
from taxel.evaluation.paired import LEVEL, sign_flip
from taxel.evaluation.splits import Split
from taxel.evaluation.teng.model_comparison import (
    ComparisonConfig,
    TrivialResult,
    load_windows,
    split_windows,
    trivial_company,
)
from taxel.jobs.running import side_by_side
from taxel.labels.trials import coarsest_group
from taxel.training.augment import Augment
from taxel.training.fitting import Job
from taxel.windows.config import WAVELET, WindowConfig
from taxel.windows.dataset import Dataset

BASE = "cnn2d"
"""The model whose windows are cleaned or changed: the thesis's own."""
NOTHING = "nothing"
"""The way that every other is paired with."""


@dataclass(frozen=True, slots=True)
class Gain:
    """What one way of cleaning or changing windows gives, under the held-out split."""

    target: str
    way: str
    split: str
    accuracy: float
    """Of all test windows, mean over the runs, 0…1."""
    trial_accuracy: float
    """Of whole trials, mean over the runs, 0…1."""
    difference: float
    """Accuracy less that of `NOTHING` on the same windows."""
    interval: tuple[float, float]
    """95 % of the difference, whole groups resampled."""
    p: float
    """Sign-flip test over groups."""
    by_run: tuple[float, ...]
    """Each run's difference."""
    groups: int
    """Groups, such as sessions, that were held out."""
    ways: int
    """Ways that were tried; a claim must be stronger by as much (Bonferroni)."""

    @property
    def verdict(self) -> str:
        """Return in plain words what it gives."""
        points = f"{100 * abs(self.difference):.1f} points"
        if self.way == NOTHING:
            return "what the others are paired with"
        if self.p < LEVEL / self.ways:
            return f"gives {points}" if self.difference > 0 else f"costs {points}"
        return f"nothing that {self.groups} groups could show"


def compare_cleaning(
    runs: Sequence[tuple[Path, int]],
    config: ComparisonConfig,
    on_step: Callable[[str], None] = lambda _: None,
) -> tuple[list[Gain], list[TrivialResult]]:
    """Measure what each way of cleaning or changing windows gives, paired with nothing.

    Args:
        runs: (folder of recordings, seed of splits and networks) of each run.
        config: What to run.
        on_step: Called with a line after each run and way.

    Raises:
        BadDataset: The recordings do not make such a data set.
        BadSplit: They cannot be split so.
    """
    for path, _ in runs:
        dataset = load_windows(path, config, config.targets[0])
    ways = list(ways_to_train(dataset, config))
    jobs = [(path, replace(config, train=replace(config.train, seed=seed)), target, way)
            for target in config.targets for way in ways for path, seed in runs]  # fmt: skip
    found = side_by_side(
        _one_way, jobs, lambda job: on_step(f"{job.target} · {job.way}"), config.workers
    )
    each = [[result for result in found if result.target == target] for target in config.targets]
    gains = [gain for own in each for gain in _gains(own, ways)]
    trivial = side_by_side(
        trivial_company, [(runs[0][0], config, target, "held out") for target in config.targets],
        lambda job: on_step(f"trivial baselines · {job.target}"), config.workers,
    )  # fmt: skip
    return gains, trivial


def ways_to_train(
    dataset: Dataset, config: ComparisonConfig
) -> dict[str, tuple[WindowConfig, Augment]]:
    """Return each way's window and augmentation; those that do not fit the array are left out.

    Args:
        dataset: Its channels decide whether there are fingers, its gate the segmentation's level.
        config: Window and training that each way changes in one thing.
    """
    window, plain = config.window, Augment()
    ways = {NOTHING: (window, plain)}
    if window.layout == "B":
        ways[f"wavelet {WAVELET}"] = (replace(window, wavelet=WAVELET), plain)
    if window.gate is not None:
        ways["segmentation at the gate"] = (replace(window, segment=window.gate), plain)
    changes = {
        "shift, 2 rows": Augment(shift_rows=2),
        "rotation, 10°": Augment(rotate_deg=10.0),
        "noise, 10 % of spread": Augment(noise=0.1),
        "gain, 30 %": Augment(gain=0.3),
        "channel gain, 20 %": Augment(channel_gain=0.2),
    }
    channels = len(dataset.sensor.channels)
    if channels % plain.phalanges == 0 and channels > plain.phalanges:
        changes["shift, 1 finger"] = Augment(shift_fingers=1)
    return ways | {way: (window, augment) for way, augment in changes.items()}


@dataclass(frozen=True, slots=True)
class _WayRun:
    """One way in one run: counts by held-out group."""

    target: str
    way: str
    split: str
    groups: tuple[str, ...]
    """Folder and name of each held-out group."""
    right: NDArray[np.intp]
    """Windows predicted correctly in each group."""
    count: NDArray[np.intp]
    """Windows in each group."""
    trial_accuracy: float


def _one_way(path: Path, config: ComparisonConfig, target: str, way: str) -> _WayRun:
    """Measure one way in one run; runs in a process of its own."""
    torch.set_num_threads(1)
    plain = load_windows(path, config, target)
    window, augment = ways_to_train(plain, config)[way]
    dataset = plain if window == config.window else load_windows(path, config, target, window)
    if not np.array_equal(dataset.windows.start_s, plain.windows.start_s):
        raise BadDataset(
            "the same windows however they are cleaned", "others", "report the recordings"
        )
    split = split_windows(dataset, config, target, "held out")
    train = replace(config.train, augment=augment)
    job = Job(model=BASE, target=target, train=train)
    return _count_right(
        path, dataset, split, [run_fold(dataset, f, job) for f in split.folds], job, way
    )


def _count_right(
    path: Path, dataset: Dataset, split: Split, results: Sequence[FoldResult], job: Job, way: str
) -> _WayRun:
    test = np.concatenate([result.test for result in results])
    right = np.concatenate([result.probabilities.argmax(axis=1) == result.y for result in results])
    owner = dataset.group(coarsest_group(dataset.trials))[dataset.trial[test]]
    names, index = np.unique(owner, return_inverse=True)
    return _WayRun(
        target=job.target,
        way=way,
        split=split.name,
        groups=tuple(f"{path}: {name}" for name in names),
        right=np.bincount(index[right], minlength=len(names)).astype(np.intp),
        count=np.bincount(index).astype(np.intp),
        trial_accuracy=pool(dataset, split, results).trial_accuracy,
    )


def _gains(found: Sequence[_WayRun], ways: Sequence[str]) -> list[Gain]:
    """Pair each way with nothing, group by group; runs of one folder share its groups."""
    base = [result for result in found if result.way == NOTHING]
    gains = []
    for way in ways:
        results = [result for result in found if result.way == way]
        changed = [result.right - plain.right for result, plain in zip(results, base, strict=True)]
        _, group = np.unique(
            [name for result in results for name in result.groups], return_inverse=True
        )
        count = np.bincount(group, weights=np.concatenate([result.count for result in results]))
        every = np.bincount(group, weights=np.concatenate(changed)).astype(np.float64)
        gains.append(
            Gain(
                target=results[0].target,
                way=way,
                split=results[0].split,
                accuracy=float(sum(result.right.sum() for result in results) / count.sum()),
                trial_accuracy=float(np.mean([result.trial_accuracy for result in results])),
                difference=float(every.sum() / count.sum()),
                interval=ratio_interval(every, count),
                p=sign_flip(every),
                by_run=tuple(
                    float(c.sum() / result.count.sum())
                    for c, result in zip(changed, results, strict=True)
                ),
                groups=len(every),
                ways=len(ways) - 1,
            )
        )
    return gains
