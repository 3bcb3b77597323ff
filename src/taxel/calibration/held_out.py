"""How well forces of presses that no curve was fitted on are measured, sensor by sensor and pooled.

Knows nothing about scans, files or pages.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from taxel.calibration.curves import Form
from taxel.calibration.fitting import HeldOut, bands_of, hold_out, mean_error
from taxel.calibration.press_table import PressTable
from taxel.calibration.results import Errors, SensorResult

IN_RANGE = "forces in its range"
"""Name of the presses whose force lies in the range of their sensor."""

Array = NDArray[np.float64]


def errors_of(held: Sequence[tuple[str, HeldOut]], rng: np.random.Generator) -> tuple[Errors, ...]:
    """Return the mean errors of presses held out, with intervals, one a way of holding out."""
    return tuple(
        Errors(
            split=split,
            curve_n=mean_error(presses.curve_n, presses.force_n, rng),
            line_n=mean_error(presses.line_n, presses.force_n, rng),
            presses=len(presses.force_n),
        )
        for split, presses in held
        if len(presses.force_n)
    )


def pooled(sensors: Sequence[SensorResult], rng: np.random.Generator) -> tuple[Errors, ...]:
    """Return the errors over all sensors with a curve; presses are drawn anew."""
    names = {split: None for sensor in sensors for split, _ in sensor.held_out}
    every = [
        (
            name,
            _joined(
                [held for sensor in sensors for split, held in sensor.held_out if split == name]
            ),
        )
        for name in names
    ]
    return errors_of(every, rng)


def by_force(sensors: Sequence[SensorResult]) -> tuple[tuple[float, float, float], ...]:
    """Return (mean force, mean error of the curve, of the line) of each band of forces, newtons."""
    every = _joined([sensor.held_out[0][1] for sensor in sensors if sensor.held_out])
    curve, line = np.abs(every.curve_n - every.force_n), np.abs(every.line_n - every.force_n)
    bands = bands_of(every.force_n)
    return tuple(
        (float(every.force_n[bands == b].mean()), _mean(curve[bands == b]), _mean(line[bands == b]))
        for b in np.unique(bands)
    )


def held_out(own: PressTable, form: Form, largest_n: float) -> tuple[tuple[str, HeldOut], ...]:
    """Return the forces of presses held out; last, of those among the first ones whose
    force in the sensor's range, with nothing above it given, as in `apply`.
    """
    found = [
        (split, hold_out(form, own.force_n, own.volts, folds)) for split, folds in own.splits()
    ]
    split, folds = own.splits()[0]
    inside = own.force_n <= largest_n
    # The line gets its best chance: laid through the presses of this range alone.
    alone = hold_out(form, own.force_n[inside], own.volts[inside], folds[inside])
    within = HeldOut(
        force_n=alone.force_n,
        curve_n=np.minimum(found[0][1].curve_n[inside], largest_n),
        line_n=np.minimum(alone.line_n, largest_n),
    )
    found.append((f"{split}, {IN_RANGE}", within))
    return tuple(found)


def _joined(parts: Sequence[HeldOut]) -> HeldOut:
    return HeldOut(
        force_n=np.concatenate([part.force_n for part in parts]),
        curve_n=np.concatenate([part.curve_n for part in parts]),
        line_n=np.concatenate([part.line_n for part in parts]),
    )


def _mean(values: Array) -> float:
    known = values[np.isfinite(values)]
    return float(known.mean()) if len(known) else math.nan
