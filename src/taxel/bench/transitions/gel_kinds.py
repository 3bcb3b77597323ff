"""Rows of `taxel bench transitions` on grasps that are not the paper's pours, with rigid gels and
with gels that shear as layers.

Pushes, pours without slip, failing grips and sudden slips; and a gripper that moves: lifts, tilts,
carries, hand-overs, collisions. The warnings that come with taxel, as they are. Images are
rendered, JPEG-coded and followed as live; poses are kept in a folder, part by part, so that a run
that was stopped goes on. Knows nothing about how rows are printed.

Source: docs/decisions/0037 and 0045.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Final

from taxel.bench.rows import Row, missing
from taxel.bench.transitions.gel_warning import GELS, follow, pose_file
from taxel.bench.transitions.slip_warning import RULE, Warner, poses_folder, shipped_warner
from taxel.bundles.shipped import BOTH_GELS, CUP_POUR
from taxel.evaluation.early_warning.events import EventScores
from taxel.evaluation.early_warning.learn_slip_warning import track_of
from taxel.evaluation.early_warning.slip_warnings import WarningTrack, score_warnings
from taxel.jobs.running import side_by_side
from taxel.plain_text import number_of
from taxel.sim.pour.cup_pour import Gel
from taxel.sim.pour.cups import MOVING_KINDS, OTHER_KINDS, Kind, PourRun
from taxel.training.slip.cups import (
    TEST_CUPS,
    PourRows,
    keep_runs,
    mild_bumps,
    moving_part,
    other_part,
)
from taxel.training.slip.rim_features import ring_features

ALL_MOVING: Final = "gripper that moves"
"""Name of the rows on `MOVING_KINDS` together."""
_Part = tuple[int, str, list[PourRun]]
_Groups = Mapping[str, Sequence[Kind]]
_OTHERS: Final[_Groups] = {kind: (kind,) for kind in OTHER_KINDS}
_MOVING: Final[_Groups] = {ALL_MOVING: MOVING_KINDS} | {kind: (kind,) for kind in MOVING_KINDS}


def gel_kind_rows() -> list[Row]:
    """Render what is missing, and judge on both versions: ten minutes of one core a gel."""
    return _rows_of((CUP_POUR, BOTH_GELS), list(_other_parts()), _OTHERS)


def moving_rows() -> list[Row]:
    """The same where the gripper moves: a quarter of an hour of one core a gel."""
    parts = [(cup, "moving", moving_part(cup)) for cup in TEST_CUPS]
    return _rows_of((CUP_POUR, BOTH_GELS, RULE), parts, _MOVING)


def judge_kinds(
    warners: Sequence[Warner], pours: Sequence[PourRows], where: str, groups: _Groups
) -> list[Row]:
    """Return each warning's false alarms and misses, group by group.

    Args:
        warners: What warns.
        pours: Of test cups.
        where: What the images show, in words.
        groups: Name in rows → kinds of grasps.
    """
    found = ring_features(pours)
    rows = []
    for warner in warners:
        tracks = [track_of(pour, warner.drive(pour)) for pour in found]
        for group, kinds in groups.items():
            own = [track for track in tracks if track.groups["kind"] in kinds]
            rows += _rows(f"slip warning, {warner.name}, {group}, {where}", own, warner.threshold)
    return rows


def _rows_of(names: Iterable[str], parts: Sequence[_Part], groups: _Groups) -> list[Row]:
    place = poses_folder()
    warners = [shipped_warner(name) for name in names]
    rows = []
    for gel in GELS:
        files = [(pose_file(place, cup, part, gel), runs) for cup, part, runs in parts]
        side_by_side(_render, [(file, runs, gel) for file, runs in files])
        pours = [pour for file, runs in files for pour in keep_runs(file, runs)]
        rows += judge_kinds(warners, pours, f"on gel {gel}", groups)
    return rows


def _render(file: Path, runs: Sequence[PourRun], gel: Gel) -> None:
    """Follow the images of some runs, unless they are kept."""
    import cv2

    cv2.setNumThreads(1)
    keep_runs(file, runs, follow(gel))


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


def _other_parts() -> Iterator[_Part]:
    """Yield (cup, name of the part, runs): a grasp of each other kind, and mild pushes."""
    for cup in TEST_CUPS:
        yield cup, "other-0", other_part(cup, 0)
        yield cup, "bumps", mild_bumps(cup)
