"""The TENG hand that grasps on command: four motors, an object between them, twelve pads.

A motor drives its finger at one speed; where the object stands in the way the finger stops, the
motor's current rises towards its stall and the finger's pads touch. Whoever controls the motors
says each millisecond which of them turn. Pads, charge and converter are those of the other
simulator (`contact`, `electrics`). Pure physics: knows no clock, file or order.
"""

from __future__ import annotations

import zlib
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from taxel.sim.teng import constants
from taxel.sim.teng.contact import Grasp, draw_grasp
from taxel.sim.teng.electrics import Sensors, Session, draw_session, full_voltage
from taxel.sim.teng.hand import TengHandConfig

FINGERS = len(constants.FINGERS)
STEP_S = 0.001
"""One step, seconds; the scans' spacing too."""
_PHALANGES = len(constants.PHALANGES)
_OPEN_MM = 60.0
"""Half of what fits into the open hand, millimetres. Our choice, docs/decisions/0043."""
_ROUND_PERMILLE = 40.0
"""How much later a finger meets the object where none of its pressure falls, per mille of the
travel. Our choice, docs/decisions/0043."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Motors:
    """What the four motors are like. Source: our choice, as those of the emulated boards
    (firmware/emulator/power.c); the thesis names 12 V and 200 N and neither speed nor current.
    """

    stroke_s: float = 5.0
    """From open to closed, seconds."""
    run_ma: float = 300.0
    """While a finger moves freely, milliamperes."""
    stall_ma: float = 1500.0
    """While it cannot move, milliamperes."""
    peak_s: float = 0.015
    """Fading time of the start-up peak, seconds."""
    touch_s: float = 0.002
    """Rise of the current after contact, seconds."""


class GraspedHand:
    """Fingers, object and pads, a millisecond at a time.

    Args:
        config: Forces, surroundings and the converter; its preset and counts are not used.
        motors: What drives the fingers.
    """

    def __init__(self, config: TengHandConfig | None = None, motors: Motors | None = None) -> None:
        self.config = config or TengHandConfig()
        self.motors = motors or Motors()
        self.session_name = ""
        self.position = np.zeros(FINGERS)
        """Shape (4,): 0 open … 1000 closed, per mille."""
        self.turning = np.zeros(FINGERS, np.int8)
        """Shape (4,): −1 opens, 0 off, 1 closes."""
        self._grasp: Grasp | None = None
        self._object = np.full(FINGERS, np.inf)
        self._since_s = np.zeros(FINGERS)  # since the motor was switched
        self._touch_s = np.zeros(FINGERS)  # since the finger met the object, motor closing
        self._press = np.zeros(FINGERS)  # 0 away … 1 fully on the pads
        self.begin_session("live")

    def begin_session(self, name: str) -> None:
        """Draw new gains and surroundings; the same name gives the same ones.

        Args:
            name: The session's.
        """
        if name == self.session_name:
            return
        self.session_name = name
        rng = np.random.default_rng([self.config.seed, zlib.crc32(name.encode())])
        config = self.config
        self.session: Session = draw_session(
            rng, config.temperature_c, config.humidity_pct, config.dust, config.moisture
        )
        self._sensors = Sensors(
            self.session, 1 / STEP_S, config.wiring, config.reference_v, rng.spawn(1)[0]
        )

    def present(self, shape: str, material: str, number: int) -> None:
        """Put an object between the open fingers.

        Args:
            shape: One of `SHAPES`.
            material: One of `MATERIALS`.
            number: Of the grasp: its size, place and force follow from it and the session.
        """
        seed = [self.config.seed, zlib.crc32(self.session_name.encode()), number]
        self._grasp = draw_grasp(
            np.random.default_rng(seed), shape, material, self.config.force_n, self.config.moving
        )
        finger = self._grasp.pressure.reshape(FINGERS, _PHALANGES).mean(axis=1)
        meets = 1000.0 * (1.0 - self._grasp.size_mm / _OPEN_MM)
        self._object = meets + _ROUND_PERMILLE * np.clip(1.0 - finger, 0.0, 1.0)

    @property
    def touching(self) -> NDArray[np.bool_]:
        """Shape (4,): fingers that are on the object."""
        return np.asarray(self.position >= self._object)

    @property
    def currents_ma(self) -> NDArray[np.float64]:
        """Shape (4,): each motor's current, milliamperes, negative while it opens."""
        motors = self.motors
        more = motors.stall_ma - motors.run_ma
        peak = more * np.exp(-self._since_s / motors.peak_s)
        touch = more * (1.0 - np.exp(-self._touch_s / motors.touch_s))
        return np.asarray(self.turning * (motors.run_ma + np.maximum(peak, touch)))

    def turn(self, directions: NDArray[np.int8]) -> None:
        """Switch the motors.

        Args:
            directions: Shape (4,): −1 opens, 0 off, 1 closes.
        """
        self._since_s = np.where(directions == self.turning, self._since_s, 0.0)
        self.turning = directions.astype(np.int8)

    def step(self) -> NDArray[np.float64]:
        """Let a millisecond pass; return the charge on the pads over their capacitance, volts,
        shape (12,), as `volts` takes it.
        """
        travel = 1000.0 * STEP_S / self.motors.stroke_s
        self.position = np.clip(self.position + travel * self.turning, 0.0, 1000.0)
        self.position = np.minimum(self.position, np.maximum(self._object, 0.0))
        self._since_s += STEP_S
        pressing = self.touching & (self.turning > 0)
        self._touch_s = np.where(pressing, self._touch_s + STEP_S, 0.0)
        return self._charge()

    def _charge(self) -> NDArray[np.float64]:
        grasp = self._grasp
        if grasp is None:
            return np.zeros(FINGERS * _PHALANGES)
        change = STEP_S / grasp.rise_s
        self._press = np.clip(self._press + np.where(self.touching, change, -change), 0.0, 1.0)
        smooth = self._press**2 * (3.0 - 2.0 * self._press)
        volts = full_voltage(self.session, grasp.material, grasp.force_n) * self.session.gain
        return np.asarray(np.repeat(smooth, _PHALANGES) * grasp.pressure * volts)

    def volts(self, charge: NDArray[np.float64]) -> NDArray[np.float32]:
        """Return what the converters read, volts, shape (n, 12).

        Args:
            charge: What `step` returned, in order, shape (n, 12).
        """
        return self._sensors.read(charge)
