"""What the pads could give as a source of power: charge and energy a press, a capacitor's curve.

An estimate from the voltages that the converter read, by the model of one pad as a current into
R ∥ C (docs/explanation/physics-teng.md): charge that came until the peak is C · (V + ∫V dt / τ),
energy in the input's own resistance ∫V² / R dt with R = τ / C. A converter sees the positive half
alone. Knows nothing about files or screens.

Background of our choices: docs/decisions/0047.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from taxel.calibration.baseline import smoothed
from taxel.signals import Samples, Validity
from taxel.windows.following import rest_and_noise
from taxel.windows.gate import NOISE_SIGMAS

_LEAST_V = 0.05
"""What stands less above rest is no press, volts. Our choice, docs/decisions/0047."""
_LEAST_S = 0.02
"""Nor is what is shorter, seconds: the smoothing's own length. Our choice, 0047."""
_MOST_STEPS = 2_000_000
"""Presses that a capacitor's curve is followed for. Our choice, docs/decisions/0047."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Circuit:
    """What is assumed of pads and storage."""

    capacitance_pf: float = 250.0
    """Pad and cable, picofarads: the middle of the simulated hand's 150 to 350 pF, 0047."""
    time_constant_s: float = 0.16
    """R · C at the converter's input, seconds: the middle of the simulated hand's, 0047."""
    storage_uf: float = 1.0
    """Capacitor that is charged, microfarads. Our choice, docs/decisions/0047."""
    diode_v: float = 0.3
    """Each of a bridge's two conducting diodes takes so much, volts: a Schottky diode. Our choice,
    docs/decisions/0047."""


@dataclass(frozen=True, slots=True)
class PressPower:
    """One press of one pad."""

    at_s: float
    """When it began, fitted clock, seconds."""
    channel: int
    open_v: float
    """Its charge over the pad's capacitance, volts: what it would read if nothing leaked."""
    charge_nc: float
    """Nanocoulombs, until the peak."""
    energy_nj: float
    """Nanojoules, in the converter input's own resistance, while it read above rest."""
    at_end: bool
    """The converter was at its end: all of these are "at least"."""


def presses_of(samples: Samples, rate_hz: float, circuit: Circuit) -> list[PressPower]:
    """Return what each press gave, oldest first.

    Args:
        samples: Some seconds or more of an array that reads volts, touched for less than half of
            the time.
        rate_hz: Scans a second, as measured.
        circuit: What is assumed of the pads.
    """
    usable = np.where(samples.usable, samples.values, np.nan).astype(np.float64)
    rest, noise = rest_and_noise(usable)
    calm = smoothed(usable, rate_hz) - np.nan_to_num(rest)
    ends = (samples.validity & np.uint8(Validity.SATURATED)) != 0
    least = np.maximum(NOISE_SIGMAS * np.nan_to_num(noise), _LEAST_V)
    found = [
        press
        for channel in range(calm.shape[1])
        for press in _of_channel(
            channel, calm[:, channel], samples.fitted_s, ends[:, channel], float(least[channel]),
            rate_hz, circuit,
        )
    ]  # fmt: skip
    return sorted(found, key=lambda press: (press.at_s, press.channel))


def _of_channel(
    channel: int,
    volts: NDArray[np.float64],
    time_s: NDArray[np.float64],
    ends: NDArray[np.bool_],
    least_v: float,
    rate_hz: float,
    circuit: Circuit,
) -> list[PressPower]:
    edges = np.flatnonzero(np.diff(np.concatenate([[False], volts > least_v, [False]])))
    farads = circuit.capacitance_pf * 1e-12
    over_tau = 1.0 / (rate_hz * circuit.time_constant_s)
    powers = []
    for first, last in edges.reshape(-1, 2).tolist():
        if last - first < max(2.0, _LEAST_S * rate_hz):
            continue
        run = volts[first:last]
        peak = int(np.argmax(run))
        open_v = float(run[peak] + run[:peak].sum() * over_tau)
        powers.append(
            PressPower(
                at_s=float(time_s[first]),
                channel=channel,
                open_v=open_v,
                charge_nc=1e9 * farads * open_v,
                energy_nj=1e9 * farads * float(np.square(run).sum()) * over_tau,
                at_end=bool(ends[first:last].any()),
            )
        )
    return powers


def capacitor_curve(
    presses: Sequence[PressPower], period_s: float, at_s: Sequence[float], circuit: Circuit
) -> NDArray[np.float64]:
    """Return the storage's voltage at some moments, shape (moments,), volts.

    Each pad has a bridge of its own. A press pushes its charge, and its release the same charge
    the other way; a pad at open voltage V0 gives the share 1 − (V + 2 · diode) / V0 of it to a
    storage that then stands at V, and nothing above V0 − 2 · diode. The presses are repeated,
    period after period.
    Source: balance of charge between two capacitors; docs/decisions/0047.

    Args:
        presses: Of one period.
        period_s: How long they took, seconds.
        at_s: Moments, rising, seconds.
        circuit: Pads and storage.

    Raises:
        ValueError: So many presses lie before the last moment that they cannot be followed.
    """
    if not presses or period_s <= 0:
        return np.zeros(len(at_s))
    if at_s[-1] / period_s * len(presses) > _MOST_STEPS:
        raise ValueError(f"needed at most {_MOST_STEPS:,} presses; got more")
    begin_s = presses[0].at_s
    kept = circuit.storage_uf / (circuit.storage_uf + circuit.capacitance_pf * 1e-6)
    storage_v, number, curve = 0.0, 0, []
    for moment_s in at_s:
        while True:
            turn, place = divmod(number, len(presses))
            press = presses[place]
            if turn * period_s + press.at_s - begin_s > moment_s:
                break
            full_v = press.open_v - 2.0 * circuit.diode_v
            if full_v > storage_v:
                storage_v = full_v - (full_v - storage_v) * kept**2  # press and release
            number += 1
        curve.append(storage_v)
    return np.array(curve)
