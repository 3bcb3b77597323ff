"""What a bundle that watches a grasp is worth on recordings: alarms, leads, misses.

Whether a grasp held, and when it slipped, is known by the simulator's truth (gross slip, 300 µm),
else by a person's correction (`taxel.labels.corrections`), else by the grasp's label `outcome`,
which gives no moment. Knows nothing about models, images or screens.

Background of our choices: docs/decisions/0036.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import numpy as np

from taxel.decisions.grasp_track import GraspTrack
from taxel.errors import BadDataset
from taxel.evaluation.early_warning.events import (
    EventScores,
    RunOutcome,
    StateTrack,
    alarms,
    judge,
    poisson_interval,
    summarise,
)
from taxel.evaluation.intervals import at_least_exact
from taxel.evaluation.rank_area import area
from taxel.evaluation.transitions.data import truth_moments
from taxel.labels.corrections import read_corrections
from taxel.sim.pour.state import has_truth
from taxel.windows.camera_recordings import LEAST_FRAMES, read_camera_recording

HELD: Final = frozenset({"hold", "held", "stable", "no slip"})
LOST: Final = frozenset({"slip", "slipped", "gross slip", "drop", "dropped", "unstable"})
"""Outcomes, in lower case. Source: `taxel.recordings.trial_log`, the simulator, gelsight-slip."""
RULES: Final = "gross-slip", "slip", "change"
"""Rules of which a person's correction says when a grasp slipped, the first one first."""
CLUSTERS: Final = "object", "cup", "session"
"""Groups that intervals are resampled by: the first that all grasps name, with two values."""


@dataclass(frozen=True, slots=True, kw_only=True)
class WatchedGrasp:
    """One grasp: what the bundle warned of, and what came of it."""

    slips: bool | None
    """None where nobody says."""
    outcome: RunOutcome
    """As judged; a grasp that slips at an unknown moment is judged as one that holds."""
    timed: bool
    """Whether it is known when it slipped; True where it holds."""
    alarmed: bool
    """Whether there was an alarm at any time."""
    largest: float
    """Largest score or probability, 0…1; 0 where there was none."""
    length_s: float
    word: str
    """Its label `outcome`; empty without one."""


@dataclass(frozen=True, slots=True, kw_only=True)
class GraspScores:
    """A bundle that watches a grasp, on a folder of recordings."""

    grasps: int
    held: int
    held_min: float
    """Minutes of grasps that held, without their first 0.4 s."""
    held_alarmed: int
    """Grasps that held with an alarm."""
    false_alarms: int
    false_alarms_per_min: float
    """In grasps that held; NaN without any."""
    false_alarms_interval: tuple[float, float]
    """Exact 95 % Poisson interval."""
    slipped: int
    slipped_alarmed: int
    """Grasps that slipped with an alarm at any time."""
    timed: int
    """Grasps that slipped of which it is known when."""
    missed_share: float
    """Of these, without an alarm before, 0…1; NaN without any. The warning may come up to 2 s
    before the onset."""
    missed_interval: tuple[float, float]
    """The wider of clusters resampled and exact binomial."""
    lead_median_s: float
    """Alarm before the slip, of those with an alarm; NaN without any."""
    lead_p5_s: float
    lead_interval_s: tuple[float, float]
    cluster: str
    """Group that intervals of misses and leads are resampled by: 95 %."""
    area: float
    """AUC of the largest score, slipped against held; NaN where one of them lacks."""
    length_area: float
    """AUC of "the shorter grasp slips", a baseline that sees no image."""
    unknown_share: float
    """Mean share of UNKNOWN, 0…1."""
    left_out: Mapping[str, int]
    """Outcome that says neither → grasps; empty for none."""


def judged(path: Path, tracks: Sequence[GraspTrack]) -> list[WatchedGrasp]:
    """Return what a bundle was worth in each grasp of a recording.

    Args:
        path: The recording.
        tracks: The bundle's states in its grasps; those too short to be judged are left out.

    Raises:
        BadRecording: The recording is damaged.
        BadFile: Corrections beside it are.
    """
    onset_s, event_s, known = _moments(path) if len(tracks) == 1 else (None, None, False)
    found = []
    for track in tracks:
        if len(track.states) < LEAST_FRAMES:
            continue
        word = track.labels.get("outcome", "")
        slips = event_s is not None if known else _slips(word.strip().lower())
        outcome = judge(
            StateTrack(
                states=track.states, time_s=track.time_s, onset_s=onset_s, event_s=event_s,
                groups=track.groups,
            )
        )  # fmt: skip
        found.append(
            WatchedGrasp(
                slips=slips,
                outcome=outcome,
                timed=known or slips is False,
                alarmed=bool(alarms(track.states, track.time_s, float(track.time_s[0]))),
                largest=float(np.nan_to_num(track.scores).max()),
                length_s=float(track.time_s[-1] - track.time_s[0]),
                word=word,
            )
        )
    return found


def _slips(word: str) -> bool | None:
    if word in HELD:
        return False
    return True if word in LOST else None


def _moments(path: Path) -> tuple[float | None, float | None, bool]:
    """Return when a warning begins to be justified and when it slips, seconds on the recording's
    clock, and whether that is known: (None, None, True) where it is known to hold.
    """
    pour = read_camera_recording(path)
    if has_truth(pour.sensor.channels):
        return *truth_moments(pour), True
    begin_s = float(pour.time_s[0])
    own = read_corrections(path, float(pour.time_s[-1]) - begin_s)
    for rule in RULES:
        if rule in own:
            onset_s = own[rule].onset_s
            event_s = None if onset_s is None else begin_s + onset_s
            return event_s, event_s, True
    return None, None, False


def summed(grasps: Sequence[WatchedGrasp], folder: Path) -> GraspScores:
    """Return the scores of many grasps.

    Args:
        grasps: As they were watched.
        folder: Where they lie, for the message.

    Raises:
        BadDataset: Of none it is known whether it held.
    """
    known = [grasp for grasp in grasps if grasp.slips is not None]
    if not known:
        raise BadDataset(
            f"grasps with a label outcome, such as {', '.join(sorted(HELD | LOST))}",
            f"none among {len(grasps)} in {folder}",
            "import them with label:outcome, or correct one with: taxel label FILE --onset S",
        )  # fmt: skip
    held = [grasp for grasp in known if not grasp.slips]
    slipped = [grasp for grasp in known if grasp.slips]
    timed = [grasp.outcome for grasp in slipped if grasp.timed]
    cluster = next((key for key in CLUSTERS if _parts(known, key)), "recording")
    judged = [grasp.outcome for grasp in held] + timed
    events: EventScores | None = summarise(judged, cluster) if judged else None
    truth = np.array([grasp.slips for grasp in known]).astype(np.intp)

    def ranked(values: Sequence[float]) -> float:
        return area(truth, np.column_stack([-np.array(values), values]))

    nothing = float("nan"), float("nan")
    minutes = 0.0 if events is None else events.hold_min
    others = [grasp.word for grasp in grasps if grasp.slips is None]
    return GraspScores(
        grasps=len(known),
        held=len(held),
        held_min=minutes,
        held_alarmed=sum(grasp.outcome.false_alarms > 0 for grasp in held),
        false_alarms=0 if events is None else events.false_alarms,
        false_alarms_per_min=float("nan") if events is None else events.false_alarms_per_min,
        false_alarms_interval=(
            nothing if events is None else poisson_interval(events.false_alarms, minutes)
        ),
        slipped=len(slipped),
        slipped_alarmed=sum(grasp.alarmed for grasp in slipped),
        timed=len(timed),
        missed_share=float("nan") if events is None else events.missed_share,
        missed_interval=(
            nothing
            if events is None or not timed
            else at_least_exact(
                events.missed_interval, sum(outcome.missed for outcome in timed), len(timed)
            )
        ),
        lead_median_s=float("nan") if events is None else events.lead_median_s,
        lead_p5_s=float("nan") if events is None else events.lead_p5_s,
        lead_interval_s=nothing if events is None or not timed else events.lead_interval_s,
        cluster=cluster,
        area=ranked([grasp.largest for grasp in known]),
        length_area=ranked([-grasp.length_s for grasp in known]),
        unknown_share=float(np.mean([grasp.outcome.unknown_share for grasp in known])),
        left_out={word: others.count(word) for word in sorted(set(others))},
    )


def _parts(grasps: Sequence[WatchedGrasp], key: str) -> bool:
    values = {grasp.outcome.groups.get(key) for grasp in grasps}
    return None not in values and len(values) > 1
