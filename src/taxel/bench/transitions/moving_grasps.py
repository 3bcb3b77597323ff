"""Rows of `taxel bench transitions` on the slip warning in grasps that move, one a kind.

The rule that comes with taxel, with the threshold that comes with it, on lifts, tilts, carries,
hand-overs and collisions of test cups, and on a pour of each cup beside them. Images are rendered,
JPEG-coded and followed as live; poses are kept in a folder, so that a run that was stopped goes on.
Knows nothing about how rows are printed.

Source: docs/decisions/0045.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from scipy.stats import binomtest

from taxel.bench.rows import Row, missing
from taxel.bench.transitions.slip_warning import RULE, poses_folder, shipped_warner
from taxel.bundles.grasp import read_grasp_contract
from taxel.bundles.shipped import shipped_bundle
from taxel.decisions.stability import states
from taxel.evaluation.early_warning.events import StateTrack, judge, summarise
from taxel.evaluation.early_warning.learn_slip_warning import track_of
from taxel.evaluation.early_warning.slip_warnings import EVENTS
from taxel.sim.pour.cups import MOVING_KINDS, Kind
from taxel.training.slip.cups import TEST_CUPS, keep_runs, moving_part
from taxel.training.slip.heads import PourFeatures, features_of

BUNDLE = RULE
"""What warns: nothing in it has learned from any of these kinds."""
_KINDS: tuple[Kind, ...] = (*MOVING_KINDS, "pour")


def render(folder: Path) -> None:
    """Follow the images of all cups that are not kept yet: about twenty minutes of one core."""
    import cv2

    cv2.setNumThreads(1)
    for cup in TEST_CUPS:
        keep_runs(_file(folder, cup), moving_part(cup))


def kept(folder: Path) -> list[PourFeatures]:
    """Return the grasps that are kept."""
    return [
        features_of(pour)
        for cup in TEST_CUPS
        if _file(folder, cup).exists()
        for pour in keep_runs(_file(folder, cup), moving_part(cup))
    ]


def moving_rows() -> list[Row]:
    """Render what is missing and return a few rows a kind."""
    render(poses_folder())
    return rows_of(kept(poses_folder()))


def rows_of(found: Sequence[PourFeatures]) -> list[Row]:
    """Return lead, misses and false alarms of each kind; no goals stand on them."""
    warner = shipped_warner(BUNDLE)
    stability = read_grasp_contract(shipped_bundle(BUNDLE)).stability
    tracks = []
    for grasp in found:
        truth = track_of(grasp, warner.drive(grasp))
        decided = states(truth.drive, truth.time_s, stability)
        tracks.append(
            StateTrack(
                states=decided,
                time_s=truth.time_s,
                onset_s=truth.onset_s,
                event_s=truth.event_s,
                groups=truth.groups,
            )
        )
    return [row for kind in _KINDS for row in _kind_rows(kind, tracks)]


def _kind_rows(kind: Kind, tracks: Sequence[StateTrack]) -> list[Row]:
    name = f"slip warning by kind, {BUNDLE}, {kind}"
    outcomes = [judge(track, EVENTS) for track in tracks if track.groups["kind"] == kind]
    if not outcomes:
        return [missing(f"{name}: median lead before 300 um", "s", "", "none rendered yet")]
    events = summarise(outcomes)
    missed = sum(outcome.missed for outcome in outcomes)
    about = f"{events.events} slips of {len(outcomes)} grasps on {events.clusters} test cups"
    if events.clusters < len(TEST_CUPS):
        about += f" (asked: {len(TEST_CUPS)}; go on with --full)"
    rows = []
    if events.events:
        low, high = binomtest(missed, events.events).proportion_ci(0.95, "exact")
        lead_low, lead_high = events.lead_interval_s
        warned = sum(outcome.event and outcome.lead_s is not None for outcome in outcomes)
        rows = [
            _row(f"{name}: median lead before 300 um", events.lead_median_s, "s",
                 f"95 % {lead_low:.2f} … {lead_high:.2f}, cups resampled; {about}, "
                 f"{warned} warned of at all; a lead below 0 comes after"),
            _row(f"{name}: missed", missed / events.events, "share",
                 f"{missed} of {events.events} not warned of before 300 um; 95 % {low:.2f} … "
                 f"{high:.2f}, exact binomial"),
        ]  # fmt: skip
    else:
        rows = [missing(f"{name}: median lead before 300 um", "s", "", f"{about}")]
    if events.hold_min > 0:
        least, most = events.false_alarms_poisson
        rows.append(
            _row(f"{name}: false alarms", events.false_alarms_per_min, "1/min",
                 f"{events.false_alarms} in {events.hold_min:.1f} min of grasps that hold; 95 % "
                 f"{least:.2f} … {most:.2f}, exact Poisson")
        )  # fmt: skip
    return rows


def _row(name: str, value: float, unit: str, note: str) -> Row:
    known = None if value != value else float(value)
    return Row(name=name, value=known, unit=unit, note=note)


def _file(folder: Path, cup: int) -> Path:
    return folder / f"{cup}-moving.npz"
