"""Choose thresholds and debounce of the stability monitor on training cups.

Give it probabilities of cups that the model was *not* fitted on (out of fold, within the
training cups), or they look better than they will be; never a test cup's. Knows nothing
about models, folds or files.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import product

import numpy as np
from numpy.typing import NDArray

from taxel.decisions.stability import StabilityConfig, states
from taxel.errors import BadInput
from taxel.evaluation.early_warning.events import EventConfig, RunOutcome, StateTrack, judge

_LEAD_STEP_S = 0.01
"""Leads closer than this are alike; fewer false alarms then decide, seconds."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ProbabilityTrack:
    """One training run: its probabilities, and what truly happened."""

    probabilities: NDArray[np.floating]
    """Shape (n,): of instability, 0…1, from a model that did not see this cup."""
    time_s: NDArray[np.float64]
    """Shape (n,): of the newest frame of each window, seconds."""
    onset_s: float | None
    """When a warning begins to be justified (micro-slip); None: never."""
    event_s: float | None
    """When what it warns of happens (gross slip); None: the run holds."""
    groups: Mapping[str, str] = field(default_factory=dict)
    """Cup, force, position and so on."""
    usable: NDArray[np.bool_] | None = None
    """Shape (n,): False where a window may not be trusted; None: all may."""


@dataclass(frozen=True, slots=True, kw_only=True)
class TuningGoal:
    """Maximise the median lead within these limits.

    Source: our choice, docs/decisions/0013: half of what is promised on unseen cups.
    """

    false_alarms_per_min: float = 0.25
    """Most false alarms a minute, over runs that hold and calm stretches of the others."""
    missed_share: float = 0.05
    """Most events without a warning before them, 0…1."""


@dataclass(frozen=True, slots=True, kw_only=True)
class TuningGrid:
    """What is tried."""

    warn: tuple[float, ...] = (0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 0.95, 0.98)
    """Thresholds for a warning, 0…1."""
    clear_share: tuple[float, ...] = (0.5,)
    """`clear` as a share of `warn`, 0…1."""
    raise_s: tuple[float, ...] = (0.0, 0.05, 0.1, 0.2)
    """Debounce before a warning, seconds."""
    clear_s: tuple[float, ...] = (0.3, 1.0)
    """Debounce before a warning is cleared, seconds."""

    def configs(self, base: StabilityConfig) -> Iterator[StabilityConfig]:
        """Give each combination; `unstable` stands half way from `warn` to 1."""
        for warn, share, raise_s, clear_s in product(
            self.warn, self.clear_share, self.raise_s, self.clear_s
        ):
            yield replace(
                base,
                warn=warn,
                clear=warn * share,
                unstable=(1 + warn) / 2,
                raise_s=raise_s,
                clear_s=clear_s,
            )


@dataclass(frozen=True, slots=True, kw_only=True)
class Tuned:
    """The monitor's chosen thresholds, with their figures on the runs they were chosen on."""

    config: StabilityConfig
    """From probability to state."""
    within: bool
    """True where the limits are kept; False: the combination that comes nearest to them."""
    lead_median_s: float
    """Median warning before the event, seconds; minus infinity without any warning."""
    missed_share: float
    """Events without a warning before them, 0…1; 0 without events."""
    false_alarms_per_min: float
    """False alarms a minute, over runs that hold and calm stretches of the others."""


def tune(
    tracks: Sequence[ProbabilityTrack],
    goal: TuningGoal | None = None,
    base: StabilityConfig | None = None,
    grid: TuningGrid | None = None,
    events: EventConfig | None = None,
) -> Tuned:
    """Return the thresholds and debounce that warn earliest within the limits.

    Args:
        tracks: Training runs, with probabilities from models that did not see their cup.
        goal: The limits.
        base: Where ages and freezing come from; they are not tuned.
        grid: What is tried.
        events: What counts as a warning.

    Raises:
        BadInput: No run has an event, or none holds: there is nothing to weigh.
    """
    happened = [track.event_s is not None for track in tracks]
    if not any(happened) or all(happened):
        raise BadInput(
            "training runs with the event and runs that hold",
            f"{sum(happened)} with it of {len(happened)}",
            "add runs of the other kind",
        )
    limits = goal or TuningGoal()
    tried = [
        _try(tracks, config, limits, events or EventConfig())
        for config in (grid or TuningGrid()).configs(base or StabilityConfig())
    ]
    return max(tried, key=lambda candidate: _merit(candidate, limits))


def _try(
    tracks: Sequence[ProbabilityTrack],
    config: StabilityConfig,
    goal: TuningGoal,
    events: EventConfig,
) -> Tuned:
    outcomes = [
        judge(
            StateTrack(
                states=states(track.probabilities, track.time_s, config, track.usable),
                time_s=track.time_s,
                onset_s=track.onset_s,
                event_s=track.event_s,
            ),
            events,
        )
        for track in tracks
    ]
    missed = float(np.mean([outcome.missed for outcome in outcomes if outcome.event]))
    rate = _rate_per_min(outcomes)
    leads = [outcome.lead_s for outcome in outcomes if outcome.lead_s is not None]
    return Tuned(
        config=config,
        within=missed <= goal.missed_share and rate <= goal.false_alarms_per_min,
        lead_median_s=float(np.median(leads)) if leads else -np.inf,
        missed_share=missed,
        false_alarms_per_min=rate,
    )


def _rate_per_min(outcomes: Sequence[RunOutcome]) -> float:
    judged_s = sum(outcome.judged_s for outcome in outcomes)
    count = sum(outcome.false_alarms for outcome in outcomes)
    return count * 60.0 / judged_s if judged_s > 0 else 0.0


def _merit(tuned: Tuned, goal: TuningGoal) -> tuple[float, ...]:
    """Return what is compared: limits kept, else the excess; then lead, then fewer errors."""
    excess = 0.0
    if not tuned.within:
        excess = max(tuned.false_alarms_per_min - goal.false_alarms_per_min, 0.0) / max(
            goal.false_alarms_per_min, 1e-3
        ) + max(tuned.missed_share - goal.missed_share, 0.0) / max(goal.missed_share, 1e-3)
    steps = (
        np.floor(tuned.lead_median_s / _LEAD_STEP_S) if np.isfinite(tuned.lead_median_s) else -1e9
    )
    return -excess, float(steps), -tuned.false_alarms_per_min, -tuned.missed_share
