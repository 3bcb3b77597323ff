"""What a calibration finds: one value a thing, with its unit and its interval.

Knows nothing about how it was found.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from taxel.calibration.baseline import Noise, RestLine
from taxel.calibration.curves import Curve, Form
from taxel.calibration.figures_of_merit import Ghosts, Hysteresis, Interval, Uniformity
from taxel.calibration.fitting import HeldOut
from taxel.calibration.presses import Script
from taxel.calibration.responses import Measure
from taxel.signals import Samples, SensorInfo

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True, kw_only=True)
class PressedRecording:
    """One calibration recording with the known forces that were applied in it."""

    samples: Samples
    script: Script
    rate_hz: float
    """Scans a second, as measured."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Errors:
    """The errors on presses that were not fitted on, newtons."""

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
    """Which presses were held out together, and the forces by it; empty without a curve."""
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
    """Smallest usable force; below the smallest press it is the curve's word alone."""
    largest_n: float
    """Largest usable force: beyond it the curve is too flat for its presses' spread."""
    rise_s: Interval
    """10 to 90 %, gauge and sensor together: median, quartiles."""
    fall_s: Interval
    """Time constant after the peak: median, quartiles."""
    recovery_s: Interval
    """90 to 10 % after the peak, gauge and sensor together: median, quartiles."""
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
