"""Faults of a sensor array, made on its scans before grid, gate and windows see them.

Each fault takes one recording's scans and gives what the array would have delivered: values
as the converter would show them, times as they would be stamped, validity as a driver
would mark it. A fault holds for the whole recording, reference touches included. Knows
nothing about windows or models.

Source: our choice of faults and levels, docs/decisions/0029; hum and its third harmonic as
in docs/decisions/0005.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from taxel.evaluation.robustness.faults import find_fault, refused_level
from taxel.signals import Samples, SensorInfo, Validity, flag_values

THIRD_HARMONIC = 0.3
"""Of the hum, as a share of it. Source: docs/decisions/0005."""
BURST_S = 0.1
"""Mean length of a burst of lost scans, seconds. Our choice: a USB stall."""
_FLAGS_OF_VALUES = np.uint8(Validity.SATURATED | Validity.NOT_FINITE)


@dataclass(frozen=True, slots=True, kw_only=True)
class Touched:
    """One recording's scans with what a fault must know of them."""

    samples: Samples
    sensor: SensorInfo
    contact: NDArray[np.bool_]
    """Shape (n,): True where something is touched."""
    full: NDArray[np.float64]
    """Shape (channels,): full scale; where unknown, the span of the channel's own values."""
    lowest: NDArray[np.float64]
    """Shape (channels,): what the converter cannot fall below: 0 where no value is negative and
    the full scale is known, minus infinity otherwise."""


Make = Callable[[Touched, float, np.random.Generator], Samples]


@dataclass(frozen=True, slots=True)
class ArrayFault:
    """One way in which an array gets worse."""

    summary: str
    unit: str
    levels: tuple[float, ...]
    """The mildest first."""
    limits: tuple[float, float]
    """Smallest and largest level that means anything."""
    make: Make
    draws: int = 1
    """Passes with other random choices, where one would say little."""
    shortens: bool = False
    """True where a touch is over after fewer windows, so that its last are not answered at all."""


def touched(
    samples: Samples, sensor: SensorInfo, gate: float | None, spans: NDArray[np.float64]
) -> Touched:
    """Return a recording as faults need it.

    Args:
        samples: The scans.
        sensor: The array.
        gate: Contact threshold in the channels' unit; None takes what lies in a touch.
        spans: Shape (touches, 2): start and end of each touch, seconds.
    """
    values = np.where(samples.usable, samples.values, np.nan).astype(np.float64)
    with np.errstate(invalid="ignore"):
        if gate is not None:
            contact = (values > gate).any(axis=1)
        else:
            place = np.searchsorted(spans[:, 0], samples.fitted_s, side="right") - 1
            contact = (place >= 0) & (samples.fitted_s <= spans[np.maximum(place, 0), 1])
        low = np.nanmin(values, axis=0, initial=np.inf)
        high = np.nanmax(values, axis=0, initial=-np.inf)
    span = np.where(np.isfinite(high - low) & (high > low), high - low, 1.0)
    known = sensor.full_scale is not None
    full = np.full(len(span), float(sensor.full_scale)) if sensor.full_scale is not None else span
    lowest = np.where(known & (low >= 0), 0.0, -np.inf)
    contact = np.asarray(contact, bool)
    return Touched(samples=samples, sensor=sensor, contact=contact, full=full, lowest=lowest)


def noise(touched: Touched, level: float, random: np.random.Generator) -> Samples:
    """Normal noise on every channel; level: signal over noise, dB.

    The signal is the mean square of all channels of one unit over the scans in contact; what is
    missing there is no signal of 0.
    """
    usable = touched.samples.usable[touched.contact]
    values = np.where(usable, touched.samples.values[touched.contact], 0.0)
    count = usable.sum(axis=0)
    power = np.square(values, dtype=np.float64).sum(axis=0) / np.maximum(count, 1)
    power = np.where(count > 0, power, touched.full**2 if not len(values) else np.nan)
    units = np.array(touched.sensor.units)
    known = np.isfinite(power)
    shared = np.array(
        [power[own].mean() if (own := (units == unit) & known).any() else 0.0 for unit in units]
    )
    sigma = np.sqrt(shared) * 10 ** (-level / 20)
    return _shown(
        touched,
        touched.samples.values + random.normal(0.0, 1.0, touched.samples.values.shape) * sigma,
    )


def hum(mains_hz: float) -> Make:
    """Return mains hum with its third harmonic; level: its peak, per cent of full scale.

    Each channel has a phase of its own. Scans slower than the mains fold it to lower rates.
    """

    def make(touched: Touched, level: float, random: np.random.Generator) -> Samples:
        phase = random.uniform(0, 2 * np.pi, len(touched.full))
        turn = 2 * np.pi * mains_hz * touched.samples.fitted_s[:, None] + phase
        wave = np.sin(turn) + THIRD_HARMONIC * np.sin(3 * turn)
        return _shown(touched, touched.samples.values + level / 100 * touched.full * wave)

    return make


def dead(touched: Touched, level: float, random: np.random.Generator) -> Samples:
    """Channels that read 0, as a broken wire on a grounded pin; level: how many."""
    values = touched.samples.values.copy()
    values[:, _some(touched, level, random)] = 0.0
    return _shown(touched, values)


def missing(touched: Touched, level: float, random: np.random.Generator) -> Samples:
    """Channels that are marked missing, their values NaN; level: how many."""
    chosen = _some(touched, level, random)
    values, validity = touched.samples.values.copy(), touched.samples.validity.copy()
    values[:, chosen] = np.nan
    validity[:, chosen] |= np.uint8(Validity.MISSING | Validity.NOT_FINITE)
    return replace(touched.samples, values=values, validity=validity)


def stuck(touched: Touched, level: float, random: np.random.Generator) -> Samples:
    """Channels that stand for ever at one of their own values in contact; level: how many.

    Of a channel without a value in the scan that is drawn it is the nearest that it has.
    """
    values = touched.samples.values.copy()
    rows = np.flatnonzero(touched.contact)
    row = int(random.choice(rows)) if len(rows) else 0
    for channel in _some(touched, level, random):
        known = np.flatnonzero(touched.contact & touched.samples.usable[:, channel])
        place = known[np.abs(known - row).argmin()] if len(known) else row
        values[:, channel] = values[place, channel]
    return _shown(touched, values)


def swapped(touched: Touched, level: float, random: np.random.Generator) -> Samples:
    """Pairs of channels in each other's place, as plugs are; level: how many pairs."""
    chosen = random.permutation(len(touched.full))[: 2 * round(level)]
    columns = np.arange(len(touched.full))
    columns[chosen[0::2]], columns[chosen[1::2]] = chosen[1::2], chosen[0::2]
    return touched.samples.only(columns.tolist())


def drift(touched: Touched, level: float, random: np.random.Generator) -> Samples:
    """A gain that fades alike in all channels; level: loss, per cent a minute."""
    return _shown(
        touched, touched.samples.values * np.exp(-level / 100 * _minutes(touched))[:, None]
    )


def channel_drift(touched: Touched, level: float, random: np.random.Generator) -> Samples:
    """A gain that drifts in each channel at its own rate, up or down; level: per cent a minute.

    Rates are drawn evenly between minus and plus the level.
    """
    rate = random.uniform(-1.0, 1.0, len(touched.full)) * level / 100
    return _shown(touched, touched.samples.values * np.exp(_minutes(touched)[:, None] * rate))


def skew(touched: Touched, level: float, random: np.random.Generator) -> Samples:
    """A board whose clock is slow, so that its scans lie further apart; level: ppm.

    The host's clock fit knows their true times; where scans are rows, windows last longer. A scan
    beside a missing one is missing, too: nobody knows what it would have read.
    """
    time_s = touched.samples.fitted_s
    step = 1.0 + level * 1e-6
    index = np.arange(len(time_s))
    count = round(index[-1] / step) + 1  # half a scan beyond the end is the last: none is cut off
    place = (np.arange(count) * step).clip(max=float(index[-1]))
    taken_s = np.interp(place, index, time_s)
    part = touched.samples[np.floor(place).astype(np.intp)]
    values, validity = _between(touched.samples, place)
    return replace(
        _shown(replace(touched, samples=replace(part, validity=validity)), values),
        counter=np.arange(count, dtype=np.int64),
        fitted_s=taken_s,
        arrival_s=np.interp(place, index, touched.samples.arrival_s),
    )


def jitter(touched: Touched, level: float, random: np.random.Generator) -> Samples:
    """Scans that are taken at uneven moments but stamped evenly; level: deviation, ms.

    One that falls beside a missing scan is missing, as in `skew`.
    """
    period_s = 1.0 / touched.sensor.rate_hz
    n = len(touched.samples)
    place = np.arange(n) + random.normal(0.0, level / 1000 / period_s, n)
    values, validity = _between(touched.samples, np.asarray(place.clip(0, n - 1), np.float64))
    return _shown(replace(touched, samples=replace(touched.samples, validity=validity)), values)


def loss(touched: Touched, level: float, random: np.random.Generator) -> Samples:
    """Single scans that never arrive; level: per cent of all."""
    return touched.samples[random.random(len(touched.samples)) >= level / 100]


def burst_loss(touched: Touched, level: float, random: np.random.Generator) -> Samples:
    """Scans lost in bursts of 0.1 s on average; level: per cent of all."""
    n, share = len(touched.samples), level / 100
    mean = max(1.0, BURST_S * touched.sensor.rate_hz)
    kept = np.ones(n, bool)
    at = 0
    while share > 0 and at < n:  # bursts and the stretches between them, both geometric
        at += int(random.geometric(min(1.0, share / (1 - share) / mean)))
        length = int(random.geometric(1.0 / mean))
        kept[at : at + length] = False
        at += length
    return touched.samples[kept]


def offset(touched: Touched, level: float, random: np.random.Generator) -> Samples:
    """A baseline that stands too high in all channels; level: per cent of full scale."""
    return _shown(touched, touched.samples.values + level / 100 * touched.full)


def saturation(touched: Touched, level: float, random: np.random.Generator) -> Samples:
    """A converter whose range ends early; level: per cent of full scale that is missing.

    Values at its new end are marked saturated. Without a known full scale the range of each
    channel's own values is what shrinks.
    """
    good = np.where(touched.samples.usable, touched.samples.values, -np.inf)
    top = (
        touched.full if touched.sensor.full_scale is not None else good.max(axis=0, initial=-np.inf)
    )
    end = (top - level / 100 * touched.full).astype(np.float32)
    values = np.minimum(touched.samples.values, end)
    validity = touched.samples.validity.copy()
    validity[touched.samples.usable & (values >= end)] |= np.uint8(Validity.SATURATED)
    return replace(touched.samples, values=values, validity=validity)


ARRAY_FAULTS: Mapping[str, ArrayFault] = {
    "noise": ArrayFault(
        "normal noise, signal over noise", "dB", (40, 30, 25, 20, 15, 10, 5), (-20, 80), noise
    ),
    "hum": ArrayFault(
        "mains hum of 50 Hz with its third harmonic",
        "% of full scale",
        (0.5, 1, 2, 5, 10),
        (0, 100),
        hum(50.0),
    ),
    "hum-60": ArrayFault(
        "mains hum of 60 Hz with its third harmonic",
        "% of full scale",
        (0.5, 1, 2, 5, 10),
        (0, 100),
        hum(60.0),
    ),
    "dead": ArrayFault("channels that read 0", "channels", (1, 2, 3, 4), (0, 4096), dead, 4),
    "missing": ArrayFault("channels marked missing", "channels", (1, 2, 3, 4), (0, 4096), missing),
    "stuck": ArrayFault(
        "channels that stand at one value", "channels", (1, 2, 3, 4), (0, 4096), stuck, 4
    ),
    "swapped": ArrayFault(
        "pairs of channels in each other's place", "pairs", (1, 2, 3), (0, 2048), swapped, 4
    ),
    "drift": ArrayFault(
        "gain that fades in all channels", "%/min", (0.5, 1, 2, 5, 10), (-100, 100), drift
    ),
    "channel-drift": ArrayFault(
        "gain that drifts in each channel",
        "%/min",
        (0.5, 1, 2, 5, 10),
        (0, 100),
        channel_drift,
        2,
    ),
    "skew": ArrayFault(
        "a clock that is slow",
        "ppm",
        (100, 1000, 10_000, 50_000),
        (0, 500_000),
        skew,
        shortens=True,
    ),
    "jitter": ArrayFault(
        "uneven scans, stamped evenly", "ms", (1, 2, 5, 10, 20), (0, 10_000), jitter
    ),
    "loss": ArrayFault("single scans lost", "%", (1, 5, 10, 20, 40), (0, 99), loss),
    "burst-loss": ArrayFault(
        "scans lost in bursts of 0.1 s", "%", (1, 5, 10, 20, 40), (0, 90), burst_loss
    ),
    "offset": ArrayFault(
        "a baseline too high", "% of full scale", (1, 2, 5, 10, 20), (-100, 100), offset
    ),
    "saturation": ArrayFault(
        "a range that ends early", "% of full scale", (5, 10, 20, 30, 40), (0, 100), saturation
    ),
}
"""Name → fault."""


def find_array_fault(name: str) -> ArrayFault:
    """Return a fault by name.

    Raises:
        BadInput: There is none of this name.
    """
    return find_fault(ARRAY_FAULTS, name)


def limits_of(fault: ArrayFault, channels: int | None) -> tuple[float, float]:
    """Return a fault's limits on an array of so many channels; its own where that is not known."""
    low, high = fault.limits
    shared = {"channels": 1, "pairs": 2}.get(fault.unit)
    return low, high if shared is None or channels is None else channels // shared


def check_level(name: str, fault: ArrayFault, level: float, channels: int | None) -> None:
    """Refuse a level that means nothing.

    Raises:
        BadInput: It lies outside the fault's limits, or asks for more channels than there are.
    """
    low, high = limits_of(fault, channels)
    whole = fault.unit not in ("channels", "pairs") or level == round(level)
    if not (low <= level <= high and whole):
        words = "whole numbers" if fault.unit in ("channels", "pairs") else "levels"
        raise refused_level(f"{words} of {name}", (low, high), fault.unit, level)


def _shown(touched: Touched, values: NDArray[np.floating]) -> Samples:
    """Return the scans with other values, as the converter would show and mark them."""
    limit = np.inf if touched.sensor.full_scale is None else touched.sensor.full_scale
    shown = np.clip(values, touched.lowest, limit).astype(np.float32)
    kept = touched.samples.validity & ~_FLAGS_OF_VALUES
    return replace(
        touched.samples, values=shown, validity=kept | flag_values(shown, touched.sensor.full_scale)
    )


def _some(touched: Touched, level: float, random: np.random.Generator) -> NDArray[np.intp]:
    """Return the columns of some channels, chosen at random."""
    return np.asarray(random.permutation(len(touched.full))[: round(level)], np.intp)


def _minutes(touched: Touched) -> NDArray[np.float64]:
    return np.asarray((touched.samples.fitted_s - touched.samples.fitted_s[0]) / 60.0)


def _between(
    samples: Samples, place: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.uint8]]:
    """Return values between scans, by straight lines, and the flags of both; place in scans (m,).

    At a scan itself only that scan counts.
    """
    before, after = np.floor(place).astype(np.intp), np.ceil(place).astype(np.intp)
    share = (place - before)[:, None]
    values = (1 - share) * samples.values[before] + share * samples.values[after]
    return np.asarray(values), samples.validity[before] | samples.validity[after]
