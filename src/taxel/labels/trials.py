"""Trials: the labelled stretches of recordings, and the groups that must stay together.

A trial is the smallest thing that a split may move: one grasp, one sign, one
imported file. Knows nothing about windows, models or splits.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from taxel.name_order import Part, counting_order
from taxel.recordings.imports.own_groups import CUT_FROM
from taxel.recordings.manifest import Manifest
from taxel.signals import Mark

OBJECTS = ("object", "cup", "item", "specimen")
"""Groups that say what was touched; they may well predict the class."""
SESSIONS = (
    "session", "sitting", "power_on", "day", "date", "visit", "operator", "person", "subject",
    "participant", "user", "lab", "rig", "station", "sensor", "device", "pad", "gel", "batch",
    "placement", "mounting",
)  # fmt: skip
"""Groups that say where, when or by whom a trial was recorded; they must predict no class."""
TIMES = SESSIONS[:6]
"""Those that say when: what was recorded together is alike, whoever held it."""
USUAL_GROUPS = (*OBJECTS, "session", "sitting", "day", "person", "subject")
"""Groups that people part trials by: named first where others part them alike."""
_COARSE = ("session", "file", "recording", CUT_FROM)
"""Groups that hold several trials, those that hold the most first."""
TOGETHER = frozenset((*SESSIONS, *OBJECTS, *_COARSE, "run", "block"))
"""Groups of which trials of one value belong together, whatever their class: one day is the same
day for two classes, though take 8 of one is another than take 8 of the other. Lower case."""
TIME = "time"
"""In place of a group, unless one is called so: when a trial of a recording begins, seconds."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Trial:
    """One labelled stretch of one recording."""

    recording: str
    """The recording's file name, without its folder."""
    start_s: float
    """First moment of the trial on the recording's fitted clock, seconds."""
    end_s: float
    """Last moment of the trial, same clock, seconds."""
    labels: Mapping[str, str]
    """What may be learned."""
    groups: Mapping[str, str]
    """What it belongs to; always holds "recording" and "trial"."""

    @property
    def duration_s(self) -> float:
        """Length of the trial, seconds."""
        return self.end_s - self.start_s


def group_value(trial: Trial, key: str) -> str | None:
    """Return a trial's value of a group, or of `TIME`; None where it has none.

    Args:
        trial: Of an array.
        key: The group's name.
    """
    found = trial.groups.get(key)
    return f"{trial.start_s:.6f}" if found is None and key == TIME else found


def order_in_time(trial: Trial) -> tuple[tuple[tuple[Part, ...], str], float]:
    """Return what trials of a session are ordered by: recording by recording, for each has a clock
    of its own, as people count their names, and as a folder is replayed live; then by time.
    """
    return counting_order(trial.recording), trial.start_s


def ends_of_rows(trials: Sequence[Trial], slack_s: float) -> NDArray[np.float64]:
    """Return until when a row may lie in each trial, seconds, shape (n,).

    Where one trial ends at the very moment at which the next begins, the row of that moment is the
    next one's alone: a split between the two must not put it on both sides.

    Args:
        trials: Of one recording, in the order of their starts.
        slack_s: How far behind its end a row may lie, as clocks round.
    """
    starts = np.array([trial.start_s for trial in trials])
    ends = np.array([trial.end_s for trial in trials])
    place = np.searchsorted(starts, ends - slack_s)
    following = np.append(starts, np.inf)[place]
    touches = (following <= ends + slack_s) & (following > starts + slack_s)
    return np.where(touches, following - slack_s, ends + slack_s)


def as_numbers(values: Iterable[str]) -> NDArray[np.float64]:
    """Return values of a group as numbers, shape (n,).

    Raises:
        ValueError: One is text. So is 1_10, a day and a run, which Python would take for 110.
    """
    texts = list(values)
    if odd := next((text for text in texts if "_" in text), None):
        raise ValueError(f"{str(odd)!r} is a name")
    numbers = []
    for text in texts:
        try:
            numbers.append(float(text))
        except ValueError:
            raise ValueError(f"{str(text)!r} is no number") from None
    return np.array(numbers)


def span_at(moment_s: float, spans: Sequence[tuple[float, float]], slack_s: float) -> int | None:
    """Return which stretch a moment lies in; None where it lies in none.

    Where stretches follow each other closely, the last to begin of those that hold it; only where
    none does, the nearest within the slack.

    Args:
        moment_s: Seconds.
        spans: First and last moment of each, same clock.
        slack_s: How far outside it may lie, as tables round.
    """
    inside = [i for i, (first, last) in enumerate(spans) if first <= moment_s <= last]
    if inside:
        return max(inside, key=lambda i: spans[i][0])
    away = [max(first - moment_s, moment_s - last) for first, last in spans]
    near = min(range(len(spans)), key=lambda i: away[i], default=None)
    return near if near is not None and away[near] <= slack_s else None


def coarsest_group(trials: Sequence[Trial], split: str = "") -> str:
    """Return the group to draw or hold out as a whole: the coarsest of which there are two.

    That is the session, else the file, else the recording, else what pieces were cut from, else the
    trial. A group that a split holds out takes its place, such as an object that was touched in
    several sessions, unless it lies within it.

    Args:
        trials: Those that are judged, at least one.
        split: The split's name, such as "object held out".
    """
    known = {key: {trial.groups.get(key) for trial in trials} for key in _COARSE}
    first = next((key for key, own in known.items() if len(own) > 1 and None not in own), "trial")
    held = held_out(split, trials)
    if held is not None:
        own = {trial.groups[held] for trial in trials}
        if 1 < len(own) < len({(trial.groups[held], trial.groups[first]) for trial in trials}):
            return held
    return first


def held_out(split: str, trials: Sequence[Trial]) -> str | None:
    """Return the group that a split holds out by its name; None where it names none of theirs.

    Args:
        split: Such as "object held out", or of a table "folds.csv, object held out"; what a
            comparison adds stands behind "; ".
        trials: Those that are judged, at least one.
    """
    shared = set.intersection(*(set(trial.groups) for trial in trials))
    parts = [f", {part}" for part in split.split("; ")]
    named = (key for key in shared if any(p.endswith(f", {key} held out") for p in parts))
    return max(named, key=len, default=None)


def lone_group(trials: Sequence[Trial], split: str = "") -> str | None:
    """Return the group that these trials show one value of, though others are to be expected.

    That is what the split holds out, else the session. An interval over what lies within it, such
    as the files of one session, says nothing about other sessions.

    Args:
        trials: Those that were tested, at least one.
        split: The split's name, such as "session held out".
    """
    for key in (held_out(split, trials), "session"):
        values = {trial.groups.get(key) for trial in trials} if key else set()
        if len(values) == 1 and None not in values:
            return key
    return None


def trials_of(
    path: Path, manifest: Manifest, marks: list[Mark], start_s: float, end_s: float
) -> list[Trial]:
    """Return the trials of one recording, oldest first.

    Each mark is a trial; a recording without marks is one trial as a whole.
    A mark's own labels and groups win over the recording's. One that ends after the recording, as
    where it was stopped within a grasp, is a trial up to the last scan: it lasts no longer.

    Args:
        path: The recording's file.
        manifest: Labels and groups of the whole recording.
        marks: Its marks, in any order.
        start_s: Time of its first scan, seconds.
        end_s: Time of its last scan, seconds.
    """
    stretches = sorted(marks, key=lambda mark: mark.start_s) or [
        Mark(start_s=start_s, end_s=end_s, labels={}, groups={})
    ]
    return [
        Trial(
            recording=path.name,
            start_s=mark.start_s,
            end_s=max(mark.start_s, min(mark.end_s, end_s)),
            labels={**manifest.labels, **mark.labels},
            groups={
                **manifest.groups,
                **mark.groups,
                "recording": path.stem,
                "trial": f"{path.stem}#{index}",
            },
        )
        for index, mark in enumerate(stretches)
    ]
