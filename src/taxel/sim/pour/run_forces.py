"""What a run does by itself: how its grip fades, falls or closes, and what pulls at the cup.

Knows nothing about the cup's motion, gels or pixels.

Source: docs/decisions/0013; closing jaws, docs/decisions/0045.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from taxel.sim.pour.cups import PourRun
from taxel.sim.pour.grip_limits import force_of, indentation
from taxel.sim.pour.state import GraspPhase

GRIP_SETTLE_S = 1.5
"""Time constant of the grip's relaxation. Source: our choice, docs/decisions/0013."""
_LEAST_N = 0.5
"""Grip below which a gel's depth falls no further, unless jaws are closing. Our choice."""


class RunGrip:
    """The grip of one run: what is commanded, what of it is lost, and jaws that close."""

    def __init__(self, run: PourRun) -> None:
        self._run = run
        self._approach = run.approach
        self.settled_s = 0.0 if run.approach is None else run.approach.settled_s
        """When the grasp is made, seconds."""

    def held_s(self, time_s: float) -> float:
        """Return how long ago the grasp settled, seconds; 0 before."""
        return max(time_s - self.settled_s, 0.0)

    def normal_n(self, time_s: float, grip_n: float) -> float:
        """Return the force that both gels bear.

        Args:
            time_s: Since time zero.
            grip_n: What the gripper is ordered to hold.
        """
        run = self._run
        lost = run.relaxation * (1.0 - np.exp(-self.held_s(time_s) / GRIP_SETTLE_S))
        drop = run.grip_drop * min(max((time_s - run.start_s) / 0.33, 0.0), 1.0)
        held_n = float(grip_n * (1.0 + run.grip_error) * (1.0 - lost) * (1.0 - drop))
        if self._approach is None:
            return held_n
        after_s = time_s - self._approach.contact_s - self._approach.lag_s
        return min(force_of(self._approach.close_mm_s * after_s), held_n)

    def depth_mm(self, time_s: float, normal_n: float) -> float | NDArray[np.float64]:
        """Return how deep both gels are pressed in, or each, shape (2,), after an approach."""
        approach = self._approach
        if approach is None:
            return indentation(max(normal_n, _LEAST_N))[0]
        depth = np.full(2, indentation(normal_n)[0])
        if time_s >= self.settled_s:
            return depth
        alone_mm = approach.close_mm_s * max(time_s - approach.contact_s, 0.0)
        alone_mm = min(alone_mm, indentation(approach.push_n)[0])
        depth[approach.first] = max(depth[approach.first], alone_mm)
        return depth

    def phase(self, time_s: float) -> GraspPhase:
        """Return how far the grasp is."""
        if time_s >= self.settled_s:
            return GraspPhase.HELD
        assert self._approach is not None
        return GraspPhase.OPEN if time_s < self._approach.contact_s else GraspPhase.CLOSING


class RunPulls:
    """Unrest of the hand, the jet of what is poured, and a push."""

    def __init__(self, run: PourRun) -> None:
        self._run = run
        self._random = np.random.default_rng([14, run.seed])
        self._unrest = np.zeros(2)

    def step(
        self, time_s: float, dt_s: float, poured: bool
    ) -> tuple[NDArray[np.float64], float, float]:
        """Return unrest (2,), jet and push, newtons; x and down, the last two down.

        Args:
            time_s: Since time zero.
            dt_s: Since the last call.
            poured: True while something is poured.
        """
        run = self._run
        # Unrest of the hand and the jet: noise of about 8 Hz.
        fade = np.exp(-dt_s * 50.0)
        kick = self._random.normal(size=2) * np.sqrt(1.0 - fade**2)
        self._unrest = self._unrest * fade + kick
        unrest_n = run.vibration_n * self._unrest * (2.0 if poured else 1.0)
        if run.approach is not None and time_s < run.approach.settled_s:
            unrest_n = np.zeros(2)  # the hand does not hold the cup yet
        jet_n = 1.4 * run.flow_g_s / 1000.0 if poured else 0.0  # 1.4 m/s after 10 cm of fall
        since_s = (time_s - run.bump_s) / 0.08
        bump_n = run.bump_n * np.sin(np.pi * since_s) if 0.0 < since_s < 1.0 else 0.0
        return unrest_n, jet_n, float(bump_n)
