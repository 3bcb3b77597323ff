"""The weak baselines that the simulator was tuned to, and that its freeze keeps.

A small CNN on windows of shape, of material, and of both (nine classes). Knows
nothing about goals.
"""

from __future__ import annotations

import tempfile
from dataclasses import replace
from pathlib import Path

import numpy as np

from taxel.evaluation.crossval import run_fold
from taxel.evaluation.splits import Split, by_group, random_windows
from taxel.sources.simulated.data_sets import simulate_presets
from taxel.training.fitting import Job
from taxel.training.loop import TrainConfig
from taxel.windows.config import TENG_WINDOW
from taxel.windows.dataset import Dataset, load_dataset

_SCANS = 160_000
_FOLDS = 5
_RANDOM_FOLDS_RUN = 2
"""Folds of the random split that are run: they hardly differ."""


def weak_accuracies(seed: int, epochs: int) -> dict[tuple[str, str], float]:
    """Return (target, "random" or "session") → accuracy of a small CNN on one seed's set."""
    with tempfile.TemporaryDirectory(prefix="taxel-") as scratch:
        simulate_presets(Path(scratch), ("honest",), _SCANS, seed)
        dataset = _with_both(load_dataset(Path(scratch) / "honest", TENG_WINDOW))
    found = {}
    for target in ("shape", "material", "both"):
        random = random_windows(dataset, target, _FOLDS, 0, 0.0)
        sessions = by_group(dataset, target, "session", 6, 0)
        found[target, "random"] = _mean(dataset, random, target, epochs, _RANDOM_FOLDS_RUN)
        found[target, "session"] = _mean(dataset, sessions, target, epochs, len(sessions.folds))
    return found


def weak_paper_accuracies(epochs: int) -> dict[str, float]:
    """Return target → accuracy with one session a class, random split."""
    found = {}
    with tempfile.TemporaryDirectory(prefix="taxel-") as scratch:
        simulate_presets(Path(scratch), ("paper",), _SCANS, 0)
        for target in ("shape", "material"):
            dataset = load_dataset(Path(scratch) / "paper", TENG_WINDOW, where={"task": target})
            split = random_windows(dataset, target, _FOLDS, 0, 0.0)
            found[target] = _mean(dataset, split, target, epochs, _RANDOM_FOLDS_RUN)
    return found


def _with_both(dataset: Dataset) -> Dataset:
    """Add the label "both": shape and material together."""
    trials = tuple(
        replace(t, labels={**t.labels, "both": f"{t.labels['shape']} {t.labels['material']}"})
        for t in dataset.trials
    )
    return replace(dataset, trials=trials)


def _mean(dataset: Dataset, split: Split, target: str, epochs: int, folds: int) -> float:
    job = Job(model="cnn2d", target=target, train=TrainConfig(epochs=epochs))
    scores = [run_fold(dataset, fold, job).scores.accuracy for fold in split.folds[:folds]]
    return float(np.mean(scores))
