"""Rows of `taxel bench transitions`: a recogniser of camera trials as an alarm on real gels.

It learns from trials of gelsight-slip that say whether the object slipped, and is watched, as live,
on those of objects that it has not seen: an alarm is the verdict so far that the object slips.
Counted as the slip warnings are (`taxel.bench.transitions.real_gels`). Knows nothing about how rows
are printed.

Source: docs/decisions/0041.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
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
"""What is judged, with crops as long as the shortest trial."""
SHORT: Final = 24
"""Images of a shorter crop, whose first verdict comes sooner. Source: our choice, decision 41."""
LEAST: Final = 0.8
"""Confidence from which on a verdict is an alarm, 0…1. Source: our choice, before the rows were
measured, docs/decisions/0041."""
LESS: Final = 0.6
"""A lower one, of verdicts on shorter crops, which are less sure. Source: our choice, with a look
at one split's test trials, decision 41."""
FOLDS: Final = 5
_SLIP: Final = "slip"


def recogniser_alarm_rows(data: Path | None, *, short: bool = False) -> list[Row]:
    """Train on four fifths of the objects, watch the trials of the others: half an hour of two
    cores.

    Args:
        data: Where the folder gelsight-slip lies.
        short: Take shorter crops, whose first verdict comes sooner.
    """
    folder = trials_folder(data)
    crop = SHORT if short else FIRST
    levels = _levels(crop)
    names = list(levels)
    if folder is None:
        why = "no recordings: name their folder with --data"
        return [missing(f"{name} on real gels: trials that slip with an alarm", "share", "", why)
                for name in names]  # fmt: skip
    with TemporaryDirectory() as place:
        files = import_trials(folder, Path(place) / "real")
        jobs: list[tuple[Path, Path, dict[str, float]]] = []
        for number, tested in enumerate(object_folds(files)):
            table, run = Path(place) / f"fold-{number}.csv", Path(place) / f"run-{number}"
            write_whole(table, folds_table(files, tested).encode())
            run_verb("train-trials", str(files[0].parent), "--target", "outcome", "--folds",
                     str(table), "--crop", str(crop), "--no-check", "--output", str(run),
                     "--json")  # fmt: skip
            jobs += [(run / IN_RUN, file, levels) for file in tested]
        found = side_by_side(watch_verdicts, jobs)
    trials = [trial for trial, _ in found]
    rows = judge_rows(trials, names[:1])
    rows += [row for row in judge_rows(trials, names[1:]) if row.unit == "share"]
    for name in names:
        firsts = [first[name] for trial, first in found if trial.slips]
        at = [first for first in firsts if first is not None]
        when = Row(
            name=f"{name} on real gels: image of the first alarm, median of trials that slip",
            value=float(np.median(at)) if at else float("nan"), unit="image",
            note=f"of the {len(at)} with an alarm; the first verdict comes with image {crop}",
        )  # fmt: skip
        rows.append(when)
    return rows


def _levels(crop: int) -> dict[str, float]:
    """Return what is judged, and from which confidence on a verdict is an alarm."""
    if crop == FIRST:
        return {RECOGNISER: LEAST}
    name = f"{RECOGNISER} crops of {crop} images,"
    return {f"{name} confidence {least:g}": least for least in (LEAST, LESS)}


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


def watch_verdicts(
    bundle: Path, path: Path, levels: Mapping[str, float]
) -> tuple[RealTrial, dict[str, int | None]]:
    """Return what a recogniser says in a recording, as live, and the image of each first alarm.

    Args:
        bundle: Of camera trials.
        path: The recording.
        levels: Name → least confidence of an alarm.
    """
    manifest = read_manifest(path)
    opened = read_trial_bundle(bundle)
    at = opened.contract.classes.index(_SLIP)
    watch = TrialWatch(opened, manifest.cameras)
    sure: list[float] = []
    scores: list[float] = []
    for found in frame_sets(path, len(manifest.cameras)):
        for frame in found.frames:
            watch.see(frame)
        verdict = watch.push(found).verdict
        sure.append(verdict.confidence if verdict.label == _SLIP else 0.0)
        scores.append(float(verdict.probabilities[at]))
    alarms = {name: [own >= least for own in sure] for name, least in levels.items()}
    watched = {
        name: Watched(
            alarm=any(own),
            early=any(own[:FIRST]),
            largest=float(np.nan_to_num(scores[:FIRST]).max(initial=0.0)),
        )
        for name, own in alarms.items()
    }
    trial = RealTrial(
        object=manifest.groups["object"], slips=manifest.labels["outcome"] == _SLIP,
        images=len(sure), watched=watched,
    )  # fmt: skip
    return trial, {name: own.index(True) + 1 if any(own) else None for name, own in alarms.items()}
