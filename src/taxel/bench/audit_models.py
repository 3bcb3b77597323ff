"""Rows of `taxel bench audit --full`: every model, and what cleaning gives.

Accuracies without a goal, their split in the name. Knows nothing about how they
are printed.
"""

from __future__ import annotations

import tempfile
from pathlib import Path

from taxel.bench.rows import Row
from taxel.evaluation.teng.cleaning_gains import BASE, NOTHING, Gain, compare_cleaning
from taxel.evaluation.teng.model_comparison import (
    ComparisonConfig,
    ModelResult,
    TrivialResult,
    compare_models,
)
from taxel.sources.data_sets import simulate_presets

SCANS = 160_000
"""Scans a class. Source: TENG thesis, section 3.5.1."""
SETS = (0, 1, 2)
"""Seeds of the simulated data sets that cleaning is measured on."""


def model_rows() -> list[Row]:
    """Measure every model on the honest preset under both splits: about ten minutes."""
    with tempfile.TemporaryDirectory(prefix="taxel-") as scratch:
        simulate_presets(Path(scratch), ("honest",), SCANS, 0)
        results, trivial = compare_models(Path(scratch) / "honest", ComparisonConfig())
    return [*(_model_row(one, trivial) for one in results), *map(_trivial_row, trivial)]


def cleaning_rows() -> list[Row]:
    """Measure what each way of cleaning gives over three simulated sets: about ten minutes."""
    with tempfile.TemporaryDirectory(prefix="taxel-") as scratch:
        for seed in SETS:
            simulate_presets(Path(scratch) / str(seed), ("honest",), SCANS, seed)
        runs = [(Path(scratch) / str(seed) / "honest", seed) for seed in SETS]
        gains, trivial = compare_cleaning(runs, ComparisonConfig())
    return [*map(_gain_row, gains), *map(_trivial_row, trivial)]


def _model_row(one: ModelResult, trivial: list[TrivialResult]) -> Row:
    low, high = one.pooled.interval
    (best,) = [max(each.accuracies.values()) for each in trivial
               if (each.target, each.split) == (one.target, one.pooled.split)]  # fmt: skip
    size = "" if one.parameters is None else f"{one.parameters:,} parameters, "
    note = (
        f"95 % {low:.3f} … {high:.3f} by {one.pooled.interval_group}; whole grasps "
        f"{one.pooled.trial_accuracy:.3f}; {size}{one.fold_s:.1f} s a fold, "
        f"{one.inference_us:.0f} µs a window; best trivial baseline {best:.3f}"
    )
    name = f"sim honest, {one.model}: {one.target}, {one.pooled.split}"
    return _row(name, one.pooled.scores.accuracy, note)


def _gain_row(one: Gain) -> Row:
    name = f"sim honest, {BASE}, windows with {one.way}: {one.target}, {one.split}"
    if one.way == NOTHING:
        name = f"sim honest, {BASE}, windows as they are: {one.target}, {one.split}"
        return _row(name, one.accuracy, f"mean of {len(one.by_run)} sets")
    low, high = one.interval
    note = (
        f"{100 * one.difference:+.1f} points against nothing, 95 % {100 * low:+.1f} … "
        f"{100 * high:+.1f} over {one.groups} sessions, p {one.p:.3f}: {one.verdict}"
    )
    return _row(name, one.accuracy, note)


def _trivial_row(one: TrivialResult) -> Row:
    each = ", ".join(f"{name} {accuracy:.3f}" for name, accuracy in one.accuracies.items())
    name = f"sim honest, best trivial baseline: {one.target}, {one.split}"
    return _row(name, max(one.accuracies.values()), each)


def _row(name: str, value: float, note: str) -> Row:
    return Row(name=name, value=value, unit="accuracy", goal="", ok=None, note=note)
