"""What an operator lives by: how early a warning comes, how often it is missed or false.

Computed on the states that `taxel.decisions.stability` gives, never on probabilities. Plainly:

- An *alarm* is an unbroken stretch of WARNING or UNSTABLE; UNKNOWN neither ends nor starts one.
  Nothing before the settled start counts; an alarm that stands there begins there.
- The *event* is what the warning is for (gross slip), the *onset* is the first moment at which
  a warning is justified (micro-slip, or whichever label is chosen; the event itself if there
  is none). A run without an event *holds*.
- A *false alarm* is any alarm in a run that holds, or an alarm that began more than `early_s`
  before the onset and was cleared before the onset.
- The *warning* of a run with an event is its first alarm that is not false. If it began more
  than `early_s` before the onset and still stood there, it is *early*: it counts from
  `early_s` before the onset, so that a warning that is always on earns no lead from it.
- *Delay* is warning − onset (negative: before it); *lead* is event − warning (negative: too
  late). A run is *missed* when no warning came before its event.

Knows nothing about models, images or files.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, field

import numpy as np
from numpy.typing import NDArray
from scipy.stats import chi2

from taxel.decisions.stability import Stability
from taxel.errors import BadInput
from taxel.evaluation.intervals import Interval, draw_rows, percentile_interval
from taxel.plain_text import finite, number_of


@dataclass(frozen=True, slots=True, kw_only=True)
class EventConfig:
    """What counts as a warning. Source: our choice, docs/decisions/0013."""

    settled_s: float = 0.4
    """Nothing before this is judged, seconds after the run's first moment."""
    early_s: float = 2.0
    """A warning this long before the onset is still one for it, seconds."""


@dataclass(frozen=True, slots=True, kw_only=True)
class StateTrack:
    """One run: its states, and what truly happened."""

    states: NDArray[np.int8]
    """Shape (n,): numbers of `Stability`, oldest first."""
    time_s: NDArray[np.float64]
    """Shape (n,): strictly increasing, seconds."""
    onset_s: float | None
    """When a warning begins to be justified (micro-slip), same clock; None: never."""
    event_s: float | None
    """When what it warns of happens (gross slip), same clock; None: the run holds."""
    groups: Mapping[str, str] = field(default_factory=dict)
    """Cup, force, position and so on."""

    def __post_init__(self) -> None:
        if len(self.states) != len(self.time_s) or len(self.states) < 2:
            raise BadInput(
                "at least two states, with one time each",
                f"{number_of(len(self.states), 'state')} and {number_of(len(self.time_s), 'time')}",
                "give arrays of one length",
            )


@dataclass(frozen=True, slots=True, kw_only=True)
class RunOutcome:
    """The outcome of one run."""

    event: bool
    """True where the event happened."""
    warned_s: float | None
    """When the warning came, the run's clock, seconds; None: it never came."""
    delay_s: float | None
    """Warning after the onset, seconds; negative: before it; None without a warning."""
    lead_s: float | None
    """Warning before the event, seconds; negative: after it; None without a warning."""
    early: bool
    """True where the warning stood since more than `early_s` before the onset."""
    false_alarms: int
    """False alarms."""
    judged_s: float
    """Time in which an alarm would be false, seconds."""
    unknown_share: float
    """Share of the states since the settled start that are UNKNOWN, 0…1."""
    groups: Mapping[str, str]
    """Cup, force, position and so on."""

    @property
    def missed(self) -> bool:
        """True where the event happened without a warning before it."""
        return self.event and (self.lead_s is None or self.lead_s < 0)


def alarms(
    states: NDArray[np.int8], time_s: NDArray[np.float64], from_s: float
) -> list[tuple[float, float]]:
    """Return the start of each alarm and the moment at which it is cleared, seconds.

    An alarm that stands at the end is cleared at infinity.

    Args:
        states: Shape (n,): numbers of `Stability`.
        time_s: Shape (n,), seconds.
        from_s: Moments before this are left out, seconds.
    """
    judged = (time_s >= from_s) & (states != Stability.UNKNOWN)
    times = time_s[judged]
    alarm = np.isin(states[judged], (Stability.WARNING, Stability.UNSTABLE))
    edges = np.flatnonzero(np.diff(np.concatenate([[False], alarm, [False]]).astype(np.int8)))
    ends = np.concatenate([times, [np.inf]])
    return [
        (float(times[start]), float(ends[stop]))
        for start, stop in zip(edges[::2], edges[1::2], strict=True)
    ]


def judge(track: StateTrack, config: EventConfig | None = None) -> RunOutcome:
    """Return the outcome of one run, by the rules in the module's header."""
    config = config or EventConfig()
    start_s = float(track.time_s[0]) + config.settled_s
    end_s = float(track.time_s[-1])
    alarm_spans = alarms(track.states, track.time_s, start_s)
    after = track.states[track.time_s >= start_s]
    unknown = float((after == Stability.UNKNOWN).mean()) if len(after) else 1.0
    if track.event_s is None:
        return RunOutcome(
            event=False,
            warned_s=None,
            delay_s=None,
            lead_s=None,
            early=False,
            false_alarms=len(alarm_spans),
            judged_s=max(end_s - start_s, 0.0),
            unknown_share=unknown,
            groups=track.groups,
        )
    onset_s = track.event_s if track.onset_s is None else min(track.onset_s, track.event_s)
    earliest_s = onset_s - config.early_s
    true = [
        (begin, clear) for begin, clear in alarm_spans if begin >= earliest_s or clear > onset_s
    ]
    warned_s = max(true[0][0], earliest_s) if true else None
    return RunOutcome(
        event=True,
        warned_s=warned_s,
        delay_s=None if warned_s is None else warned_s - onset_s,
        lead_s=None if warned_s is None else track.event_s - warned_s,
        early=bool(true) and true[0][0] < earliest_s,
        false_alarms=len(alarm_spans) - len(true),
        judged_s=max(earliest_s - start_s, 0.0),
        unknown_share=unknown,
        groups=track.groups,
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class EventScores:
    """Scores over many runs. Each interval is 95 %, by resampling whole cups; (NaN, NaN)
    where there is one cup only. Times in seconds, NaN where there is nothing to measure.
    """

    runs: int
    """Runs judged."""
    events: int
    """Runs in which the event happened; the others hold."""
    clusters: int
    """Cups (or other clusters) behind the intervals."""
    delay_median_s: float
    """Warning after the onset, over runs that were warned; late ones included."""
    delay_p5_s: float
    delay_p95_s: float
    delay_interval_s: Interval
    """Of the median."""
    lead_median_s: float
    """Warning before the event, over runs that were warned; late ones negative."""
    lead_p5_s: float
    lead_p95_s: float
    lead_interval_s: Interval
    """Of the median."""
    missed_share: float
    """Events without a warning before them, 0…1."""
    missed_interval: Interval
    early_share: float
    """Events whose warning stood since long before the onset, 0…1: always-on detectors."""
    false_alarms: int
    """False alarms in runs that hold."""
    hold_min: float
    """Minutes of runs that hold."""
    false_alarms_per_min: float
    """False alarms a minute in runs that hold."""
    false_alarms_interval: Interval
    false_alarms_poisson: Interval
    """Exact 95 % Poisson interval of the same rate: what zero alarms are worth."""
    false_alarms_per_min_all: float
    """The same with the stretches long before the onset of runs that do not hold."""
    unknown_share: float
    """Mean share of UNKNOWN states, 0…1."""

    def as_dict(self) -> dict[str, object]:
        """Return the fields by name, NaN and infinity as None, as JSON wants them."""
        return dict(finite(asdict(self)))


def summarise(outcomes: Sequence[RunOutcome], cluster: str = "cup", seed: int = 0) -> EventScores:
    """Return the scores of many runs, with intervals by resampling whole clusters.

    Args:
        outcomes: Of each run.
        cluster: The group that is resampled; runs without it are clusters of their own.
        seed: Seed of the resampling.

    Raises:
        BadInput: There are no runs.
    """
    if not outcomes:
        raise BadInput("at least one run", "none", "judge some runs first")
    table = _Table(outcomes, cluster)
    drawn = draw_rows(table.cluster, seed)
    delay = _percentiles(table.delay_s)
    lead = _percentiles(table.lead_s)
    holding = ~table.event
    alarms_held = int(table.false_alarms[holding].sum())
    hold_min = float(table.judged_s[holding].sum()) / 60.0

    def interval(statistic: Callable[[NDArray[np.intp]], float]) -> Interval:
        return percentile_interval([statistic(rows) for rows in drawn])

    return EventScores(
        runs=len(outcomes),
        events=int(table.event.sum()),
        clusters=table.clusters,
        delay_p5_s=delay[0],
        delay_median_s=delay[1],
        delay_p95_s=delay[2],
        delay_interval_s=interval(lambda rows: _median(table.delay_s[rows])),
        lead_p5_s=lead[0],
        lead_median_s=lead[1],
        lead_p95_s=lead[2],
        lead_interval_s=interval(lambda rows: _median(table.lead_s[rows])),
        missed_share=share_of(table.missed, table.event),
        missed_interval=interval(lambda r: share_of(table.missed[r], table.event[r])),
        early_share=share_of(table.early, table.event),
        false_alarms=alarms_held,
        hold_min=hold_min,
        false_alarms_per_min=_per_min(table.false_alarms[holding], table.judged_s[holding]),
        false_alarms_interval=interval(
            lambda r: _per_min(table.false_alarms[r][holding[r]], table.judged_s[r][holding[r]])
        ),
        false_alarms_poisson=poisson_interval(alarms_held, hold_min),
        false_alarms_per_min_all=_per_min(table.false_alarms, table.judged_s),
        unknown_share=float(np.mean([outcome.unknown_share for outcome in outcomes])),
    )


def by_group(
    outcomes: Sequence[RunOutcome], key: str, cluster: str = "cup", seed: int = 0
) -> dict[str, EventScores]:
    """Return the scores of each value of a group, such as cup, force or position.

    Raises:
        BadInput: A run does not have that group.
    """
    parts: dict[str, list[RunOutcome]] = {}
    for outcome in outcomes:
        if key not in outcome.groups:
            raise BadInput(
                f"runs with a {key!r}",
                f"one with {', '.join(outcome.groups)}",
                "choose one of them",
            )
        parts.setdefault(outcome.groups[key], []).append(outcome)
    return {value: summarise(parts[value], cluster, seed) for value in sorted(parts, key=_natural)}


def poisson_interval(count: int, minutes: float) -> Interval:
    """Return the exact 95 % interval of a rate, events a minute; (NaN, NaN) without time.

    Source: Garwood, Biometrika 28 (1936) 437.
    """
    if minutes <= 0:
        return float("nan"), float("nan")
    low = float(chi2.ppf(0.025, 2 * count)) / 2 if count else 0.0
    return low / minutes, float(chi2.ppf(0.975, 2 * count + 2)) / 2 / minutes


class _Table:
    """The outcomes as columns, shape (runs,), NaN where there is no value."""

    def __init__(self, outcomes: Sequence[RunOutcome], cluster: str) -> None:
        self.event = np.array([outcome.event for outcome in outcomes])
        self.missed = np.array([outcome.missed for outcome in outcomes])
        self.early = np.array([outcome.early for outcome in outcomes])
        self.delay_s = np.array([_or_nan(outcome.delay_s) for outcome in outcomes])
        self.lead_s = np.array([_or_nan(outcome.lead_s) for outcome in outcomes])
        self.false_alarms = np.array([outcome.false_alarms for outcome in outcomes])
        self.judged_s = np.array([outcome.judged_s for outcome in outcomes])
        names = [outcome.groups.get(cluster, f"\0{i}") for i, outcome in enumerate(outcomes)]
        self.cluster = np.array(names)
        self.clusters = len(set(names))


def _percentiles(values: NDArray[np.float64]) -> tuple[float, float, float]:
    known = values[~np.isnan(values)]
    if not len(known):
        return float("nan"), float("nan"), float("nan")
    low, middle, high = np.percentile(known, [5, 50, 95])
    return float(low), float(middle), float(high)


def _median(values: NDArray[np.float64]) -> float:
    known = values[~np.isnan(values)]
    return float(np.median(known)) if len(known) else float("nan")


def share_of(part: NDArray[np.bool_], whole: NDArray[np.bool_]) -> float:
    """Return the share of a whole's True that a part has, 0…1, shape (n,) each; NaN of none."""
    return float(part.sum() / whole.sum()) if whole.any() else float("nan")


def _per_min(count: NDArray[np.intp], seconds: NDArray[np.float64]) -> float:
    total_s = float(seconds.sum())
    return float(count.sum()) * 60.0 / total_s if total_s > 0 else float("nan")


def _or_nan(value: float | None) -> float:
    return float("nan") if value is None else value


def _natural(value: str) -> tuple[int, float, str]:
    """Sort numbers by value, before words."""
    try:
        return 0, float(value), value
    except ValueError:
        return 1, 0.0, value
