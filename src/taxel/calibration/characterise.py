"""From recordings and their presses to everything that is known of an array's sensors.

Knows nothing about files, pages or the terminal.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from taxel.calibration.baseline import Noise, RestLine, measure_noise
from taxel.calibration.curves import Curve, Form
from taxel.calibration.figures_of_merit import (
    OUTLIER_SHARE,
    REFERENCE_SHARE,
    Ghosts,
    Hysteresis,
    Uniformity,
    ghosts,
    hysteresis,
    repeatability_v,
    told_range,
    uniformity,
)
from taxel.calibration.fitting import (
    FEWEST_FORCES,
    FEWEST_PRESSES,
    HeldOut,
    NoCurve,
    band,
    bands_of,
    choose_form,
    distinct,
    fit_curve,
    hold_out,
    mean_error,
    r_squared,
)
from taxel.calibration.presses import Reference, Script
from taxel.calibration.responses import Measure, Responses, measure_responses
from taxel.errors import BadDataset
from taxel.signals import Samples, SensorInfo, Validity

_GRID = 41
"""Points at which a curve's band is given."""

MOST_AT_END = 0.1
"""Share of a force's presses at the converter's end from which on that force is left out whole,
and all above it. Our choice, docs/decisions/0022."""
TOLD_ONLY = "forces it tells"
"""Name of the presses whose force lies in the range that their sensor tells."""

Array = NDArray[np.float64]
Interval = tuple[float, float, float]
"""Value, lower and upper end of its 95 % interval."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Taken:
    """One recording and what was done to the array in it."""

    samples: Samples
    script: Script
    rate_hz: float
    """Scans a second, as measured."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Errors:
    """What is told of presses that were not fitted on, newtons."""

    split: str
    """Which presses were held out together."""
    curve_n: Interval
    """Mean absolute error of the curve."""
    line_n: Interval
    """Of a straight line: the trivial baseline."""
    presses: int


@dataclass(frozen=True, slots=True, kw_only=True)
class SensorResult:
    """What one sensor is."""

    channel: str
    curve: Curve | None
    """None where its presses give none."""
    why_none: str
    """Why there is no curve; empty where there is one."""
    force_n: Array
    """Shape (presses,): what the gauge showed, in time's order, of usable presses."""
    volts: Array
    """Shape (presses,): above the baseline."""
    rising: NDArray[np.bool_]
    held_out: tuple[tuple[str, HeldOut], ...]
    """Which presses were held out together, and what was told of them; empty without a curve."""
    saturated: int
    """Presses left out since the converter was at its end, in them or in others of such force."""
    unusable: int
    """Presses left out since a value in them was missing, stale or not finite."""
    r2: float
    grid_n: Array
    """Shape (points,): forces at which the band is given."""
    band_v: tuple[Array, Array]
    """Lower and upper end of the curve's 95 % confidence band."""
    hysteresis: Hysteresis
    repeatability_v: float
    spread_v: float
    """Standard deviation of all presses about the curve, volts."""
    sensitivity: tuple[tuple[float, float], ...]
    """(force, volts a newton) at the smallest, a middle and the largest force."""
    smallest_n: float
    """Smallest force told; below the smallest press it is the curve's word alone."""
    largest_n: float
    """Largest force told: beyond it the curve is too flat for its presses' spread."""
    rise_s: Interval
    """10 to 90 %, gauge and sensor together: median, quartiles."""
    fall_s: Interval
    """Time constant after the peak: median, quartiles."""
    noise: Noise
    rest: RestLine | None
    errors: tuple[Errors, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class Characterisation:
    """What the array is."""

    sensor: SensorInfo
    measure: Measure
    form: Form
    form_scores: dict[str, float]
    """Form → AICc summed over the sensors; the lowest was chosen."""
    sensors: tuple[SensorResult, ...]
    """One a channel, pressed or not."""
    forces_n: tuple[float, float]
    """Smallest and largest force pressed."""
    at_one_force: Uniformity
    references: tuple[Uniformity, ...]
    """One a known voltage."""
    ghosts: Ghosts
    errors: tuple[Errors, ...]
    """Pooled over the sensors that have a curve."""
    error_by_force: tuple[tuple[float, float, float], ...]
    """(mean force, mean absolute error of the curve, of the line) of each band, newtons,
    with rounds held out."""


def characterise(
    taken: Sequence[Taken], sensor: SensorInfo, measure: Measure = "peak", seed: int = 0
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
    if not any(one.script.presses for one in taken):
        raise BadDataset(
            "presses of known force",
            "none",
            "mark them with the labels sensor and force_n, or list them with --presses",
        )
    rng = np.random.default_rng(seed)
    measured = [measure_responses(t.samples, t.script, t.rate_hz, measure) for t in taken]
    table = _Presses.of(measured)
    longest = max(range(len(taken)), key=lambda i: len(taken[i].samples))
    by_channel = [table.only(table.channel == c) for c in range(len(sensor.channels))]
    fitted = [one for one in by_channel if not one.too_few]
    if not fitted:
        reasons = {one.too_few for one in by_channel}
        raise BadDataset(
            f"{FEWEST_PRESSES} presses at {FEWEST_FORCES} forces on a sensor, none at the "
            "converter's end",
            "; ".join(sorted(reasons)),
            "press more forces, or look at --measure",
        )
    form, scores = choose_form([(one.force_n, one.volts) for one in fitted])
    sensors = tuple(
        _sensor(name, form, by_channel[c], taken[longest], measured[longest], c, rng)
        for c, name in enumerate(sensor.channels)
    )
    if not any(one.curve for one in sensors):
        raise BadDataset(
            "volts that rise with force on at least one sensor",
            sensors[0].why_none,
            "check which sensor is on which channel, and the times of the presses",
        )
    every = np.concatenate([one.force_n for one in fitted])
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
        errors=_pooled(sensors, rng),
        error_by_force=_by_force(sensors),
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class _Presses:
    """Presses of one or all sensors as columns; saturated and unusable ones still in it."""

    channel: NDArray[np.int64]
    all_force_n: Array
    all_volts: Array
    all_rising: NDArray[np.bool_]
    all_rounds: NDArray[np.int64]
    saturated: NDArray[np.bool_]
    rise_s: Array
    fall_s: Array
    ghost: Array

    @staticmethod
    def of(measured: Sequence[Responses]) -> _Presses:
        presses = [press for one in measured for press in one.presses]
        return _Presses(
            channel=np.array([press.channel for press in presses], np.int64),
            all_force_n=np.array([press.force_n for press in presses]),
            all_volts=np.concatenate([one.height for one in measured]),
            all_rising=np.array([press.rising for press in presses], bool),
            # Rounds of two recordings are not the same rounds.
            all_rounds=np.array(
                [1000 * i + p.round for i, one in enumerate(measured) for p in one.presses],
                np.int64,
            ),
            saturated=np.concatenate([one.saturated for one in measured]),
            rise_s=np.concatenate([one.rise_s for one in measured]),
            fall_s=np.concatenate([one.fall_s for one in measured]),
            ghost=np.concatenate([one.ghost for one in measured]),
        )

    def only(self, mask: NDArray[np.bool_]) -> _Presses:
        names = ("channel", "all_force_n", "all_volts", "all_rising", "all_rounds", "saturated",
                 "rise_s", "fall_s", "ghost")  # fmt: skip
        return _Presses(**{name: getattr(self, name)[mask] for name in names})

    @property
    def good(self) -> NDArray[np.bool_]:
        """Presses of one sensor to fit on. From the force on at which the converter is at its
        end in a tenth of the presses, all are left out: those below the end would be the weak ones.
        """
        good = np.asarray(~self.saturated & np.isfinite(self.all_volts))
        if not self.saturated.any():
            return good
        bands = bands_of(self.all_force_n)
        ended = [b for b in np.unique(bands) if self.saturated[bands == b].mean() >= MOST_AT_END]
        if not ended:
            return good
        limit_n = float(self.all_force_n[bands == min(ended)].min())
        return np.asarray(good & (self.all_force_n < limit_n))

    @property
    def force_n(self) -> Array:
        return np.asarray(self.all_force_n[self.good])

    @property
    def volts(self) -> Array:
        return np.asarray(self.all_volts[self.good])

    @property
    def rising(self) -> NDArray[np.bool_]:
        return np.asarray(self.all_rising[self.good])

    @property
    def rounds(self) -> NDArray[np.int64]:
        return np.asarray(self.all_rounds[self.good])

    @property
    def too_few(self) -> str:
        """Why no curve can be fitted; empty where one can."""
        if len(self.channel) == 0:
            return "never pressed"
        if len(self.force_n) >= FEWEST_PRESSES and distinct(self.force_n) >= FEWEST_FORCES:
            return ""
        what = f"{len(self.force_n)} usable presses at {distinct(self.force_n)} forces"
        at_end = int(self.saturated.sum())
        return what + (f", {at_end} at the converter's end" if at_end else "")

    def splits(self) -> list[tuple[str, NDArray[np.int64]]]:
        """Return how presses are held out: name → each press's fold."""
        ways = []
        if len(np.unique(self.rounds)) > 1:
            ways.append(("whole rounds", self.rounds))
        ways.append(("whole forces", bands_of(self.force_n)))
        return ways


def _sensor(
    name: str,
    form: Form,
    own: _Presses,
    taken: Taken,
    measured: Responses,
    channel: int,
    rng: np.random.Generator,
) -> SensorResult:
    curve, why = None, own.too_few
    force_n, volts = own.force_n, own.volts
    if not why:
        try:
            curve = fit_curve(form, force_n, volts)
        except NoCurve as error:
            why = str(error)
    grid = np.linspace(0.0, float(force_n.max()), _GRID) if len(force_n) else np.zeros(0)
    nothing = np.full(len(grid), np.nan)
    spread_v = math.nan
    if curve is not None:
        freedom = max(len(volts) - len(curve.parameters), 1)
        spread_v = math.sqrt(float(np.sum((volts - curve.volts(force_n)) ** 2)) / freedom)
    noise = measure_noise(
        taken.samples.values[:, channel], measured.told[:, channel], measured.blocks[channel],
        taken.rate_hz,
    )  # fmt: skip
    range_n = (math.nan, math.nan)
    if curve is not None:
        range_n = told_range(
            curve, noise.told_rms_v, spread_v, float(force_n.min()), float(force_n.max())
        )
    held = () if curve is None else _held_out(own, form, range_n[1])
    nan = math.nan
    return SensorResult(
        channel=name,
        curve=curve,
        why_none=why,
        force_n=force_n,
        volts=volts,
        rising=own.rising,
        held_out=held,
        saturated=int((np.isfinite(own.all_volts) & ~own.good).sum()),
        unusable=int((~np.isfinite(own.all_volts)).sum()),
        r2=nan if curve is None else r_squared(curve, force_n, volts),
        grid_n=grid,
        band_v=(nothing, nothing) if curve is None else band(curve, force_n, volts, grid, rng),
        hysteresis=(
            Hysteresis(mean_pct=nan, low_pct=nan, high_pct=nan, largest_pct=nan)
            if curve is None
            else hysteresis(curve, force_n, volts, own.rising, rng)
        ),
        repeatability_v=(
            nan if curve is None else repeatability_v(curve, force_n, volts, own.rising)
        ),
        spread_v=spread_v,
        sensitivity=() if curve is None else _sensitivity(curve, force_n),
        smallest_n=range_n[0],
        largest_n=range_n[1],
        rise_s=_quartiles(own.rise_s),
        fall_s=_quartiles(own.fall_s),
        noise=noise,
        rest=measured.lines[channel],
        errors=_errors(held, rng),
    )


def _sensitivity(curve: Curve, force_n: Array) -> tuple[tuple[float, float], ...]:
    low, high = float(force_n.min()), float(force_n.max())
    at = (low, math.sqrt(low * high), high)
    return tuple((force, float(curve.slope_v_per_n(force))) for force in at)


def _quartiles(values: Array) -> Interval:
    known = values[np.isfinite(values)]
    if len(known) == 0:
        return math.nan, math.nan, math.nan
    low, middle, high = np.percentile(known, [25, 50, 75])
    return float(middle), float(low), float(high)


def _errors(held: Sequence[tuple[str, HeldOut]], rng: np.random.Generator) -> tuple[Errors, ...]:
    return tuple(
        Errors(
            split=split,
            curve_n=mean_error(one.told_n, one.force_n, rng),
            line_n=mean_error(one.line_n, one.force_n, rng),
            presses=len(one.force_n),
        )
        for split, one in held
        if len(one.force_n)
    )


def _pooled(sensors: Sequence[SensorResult], rng: np.random.Generator) -> tuple[Errors, ...]:
    """Return the errors over all sensors with a curve; presses are drawn anew."""
    names = {split: None for one in sensors for split, _ in one.held_out}
    every = [
        (name, _joined([held for one in sensors for split, held in one.held_out if split == name]))
        for name in names
    ]
    return _errors(every, rng)


def _by_force(sensors: Sequence[SensorResult]) -> tuple[tuple[float, float, float], ...]:
    every = _joined([one.held_out[0][1] for one in sensors if one.held_out])
    told, line = np.abs(every.told_n - every.force_n), np.abs(every.line_n - every.force_n)
    bands = bands_of(every.force_n)
    return tuple(
        (float(every.force_n[bands == b].mean()), _mean(told[bands == b]), _mean(line[bands == b]))
        for b in np.unique(bands)
    )


def _held_out(own: _Presses, form: Form, largest_n: float) -> tuple[tuple[str, HeldOut], ...]:
    """Return what is told of presses held out; last, of those among the first ones whose
    force the sensor tells at all, with nothing above that told, as in `apply`.
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
        told_n=np.minimum(found[0][1].told_n[inside], largest_n),
        line_n=np.minimum(alone.line_n, largest_n),
    )
    found.append((f"{split}, {TOLD_ONLY}", within))
    return tuple(found)


def _joined(parts: Sequence[HeldOut]) -> HeldOut:
    return HeldOut(
        force_n=np.concatenate([one.force_n for one in parts]),
        told_n=np.concatenate([one.told_n for one in parts]),
        line_n=np.concatenate([one.line_n for one in parts]),
    )


def _mean(values: Array) -> float:
    known = values[np.isfinite(values)]
    return float(known.mean()) if len(known) else math.nan


def _at_one_force(sensors: Sequence[SensorResult], sensor: SensorInfo) -> Uniformity:
    """Return how alike the sensors are at a force that all were pressed with."""
    curves = [one for one in sensors if one.curve is not None]
    low = max(float(one.force_n.min()) for one in curves)
    high = min(float(one.force_n.max()) for one in curves)
    force_n = math.sqrt(low * high)
    volts = np.array(
        [math.nan if one.curve is None else float(one.curve.volts(force_n)) for one in sensors]
    )
    none = np.zeros(len(volts), bool)
    return uniformity(f"{force_n:.2f} N", volts, none, sensor.channels, OUTLIER_SHARE)


def _references(taken: Sequence[Taken], sensor: SensorInfo) -> tuple[Uniformity, ...]:
    """Return how alike the pins read known voltages, one result a voltage."""
    every: dict[float, list[tuple[Taken, Reference]]] = {}
    for one in taken:
        for reference in one.script.references:
            every.setdefault(reference.volts, []).append((one, reference))
    found = []
    for volts, stretches in sorted(every.items()):
        read = np.full(len(sensor.channels), np.nan)
        at_end = np.zeros(len(sensor.channels), bool)
        for one, reference in stretches:
            ends = np.searchsorted(one.samples.fitted_s, [reference.start_s, reference.end_s])
            part = one.samples[int(ends[0]) : int(ends[1])]
            chosen = range(len(read)) if reference.channel is None else (reference.channel,)
            for channel in chosen:
                good = part.usable[:, channel]
                if good.any():
                    read[channel] = float(part.values[good, channel].astype(np.float64).mean())
                    flags = part.validity[good, channel] & np.uint8(Validity.SATURATED)
                    at_end[channel] = bool(flags.any())
        found.append(uniformity(f"{volts:g} V", read, at_end, sensor.channels, REFERENCE_SHARE))
    return tuple(found)
