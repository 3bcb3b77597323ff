"""From the state of a grasp to the force that a gripper is told to hold.

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

    def __post_init__(self) -> None:
        steps = (self.warning_step_n, self.unstable_step_n, self.most_n)
        if not all(0 < step < math.inf for step in steps):
            raise BadInput("steps and a limit above 0 N", f"{steps}", "give newtons")
        if self.warning_step_n > self.unstable_step_n or not 0 <= self.hold_s < math.inf:
            raise BadInput(
                "warning_step_n <= unstable_step_n and hold_s of at least 0 s",
                f"{self.warning_step_n}, {self.unstable_step_n} and {self.hold_s}",
                "mend them",
            )


class GripPolicy:
    """Raise the grip on WARNING, more on UNSTABLE; hold it on STABLE and UNKNOWN.

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
        state = decision.state
        if state not in (Stability.WARNING, Stability.UNSTABLE) or self.exhausted:
            return self.force_n
        worse = state is Stability.UNSTABLE and self._last_state is not Stability.UNSTABLE
        if not worse and 0 <= time_s - self._last_s < self._config.hold_s:
            return self.force_n
        step_n = (
            self._config.unstable_step_n
            if state is Stability.UNSTABLE
            else self._config.warning_step_n
        )
        self.force_n = min(self.force_n + step_n, self._config.most_n)
        self._last_s, self._last_state = time_s, state
        if self.raised_s is None:
            self.raised_s = time_s
        return self.force_n


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
