"""A force gauge that presses each sensor of the simulated hand with known forces, up and down.

The charge under the gauge's tip follows `electrics.full_voltage`, and every scan
passes through the same leak, hum, ghosts, clipping and bits as a grasp does. Knows nothing
about files, curves or fits.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from taxel.signals import Mark, Samples, SensorInfo, flag_values
from taxel.sim.teng import constants
from taxel.sim.teng.constants import MATERIALS, SENSORS
from taxel.sim.teng.contact import smooth_step
from taxel.sim.teng.electrics import Sensors, Session, draw_session, full_voltage, quantise
from taxel.sim.teng.hand import TengHandConfig, sensor_info
from taxel.sim.teng.wear import Wear

_TAP_PART = 0.2
"""Share of a tap's period that rise, hold and release take each. Our choice, 0047."""
_TAP_JITTER = 0.05
"""Spread of the taps' rate, logarithmic. Our choice, docs/decisions/0047."""
_SENSORS_A_BOARD = 4
"""Source: TENG thesis, section 3.2: three boards, four sensors each."""


@dataclass(frozen=True, slots=True, kw_only=True)
class GaugeConfig:
    """What the gauge does. Source: forces from the thesis, section 3.4; the rest is our
    choice, docs/decisions/0022.
    """

    forces_n: tuple[float, ...] = (0.5, 0.75, 1.0, 1.5, 2.0, 3.0, 4.0, 5.0)
    """Forces of a rising series, newtons; the falling one is the same backwards."""
    rounds: int = 3
    """Rising and falling series on each sensor."""
    material: str = "plastic"
    """Of the gauge's tip; aluminium drives many sensors past 3.3 V."""
    rise_s: float = 0.06
    """From touch to the full force, seconds; letting go takes as long."""
    hold_s: float = 0.3
    """At the full force, seconds."""
    rest_s: float = 1.2
    """Between presses, seconds: several time constants."""
    force_spread: float = 0.02
    """How far a press misses the force that was asked for, logarithmic."""
    gauge_error: float = 0.005
    """Error of what the gauge shows, logarithmic."""
    scatter: float = 0.01
    """Spread of equal presses in volts, logarithmic."""
    memory: float = 0.04
    """Hysteresis: a press after one of 5 N more reads higher by this share."""
    baseline_v: tuple[float, float] = (0.03, 0.06)
    """Leakage into the pins at rest, as volts, drawn for each sensor."""
    drift_v_per_hour: tuple[float, float] = (-0.05, 0.15)
    """How that changes, volts an hour, drawn for each sensor."""
    references_v: tuple[float, ...] = (1.65, 3.3)
    """Known voltages put on all pins at the end, volts."""
    reference_s: float = 0.5
    """How long each, seconds."""
    board_error: float = 0.004
    """Error of a board's own reference, relative, standard deviation."""

    def __post_init__(self) -> None:
        if not self.forces_n or min(self.forces_n) <= 0 or self.rounds < 1:
            raise ValueError("needed forces above 0 N and at least one round")
        if self.material not in MATERIALS:
            raise ValueError(f"needed one of {', '.join(MATERIALS)}; got {self.material!r}")
        if min(self.rise_s, self.hold_s, self.rest_s, self.reference_s) <= 0:
            raise ValueError("needed times above 0 s")


@dataclass(frozen=True, slots=True, kw_only=True)
class GaugeTruth:
    """What the simulator put in, to judge what a calibration gets out."""

    session: Session
    baseline_v: NDArray[np.float64]
    """Shape (12,), at the first scan, volts."""
    drift_v_per_hour: NDArray[np.float64]
    """Shape (12,)."""
    reference_error: NDArray[np.float64]
    """Shape (12,): by how much each pin's board reads too high, relative."""


class ForceGauge:
    """The hand under the gauge; time begins at 0 and goes on from press to press.

    The sensors are those of `sim://teng` with the same settings, so that a calibration
    made here can be applied to a recording of it.

    Args:
        hand: The hand's settings; its seed draws the sensors, and the gauge's own luck.
        gauge: What the gauge does.
    """

    def __init__(self, hand: TengHandConfig, gauge: GaugeConfig | None = None) -> None:
        self._hand = hand
        self._gauge = gauge or GaugeConfig()
        own = np.random.SeedSequence([hand.seed, 0, 0 if hand.preset == "honest" else 1])
        self._session = draw_session(
            np.random.default_rng(own.spawn(1)[0]),
            hand.temperature_c,
            hand.humidity_pct,
            hand.dust,
            hand.moisture,
        )
        self._rng = np.random.default_rng([hand.seed, 0x6A75])
        self._sensors = Sensors(
            self._session, hand.rate_hz, hand.wiring, hand.reference_v, self._rng
        )
        wet = 1 - constants.MOISTURE_LOSS * self._session.moisture
        self._tau_s = self._session.time_constant_s * wet
        boards = self._rng.normal(0.0, self._gauge.board_error, len(SENSORS) // _SENSORS_A_BOARD)
        self.truth = GaugeTruth(
            session=self._session,
            baseline_v=self._rng.uniform(*self._gauge.baseline_v, len(SENSORS)),
            drift_v_per_hour=self._rng.uniform(*self._gauge.drift_v_per_hour, len(SENSORS)),
            reference_error=np.repeat(boards, _SENSORS_A_BOARD),
        )
        self._leaked = np.zeros(len(SENSORS))
        self._wear = Wear(hand.fatigue, hand.worn_presses, len(SENSORS))
        self._scan = 0

    @property
    def info(self) -> SensorInfo:
        """What the array is: as `sim://teng`, with the conditions of this session."""
        info = sensor_info(self._hand)
        conditions = {
            "temperature_c": f"{self._session.temperature_c:.1f}",
            "humidity_pct": f"{self._session.humidity_pct:.1f}",
            "gauge_tip": self._gauge.material,
            "gauge_rise_s": f"{self._gauge.rise_s:g}",
        }
        return replace(info, details={**info.details, **conditions})

    def script(self) -> Iterator[tuple[Samples, list[Mark]]]:
        """Yield scans and marks: a rest, every sensor's presses, then the known voltages."""
        gauge = self._gauge
        yield self.rest(3.0), []
        series = [*sorted(gauge.forces_n), *sorted(gauge.forces_n, reverse=True)]
        for sensor in range(len(SENSORS)):
            heavier_n = 0.0
            for number in range(gauge.rounds):
                for place, force_n in enumerate(series):
                    falling = place >= len(gauge.forces_n)
                    heavier_n = max(heavier_n, force_n) if falling else 0.0
                    samples, mark = self.press(sensor, force_n, heavier_n)
                    way = "down" if falling else "up"
                    labels = {**mark.labels, "direction": way, "round": str(number + 1)}
                    yield samples, [replace(mark, labels=labels)]
        for volts in gauge.references_v:
            yield self.rest(0.3), []
            samples = self._reference(volts)
            ends = float(samples.fitted_s[0]), float(samples.fitted_s[-1])
            yield samples, [Mark(start_s=ends[0], end_s=ends[1],
                                 labels={"reference_v": f"{volts:g}"})]  # fmt: skip
        yield self.rest(1.0), []

    def press(self, sensor: int, force_n: float, heavier_n: float = 0.0) -> tuple[Samples, Mark]:
        """Press one sensor and let go, then rest; return the scans and the press's mark.

        Args:
            sensor: Its column.
            force_n: The force that is meant, newtons; the mark says what the gauge showed.
            heavier_n: The heaviest press of this series before it, newtons.
        """
        gauge = self._gauge
        pressed_n = force_n * math.exp(self._rng.normal(0.0, gauge.force_spread))
        shown_n = pressed_n * math.exp(self._rng.normal(0.0, gauge.gauge_error))
        gain = math.exp(self._rng.normal(0.0, gauge.scatter))
        gain *= 1.0 + gauge.memory * max(heavier_n - force_n, 0.0) / 5.0
        length_s = 2 * gauge.rise_s + gauge.hold_s
        full_v = full_voltage(self._session, gauge.material, pressed_n) * gain
        samples = self._touch(sensor, full_v, (gauge.rise_s, gauge.hold_s, gauge.rest_s))
        start_s = float(samples.fitted_s[0])
        labels = {"sensor": SENSORS[sensor], "force_n": f"{shown_n:.3f}"}
        return samples, Mark(start_s=start_s, end_s=start_s + length_s, labels=labels)

    def tap(self, sensor: int, force_n: float, tap_hz: float) -> Samples:
        """Tap one sensor once, at a rate; return one period's scans.

        Rise, hold and release take a fifth of the period each, so that faster taps are quicker
        touches too. Source: our choice, docs/decisions/0047.

        Args:
            sensor: Its column.
            force_n: Newtons.
            tap_hz: Taps a second.
        """
        gauge = self._gauge
        # Whoever taps in step with the mains reads the hum's phase, not the pad.
        tap_hz *= math.exp(self._rng.normal(0.0, _TAP_JITTER))
        part_s = _TAP_PART / tap_hz
        pressed_n = force_n * math.exp(self._rng.normal(0.0, gauge.force_spread))
        gain = math.exp(self._rng.normal(0.0, gauge.scatter))
        full_v = full_voltage(self._session, gauge.material, pressed_n) * gain
        return self._touch(sensor, full_v, (part_s, part_s, 1.0 / tap_hz - 3.0 * part_s))

    def _touch(self, sensor: int, full_v: float, times_s: tuple[float, float, float]) -> Samples:
        """Touch one sensor, hold, let go and rest; rise and release take the first time each."""
        rise_s, hold_s, rest_s = times_s
        scans = round((2 * rise_s + hold_s + rest_s) * self._hand.rate_hz)
        time_s = np.arange(scans, dtype=np.float64) / self._hand.rate_hz
        up = smooth_step(time_s / rise_s)
        down = smooth_step((time_s - rise_s - hold_s) / rise_s)
        charge = np.zeros((scans, len(SENSORS)))
        charge[:, sensor] = full_v * (up - down) * self._session.gain[sensor]
        if self._hand.fatigue:
            charge[:, sensor] *= self._wear.left[sensor]
        self._wear.add(np.eye(len(SENSORS))[sensor])
        return self._scans(charge)

    def rest(self, seconds: float) -> Samples:
        """Return scans of an untouched hand."""
        return self._scans(np.zeros((round(seconds * self._hand.rate_hz), len(SENSORS))))

    def _scans(self, charge: NDArray[np.float64]) -> Samples:
        """Return what the converters read while pads are charged, shape (n, 12), volts.

        A leak of b(t) volts at the pin is a current b/τ: it charges the pad steadily.
        """
        rate_hz = self._hand.rate_hz
        time_s = (self._scan + np.arange(len(charge))) / rate_hz
        hours = time_s[:, None] / 3600.0
        leak_v = self.truth.baseline_v + self.truth.drift_v_per_hour * hours
        leaked = self._leaked + np.cumsum(leak_v / (self._tau_s * rate_hz), axis=0)
        values = self._sensors.read(charge + leaked)
        self._leaked = leaked[-1]
        return self._samples(values)

    def _reference(self, volts: float) -> Samples:
        n = round(self._gauge.reference_s * self._hand.rate_hz)
        noise = self._rng.normal(0.0, constants.NOISE_V, (n, len(SENSORS)))
        pin_v = volts * (1.0 + self.truth.reference_error) + noise
        return self._samples(quantise(pin_v, self._hand.reference_v))

    def _samples(self, values: NDArray[np.float32]) -> Samples:
        counter = self._scan + np.arange(len(values), dtype=np.int64)
        time_s = counter / self._hand.rate_hz
        self._scan += len(values)
        return Samples(
            values=values,
            counter=counter,
            device_s=time_s * (1 + self._session.clock_ppm * 1e-6),
            arrival_s=time_s,
            fitted_s=time_s,
            validity=flag_values(values, self.info.full_scale),
        )
