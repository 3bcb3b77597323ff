"""From a stream of probabilities to the state of a grasp: hysteresis, debounce, UNKNOWN.

A warning's score of 0…1, which is no probability, goes the same way.

The same class runs live and over recorded tracks. Knows nothing about models, images,
sources, screens or wall time: every moment is passed in.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import IntEnum

import numpy as np
from numpy.typing import NDArray

from taxel.decisions.reasons import REASONS
from taxel.errors import BadInput
from taxel.gel.slip_signal import Slip

_EXACT_S = 1e-9
"""Times of equal distance may differ by this from rounding, seconds."""


class Stability(IntEnum):
    """The state of a grasp; the numbers are what arrays of states hold."""

    STABLE = 0
    WARNING = 1
    UNSTABLE = 2
    UNKNOWN = 3
    NO_GRASP = 4
    """A grasp has ended and the next has not begun: no fault, and no evidence of anything. Only
    live; what is measured over recorded grasps never holds it."""

    @property
    def word(self) -> str:
        """What a person is shown."""
        return self.name.replace("_", " ")


_ALARMS = (Stability.WARNING, Stability.UNSTABLE)


@dataclass(frozen=True, slots=True, kw_only=True)
class StabilityConfig:
    """From probability to state. Source: our choice, docs/decisions/0013; thresholds and
    times are tuned on training cups by `taxel.evaluation.early_warning.tuning_stability`.
    """

    warn: float = 0.5
    """WARNING once the probability of instability has stood at or above this, 0…1."""
    clear: float = 0.3
    """STABLE again once it has stood below this, 0…1; at most `warn` (hysteresis)."""
    unstable: float = 0.8
    """UNSTABLE once it has stood at or above this, 0…1; at least `warn`."""
    raise_s: float = 0.05
    """How long it must stand above before the state is raised, seconds; 0: at once."""
    clear_s: float = 0.3
    """How long it must stand below `clear` before the state is cleared, seconds."""
    largest_age_s: float = 0.2
    """Input older than this, or a gap longer than this, is UNKNOWN, seconds."""
    frozen_s: float = 1.0
    """The very same probability, to the last bit, for longer than this is a frozen input:
    UNKNOWN, seconds. Exactly 0 and 1 do not count, nor does an alarm that it would hide.
    Infinity for methods that give steps, such as trees and trivial baselines."""

    def __post_init__(self) -> None:
        if not 0 <= self.clear <= self.warn <= self.unstable <= 1:
            raise BadInput(
                "thresholds 0 ≤ clear ≤ warn ≤ unstable ≤ 1",
                f"{self.clear}, {self.warn}, {self.unstable}",
                "order them",
            )
        times = (self.raise_s, self.clear_s, self.largest_age_s, self.frozen_s)
        if not all(time >= 0 for time in times):
            raise BadInput("times of at least 0 s", f"{times}", "give seconds")


@dataclass(frozen=True, slots=True)
class StabilityDecision:
    """The state of the grasp at one moment."""

    state: Stability
    """What is believed."""
    reason: str
    """Why the state is UNKNOWN or NO_GRASP, in words of `taxel.decisions.reasons`; else empty."""
    since_s: float
    """When this state began, on the frames' clock, seconds."""
    probability: float
    """The newest probability of instability, 0…1; NaN where it cannot be used."""
    slip: Slip | None = None
    """How far the object has slipped; None where nothing follows it."""
    is_score: bool = False
    """True where `probability` is a warning's score against its thresholds, and no probability."""

    @property
    def alarm(self) -> bool:
        """True for WARNING and UNSTABLE."""
        return self.state in _ALARMS


class StabilityMonitor:
    """Watches one grasp.

    An alarm that stood before the input failed comes back with the input until it
    is cleared by evidence; STABLE has to be earned again.
    """

    def __init__(self, config: StabilityConfig | None = None) -> None:
        self._config = config or StabilityConfig()
        self.reset()

    def reset(self) -> None:
        """Forget everything: a new grasp."""
        self._held: Stability | None = None  # what the evidence says, whatever the input's health
        self._decision = StabilityDecision(
            Stability.UNKNOWN, REASONS["no input"].say(), float("nan"), float("nan")
        )
        self._last_s: float | None = None  # of the newest input that could be used
        self._newest_s: float | None = None  # of any input
        self._value = float("nan")
        self._same_since_s = float("nan")
        self._restart()

    def push(
        self, probability: float, time_s: float, usable: bool = True, now_s: float | None = None
    ) -> StabilityDecision:
        """Take in the newest probability; return the state.

        The same `time_s` again is no new evidence: only its age is looked at.

        Args:
            probability: Of instability, 0…1.
            time_s: When the newest frame behind it was taken, seconds.
            usable: False where that window's frames may not be trusted.
            now_s: This moment on the same clock, seconds; `time_s` by default.
        """
        now = time_s if now_s is None else now_s
        if self._last_s is not None and time_s == self._last_s:
            return self.at(now)
        doubt = self._why_not(probability, time_s, usable, now)
        if doubt:
            return self.doubt(doubt, time_s if math.isfinite(time_s) else now)
        if self._last_s is not None and time_s - self._last_s > self._config.largest_age_s:
            self._lose()
        self._last_s = time_s
        self._weigh(probability, time_s)
        if self._held is None:
            reason = REASONS["evidence"].say(left_s=self._left_s(time_s))
            return self._decide(Stability.UNKNOWN, reason, time_s, probability)
        return self._decide(self._held, "", time_s, probability)

    def at(self, now_s: float) -> StabilityDecision:
        """Return the state when nothing new has come: UNKNOWN once the input is too old.

        Args:
            now_s: This moment on the frames' clock, seconds.
        """
        if self._last_s is None:
            return self._decision
        age_s = now_s - self._last_s
        if not age_s <= self._config.largest_age_s:
            return self.doubt(REASONS["old"].say(age_s=age_s), now_s)
        return self._decision

    def over(self, now_s: float, before_any: bool = False) -> StabilityDecision:
        """Take in that the grasp has ended and all of it is forgotten; return NO_GRASP.

        Args:
            now_s: This moment on the frames' clock, seconds.
            before_any: True where no grasp has begun yet, so that none can have ended.
        """
        before = self._decision
        self.reset()
        self._decision = before
        reason = REASONS["no grasp yet" if before_any else "grasp over"].say()
        return self._decide(Stability.NO_GRASP, reason, now_s, float("nan"))

    def doubt(self, reason: str, now_s: float) -> StabilityDecision:
        """Take in that nothing can be said now, and why; return UNKNOWN.

        Args:
            reason: In words of `taxel.decisions.reasons`.
            now_s: This moment on the frames' clock, seconds.
        """
        self._lose()
        return self._decide(Stability.UNKNOWN, reason, now_s, float("nan"))

    def _why_not(self, probability: float, time_s: float, usable: bool, now_s: float) -> str:
        """Return why the input cannot be used; empty where it can."""
        config = self._config
        if not math.isfinite(time_s):
            return REASONS["no time"].say()
        newest_s, self._newest_s = self._newest_s, time_s
        if newest_s is not None and time_s < newest_s:
            # A clock that was set back is believed from here on.
            self._last_s, self._value, self._same_since_s = None, float("nan"), float("nan")
            return REASONS["time stepped back"].say()
        if not now_s - time_s <= config.largest_age_s:
            return REASONS["old"].say(age_s=now_s - time_s)
        if not usable:
            return REASONS["unusable"].say()
        if not 0 <= probability <= 1:
            return REASONS["nan" if math.isnan(probability) else "no probability"].say()
        if probability != self._value:
            self._value, self._same_since_s = probability, time_s
        frozen = time_s - self._same_since_s > config.frozen_s
        if frozen and 0 < probability < 1 and self._held not in _ALARMS:
            return REASONS["unchanged"].say(same_s=time_s - self._same_since_s)
        return ""

    def _lose(self) -> None:
        """Forget what a lost stretch of input may have changed: STABLE, and all timers."""
        if self._held is Stability.STABLE:
            self._held = None
        self._restart()

    def _restart(self) -> None:
        self._calm_s: float | None = None
        self._clear_s: float | None = None
        self._warn_s: float | None = None
        self._unstable_s: float | None = None

    def _weigh(self, probability: float, time_s: float) -> None:
        """Move each timer, then the state that the evidence gives."""
        config = self._config
        self._calm_s = _since(self._calm_s, probability < config.warn, time_s)
        self._clear_s = _since(self._clear_s, probability < config.clear, time_s)
        self._warn_s = _since(self._warn_s, probability >= config.warn, time_s)
        self._unstable_s = _since(self._unstable_s, probability >= config.unstable, time_s)
        if _lasted(self._unstable_s, time_s, config.raise_s):
            self._held = Stability.UNSTABLE
        elif self._held in _ALARMS:
            if _lasted(self._clear_s, time_s, config.clear_s):
                self._held = Stability.STABLE
        elif _lasted(self._warn_s, time_s, config.raise_s):
            self._held = Stability.WARNING
        elif self._held is None and _lasted(self._calm_s, time_s, config.raise_s):
            self._held = Stability.STABLE

    def _left_s(self, time_s: float) -> float:
        """Return how long the newest evidence must still stand until a state is given, seconds."""
        begun = [since_s for since_s in (self._calm_s, self._warn_s) if since_s is not None]
        stood_s = time_s - min(begun) if begun else 0.0
        return max(0.0, self._config.raise_s - stood_s)

    def _decide(
        self, state: Stability, reason: str, time_s: float, probability: float
    ) -> StabilityDecision:
        before = self._decision
        since_s = before.since_s if state is before.state and before.since_s <= time_s else time_s
        self._decision = StabilityDecision(state, reason, since_s, probability)
        return self._decision


def states(
    probabilities: NDArray[np.floating],
    time_s: NDArray[np.float64],
    config: StabilityConfig,
    usable: NDArray[np.bool_] | None = None,
) -> NDArray[np.int8]:
    """Return the state after each probability of one recorded grasp, shape (n,).

    Runs the live class over the arrays, so that what is measured is what runs.

    Args:
        probabilities: Shape (n,): of instability, 0…1.
        time_s: Shape (n,): when the newest frame of each window was taken, seconds.
        config: From probability to state.
        usable: Shape (n,): False where a window may not be trusted; all True by default.

    Raises:
        BadInput: The arrays differ in length.
    """
    n = len(probabilities)
    good = np.ones(n, bool) if usable is None else usable
    if not n == len(time_s) == len(good):
        raise BadInput(
            "one time and one flag a probability",
            f"{len(time_s)} and {len(good)} for {n}",
            "give arrays of one length",
        )
    monitor = StabilityMonitor(config)
    found = [
        monitor.push(p, t, u).state
        for p, t, u in zip(probabilities.tolist(), time_s.tolist(), good.tolist(), strict=True)
    ]
    return np.array(found, np.int8)


def _since(since_s: float | None, holds: bool, time_s: float) -> float | None:
    """Return when a condition began to hold, or None where it does not."""
    if not holds:
        return None
    return time_s if since_s is None else since_s


def _lasted(since_s: float | None, time_s: float, least_s: float) -> bool:
    return since_s is not None and time_s - since_s >= least_s - _EXACT_S
