"""Rows of `taxel bench transitions`: a recogniser of camera trials as an alarm on real gels.

It learns from trials of gelsight-slip that say whether the object slipped, and is watched, as live,
on those of objects that it has not seen: an alarm is the verdict so far that the object slips.
Counted as the slip warnings are (`taxel.bench.transitions.real_gels`). Knows nothing about how rows
are printed.

Source: docs/decisions/0041.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Final

import numpy as np

from taxel.bench.other_processes import run_verb
from taxel.bench.rows import Row, missing
from taxel.bench.transitions.real_gels import (
    FIRST,
    RealTrial,
    Watched,
    import_trials,
    judge_rows,
    trials_folder,
)
from taxel.bundles.trials import IN_RUN, read_trial_bundle
from taxel.jobs.running import side_by_side
from taxel.live.trial_watch import TrialWatch
from taxel.recordings.reader import read_manifest
from taxel.recordings.whole import write_whole
from taxel.windows.camera_recordings import frame_sets

RECOGNISER: Final = "recogniser of camera trials, objects held out,"
"""What is judged."""
LEAST: Final = 0.8
"""Confidence from which on a verdict is an alarm, 0…1. Source: our choice, before the rows were
measured, docs/decisions/0041."""
FOLDS: Final = 5
_SLIP: Final = "slip"


def recogniser_alarm_rows(data: Path | None) -> list[Row]:
    """Train on four fifths of the objects, watch the trials of the others: half an hour of two
    cores.
    """
    folder = trials_folder(data)
    if folder is None:
        why = "no recordings: name their folder with --data"
        return [
            missing(f"{RECOGNISER} on real gels: trials that slip with an alarm", "share", "", why)
        ]
    with TemporaryDirectory() as place:
        files = import_trials(folder, Path(place) / "real")
        jobs: list[tuple[Path, Path]] = []
        for number, tested in enumerate(object_folds(files)):
            table, run = Path(place) / f"fold-{number}.csv", Path(place) / f"run-{number}"
            write_whole(table, folds_table(files, tested).encode())
            run_verb("train-trials", str(files[0].parent), "--target", "outcome", "--folds",
                     str(table), "--no-check", "--output", str(run), "--json")  # fmt: skip
            jobs += [(run / IN_RUN, file) for file in tested]
        found = side_by_side(watch_verdicts, jobs)
    trials = [trial for trial, _ in found]
    at = [first for trial, first in found if trial.slips and first is not None]
    when = Row(
        name=f"{RECOGNISER} on real gels: image of the first alarm, median of trials that slip",
        value=float(np.median(at)) if at else float("nan"), unit="image",
        note=f"of the {len(at)} with an alarm; the first verdict comes with image {FIRST}",
    )  # fmt: skip
    return [*judge_rows(trials, (RECOGNISER,)), when]


def object_folds(files: Sequence[Path]) -> list[list[Path]]:
    """Return the recordings that each fold tests, all of an object in one fold.

    Args:
        files: Recordings with the label `outcome` and the group `object`.
    """
    from sklearn.model_selection import StratifiedGroupKFold

    manifests = [read_manifest(file) for file in files]
    slips = [manifest.labels["outcome"] == _SLIP for manifest in manifests]
    objects = [manifest.groups["object"] for manifest in manifests]
    folds = StratifiedGroupKFold(FOLDS, shuffle=True, random_state=0)
    return [[files[at] for at in tested] for _, tested in folds.split(slips, slips, objects)]


def folds_table(files: Sequence[Path], tested: Sequence[Path]) -> str:
    """Return a table of folds: which recordings are tested, which are trained on."""
    lines = [f"{file.stem},{'test' if file in tested else 'train'}" for file in files]
    return "\n".join(["recording,side", *lines, ""])


def watch_verdicts(bundle: Path, path: Path) -> tuple[RealTrial, int | None]:
    """Return what a recogniser says in a recording, as live, and the image of its first alarm.

    Args:
        bundle: Of camera trials.
        path: The recording.
    """
    manifest = read_manifest(path)
    opened = read_trial_bundle(bundle)
    at = opened.contract.classes.index(_SLIP)
    watch = TrialWatch(opened, manifest.cameras)
    alarms: list[bool] = []
    scores: list[float] = []
    for found in frame_sets(path, len(manifest.cameras)):
        for frame in found.frames:
            watch.see(frame)
        verdict = watch.push(found).verdict
        alarms.append(verdict.label == _SLIP and verdict.confidence >= LEAST)
        scores.append(float(verdict.probabilities[at]))
    watched = Watched(
        alarm=any(alarms),
        early=any(alarms[:FIRST]),
        largest=float(np.nan_to_num(scores[:FIRST]).max(initial=0.0)),
    )
    trial = RealTrial(
        object=manifest.groups["object"], slips=manifest.labels["outcome"] == _SLIP,
        images=len(alarms), watched={RECOGNISER: watched},
    )  # fmt: skip
    return trial, alarms.index(True) + 1 if any(alarms) else None
