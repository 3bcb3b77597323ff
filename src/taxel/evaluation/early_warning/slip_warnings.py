"""A slip warning judged: a threshold by promise, lead before each loss, and near misses beside.

The user promises false alarms a minute; the threshold that keeps it comes from training cups that
the head had not seen. Alarms are raised at once and cleared at half the threshold after a second.
Knows nothing about images, features or how a probability came about.

Source: docs/decisions/0036.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Final

import numpy as np
from numpy.typing import NDArray

from taxel.decisions.stability import StabilityConfig, states
from taxel.errors import BadInput
from taxel.evaluation.early_warning.events import (
    EventConfig,
    EventScores,
    RunOutcome,
    StateTrack,
    judge,
    poisson_interval,
    summarise,
)
from taxel.evaluation.intervals import Interval, percentile_interval

CLEAR_S: Final = 1.0
"""How long a drive must stay below half its threshold before a warning is cleared, seconds."""
EVENTS: Final = EventConfig()
NEAR_UM: Final = (100.0, 150.0, 200.0, 250.0)
"""Slips of pours that hold which are reported beside false alarms, micrometres."""
RESAMPLES: Final = 500
_TRIED, _FEWEST_TRIED, _MOST_TRIED = 2.0, 20, 400
"""Thresholds that are tried: the largest drives of so many times the promised alarms, and of so
many pours more, evenly thinned to the last number. Source: our choice: resampled cups ask for up
to half as many again."""


@dataclass(frozen=True, slots=True, kw_only=True)
class WarningTrack:
    """One pour: what drives the warning, and what truly happened."""

    drive: NDArray[np.floating]
    """Shape (n,): probability, or another number that grows with danger, at least 0."""
    time_s: NDArray[np.float64]
    """Shape (n,): of the newest frame, seconds since the grasp."""
    onset_s: float | None
    """When it first slips more than 20 µm, from which on a warning is justified."""
    event_s: float | None
    """When it first slips more than 300 µm; None: it holds."""
    later_s: Mapping[str, float | None]
    """When worse happens, such as {"1 mm": 2.1, "drop": None}."""
    largest_um: float
    """Largest slip, micrometres."""
    groups: Mapping[str, str]
    """Cup, force, position, kind."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Promise:
    """A slip warning's threshold for a promised rate of false alarms, with the rate found."""

    threshold: float
    interval: Interval
    """95 % of thresholds over resampled cups."""
    asked_per_min: float
    """What was promised."""
    found_per_min: float
    """What the threshold gives on the pours that it was chosen on."""
    found_interval: Interval
    """95 %, by Poisson."""
    hold_min: float
    """Minutes of pours that hold."""


@dataclass(frozen=True, slots=True, kw_only=True)
class WarningScores:
    """What a warning is worth on some pours."""

    events: EventScores
    leads: dict[str, dict[str, float]]
    """Loss → {"median", "p5", "n", "missed"}: before 300 µm, 1 mm, drop."""
    near: dict[str, float]
    """"> 100 um" → pours that hold and slip so far, a minute of hold."""
    alarms_by_slip: dict[str, int]
    """False alarms by the largest slip of their pour."""


def alarm_config(threshold: float) -> StabilityConfig:
    """Return how a drive of 0…1 becomes a state: at once, cleared at half after a second."""
    return StabilityConfig(
        warn=threshold,
        clear=threshold / 2,
        unstable=1.0,
        raise_s=0.0,
        clear_s=CLEAR_S,
        frozen_s=float("inf"),
    )


def judge_track(track: WarningTrack, threshold: float) -> RunOutcome:
    """Return the outcome of one pour.

    Args:
        track: The pour.
        threshold: Of the drive; drives of any size are scaled so that it is one half.

    Raises:
        BadInput: The threshold is not above 0.
    """
    if threshold <= 0:
        raise BadInput("a threshold above 0", f"{threshold:g}", "choose another")
    scaled = np.clip(np.asarray(track.drive, np.float64) / (2 * threshold), 0.0, 1.0)
    found = states(scaled, track.time_s, alarm_config(0.5))
    return judge(
        StateTrack(
            states=found,
            time_s=track.time_s,
            onset_s=track.onset_s,
            event_s=track.event_s,
            groups=track.groups,
        ),
        EVENTS,
    )


def false_alarms(track: WarningTrack, threshold: float) -> int:
    """Return the false alarms of a pour that holds: `judge_track`'s, a hundredfold faster.

    Args:
        track: A pour that holds.
        threshold: Of the drive.
    """
    drive, time_s = np.asarray(track.drive, np.float64), track.time_s
    raised = drive >= threshold
    if not raised.any():
        return 0
    # the last moment at which each condition changed, and so for how long it has held
    index = np.arange(len(drive))
    calm = drive < threshold / 2
    since = np.maximum.accumulate(np.where(calm, -1, index)) + 1
    cleared = calm & (time_s - time_s[np.minimum(since, index)] >= CLEAR_S - 1e-9)
    settled_s = float(time_s[0]) + EVENTS.settled_s
    count, at = 0, 0
    while at < len(drive):
        begin = at + int(np.argmax(raised[at:]))
        if not raised[begin]:
            break
        ends = np.flatnonzero(cleared[begin:])
        end = begin + int(ends[0]) if len(ends) else len(drive)
        count += int(end == len(drive) or time_s[end] > settled_s)
        at = end
    return count


def keep_promise(tracks: Sequence[WarningTrack], per_min: float, seed: int = 0) -> Promise:
    """Return the lowest threshold whose false alarms a minute stay within a promise.

    Args:
        tracks: Training pours, each driven by a head that had not seen its cup.
        per_min: False alarms a minute of pours that hold.
        seed: Of the resampling of cups.

    Raises:
        BadInput: No pour holds, or the promise is below 0.
    """
    holds = [track for track in tracks if track.event_s is None]
    if not holds or per_min < 0:
        raise BadInput(
            "a promise of at least 0 and pours that hold", f"{per_min:g} and {len(holds)}",
            "promise more, or add pours",
        )  # fmt: skip
    minutes = np.array([track.time_s[-1] - track.time_s[0] - EVENTS.settled_s for track in holds])
    minutes = minutes / 60.0
    # nearly each pour above a threshold is an alarm: so many pours reach beyond the promise
    reach = _FEWEST_TRIED + int(np.ceil(_TRIED * per_min * minutes.sum()))
    peaks = np.sort([float(np.max(track.drive)) for track in holds])[-reach:]
    peaks = peaks[np.unique(np.linspace(0, len(peaks) - 1, _MOST_TRIED).round().astype(int))]
    tried = np.unique(np.nextafter(peaks, np.inf))
    counts = np.array([[false_alarms(track, float(t)) for t in tried] for track in holds])
    cups = np.array([track.groups.get("cup", str(i)) for i, track in enumerate(holds)])
    chosen = _lowest(counts.sum(axis=0), float(minutes.sum()), per_min)
    random = np.random.default_rng(seed)
    names, index = np.unique(cups, return_inverse=True)
    by_cup = np.zeros((len(names), len(tried)))
    np.add.at(by_cup, index, counts)
    time_by_cup = np.bincount(index, minutes, len(names))
    drawn = []
    for _ in range(RESAMPLES):
        pick = random.integers(0, len(names), len(names))
        place = _lowest(by_cup[pick].sum(axis=0), float(time_by_cup[pick].sum()), per_min)
        drawn.append(float(tried[place]))
    count, total = int(counts[:, chosen].sum()), float(minutes.sum())
    return Promise(
        threshold=float(tried[chosen]),
        interval=percentile_interval(drawn),
        asked_per_min=per_min,
        found_per_min=count / total,
        found_interval=poisson_interval(count, total),
        hold_min=total,
    )


def _lowest(counts: NDArray[np.floating], minutes: float, per_min: float) -> int:
    """Return the first threshold from which on the promise is kept; the last where none does."""
    broken = counts > per_min * minutes + 1e-9
    return min(int(np.flatnonzero(broken)[-1]) + 1, len(counts) - 1) if broken.any() else 0


def score_warnings(
    tracks: Sequence[WarningTrack], threshold: float, seed: int = 0
) -> tuple[WarningScores, list[RunOutcome]]:
    """Return what a threshold gives on pours, and each pour's outcome.

    Args:
        tracks: Pours that neither head nor threshold have seen.
        threshold: Of the drive.
        seed: Of the resampling of cups.
    """
    outcomes = [judge_track(track, threshold) for track in tracks]
    events = summarise(outcomes, seed=seed)
    leads = {"300 um": _leads([out.lead_s for out in outcomes if out.event])}
    for what in sorted({name for track in tracks for name in track.later_s}):
        found = [
            None if out.warned_s is None else moment - out.warned_s
            for track, out in zip(tracks, outcomes, strict=True)
            if (moment := track.later_s.get(what)) is not None
        ]
        leads[what] = _leads(found)
    held = [(t, o) for t, o in zip(tracks, outcomes, strict=True) if not o.event]
    minutes = max(events.hold_min, 1e-9)
    near = {
        f"> {um:g} um": sum(t.largest_um > um for t, _ in held) / minutes for um in NEAR_UM
    }  # fmt: skip
    edges = (0.0, 100.0, 200.0, np.inf)
    by_slip = {
        f"{low:g} to {high:g} um" if np.isfinite(high) else f"> {low:g} um": sum(
            o.false_alarms for t, o in held if low < t.largest_um <= high or low == t.largest_um
        )
        for low, high in pairwise(edges)
    }
    return WarningScores(events=events, leads=leads, near=near, alarms_by_slip=by_slip), outcomes


def _leads(found: Sequence[float | None]) -> dict[str, float]:
    known = np.array([lead for lead in found if lead is not None])
    missed = sum(lead is None or lead < 0 for lead in found)
    return {
        "n": float(len(found)),
        "median_s": float(np.median(known)) if len(known) else float("nan"),
        "p5_s": float(np.percentile(known, 5)) if len(known) else float("nan"),
        "missed": missed / len(found) if found else float("nan"),
    }
