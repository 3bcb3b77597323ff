"""Rows of `taxel bench audit --full`: the gap between the splits, and what closes it.

Knows nothing about how they are printed.
"""

from __future__ import annotations

import tempfile
from itertools import product
from pathlib import Path

import numpy as np

from taxel.bench.rows import Row, accuracy_row, row
from taxel.evaluation.baselines import trivial_accuracies
from taxel.evaluation.splits import by_group
from taxel.evaluation.teng.honest_gap import TARGETS, Step, closed, honest_gap, with_touches
from taxel.sources.simulated.data_sets import simulate_presets
from taxel.windows.config import TENG_WINDOW, WindowConfig
from taxel.windows.dataset import load_dataset

SCANS = 160_000
"""Scans a class. Source: TENG thesis, section 3.5.1."""
SETS = (0, 1, 2)
"""Seeds of the simulated sets."""
OURS = "3 reference touches"
WEAK = {"shape": (0.99, 0.77), "material": (0.66, 0.48), "shape+material": (0.65, 0.36)}
"""Random windows and held-out sessions of small CNNs. Source: docs/decisions/0005."""


def gap_rows() -> list[Row]:
    """Measure the ladder on three simulated sets: a quarter of an hour."""
    with tempfile.TemporaryDirectory(prefix="taxel-") as scratch:
        for seed in SETS:
            simulate_presets(Path(scratch) / str(seed), ("honest",), SCANS, seed)
        steps = honest_gap([Path(scratch) / str(seed) / "honest" for seed in SETS])
    rows = []
    for target in TARGETS:
        own = [step for step in steps if step.target == target]
        high, low = WEAK[target]
        ours = next(s for s in own if (s.rung.name, s.rung.split) == (OURS, "session"))
        name = f"sim honest, {target}, session held out, {OURS}"
        rows += [
            row(f"{name}: share of the gap to random windows closed", closed(own, target, OURS),
                "of 1", ">=", 0.5, "both ends measured in this run"),
            row(f"{name}: accuracy", ours.accuracy, "accuracy", ">=", (high + low) / 2,
                f"half-way from {low:.2f} to {high:.2f}; {_note(ours)}"),
        ]  # fmt: skip
        rows += [_rung(step) for step in own if step is not ours]
    return rows


def baseline_rows() -> list[Row]:
    """Predict without a network on the same sets, as measured and with touches."""
    ladder = (("as measured", TENG_WINDOW), (OURS, with_touches(3)))
    rows = []
    with tempfile.TemporaryDirectory(prefix="taxel-") as scratch:
        for seed in SETS:
            simulate_presets(Path(scratch) / str(seed), ("honest",), SCANS, seed)
        for target, (what, window) in product(TARGETS, ladder):
            each = [_trivial(Path(scratch) / str(seed) / "honest", window, target) for seed in SETS]
            mean = {name: float(np.mean([scores[name] for scores in each])) for name in each[0]}
            best = max(mean, key=lambda name: mean[name])
            name = f"sim honest, {target}, session held out, {what}: best baseline, {best}"
            note = ", ".join(f"{name} {value:.3f}" for name, value in mean.items())
            rows.append(accuracy_row(name, mean[best], note))
    return rows


def _trivial(folder: Path, window: WindowConfig, target: str) -> dict[str, float]:
    dataset = load_dataset(folder, window, target=target)
    sessions = len(set(dataset.group("session")))
    return trivial_accuracies(
        dataset, target, by_group(dataset, target, "session", sessions, 0).folds
    )


def _rung(step: Step) -> Row:
    split = "random windows (leaks)" if step.rung.split == "random" else "session held out"
    name = f"sim honest, {step.target}, {split}, {step.rung.name}: accuracy"
    return accuracy_row(name, step.accuracy, _note(step))


def _note(step: Step) -> str:
    each = ", ".join(f"{value:.3f}" for value in step.by_set)
    return f"{step.rung.model}; sets {each}; whole grasps {step.trial_accuracy:.3f}"
