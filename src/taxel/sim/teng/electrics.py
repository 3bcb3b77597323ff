"""From contact to converter counts: charge, R ∥ C, hum, ghosts, clipping, bits.

A single-electrode TENG is a current source dQ/dt into R ∥ C (Norton); its voltage
decays with R·C and turns negative on release, which the converter cannot see.
Knows nothing about objects, grasps or files.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.signal import lfilter

from taxel.sim.teng import constants
from taxel.sim.teng.pickup import Pickup
from taxel.sim.teng.unknown_objects import RELATIVE_CHARGE as UNKNOWN_CHARGE

_RELATIVE_CHARGE = constants.RELATIVE_CHARGE | UNKNOWN_CHARGE


@dataclass(frozen=True, slots=True)
class Session:
    """What stays the same within one session: drawn without regard to any class."""

    gain: NDArray[np.float64]
    """Shape (12,)."""
    time_constant_s: float
    capacitance_pf: float
    temperature_c: float
    humidity_pct: float
    dust: float
    """Share of the pads that is covered, 0…1."""
    moisture: float
    """Share of the pads that is wet, 0…1."""
    hum_v: float
    hum_phase: NDArray[np.float64]
    """Shape (12,), radians."""
    clock_ppm: float


def draw_session(
    rng: np.random.Generator,
    temperature_c: tuple[float, float],
    humidity_pct: tuple[float, float],
    dust: tuple[float, float],
    moisture: tuple[float, float],
    place: tuple[float, float, float] | None = None,
) -> Session:
    """Draw a session's nuisances from ranges (low, high).

    Args:
        rng: The session's own generator.
        temperature_c: Range, °C.
        humidity_pct: Range, percent.
        dust: Range, 0…1.
        moisture: Range, 0…1.
        place: Where in their ranges temperature, humidity and time constant lie,
            0…1 each; anywhere unless given. A data set spreads its sessions evenly.
    """
    warm, damp, slow = place if place is not None else rng.uniform(0.0, 1.0, 3)
    spread = rng.normal(0.0, constants.GAIN_DEVIATION, 12)
    rho = constants.FIRST_SECOND_CORRELATION
    spread[1] = rho * spread[0] + np.sqrt(1 - rho**2) * spread[1]
    gain = np.exp(spread)
    gain[1] *= constants.SECOND_SENSOR_GAIN
    return Session(
        gain=gain,
        time_constant_s=_between(constants.TIME_CONSTANT_S, slow),
        capacitance_pf=rng.uniform(*constants.CAPACITANCE_PF),
        temperature_c=_between(temperature_c, warm),
        humidity_pct=_between(humidity_pct, damp),
        dust=rng.uniform(*dust),
        moisture=rng.uniform(*moisture),
        hum_v=rng.uniform(*constants.HUM_V),
        hum_phase=rng.uniform(0, 2 * np.pi, 12),
        clock_ppm=rng.uniform(-constants.CLOCK_PPM, constants.CLOCK_PPM),
    )


def _between(limits: tuple[float, float], place: float) -> float:
    return float(limits[0] + (limits[1] - limits[0]) * place)


def full_voltage(session: Session, material: str, force_n: float) -> float:
    """Return the voltage of a full, sudden contact on a sensor of gain 1, volts."""
    humidity = np.exp(
        -constants.HUMIDITY_DECAY * (session.humidity_pct - constants.HUMIDITY_REFERENCE)
    )
    warm = session.temperature_c - constants.TEMPERATURE_REFERENCE
    surface = (1 - constants.DUST_LOSS * session.dust) * (
        1 - constants.MOISTURE_LOSS * session.moisture
    )
    force = 1.0 - np.exp(-force_n / constants.FORCE_SCALE_N)
    return float(
        constants.OPEN_VOLTAGE_V
        * _RELATIVE_CHARGE[material]
        * humidity
        * (1 - constants.TEMPERATURE_LOSS * warm)
        * surface
        * force
    )


class Sensors:
    """Sensors and boards of one session, sample by sample; keeps its state between calls."""

    def __init__(
        self,
        session: Session,
        rate_hz: float,
        wiring: str,
        reference_v: float,
        rng: np.random.Generator,
        pickup: Pickup | None = None,
    ) -> None:
        self._pickup = pickup
        self._session = session
        self._rate_hz = rate_hz
        self._shared = wiring == "one-board"
        self._reference_v = reference_v
        self._rng = rng
        self._tau_s = session.time_constant_s * (1 - constants.MOISTURE_LOSS * session.moisture)
        self._state = np.zeros((1, 12))
        self._charge = np.zeros((1, 12))
        self._scan = 0

    def read(self, charge: NDArray[np.float64]) -> NDArray[np.float32]:
        """Return converter readings in volts, shape (n, 12).

        Args:
            charge: Charge on each electrode over its capacitance, volts, shape (n, 12).
        """
        decay = np.exp(-1.0 / (self._rate_hz * self._tau_s))
        before = np.concatenate([self._charge, charge[:-1]])
        self._charge = charge[-1:]
        # Charge that arrives evenly between two scans has already leaked in part: (1 − d)·τ/Δt.
        kept = (1.0 - decay) * self._rate_hz * self._tau_s
        volts, self._state = lfilter([kept], [1.0, -decay], charge - before, axis=0, zi=self._state)
        volts += self._hum(len(charge))
        if self._pickup is not None:
            volts += self._pickup.next(len(charge))[:, None]
        volts = self._ghosts(volts)
        volts += self._rng.normal(0.0, constants.NOISE_V, volts.shape)
        return quantise(volts, self._reference_v)

    def _hum(self, n: int) -> NDArray[np.float64]:
        session = self._session
        level = session.hum_v * (1.0 if self._shared else constants.HUM_GROUNDED)
        time_s = (self._scan + np.arange(n)) / self._rate_hz * (1 + session.clock_ppm * 1e-6)
        self._scan += n
        turn = 2 * np.pi * constants.HUM_HZ * time_s[:, None] + session.hum_phase
        return np.asarray(level * (np.sin(turn) + constants.THIRD_HARMONIC * np.sin(3 * turn)))

    def _ghosts(self, volts: NDArray[np.float64]) -> NDArray[np.float64]:
        """Add what the sample-and-hold keeps of the pin read before.

        With all channels on one board that is the neighbour; with grounded pins
        in between it is nearly nothing.
        """
        hold = constants.HOLD_CAPACITANCE_PF
        share = hold / (hold + self._session.capacitance_pf)
        if not self._shared:
            share = constants.GROUNDED_GHOST
        held = np.roll(volts, 1, axis=1)
        return np.asarray((1.0 - share) * volts + share * held)


def quantise(volts: NDArray[np.float64], reference_v: float) -> NDArray[np.float32]:
    """Return what a converter of 10 bits gives, in volts: 0 … the sensor's 3.3 V at most.

    The input stage clips at 3.3 V; with a 5 V reference that is count 675 of 1023.

    Args:
        volts: Any shape.
        reference_v: Voltage of the largest count plus one.
    """
    step = reference_v / 2**constants.BITS
    counts = np.floor(np.clip(volts, 0.0, 3.3) / step)
    return np.asarray(np.minimum(counts, 2**constants.BITS - 1) * step, np.float32)
