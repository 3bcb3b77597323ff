"""Rows of `taxel bench transitions` on the slip warning: cups never seen, images and all.

Poses are followed in rendered, JPEG-coded images of test cups and kept in a folder, part by
part, so that a run that was stopped goes on; heads and thresholds come from training cups alone.
Knows nothing about how rows are printed.

Source: docs/decisions/0036.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from taxel.bench.rows import Row, missing, quietest, row, row_within
from taxel.bundles.grasp import read_grasp_bundle
from taxel.bundles.shipped import BOTH_GELS, CUP_POUR, shipped_bundle
from taxel.evaluation.early_warning.events import by_group
from taxel.evaluation.early_warning.learn_slip_warning import (
    PER_MIN,
    fit_head,
    head_drive,
    out_of_fold,
    promised,
    track_of,
    training_features,
)
from taxel.evaluation.early_warning.slip_warnings import (
    Promise,
    WarningScores,
    WarningTrack,
    keep_promise,
    score_warnings,
)
from taxel.sim.pour.cups import Kind, PourRun
from taxel.training.frames.features import default_cache
from taxel.training.slip.cups import (
    TEST_CUPS,
    GelRows,
    PourRows,
    keep_runs,
    mild_bumps,
    other_part,
    paper_part,
    true_pours,
)
from taxel.training.slip.heads import HeadName, PourFeatures
from taxel.training.slip.pose_noise import settle
from taxel.training.slip.rim_features import ring_features

PAPER_PARTS, OTHER_PARTS = 4, 2
RULE = "slip-rule"
"""The bundle that learns nothing; its threshold promises 0.4 a minute, and may give 0.5. Source:
our choice, 0036."""
KIND_GOALS: tuple[Kind, ...] = ("no-slip pour", "bump", "grip drop")
_NEEDED_EVENTS, _NEEDED_MIN, _NEEDED_KIND_MIN = 350, 60.0, 15.0
ROUNDS = 3
_TURNS_RAD = 0.03
COMPARED: tuple[HeadName, ...] = ("boosting", "logistic")
COMPARED_CUPS = 120
"""Training cups of the heads to compare with. Source: our choice: time."""


@dataclass(frozen=True, slots=True)
class Warner:
    """Something that warns: a drive of each moment, and its threshold."""

    name: str
    drive: Callable[[PourFeatures], NDArray[np.float64]]
    threshold: float
    note: str


def poses_folder() -> Path:
    """Return where poses are kept: beside the other features that are cached."""
    return default_cache() / "slip-poses"


def test_parts() -> Iterator[tuple[str, list[PourRun]]]:
    """Yield what is rendered, as (file's name, runs): the first parts of all cups first."""
    for part in range(PAPER_PARTS):
        for cup in TEST_CUPS:
            yield f"{cup}-paper-{part}.npz", paper_part(cup, part)
        if part == 0:
            for cup in TEST_CUPS:
                yield f"{cup}-bumps.npz", mild_bumps(cup)
        if part < OTHER_PARTS:
            for cup in TEST_CUPS:
                yield f"{cup}-other-{part}.npz", other_part(cup, part)


def render(folder: Path) -> None:
    """Follow the images of all test cups that are not kept yet: about an hour of one core."""
    import cv2

    cv2.setNumThreads(1)
    for name, runs in test_parts():
        keep_runs(folder / name, runs)


def rendered(folder: Path) -> list[PourFeatures]:
    """Return the pours of test cups that are kept."""
    found = []
    for name, runs in test_parts():
        if (folder / name).exists():
            found += ring_features(keep_runs(folder / name, runs))
    return found


def live_rows() -> list[Row]:
    """Time both cameras' features, and the whole live step, on a pour that is replayed."""
    import tempfile
    from time import thread_time

    import cv2

    from taxel.frame_codec import decode_jpeg, encode_jpeg
    from taxel.gel.touch_poses import TouchFollower
    from taxel.live.grasp_session import run_grasp_session
    from taxel.sim.pour.cup_pour import CupPourConfig, list_runs
    from taxel.sources.opening import open_source
    from taxel.sources.simulated.pour_sets import CAMERA_HZ, simulate_videos, write_run

    cv2.setNumThreads(1)
    config = CupPourConfig()
    run = list_runs(config)[0]
    images = [[decode_jpeg(encode_jpeg(image), video.info) for image in video.images]
              for video in simulate_videos(run, CAMERA_HZ, 60.0, 3.0)[1]]  # fmt: skip
    followers = [TouchFollower(each[3:9]) for each in images]
    spent_ms = []
    for pair in zip(*images, strict=False):
        begun_s = thread_time()
        for follower, image in zip(followers, pair, strict=True):
            follower.follow(image)
        spent_ms.append((thread_time() - begun_s) * 1e3)
    with tempfile.TemporaryDirectory(prefix="taxel-") as scratch:
        write_run(Path(scratch), run, config, CAMERA_HZ)
        bundle = read_grasp_bundle(shipped_bundle(CUP_POUR))
        steps = []
        for _ in range(ROUNDS):
            with open_source(f"replay://{scratch}/{run.name}.mcap?speed=max") as source:
                steps.append(np.array(run_grasp_session(source, bundle).latencies_s) * 1e3)
    return [
        row("slip: both cameras' poses of a pair of images, one core, median",
            float(np.median(spent_ms)), "ms", "<=", 12.0,
            f"processor time; 99 % {np.percentile(spent_ms, 99):.1f} ms"),
        quietest("slip: the whole live step, decode included, 99 %",
                 [float(np.percentile(each[30:], 99)) for each in steps], "ms", 1000 / 60,
                 f"median {np.median(steps[0]):.1f} ms; once a grasp, at the end of its settled "
                 "stretch, its first images are gone through at once"),
    ]  # fmt: skip


def budget_row(test: Sequence[PourFeatures]) -> list[Row]:
    """Return the error budget of poses over all rendered camera-pours, slip below 350 µm."""
    errors, gains = [], []
    pours = [found.pour for found in test]
    for first in range(0, len(pours), 60):
        part = pours[first : first + 60]
        exact = true_pours([pour.run for pour in part])
        for pour, truth in zip(part, exact, strict=True):
            for mine, its in zip(pour.gels, truth.gels, strict=True):
                found = _errors(mine, settle(its), truth)
                errors.append(np.sqrt((found[0] ** 2).mean(axis=0)))
                if np.ptp(found[1]) > _TURNS_RAD:
                    gains.append(float(np.polyfit(found[1], found[2], 1)[0]))
    if not errors:
        return [missing("slip: object less gel, RMS", "um", "<= 4", "nothing rendered yet")]
    x, y, turn = np.median(errors, axis=0) * 1e3
    note = f"median over {len(errors)} camera-pours of test cups, slip below 350 um"
    name = "slip: object less gel, RMS"
    return [
        row(f"{name}, across", float(x), "um", "<=", 4.0, note),
        row(f"{name}, down", float(y), "um", "<=", 3.0, note),
        row(f"{name}, turn", float(turn), "mrad", "<=", 2.5, note),
        row_within("slip: gain of the turn", float(np.median(gains)), "1", 0.975, 0.075,
                   f"{len(gains)} camera-pours that turn"),
    ]  # fmt: skip


def _errors(
    mine: GelRows, its: GelRows, truth: PourRows
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Return errors (n, 3), mm and rad, true turn and followed turn, (n,)."""
    count = len(mine.taken_s)
    followed = settle(mine)
    used = mine.seen & (mine.taken_s > 0.4)
    used &= np.interp(mine.taken_s, truth.time_s, truth.slip_um) < 350
    slip = (followed.object - followed.gel)[used]
    true = (its.object - its.gel)[:count][used]
    return slip - true, true[:, 2], slip[:, 2]


def slip_warning_rows() -> list[Row]:
    """Render what is missing, learn what is compared, and judge on test cups."""
    place = poses_folder()
    train = training_features(place, COMPARED_CUPS)
    render(place)
    test = rendered(place)
    return budget_row(test) + judge_rows(train, test)


def both_gels_rows() -> list[Row]:
    """Render what is missing, and judge what was learned on both gels, on rigid ones alone."""
    place = poses_folder()
    render(place)
    warner = shipped_warner(BOTH_GELS)
    return _rows("slip warning, both gels", warner, rendered(place), lead_s=0.35, goals=True)


def judge_rows(
    train: Sequence[PourFeatures],
    test: Sequence[PourFeatures],
) -> list[Row]:
    """Return the rows of what comes with taxel as it is, and of heads learned to compare with.

    Args:
        train: Training pours for the heads to compare with, thresholds too.
        test: Pours of test cups.
    """
    rows = _rows("slip warning, forecast", shipped_warner(CUP_POUR), test, lead_s=0.35, goals=True)
    for name in COMPARED:
        tracks = promised(out_of_fold(train, name))
        promise = keep_promise(tracks, PER_MIN)
        warner = Warner(
            name, partial(head_drive, fit_head(train, name)), promise.threshold, kept(promise)
        )
        rows += _rows(f"slip warning, {name}", warner, test, lead_s=0.35, goals=False)
    return rows + _rule_rows(shipped_warner(RULE), test)


def shipped_warner(name: str) -> Warner:
    """Return a warning as it comes with taxel.

    Args:
        name: Of a bundle that watches slip.
    """
    bundle = read_grasp_bundle(shipped_bundle(name))

    def drive(found: PourFeatures) -> NDArray[np.float64]:
        rows = (found.rows[:, : bundle.offset.shape[-1]] - bundle.offset) * bundle.factor
        return bundle.head.run(features=rows[:, None, None])[found.at].astype(np.float64)

    threshold = bundle.contract.stability.warn
    measured = ", ".join(f"{what} {value:.3g}" for what, value in bundle.contract.measured.items())
    note = f"threshold {threshold:.3f}, chosen on training cups held out ({measured})"
    return Warner(name, drive, threshold, note)


def kept(promise: Promise) -> str:
    """Return what a promise gave on training cups, in words."""
    return (
        f"threshold {promise.threshold:.3f} for {promise.asked_per_min:g} a minute, out of fold "
        f"{promise.found_per_min:.2f} in {promise.hold_min:.0f} min of training cups"
    )


def _rows(
    name: str, warner: Warner, test: Sequence[PourFeatures], *, lead_s: float, goals: bool
) -> list[Row]:
    tracks = [track_of(found, warner.drive(found)) for found in test]
    paper = promised(tracks)
    scores, _ = score_warnings(paper, warner.threshold)
    events = scores.events
    note = _about(scores, warner)
    rows = [
        row(f"{name}: median lead before 300 um, cups never seen", events.lead_median_s, "s", ">=",
            lead_s, note),
        row(f"{name}: lead, 5 %", events.lead_p5_s, "s", ">=", 0.05, _leads(scores)),
        row(f"{name}: missed", events.missed_share, "share", "<=", 0.05,
            f"95 % {events.missed_interval[0]:.3f} … {events.missed_interval[1]:.3f}"),
        row(f"{name}: false alarms", events.false_alarms_per_min, "1/min", "<=", PER_MIN,
            _near(scores)),
        row(f"{name}: false alarms, upper end of 95 %", events.false_alarms_interval[1], "1/min",
            "<=", 0.5, "cups resampled; exact Poisson "
            f"{events.false_alarms_poisson[0]:.2f} … {events.false_alarms_poisson[1]:.2f}"),
    ]  # fmt: skip
    for kind in KIND_GOALS:
        rows.append(_kind_row(name, kind, tracks, warner.threshold))
    rows.append(_late_row(name, tracks, warner.threshold))
    for key in ("force_n", "position"):
        rows.append(_group_row(name, key, paper, warner.threshold))
    return rows if goals else [_without_goal(row) for row in rows[:5]]


def _rule_rows(warner: Warner, test: Sequence[PourFeatures]) -> list[Row]:
    name = "slip warning, the rule without learning"
    paper = promised([track_of(found, warner.drive(found)) for found in test])
    scores, _ = score_warnings(paper, warner.threshold)
    events = scores.events
    return [
        row(f"{name}: median lead before 300 um", events.lead_median_s, "s", ">=", 0.15,
            _about(scores, warner)),
        row(f"{name}: false alarms", events.false_alarms_per_min, "1/min", "<=", 0.5,
            f"missed {events.missed_share:.3f}, lead 5 % {events.lead_p5_s:.2f} s; "
            + _near(scores)),
    ]  # fmt: skip


def _kind_row(name: str, kind: Kind, tracks: Sequence[WarningTrack], threshold: float) -> Row:
    what = f"{name}: false alarms, {kind}"
    own = [track for track in tracks if track.groups["kind"] == kind]
    held = [track for track in own if track.event_s is None]
    if not held:
        return missing(what, "1/min", "<= 0.5", "no such pours that hold are rendered yet")
    scores, _ = score_warnings(own, threshold)
    events = scores.events
    low, high = events.false_alarms_poisson
    enough = "" if events.hold_min >= _NEEDED_KIND_MIN else f", fewer than {_NEEDED_KIND_MIN:g}"
    note = (
        f"{events.false_alarms} in {events.hold_min:.1f} min{enough}, 95 % {low:.2f} … {high:.2f}"
    )
    if events.events:
        note += (f"; {events.events} slips, lead median {events.lead_median_s:.2f} s, "
                 f"missed {events.missed_share:.2f}")  # fmt: skip
    return row(what, events.false_alarms_per_min, "1/min", "<=", 0.5, note)


def _late_row(name: str, tracks: Sequence[WarningTrack], threshold: float) -> Row:
    own = [track for track in tracks if track.groups["kind"] == "late slip"]
    what = f"{name}: median lead, late slips"
    if not any(track.event_s is not None for track in own):
        return Row(name=what, value=None, unit="s", note="none rendered yet")
    scores, _ = score_warnings(own, threshold)
    events = scores.events
    return Row(name=what, value=events.lead_median_s, unit="s",
               note=f"{events.events} slips, missed {events.missed_share:.2f}; false alarms "
               f"{events.false_alarms} in {events.hold_min:.1f} min")  # fmt: skip


def _group_row(name: str, key: str, tracks: Sequence[WarningTrack], threshold: float) -> Row:
    _, outcomes = score_warnings(tracks, threshold)
    parts = [
        f"{value}: {scores.lead_median_s:.2f} s, missed {scores.missed_share:.2f} "
        f"of {scores.events}, {scores.false_alarms_per_min:.2f}/min"
        for value, scores in by_group(outcomes, key).items()
    ]
    return Row(name=f"{name}: lead, missed and false alarms by {key}", value=None, unit="",
               note="; ".join(parts))  # fmt: skip


def _without_goal(row: Row) -> Row:
    return Row(name=row.name, value=row.value, unit=row.unit, note=row.note)


def _about(scores: WarningScores, warner: Warner) -> str:
    events = scores.events
    low, high = events.lead_interval_s
    few = ""
    if events.events < _NEEDED_EVENTS or events.hold_min < _NEEDED_MIN:
        few = f" (asked: {_NEEDED_EVENTS} slips, {_NEEDED_MIN:g} min; go on with --full)"
    return (
        f"95 % {low:.2f} … {high:.2f}; {events.events} slips and {events.hold_min:.1f} min of "
        f"holds on {events.clusters} cups{few}; {warner.note}"
    )


def _leads(scores: WarningScores) -> str:
    parts = [
        f"before {name}: median {found['median_s']:.2f} s, 5 % {found['p5_s']:.2f} s "
        f"({found['n']:.0f})"
        for name, found in scores.leads.items()
    ]
    return "; ".join(parts)


def _near(scores: WarningScores) -> str:
    near = ", ".join(f"{name} {rate:.2f}" for name, rate in scores.near.items())
    alarms = ", ".join(f"{name} {count}" for name, count in scores.alarms_by_slip.items())
    return f"near misses a minute: {near}; false alarms by the pour's largest slip: {alarms}"
