"""Forces on a cup whose gripper moves, or that others touch: all in the gripper's own frame.

A gripper that speeds up, tilts or brakes is no inertial frame: gravity turns in it, and each part
of the cup is pulled by less the frame's acceleration, and outwards by its turning. A table bears
what stands on it, a person what they hold, an obstacle pushes back. Knows nothing about gels.

Sources: rigid bodies in a moving frame, any text on mechanics; the cup's own speed in the gripper
is millimetres a second, so Coriolis' force is left out. Sizes: docs/decisions/0045.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from taxel.sim.pour.cups import PourRun
from taxel.sim.pour.grip_limits import GRAVITY_M_S2
from taxel.sim.pour.gripper_path import GripperMoment
from taxel.sim.pour.scenes import Hit, Person, Scene
from taxel.sim.pour.state import GraspPhase

Array = NDArray[np.float64]

FOOT_MM = 30.0
"""Half the width of the cup's bottom: it stands on its two ends. Our choice, decision 45."""
TABLE_N_MM = 4.0
"""Stiffness of the table under each end: felt or a mat. Our choice, decision 45."""
TABLE_FRICTION = 0.3
"""Of the cup on it. Our choice, decision 45."""
TABLE_S = 0.003
"""Its damping over its stiffness. Our choice, decision 45: a cup that is put down is at rest
after some hundredths of a second."""


@dataclass(frozen=True, slots=True)
class Load:
    """What pulls at the handle, but for the gels."""

    force_n: Array
    """Shape (2,): x and down."""
    moment_n_mm: float
    """Clockwise about the pads' middle."""


class Surroundings:
    """All but the gels that acts on the cup of one run.

    Args:
        run: With a scene.
    """

    def __init__(self, run: PourRun) -> None:
        assert run.scene is not None
        self.scene: Scene = run.scene
        self._lever_mm, self._below_mm = run.cup.lever_mm, self.scene.below_mm
        self._inertia_mm2 = inertia_mm2(run)
        self._outside_n = np.zeros(2)
        self._feet = tuple(run.cup.lever_mm + side * FOOT_MM for side in (-1.0, 1.0))

    def sag_mm(self, mass_kg: float) -> float:
        """Return how deep a cup that stands at rest sinks into the table."""
        return mass_kg * GRAVITY_M_S2 / (len(self._feet) * TABLE_N_MM) * self.scene.on_table

    def gripper(self, time_s: float) -> GripperMoment:
        """Return the gripper's tilt and motion at a moment, seconds since time zero."""
        return self.scene.path.at(time_s, GRAVITY_M_S2)

    def load(
        self, time_s: float, place: Array, speed: Array, mass_kg: float, poured_n: Array
    ) -> Load:
        """Return the load on the handle at a moment: forces and moment, from weight to pushes.

        Args:
            time_s: Since time zero.
            place: Shape (3,): of the handle in the gripper, x and down (mm), turn (rad).
            speed: Shape (3,): its change a second.
            mass_kg: Of the cup and what is in it.
            poured_n: Shape (2,): jet, unrest and pushes, at the centre of mass.
        """
        gripper = self.gripper(time_s)
        cos, sin = math.cos(place[2]), math.sin(place[2])
        arm = (
            self._lever_mm * cos - self._below_mm * sin,
            self._lever_mm * sin + self._below_mm * cos,
        )
        turn2, turn_rate = float(gripper.state[2, 1]) ** 2, float(gripper.state[2, 2])
        swing = np.array([turn2 * arm[0] + turn_rate * arm[1], turn2 * arm[1] - turn_rate * arm[0]])
        weight = mass_kg * gripper.pull_m_s2
        moment = _moment(arm, weight) - mass_kg * self._inertia_mm2 * turn_rate / 1000.0
        weight = weight + mass_kg / 1000.0 * swing
        outside, about = np.zeros(2), 0.0
        scene = self.scene
        if scene.person is not None:
            borne, pulled = _borne(scene.person, time_s), _pulled(scene.person, time_s)
            outside = outside - borne * weight + pulled
            about += _moment(arm, pulled) - borne * moment
        if scene.hit is not None:
            pushed = _pushed(scene.hit, time_s)
            outside = outside + np.array([pushed, 0.0])
            about -= scene.hit.below_mm * pushed
        if scene.on_table:
            stood, turned = self._table(place, speed, gripper)
            outside = outside + stood
            about += turned
        self._outside_n = outside
        return Load(weight + poured_n + outside, moment + _moment(arm, poured_n) + about)

    def truth(self, time_s: float, phase: GraspPhase) -> Array:
        """Return the last columns of the truth, shape (8,), as `MOTION_CHANNELS`."""
        gripper = self.gripper(time_s)
        right, down, tilt = gripper.state[:, 0]
        moved = [right, -down, np.degrees(tilt), *gripper.accel_m_s2]
        return np.array([*moved, *self._outside_n, float(phase)])

    def _table(self, place: Array, speed: Array, gripper: GripperMoment) -> tuple[Array, float]:
        """Return the table's force, shape (2,), and its clockwise moment: it never pulls.

        Friction along it is taken at the height of the pads.
        """
        up_n, moment = 0.0, 0.0
        for foot in self._feet:
            deep = place[1] + place[2] * foot + gripper.state[1, 0]
            if deep > 0.0:
                rate = speed[1] + speed[2] * foot + gripper.state[1, 1]
                push = TABLE_N_MM * max(deep + TABLE_S * rate, 0.0)
                up_n, moment = up_n + push, moment - foot * push
        along = place[0] + gripper.state[0, 0] + TABLE_S * (speed[0] + gripper.state[0, 1])
        most_n = TABLE_FRICTION * up_n
        held_n = min(max(2.0 * TABLE_N_MM * along, -most_n), most_n)
        return np.array([-held_n, -up_n]), moment


def _borne(person: Person, time_s: float) -> float:
    """Return the share of the weight that a person bears."""
    share = _rise((time_s - person.start_s) / person.duration_s)
    return person.bears_from + (person.bears_to - person.bears_from) * share


def _pulled(person: Person, time_s: float) -> Array:
    """Return what a person pulls with, shape (2,), newtons."""
    return np.array(person.pull_n) * _rise((time_s - person.pull_s) / person.pull_rise_s)


def _pushed(hit: Hit, time_s: float) -> float:
    """Return what an obstacle pushes with along x, newtons."""
    since = (time_s - hit.at_s) / hit.duration_s
    return hit.force_n * math.sin(math.pi * since) if 0.0 < since < 1.0 else 0.0


def inertia_mm2(run: PourRun) -> float:
    """Return a cup's moment of inertia about the pads' middle, over its mass."""
    of_cup = run.cup.lever_mm**2 + run.cup.gyration_mm**2
    return of_cup if run.scene is None else of_cup + run.scene.below_mm**2


def _moment(at_mm: tuple[float, float], force_n: Array) -> float:
    """Return a force's clockwise moment, N mm."""
    return float(at_mm[0] * force_n[1] - at_mm[1] * force_n[0])


def _rise(share: float) -> float:
    """Return 0…1 with minimum jerk over 0…1."""
    s = min(max(share, 0.0), 1.0)
    return s * s * s * (10.0 - 15.0 * s + 6.0 * s * s)
