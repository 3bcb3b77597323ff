"""Rows of `taxel bench transitions` on pushes, pours without slip, failing grips and sudden slips,
with rigid gels and with gels that shear as layers.

The warnings that come with taxel, as they are. Images are rendered, JPEG-coded and followed as
live; poses are kept in a folder, part by part, so that a run that was stopped goes on. Knows
nothing about how rows are printed.

Source: docs/decisions/0037.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Final

from taxel.bench.rows import Row, missing
from taxel.bench.transitions.gel_warning import GELS, follow, pose_file
from taxel.bench.transitions.slip_warning import Warner, poses_folder, shipped_warner
from taxel.bundles.shipped import BOTH_GELS, CUP_POUR
from taxel.evaluation.early_warning.events import EventScores
from taxel.evaluation.early_warning.learn_slip_warning import track_of
from taxel.evaluation.early_warning.slip_warnings import WarningTrack, score_warnings
from taxel.plain_text import number_of
from taxel.sim.pour.cup_pour import Gel
from taxel.sim.pour.cups import OTHER_KINDS, PourRun
from taxel.training.slip.cups import TEST_CUPS, PourRows, keep_runs, mild_bumps, other_part
from taxel.training.slip.rim_features import ring_features

WARNINGS: Final = (CUP_POUR, BOTH_GELS)
"""Bundles that are judged."""


def gel_kind_rows() -> list[Row]:
    """Render what is missing, and judge on both versions: ten minutes of one core a gel."""
    import cv2

    cv2.setNumThreads(1)
    place = poses_folder()
    pours: dict[Gel, list[PourRows]] = {gel: [] for gel in GELS}
    for gel in GELS:
        for cup, part, runs in _parts():
            pours[gel] += keep_runs(pose_file(place, cup, part, gel), runs, follow(gel))
    warners = [shipped_warner(name) for name in WARNINGS]
    return [row for gel in GELS for row in judge_kinds(warners, pours[gel], f"on gel {gel}")]


def judge_kinds(warners: Sequence[Warner], pours: Sequence[PourRows], where: str) -> list[Row]:
    """Return each warning's false alarms and misses, kind by kind.

    Args:
        warners: What warns.
        pours: Of test cups.
        where: What the images show, in words.
    """
    found = ring_features(pours)
    rows = []
    for warner in warners:
        tracks = [track_of(pour, warner.drive(pour)) for pour in found]
        for kind in OTHER_KINDS:
            own = [track for track in tracks if track.groups["kind"] == kind]
            rows += _rows(f"slip warning, {warner.name}, {kind}, {where}", own, warner.threshold)
    return rows


def _rows(name: str, tracks: Sequence[WarningTrack], threshold: float) -> list[Row]:
    alarms, missed = f"{name}: false alarms", f"{name}: missed"
    if not tracks:
        return [missing(alarms, "1/min", "", "nothing rendered yet")]
    events = score_warnings(tracks, threshold)[0].events
    rows = [_alarms(alarms, events)] if events.hold_min else []
    if events.events:
        low, high = events.missed_interval
        rows.append(
            Row(name=missed, value=float(events.missed_share), unit="share",
                note=f"{number_of(events.events, 'slip')}, 95 % {low:.3f} … {high:.3f}; median "
                f"lead before 300 µm {events.lead_median_s:.2f} s")
        )  # fmt: skip
    return rows


def _alarms(name: str, events: EventScores) -> Row:
    low, high = events.false_alarms_poisson
    return Row(name=name, value=float(events.false_alarms_per_min), unit="1/min",
               note=f"{events.false_alarms} in {events.hold_min:.1f} min that hold, exact Poisson "
               f"{low:.2f} … {high:.2f}")  # fmt: skip


def _parts() -> Iterator[tuple[int, str, list[PourRun]]]:
    """Yield (cup, name of the part, runs): a grasp of each other kind, and mild pushes."""
    for cup in TEST_CUPS:
        yield cup, "other-0", other_part(cup, 0)
        yield cup, "bumps", mild_bumps(cup)
