"""Rows of `taxel bench transitions` on real gels: the warnings that come with taxel, as they are.

The trials of gelsight-slip say whether the object slipped, not when, so that alarms are counted by
trial: in the whole trial, and in its first images, since held objects are watched longer. Nothing
is learned or tuned here. Knows nothing about how rows are printed.

Source: docs/decisions/0036.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Final

import numpy as np
from numpy.typing import NDArray

from taxel.bench.other_processes import run_verb
from taxel.bench.rows import Row, missing
from taxel.bundles.grasp import read_grasp_bundle
from taxel.bundles.shipped import BOTH_GELS, CUP_POUR, shipped_bundle
from taxel.evaluation.intervals import ratio_interval
from taxel.jobs.running import side_by_side
from taxel.live.grasp_monitor import GraspMonitor
from taxel.recordings.reader import read_manifest
from taxel.windows.camera_recordings import frame_sets

WARNINGS: Final = (BOTH_GELS, CUP_POUR, "slip-rule")
"""Bundles that are judged."""
FIRST: Final = 48
"""Images of each camera that are the first ones: as many as the shortest trial has. Source: issue
15, crops of fixed length and place."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Watched:
    """What a warning did in one trial."""

    alarm: bool
    """Whether it warned at any time."""
    early: bool
    """The same in the first images."""
    largest: float
    """Its largest score in the first images, 0…1; 0 where it gave none."""


@dataclass(frozen=True, slots=True, kw_only=True)
class RealTrial:
    """One trial."""

    object: str
    slips: bool
    images: int
    watched: Mapping[str, Watched]
    """Warning → what it did."""


def real_gel_rows(data: Path | None) -> list[Row]:
    """Watch all trials of gelsight-slip: a quarter of an hour of two cores."""
    folder = trials_folder(data)
    if folder is None:
        why = "no recordings: name their folder with --data"
        return [missing(f"{name} on real gels: trials that slip with an alarm", "share", "", why)
                for name in WARNINGS]  # fmt: skip
    with TemporaryDirectory() as place:
        files = import_trials(folder, Path(place) / "real")
        return judge_rows(side_by_side(watch_trial, [(file,) for file in files]))


def trials_folder(data: Path | None) -> Path | None:
    """Return where gelsight-slip lies; None where it does not."""
    folder = None if data is None else data / "gelsight-slip"
    return folder if folder is not None and folder.exists() else None


def import_trials(folder: Path, recordings: Path) -> list[Path]:
    """Return the recordings of gelsight-slip, which are written to a folder, by name."""
    run_verb("import", "gelsight-slip", "--data", str(folder), "--output", str(recordings),
             "--json")  # fmt: skip
    return sorted(recordings.glob("*.mcap"))


def watch_trial(path: Path) -> RealTrial:
    """Return what each warning does in a recording, as live."""
    manifest = read_manifest(path)
    bundles = {name: read_grasp_bundle(shipped_bundle(name)) for name in WARNINGS}
    monitors = {name: GraspMonitor(bundle, manifest.cameras) for name, bundle in bundles.items()}
    alarms: dict[str, list[bool]] = {name: [] for name in WARNINGS}
    scores: dict[str, list[float]] = {name: [] for name in WARNINGS}
    for found in frame_sets(path, len(manifest.cameras)):
        for name, monitor in monitors.items():
            answer = monitor.push(found)
            alarms[name].append(answer.decision.alarm)
            scores[name].append(answer.probability)
    return RealTrial(
        object=manifest.groups["object"],
        slips=manifest.labels["outcome"] == "slip",
        images=len(alarms[WARNINGS[0]]),
        watched={
            name: Watched(
                alarm=any(alarms[name]),
                early=any(alarms[name][:FIRST]),
                largest=float(np.nan_to_num(scores[name][:FIRST]).max(initial=0.0)),
            )
            for name in WARNINGS
        },
    )


def judge_rows(trials: Sequence[RealTrial], names: Sequence[str] = WARNINGS) -> list[Row]:
    """Return, of each warning, the shares of trials with an alarm and how its score ranks them.

    Args:
        trials: Some that slip and some that hold.
        names: Of the warnings.
    """
    from sklearn.metrics import roc_auc_score

    slips = np.array([trial.slips for trial in trials])
    objects = np.array([trial.object for trial in trials])
    length = roc_auc_score(slips, [-trial.images for trial in trials])
    rows: list[Row] = []
    for name in names:
        own = [trial.watched[name] for trial in trials]
        alarm, early = (
            np.array([getattr(watched, kind) for watched in own]) for kind in ("alarm", "early")
        )
        largest = [watched.largest for watched in own]
        rows += [
            _share(f"{name} on real gels: trials that slip with an alarm", slips, objects, alarm,
                   early),
            _share(f"{name} on real gels: trials that hold with an alarm", ~slips, objects, alarm,
                   early),
            Row(name=f"{name} on real gels: AUC of the largest score in the first {FIRST} images",
                value=float(roc_auc_score(slips, largest)), unit="AUC",
                note=f"{len(trials)} trials; that the shorter trial slips {length:.3f}"),
        ]  # fmt: skip
    return rows


def _share(
    name: str,
    asked: NDArray[np.bool_],
    objects: NDArray[np.str_],
    alarm: NDArray[np.bool_],
    early: NDArray[np.bool_],
) -> Row:
    names = np.unique(objects[asked])
    of = [int((asked & (objects == own)).sum()) for own in names]
    hits = [int((alarm & asked & (objects == own)).sum()) for own in names]
    low, high = ratio_interval(np.array(hits), np.array(of))
    return Row(
        name=name, value=float(alarm[asked].mean()), unit="share",
        note=f"{alarm[asked].sum()} of {asked.sum()}, 95 % {low:.3f} … {high:.3f}, objects "
        f"resampled; in the first {FIRST} images {early[asked].sum()}",
    )  # fmt: skip
