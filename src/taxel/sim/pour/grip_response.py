"""What a gripper does with a commanded force: late, gradually, within limits.

A command travels over a bus and waits in the gripper's controller; then the force follows as
a first-order lag whose slope is limited by how fast the jaws press on. Joined with the cup's
dynamics it gives a pour whose grip may change. Pure physics: knows nothing about buses,
cameras, decisions or who commands.

Source: docs/decisions/0017.
"""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass

from taxel.errors import BadInput
from taxel.sim.pour.cup_pour import PourSim
from taxel.sim.pour.cups import PourRun

SUBSTEPS = 4
"""Steps of the gripper within one of the pour: 2 ms at 120 Hz. Source: our choice."""


@dataclass(frozen=True, slots=True, kw_only=True)
class GripResponseConfig:
    """How a gripper answers. Source: our choice, docs/decisions/0017, where no other stands."""

    latency_s: float = 0.015
    """From the command to the first change of force, seconds: a Modbus write and its answer
    take 1.4 ms at 115200 bit/s, the rest is the gripper's own cycle."""
    time_constant_s: float = 0.03
    """Of the first-order lag, seconds."""
    slew_n_s: float = 300.0
    """Steepest change of force, newtons a second: from 15 to 50 N the gels give way by 1 mm on
    each side (docs/explanation/physics-gel), which jaws of 9 mm/s do in 0.12 s."""
    least_n: float = 15.0
    """Smallest force that can be commanded, newtons. Source: paper, section 3.2."""
    most_n: float = 50.0
    """Largest force that can be commanded, newtons. Source: paper, section 3.2."""

    def __post_init__(self) -> None:
        if not (self.latency_s >= 0 and self.time_constant_s > 0 and self.slew_n_s > 0):
            raise BadInput(
                "a latency of at least 0 s, a time constant and a slew above 0",
                f"{self.latency_s}, {self.time_constant_s} and {self.slew_n_s}",
                "mend them",
            )
        if not 0 < self.least_n <= self.most_n < math.inf:
            raise BadInput(
                "limits 0 < least_n <= most_n", f"{self.least_n} and {self.most_n}", "mend them"
            )


class GripResponse:
    """The force of one gripper over time.

    Args:
        force_n: What it holds at time zero, and has held for long; it may lie outside the
            limits of commands.
        config: How it answers.
    """

    def __init__(self, force_n: float, config: GripResponseConfig | None = None) -> None:
        self.config = config or GripResponseConfig()
        self.force_n = force_n
        """Force now, newtons."""
        self.target_n = force_n
        """The force that has reached the gripper as a command, newtons."""
        self.time_s = 0.0
        self._coming: deque[tuple[float, float]] = deque()

    def command(self, force_n: float, after_s: float = 0.0) -> None:
        """Command a force; what lies outside the limits is cut to them.

        Args:
            force_n: Newtons.
            after_s: How much later than now the command is given, seconds. A command never
                overtakes an earlier one.

        Raises:
            BadInput: The force is no number, or the time is negative.
        """
        if not math.isfinite(force_n) or not 0 <= after_s < math.inf:
            raise BadInput(
                "a force in newtons and a time from 0 s", f"{force_n} and {after_s}", "mend them"
            )
        config = self.config
        due_s = self.time_s + after_s + config.latency_s
        if self._coming:
            due_s = max(due_s, self._coming[-1][0])
        self._coming.append((due_s, min(max(force_n, config.least_n), config.most_n)))

    def step(self, dt_s: float) -> float:
        """Go on by some time; return the force at its end, newtons.

        A command that falls due within the step works from the step's end.

        Args:
            dt_s: Seconds; short beside the time constant.
        """
        config = self.config
        gap_n = self.target_n - self.force_n
        move_n = gap_n * -math.expm1(-dt_s / config.time_constant_s)
        reach_n = config.slew_n_s * dt_s
        self.force_n += min(max(move_n, -reach_n), reach_n)
        self.time_s += dt_s
        while self._coming and self._coming[0][0] <= self.time_s + 1e-9:
            self.target_n = self._coming.popleft()[1]
        return self.force_n


class GrippedPour:
    """One pour held by a gripper that answers to commands.

    With no command it is the very run that `simulate_pour` gives, to the last bit.

    Args:
        run: What is tried; it starts with `run.force_n`.
        config: How the gripper answers.
    """

    def __init__(self, run: PourRun, config: GripResponseConfig | None = None) -> None:
        self.sim = PourSim(run)
        self.gripper = GripResponse(run.force_n, config)

    def step(self, dt_s: float) -> None:
        """Go on by some time.

        Args:
            dt_s: Seconds.
        """
        for _ in range(SUBSTEPS):
            self.sim.step(self.gripper.step(dt_s / SUBSTEPS), dt_s / SUBSTEPS)
