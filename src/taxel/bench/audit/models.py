"""Rows of `taxel bench audit --full`: every model, and what cleaning gives.

Accuracies without a goal, their split in the name. Knows nothing about how they
are printed.
"""

from __future__ import annotations

import tempfile
from pathlib import Path

from taxel.bench.rows import Row, accuracy_row
from taxel.evaluation.teng.cleaning_gains import BASE, NOTHING, Gain, compare_cleaning
from taxel.evaluation.teng.model_comparison import (
    ComparisonConfig,
    ModelResult,
    TrivialResult,
    compare_models,
)
from taxel.sources.simulated.data_sets import simulate_presets

SCANS = 160_000
"""Scans a class. Source: TENG thesis, section 3.5.1."""
SETS = (0, 1, 2)
"""Seeds of the simulated data sets that cleaning is measured on."""


def model_rows() -> list[Row]:
    """Measure every model on the honest preset under both splits: about ten minutes."""
    with tempfile.TemporaryDirectory(prefix="taxel-") as scratch:
        simulate_presets(Path(scratch), ("honest",), SCANS, 0)
        results, trivial = compare_models(Path(scratch) / "honest", ComparisonConfig())
    return [*(_model_row(result, trivial) for result in results), *map(_trivial_row, trivial)]


def cleaning_rows() -> list[Row]:
    """Measure what each way of cleaning gives over three simulated sets: about ten minutes."""
    with tempfile.TemporaryDirectory(prefix="taxel-") as scratch:
        for seed in SETS:
            simulate_presets(Path(scratch) / str(seed), ("honest",), SCANS, seed)
        runs = [(Path(scratch) / str(seed) / "honest", seed) for seed in SETS]
        gains, trivial = compare_cleaning(runs, ComparisonConfig())
    return [*map(_gain_row, gains), *map(_trivial_row, trivial)]


def _model_row(result: ModelResult, trivial: list[TrivialResult]) -> Row:
    low, high = result.pooled.interval
    (best,) = [max(each.accuracies.values()) for each in trivial
               if (each.target, each.split) == (result.target, result.pooled.split)]  # fmt: skip
    size = "" if result.parameters is None else f"{result.parameters:,} parameters, "
    note = (
        f"95 % {low:.3f} … {high:.3f} by {result.pooled.interval_group}; whole grasps "
        f"{result.pooled.trial_accuracy:.3f}; {size}{result.fold_s:.1f} s a fold, "
        f"{result.inference_us:.0f} µs a window; best trivial baseline {best:.3f}"
    )
    name = f"sim honest, {result.model}: {result.target}, {result.pooled.split}"
    return accuracy_row(name, result.pooled.scores.accuracy, note)


def _gain_row(gain: Gain) -> Row:
    name = f"sim honest, {BASE}, windows with {gain.way}: {gain.target}, {gain.split}"
    if gain.way == NOTHING:
        name = f"sim honest, {BASE}, windows as they are: {gain.target}, {gain.split}"
        return accuracy_row(name, gain.accuracy, f"mean of {len(gain.by_run)} sets")
    low, high = gain.interval
    note = (
        f"{100 * gain.difference:+.1f} points against nothing, 95 % {100 * low:+.1f} … "
        f"{100 * high:+.1f} over {gain.groups} sessions, p {gain.p:.3f}: {gain.verdict}"
    )
    return accuracy_row(name, gain.accuracy, note)


def _trivial_row(result: TrivialResult) -> Row:
    each = ", ".join(f"{name} {accuracy:.3f}" for name, accuracy in result.accuracies.items())
    name = f"sim honest, best trivial baseline: {result.target}, {result.split}"
    return accuracy_row(name, max(result.accuracies.values()), each)
