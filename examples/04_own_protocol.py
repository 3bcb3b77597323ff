"""A protocol of one's own: train on dry sessions, test on humid ones; no trial on both sides."""

import tempfile
from pathlib import Path

import numpy as np

from taxel.evaluation.crossval import pool, run_fold
from taxel.evaluation.splits import Split, TrialFold
from taxel.sources.simulated.data_sets import simulate_presets
from taxel.training.fitting import Job
from taxel.windows.config import TENG_WINDOW
from taxel.windows.dataset import Dataset, load_dataset


def dry_to_humid(dataset: Dataset, limit_pct: float) -> Split:
    """Return one fold: sessions up to a relative humidity against those above it."""
    humid = dataset.group("humidity_pct").astype(float) > limit_pct
    train = frozenset(np.flatnonzero(~humid).tolist())
    test = frozenset(np.flatnonzero(humid).tolist())
    name = f"up to {limit_pct:g} % RH → above"
    return Split(name, (TrialFold(name, train, test),), final=None)


with tempfile.TemporaryDirectory() as folder:
    simulate_presets(Path(folder), ("honest",), 16_000, 0)
    data = load_dataset(Path(folder) / "honest", TENG_WINDOW, target="shape")

split = dry_to_humid(data, 50.0)
job = Job(model="extra-trees", target="shape")
result = pool(data, split, [run_fold(data, fold, job) for fold in split.folds])
low, high = result.interval
print(f"{job.model}, {result.split}: {result.scores.accuracy:.3f} [{low:.3f}, {high:.3f}]")
print(f"interval over {result.interval_group}s; tested on {len(split.folds[0].test)} trials")
