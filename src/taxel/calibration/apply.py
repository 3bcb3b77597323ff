"""Later scans of the same sensors, with baseline and drift taken away, in volts or newtons.

The raw recording is never touched. Knows nothing about how a calibration was made.

Background of our choices: docs/decisions/0022.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from taxel.calibration.baseline import RestLine, rest_blocks, rest_line, smoothed
from taxel.calibration.stored import Calibration, ChannelCalibration, shown_units
from taxel.errors import BadInput
from taxel.recordings.reader import iterate_blocks, read_recording
from taxel.recordings.writer import Recorder
from taxel.signals import Samples, SensorInfo, Validity

Unit = Literal["V", "N"]
"""V: baseline and drift taken away. N: and turned into force by the curves."""

_QUIET_SIGMAS = 8.0
"""A block whose smoothed values span less than this many noises is at rest. Our choice: a
block holds about a dozen independent values, whose span stays below 5."""
_PERIOD_S = 10.0
"""Rest is looked for in periods of this length, seconds, one value each. Our choice."""
_AT_ONCE = 50_000
"""Scans handed to the recorder at once."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Corrected:
    """Scans after a calibration."""

    samples: Samples
    info: SensorInfo
    """What the array is now: units and details say what was done."""
    baselines: tuple[RestLine, ...]
    """One a channel: what was taken away."""
    borrowed: tuple[str, ...]
    """Channels that showed no rest here, so that the calibration's own baseline was taken."""


def correct(
    samples: Samples, info: SensorInfo, calibration: Calibration, unit: Unit, rate_hz: float
) -> Corrected:
    """Return scans with their baseline and drift taken away, and in newtons where asked.

    The baseline is found anew in these scans: a calibration's own is as old as the
    calibration. Newtons are read off the signal smoothed over 20 ms, as presses were. A force
    above its sensor's range is given as the largest one and flagged SATURATED: "at
    least". A channel without a curve has no newtons: NaN, flagged NOT_FINITE. For sensors
    that answer to a change (measure "peak") newtons hold at the peak of a press from rest,
    and sink with the charge while the force stays.

    Args:
        samples: Of one recording, whole: baselines need its rests.
        info: The array they come from.
        calibration: Its calibration.
        unit: V, which stands for the array's own unit, or N.
        rate_hz: Scans a second, as measured.

    Raises:
        BadInput: The calibration is of other sensors.
    """
    calibration.check_fits(info, info.name)
    calm = smoothed(np.where(samples.usable, samples.values, np.nan), rate_hz)
    lines, borrowed = [], []
    for column, channel in enumerate(calibration.channels):
        line = _own_line(samples, calm[:, column], column, channel, rate_hz)
        if line is None:
            borrowed.append(channel.channel)
            level = 0.0 if math.isnan(channel.baseline) else channel.baseline
            line = RestLine(at_s=0.0, level=level, per_hour=0.0, per_hour_95=(math.nan, math.nan))
        lines.append(line)
    values = np.empty(samples.values.shape, np.float32)
    validity = np.array(samples.validity)
    for column, (channel, line) in enumerate(zip(calibration.channels, lines, strict=True)):
        read = calm[:, column] if unit == "N" else samples.values[:, column].astype(np.float64)
        above = read - line.at(samples.fitted_s)
        if unit == "V":
            values[:, column] = above
        else:
            values[:, column], flags = newtons(above, channel)
            validity[:, column] |= flags
    unusable = ~samples.usable
    values[unusable] = samples.values[unusable] if unit == "V" else np.float32(np.nan)
    return Corrected(
        samples=replace(samples, values=values, validity=validity),
        info=described(info, calibration, unit),
        baselines=tuple(lines),
        borrowed=tuple(borrowed),
    )


def write_corrected(
    source: Path, output: Path, calibration: Calibration, unit: Unit, overwrite: bool = False
) -> dict[str, Any]:
    """Write a recording's corrected copy beside it: scans, marks and frames; return its ledger.

    Args:
        source: The raw recording; it stays as it is.
        output: The recording to be, ending in .mcap.
        calibration: Of the same sensors.
        unit: V, which stands for the array's own unit, or N.
        overwrite: Replace an existing output.

    Raises:
        BadInput: Other sensors, or the output is the source, or exists.
        BadRecording: The source cannot be read.
        RecordingFailed: The disk refused.
    """
    if output.suffix != ".mcap":
        raise BadInput("a recording's name that ends in .mcap", str(output), "rename it")
    if output.exists() and output.samefile(source):
        raise BadInput("another file for --output", "the raw recording", "raw is kept")
    recording = read_recording(source)
    sensor = recording.manifest.sensor
    calibration.check_fits(sensor, str(source))
    if not len(recording.samples):
        raise BadInput("a recording with scans", f"none in {source}", "record it again")
    corrected = correct(
        recording.samples, sensor, calibration, unit, rate_of(recording.samples, sensor.rate_hz)
    )
    info = replace(corrected.info, details={**corrected.info.details, "raw": source.name})
    manifest = replace(recording.manifest, sensor=info)
    recorder = Recorder(output, manifest, overwrite=overwrite)
    try:
        for first in range(0, len(corrected.samples), _AT_ONCE):
            recorder.write(corrected.samples[first : first + _AT_ONCE])
            recorder.flush()
        for mark in recording.marks:
            recorder.mark(mark)
        if manifest.cameras:
            _copy_frames(source, recorder)
        recorder.close("corrected")
    except BaseException:
        recorder.discard()
        raise
    return {
        "recording": str(output),
        "raw": str(source),
        "unit": shown_units(corrected.info.units)[0],
        "calibration": calibration.digest,
        "baselines": {
            channel.channel: {"level_v": line.level, "drift_v_per_hour": line.per_hour}
            for channel, line in zip(calibration.channels, corrected.baselines, strict=True)
        },
        "borrowed_baselines": list(corrected.borrowed),
        **recorder.statistics(),
    }


def rate_of(samples: Samples, nominal_hz: float) -> float:
    """Return the scans a second as measured; the nominal rate where there are too few."""
    if len(samples) < 10:
        return nominal_hz
    median_s = float(np.median(np.diff(samples.fitted_s[:100_000])))
    span_s = float(samples.fitted_s[-1] - samples.fitted_s[0])
    if median_s <= 0 or span_s <= 0:
        return nominal_hz
    mean_hz = (len(samples) - 1) / span_s
    # A gap in the recording lowers the mean and leaves the median; bunched times the reverse.
    return mean_hz if 0.5 < mean_hz * median_s < 2.0 else 1.0 / median_s


def _own_line(
    samples: Samples,
    calm: NDArray[np.float64],
    column: int,
    channel: ChannelCalibration,
    rate_hz: float,
) -> RestLine | None:
    """Return the baseline that these scans show, or None where they never rest.

    Source: docs/decisions/0022.
    """
    if math.isnan(channel.noise):
        return None
    values = samples.values[:, column]
    span = max(_QUIET_SIGMAS * channel.noise, 1e-9)
    at_s, level, floored = [], [], []
    for block in rest_blocks(samples.usable[:, column], rate_hz):
        if float(np.ptp(calm[block])) > span:
            continue
        where = float(samples.fitted_s[block].mean())
        # After a release a TENG's voltage is negative and reads 0: that is no baseline.
        if float(np.mean(values[block] <= 0.0)) > 0.5:
            floored.append(float(calm[block].mean()))
            continue
        at_s.append(where)
        level.append(float(calm[block].mean()))
    if not at_s and len(floored) > 1:
        none = (math.nan, math.nan)
        return RestLine(at_s=0.0, level=float(np.median(floored)), per_hour=0.0, per_hour_95=none)
    if not at_s:
        return None
    times, levels = np.array(at_s), np.array(level)
    period = np.floor((times - times[0]) / _PERIOD_S)
    # In each period the lower half: a sensor that is held down is quiet too, and higher.
    chosen = [
        np.flatnonzero(period == p)[np.argsort(levels[period == p])] for p in np.unique(period)
    ]
    middles = np.array([float(times[rows].mean()) for rows in chosen])
    lows = np.array([float(np.median(levels[rows[: max(1, len(rows) // 2)]])) for rows in chosen])
    return rest_line(middles, lows)


def newtons(
    above: NDArray[np.float64], channel: ChannelCalibration
) -> tuple[NDArray[np.float64], NDArray[np.uint8]]:
    """Return one channel's forces and their flags, shape (n,) each.

    Args:
        above: Volts above the baseline, shape (n,).
        channel: Its calibration.
    """
    flags = np.zeros(len(above), np.uint8)
    if channel.curve is None or math.isnan(channel.largest_n):
        return np.full(len(above), np.nan), flags | np.uint8(Validity.NOT_FINITE)
    force = channel.curve.force_n(above)
    flags[force > channel.largest_n] = np.uint8(Validity.SATURATED)
    return np.minimum(force, channel.largest_n), flags


def described(info: SensorInfo, calibration: Calibration, unit: Unit) -> SensorInfo:
    """Return what an array is once it was corrected: units, full scale, what was done."""
    what = "baseline, drift" + (", force in newtons" if unit == "N" else "")
    details = {**info.details, "calibration": calibration.digest, "corrected": what}
    if unit == "V":
        return replace(info, details=details)
    largest = [
        channel.largest_n for channel in calibration.channels if math.isfinite(channel.largest_n)
    ]
    return replace(
        info,
        units=("N",) * len(info.channels),
        full_scale=max(largest, default=None),
        details=details,
    )


def _copy_frames(source: Path, recorder: Recorder) -> None:
    for block in iterate_blocks(source):
        for frame in block.frames:
            recorder.frame(frame)
