"""From recordings and their presses to everything that is known of an array's sensors.

Knows nothing about files, pages or the terminal.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from taxel.calibration.baseline import measure_noise
from taxel.calibration.curves import Curve, Form
from taxel.calibration.figures_of_merit import (
    OUTLIER_SHARE,
    REFERENCE_SHARE,
    Hysteresis,
    Uniformity,
    ghosts,
    hysteresis,
    quartiles,
    repeatability_v,
    uniformity,
    usable_range,
)
from taxel.calibration.fitting import (
    FEWEST_FORCES,
    FEWEST_PRESSES,
    NoCurve,
    band,
    choose_form,
    fit_curve,
    r_squared,
)
from taxel.calibration.held_out import by_force, errors_of, held_out, pooled
from taxel.calibration.press_table import PressTable
from taxel.calibration.presses import Reference
from taxel.calibration.responses import Measure, Responses, measure_responses
from taxel.calibration.results import (
    Array,
    Characterisation,
    PressedRecording,
    SensorResult,
)
from taxel.errors import BadDataset
from taxel.signals import SensorInfo, Validity

_GRID = 41
"""Points at which a curve's band is given."""


def characterise(
    taken: Sequence[PressedRecording], sensor: SensorInfo, measure: Measure = "peak", seed: int = 0
) -> Characterisation:
    """Return what presses of known force say about an array.

    Args:
        taken: Recordings of the one array; noise and drift are read off the longest.
        sensor: The array.
        measure: How a press becomes one number.
        seed: Of the bootstrap's draws.

    Raises:
        BadDataset: No presses, or no sensor with a curve.
    """
    if not any(recording.script.presses for recording in taken):
        raise BadDataset(
            "presses of known force",
            "none",
            "mark them with the labels sensor and force_n, or list them with --presses",
        )
    rng = np.random.default_rng(seed)
    measured = [measure_responses(t.samples, t.script, t.rate_hz, measure) for t in taken]
    table = PressTable.of(measured)
    longest = max(range(len(taken)), key=lambda i: len(taken[i].samples))
    by_channel = [table.only(table.channel == c) for c in range(len(sensor.channels))]
    fitted = [channel for channel in by_channel if not channel.too_few]
    if not fitted:
        reasons = {channel.too_few for channel in by_channel}
        raise BadDataset(
            f"{FEWEST_PRESSES} presses at {FEWEST_FORCES} forces on a sensor, none at the "
            "converter's end",
            "; ".join(sorted(reasons)),
            "press more forces, or look at --measure",
        )
    form, scores = choose_form([(channel.force_n, channel.volts) for channel in fitted])
    sensors = tuple(
        _sensor(name, form, by_channel[c], taken[longest], measured[longest], c, rng)
        for c, name in enumerate(sensor.channels)
    )
    if not any(sensor.curve for sensor in sensors):
        raise BadDataset(
            "volts that rise with force on at least one sensor",
            sensors[0].why_none,
            "check which sensor is on which channel, and the times of the presses",
        )
    every = np.concatenate([channel.force_n for channel in fitted])
    return Characterisation(
        sensor=sensor,
        measure=measure,
        form=form,
        form_scores={str(name): score for name, score in scores.items()},
        sensors=sensors,
        forces_n=(float(every.min()), float(every.max())),
        at_one_force=_at_one_force(sensors, sensor),
        references=_references(taken, sensor),
        ghosts=ghosts(table.ghost, table.channel, sensor.channels),
        errors=pooled(sensors, rng),
        error_by_force=by_force(sensors),
    )


def _sensor(
    name: str,
    form: Form,
    presses: PressTable,
    taken: PressedRecording,
    measured: Responses,
    channel: int,
    rng: np.random.Generator,
) -> SensorResult:
    """Return what one sensor's presses say; NaN and empty where only a curve could say it."""
    curve, why = None, presses.too_few
    force_n, volts, nan = presses.force_n, presses.volts, math.nan
    if not why:
        try:
            curve = fit_curve(form, force_n, volts)
        except NoCurve as error:
            why = str(error)
    grid = np.linspace(0.0, float(force_n.max()), _GRID) if len(force_n) else np.zeros(0)
    nothing = np.full(len(grid), nan)
    result = SensorResult(
        channel=name,
        curve=curve,
        why_none=why,
        force_n=force_n,
        volts=volts,
        rising=presses.rising,
        held_out=(),
        saturated=int((np.isfinite(presses.all_volts) & ~presses.good).sum()),
        unusable=int((~np.isfinite(presses.all_volts)).sum()),
        r2=nan,
        grid_n=grid,
        band_v=(nothing, nothing),
        hysteresis=Hysteresis(mean_pct=nan, low_pct=nan, high_pct=nan, largest_pct=nan),
        repeatability_v=nan,
        spread_v=nan,
        sensitivity=(),
        smallest_n=nan,
        largest_n=nan,
        rise_s=quartiles(presses.rise_s),
        fall_s=quartiles(presses.fall_s),
        recovery_s=quartiles(presses.recovery_s),
        noise=measure_noise(
            taken.samples.values[:, channel], measured.smooth[:, channel],
            measured.blocks[channel], taken.rate_hz,
        ),
        rest=measured.lines[channel],
        errors=(),
    )  # fmt: skip
    return result if curve is None else _with_curve(result, curve, form, presses, rng)


def _with_curve(
    result: SensorResult, curve: Curve, form: Form, presses: PressTable, rng: np.random.Generator
) -> SensorResult:
    """Return a sensor's result with all that its curve says."""
    force_n, volts = presses.force_n, presses.volts
    freedom = max(len(volts) - len(curve.parameters), 1)
    spread_v = math.sqrt(float(np.sum((volts - curve.volts(force_n)) ** 2)) / freedom)
    smallest_n, largest_n = usable_range(
        curve, result.noise.told_rms_v, spread_v, float(force_n.min()), float(force_n.max())
    )
    held = held_out(presses, form, largest_n)
    return replace(
        result,
        held_out=held,
        r2=r_squared(curve, force_n, volts),
        band_v=band(curve, force_n, volts, result.grid_n, rng),
        hysteresis=hysteresis(curve, force_n, volts, presses.rising, rng),
        repeatability_v=repeatability_v(curve, force_n, volts, presses.rising),
        spread_v=spread_v,
        sensitivity=_sensitivity(curve, force_n),
        smallest_n=smallest_n,
        largest_n=largest_n,
        errors=errors_of(held, rng),
    )


def _sensitivity(curve: Curve, force_n: Array) -> tuple[tuple[float, float], ...]:
    low, high = float(force_n.min()), float(force_n.max())
    at = (low, math.sqrt(low * high), high)
    return tuple((force, float(curve.slope_v_per_n(force))) for force in at)


def _at_one_force(sensors: Sequence[SensorResult], sensor: SensorInfo) -> Uniformity:
    """Return how alike the sensors are at a force that all were pressed with."""
    curves = [sensor for sensor in sensors if sensor.curve is not None]
    low = max(float(curve.force_n.min()) for curve in curves)
    high = min(float(curve.force_n.max()) for curve in curves)
    force_n = math.sqrt(low * high)
    volts = np.array(
        [
            math.nan if sensor.curve is None else float(sensor.curve.volts(force_n))
            for sensor in sensors
        ]
    )
    none = np.zeros(len(volts), bool)
    return uniformity(f"{force_n:.2f} N", volts, none, sensor.channels, OUTLIER_SHARE)


def _references(taken: Sequence[PressedRecording], sensor: SensorInfo) -> tuple[Uniformity, ...]:
    """Return how alike the pins read known voltages, one result a voltage."""
    every: dict[float, list[tuple[PressedRecording, Reference]]] = {}
    for recording in taken:
        for reference in recording.script.references:
            every.setdefault(reference.volts, []).append((recording, reference))
    found = []
    for volts, stretches in sorted(every.items()):
        read = np.full(len(sensor.channels), np.nan)
        at_end = np.zeros(len(sensor.channels), bool)
        for stretch, reference in stretches:
            ends = np.searchsorted(stretch.samples.fitted_s, [reference.start_s, reference.end_s])
            part = stretch.samples[int(ends[0]) : int(ends[1])]
            chosen = range(len(read)) if reference.channel is None else (reference.channel,)
            for channel in chosen:
                good = part.usable[:, channel]
                if good.any():
                    read[channel] = float(part.values[good, channel].astype(np.float64).mean())
                    flags = part.validity[good, channel] & np.uint8(Validity.SATURATED)
                    at_end[channel] = bool(flags.any())
        found.append(uniformity(f"{volts:g} V", read, at_end, sensor.channels, REFERENCE_SHARE))
    return tuple(found)
