"""From the state of a grasp to the force that a gripper is commanded to hold.

Three policies: one that follows the monitor's decisions, and two to compare it with, a
difference of pixels and always the maximum. All of them only ever raise the force within a
grasp: a cup that has been filled needs it until it is set down. Knows nothing about
buses, registers, models or wall time: every moment is passed in.

Source: docs/decisions/0017.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from taxel.decisions.stability import Stability, StabilityDecision
from taxel.errors import BadInput
from taxel.labels.change import ChangeConfig, ChangeMeter


@dataclass(frozen=True, slots=True, kw_only=True)
class GripPolicyConfig:
    """How far and how fast the grip is raised. Source: our choice, docs/decisions/0017."""

    most_n: float = 50.0
    """Never more than this is commanded, newtons. Source: paper, section 3.2."""
    warning_step_n: float = 10.0
    """Raise on WARNING, newtons."""
    unstable_step_n: float = 35.0
    """Raise on UNSTABLE, newtons: from the least force of the paper's to the largest."""
    hold_s: float = 0.3
    """Time that a raise is given to act before the next one of the same state, seconds. A
    state that worsens from WARNING to UNSTABLE does not wait."""
    slip_step_n: float = 10.0
    """Where the monitor measures slip: raise by this on WARNING and UNSTABLE alike, newtons."""
    slip_advance_mm: float = 0.1
    """The next raise of the same alarm then waits until the object has slipped by so much,
    further or back, millimetres."""
    slip_hold_s: float = 0.1
    """And at least so long, seconds: the gripper's answer takes 0.05 to 0.1 s."""
    lost_mm: float = 1.0
    """From this slip on nothing waits: the largest force, millimetres."""

    def __post_init__(self) -> None:
        steps = (
            self.warning_step_n, self.unstable_step_n, self.most_n, self.slip_step_n,
            self.slip_advance_mm, self.lost_mm,
        )  # fmt: skip
        if not all(0 < step < math.inf for step in steps):
            raise BadInput("steps and limits above 0", f"{steps}", "give newtons and millimetres")
        holds = (self.hold_s, self.slip_hold_s)
        if self.warning_step_n > self.unstable_step_n or not all(0 <= t < math.inf for t in holds):
            raise BadInput(
                "warning_step_n <= unstable_step_n, hold_s and slip_hold_s of at least 0 s",
                f"{self.warning_step_n}, {self.unstable_step_n}, {self.hold_s} and "
                f"{self.slip_hold_s}",
                "mend them",
            )


class GripPolicy:
    """Raise the grip on WARNING and UNSTABLE; hold it on STABLE and UNKNOWN.

    Where the decision carries a slip that is followed, the grip is raised step by step for as
    long as the object slips, to or fro, and to the limit once it is nearly lost. Without it, a
    small step on WARNING and a large one on UNSTABLE, each again as long as the state lasts.

    Args:
        start_n: Force at which the grasp begins, newtons. More than the limit is kept, and
            never raised.
        config: Steps and limits.

    Raises:
        BadInput: The force is no number above 0.
    """

    def __init__(self, start_n: float, config: GripPolicyConfig | None = None) -> None:
        self._config = config or GripPolicyConfig()
        self.reset(start_n)

    def reset(self, start_n: float) -> None:
        """Begin another grasp."""
        self.force_n = checked_force(start_n)
        """The force to hold now, newtons."""
        self.raised_s: float | None = None
        """When it was raised first, the decisions' clock, seconds; None: not yet."""
        self._last_s = -math.inf
        self._last_state = Stability.STABLE
        self._last_mm = math.inf
        """Slip at the last raise of this alarm, mm; infinity before it."""

    def twin(self) -> GripPolicy:
        """Return another with the same steps and limits, at the same force."""
        return GripPolicy(self.force_n, self._config)

    @property
    def exhausted(self) -> bool:
        """True once the limit is reached: nothing that comes can change the force."""
        return self.force_n >= self._config.most_n

    def push(self, decision: StabilityDecision, time_s: float) -> float:
        """Take in the newest decision; return the force to hold, newtons.

        Args:
            decision: Of the monitor.
            time_s: When it was made, on one clock, seconds. A clock that was set back, or
                that says nothing, never holds a raise up.
        """
        state, slip_mm = decision.state, _followed_mm(decision, self._config.slip_advance_mm)
        if state not in (Stability.WARNING, Stability.UNSTABLE):
            if state is Stability.STABLE:  # the next alarm is a new one
                self._last_mm = math.inf
            return self.force_n
        if self.exhausted:
            return self.force_n
        followed = math.isfinite(slip_mm)
        step_n = self._by_slip(slip_mm, time_s) if followed else self._by_state(state, time_s)
        if not step_n:
            return self.force_n
        self.force_n = min(self.force_n + step_n, self._config.most_n)
        self._last_s, self._last_state = time_s, state
        if followed:
            self._last_mm = slip_mm
        if self.raised_s is None:
            self.raised_s = time_s
        return self.force_n

    def _by_slip(self, slip_mm: float, time_s: float) -> float:
        """Return by how much to raise now that the object has slipped so far, newtons."""
        config = self._config
        if slip_mm >= config.lost_mm:
            return config.most_n
        waits = 0 <= time_s - self._last_s < config.slip_hold_s
        if waits or abs(slip_mm - self._last_mm) < config.slip_advance_mm:
            return 0.0
        return config.slip_step_n

    def _by_state(self, state: Stability, time_s: float) -> float:
        """Return by how much to raise in such a state, newtons."""
        config = self._config
        worse = state is Stability.UNSTABLE and self._last_state is not Stability.UNSTABLE
        if not worse and 0 <= time_s - self._last_s < config.hold_s:
            return 0.0
        return config.unstable_step_n if state is Stability.UNSTABLE else config.warning_step_n


def _followed_mm(decision: StabilityDecision, advance_mm: float) -> float:
    """Return the slip that a decision carries, mm; NaN where it is not known well enough to wait
    for its advance: it is not followed, or its standard deviation is as large as that.
    """
    slip = decision.slip
    if slip is None or not slip.seen or not slip.distance_sd_mm < advance_mm:
        return math.nan
    return slip.distance_mm


@dataclass(frozen=True, slots=True, kw_only=True)
class PixelDifferenceConfig:
    """When a difference of pixels raises the grip."""

    threshold: float = 3.0
    """Mean difference to the settled first frames, per cent of the brightness, of the camera
    that differs most. Tuned on training cups, docs/decisions/0017."""
    raise_s: float = 0.05
    """How long it must stand above, seconds."""
    most_n: float = 50.0
    """What the grip is raised to, newtons."""


class PixelDifference:
    """For comparison: full force once the image differs enough from the first ones.

    Args:
        start_n: Force at which the grasp begins, newtons.
        cameras: How many there are.
        rate_hz: Frames a second.
        config: Threshold and limit.

    Raises:
        BadInput: The force is no number above 0.
    """

    def __init__(
        self,
        start_n: float,
        cameras: int,
        rate_hz: float,
        config: PixelDifferenceConfig | None = None,
    ) -> None:
        self._config = config or PixelDifferenceConfig()
        settled = ChangeConfig().settled(rate_hz)
        self._meters = [ChangeMeter(settled) for _ in range(cameras)]
        self._shown: list[NDArray[np.uint8] | None] = [None] * cameras
        self._values = [0.0] * cameras
        self._since_s: float | None = None
        self.force_n = checked_force(start_n)
        """The force to hold now, newtons."""
        self.raised_s: float | None = None
        """When it was raised, seconds; None: not yet."""

    @property
    def exhausted(self) -> bool:
        """True once the limit is reached: nothing that comes can change the force."""
        return self.force_n >= self._config.most_n

    def push(self, images: Sequence[NDArray[np.uint8]], time_s: float) -> float:
        """Take in the newest image of each camera; return the force to hold, newtons.

        Args:
            images: One a camera, shape (height, width, 3); the very same object again is a
                repeated frame.
            time_s: When they were taken, seconds.
        """
        for camera, (meter, image) in enumerate(zip(self._meters, images, strict=True)):
            if image is self._shown[camera] and meter.complete:
                continue
            self._shown[camera] = image
            values = meter.push(image)
            if len(values):
                self._values[camera] = float(values[-1])
        above = max(self._values) > self._config.threshold
        self._since_s = (time_s if self._since_s is None else self._since_s) if above else None
        if self._since_s is None or time_s - self._since_s < self._config.raise_s - 1e-9:
            return self.force_n
        if not self.exhausted:
            self.force_n = max(self.force_n, self._config.most_n)
            self.raised_s = time_s
        return self.force_n


def checked_force(force_n: float) -> float:
    """Return a force, newtons.

    Raises:
        BadInput: It is no number above 0.
    """
    if not 0 < force_n < math.inf:
        raise BadInput("a grip force above 0 N", f"{force_n}", "give newtons")
    return float(force_n)
