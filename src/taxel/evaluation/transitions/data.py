"""Pours ready to be judged: labels, features and folds of whole cups.

Knows nothing about tables or screens.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from taxel.errors import BadDataset
from taxel.evaluation.splits import TrialFold
from taxel.labels.agreement import onset_s
from taxel.labels.slip import label_truth
from taxel.models.sequence import SENSORS
from taxel.sim.pour.state import TRUTH_CHANNELS, has_truth
from taxel.training.frames.features import FrameFeatures, Progress
from taxel.training.frames.heads import HeadConfig, TrainedHead, fit_head, tracks_of
from taxel.training.frames.labels import change_signals, frame_labels, truth_of
from taxel.windows.camera_recordings import (
    CameraRecording,
    check_order,
    read_camera_recordings,
)
from taxel.windows.sequence import label_windows

DIFFERENCE = "difference to first frames"
"""A trivial baseline: the larger of both cameras' changes, per cent of the brightness."""


@dataclass(frozen=True, slots=True, kw_only=True)
class CameraSet:
    """Pours with the labels of one rule."""

    pours: tuple[CameraRecording, ...]
    rule: str
    labels: tuple[NDArray[np.int8], ...]
    """Each shape (n,): 0 stable, 1 unstable."""
    signals: tuple[NDArray[np.float32], ...]
    """Each shape (n, cameras): change against the settled frames, per cent."""

    def cups(self) -> NDArray[np.str_]:
        """Return each pour's cup, its group of that name, shape (pours,).

        Raises:
            BadDataset: A pour has no such group.
        """
        for pour in self.pours:
            if "cup" not in pour.groups:
                raise BadDataset(
                    "the group 'cup' on every recording",
                    f"{pour.path} with {', '.join(sorted(pour.groups)) or 'none'}",
                    "import again with a column group:cup in the table, or record again with "
                    "--group cup=NAME",
                )
        return np.array([pour.groups["cup"] for pour in self.pours])

    def some(self, most: int) -> CameraSet:
        """Return so many of the recordings at most, spread evenly over all of them."""
        rows = np.unique(np.linspace(0, len(self.pours) - 1, most).astype(int)).tolist()
        return CameraSet(
            pours=tuple(self.pours[row] for row in rows), rule=self.rule,
            labels=tuple(self.labels[row] for row in rows),
            signals=tuple(self.signals[row] for row in rows),
        )  # fmt: skip

    def unstable_share(self) -> float:
        """Return the share of frames that are unstable, 0…1."""
        return float(np.concatenate(self.labels).mean())


def load_camera_set(
    path: Path,
    rule: str,
    cache: Path,
    on_progress: Callable[[Progress], None] = lambda _: None,
) -> CameraSet:
    """Read a folder of recordings and label it.

    Args:
        path: The folder.
        rule: A name in `RULES`.
        cache: Folder for what can be computed again.
        on_progress: Called after each recording.

    Raises:
        BadRecording: A recording is damaged.
        BadDataset: There are none with cameras, one has another number of cameras than two, or
            the same in another order, or lacks the truth that the rule needs.
    """
    pours = read_camera_recordings(path)
    for pour in pours:
        if len(pour.cameras) != SENSORS:
            raise BadDataset(
                f"{SENSORS} cameras in each recording, one a finger",
                f"{len(pour.cameras)} in {pour.path.name}",
                "record both, or import with the columns left and right",
            )
    check_order(pours)
    signals = change_signals(pours, cache, on_progress=on_progress)
    labels = frame_labels(pours, rule, signals)
    return CameraSet(pours=tuple(pours), rule=rule, labels=tuple(labels), signals=tuple(signals))


def cup_folds(cups: NDArray[np.str_]) -> list[TrialFold]:
    """Return one fold a cup, that cup held out, by name.

    Args:
        cups: Each pour's cup, shape (pours,).

    Raises:
        BadDataset: There are fewer than two cups.
    """
    names = sorted(set(cups.tolist()))
    if len(names) < 2:
        raise BadDataset("at least two of the group cup", f"{len(names)}", "record more")
    return [
        TrialFold.of(name, np.flatnonzero(cups != name), np.flatnonzero(cups == name))
        for name in names
    ]


@dataclass(frozen=True, slots=True)
class Judged:
    """One fold, judged."""

    fold: TrialFold
    probabilities: tuple[NDArray[np.float32], ...]
    """One a test pour, at each window's end, shape (n − k + 1,); NaN where it spans an outage."""
    labels: tuple[NDArray[np.int8], ...]
    """The same windows' labels."""

    def scored(self) -> list[tuple[NDArray[np.float32], NDArray[np.int8]]]:
        """Return probabilities and labels of each test pour's windows that span no outage."""
        pairs = zip(self.probabilities, self.labels, strict=True)
        return [(p[~np.isnan(p)], y[~np.isnan(p)]) for p, y in pairs]


def judge_fold(
    features: Sequence[FrameFeatures],
    labels: Sequence[NDArray[np.int8]],
    fold: TrialFold,
    config: HeadConfig,
    *,
    watch: bool = False,
) -> tuple[Judged, TrainedHead]:
    """Train a head on a fold's training pours and judge its test pours.

    Args:
        features: Of all pours.
        labels: One a frame of each.
        fold: Which pours are on which side.
        config: How to train.
        watch: Look at some windows of the test pours after each epoch, for a curve; nothing is
            chosen by them.
    """
    watched = tracks_of(features, labels, fold.test_rows) if watch else ()
    trained = fit_head(tracks_of(features, labels, fold.train_rows), config, watched=watched)
    probabilities = tuple(trained.judged(features[i]) for i in fold.test_rows)
    windows = tuple(label_windows(labels[i], config.frames) for i in fold.test_rows)
    return Judged(fold, probabilities, windows), trained


def truth_moments(pour: CameraRecording) -> tuple[float | None, float | None]:
    """Return when micro-slip and gross slip begin, seconds on the pour's clock; None: never."""
    truth = truth_of(pour)
    micro, gross = (label_truth(truth, rule) for rule in ("micro-slip", "gross-slip"))
    return onset_s(micro, pour.time_s), onset_s(gross, pour.time_s)


def trivial_features(data: CameraSet, index: int) -> dict[str, NDArray[np.float64]]:
    """Return what a trivial baseline looks at, one number a frame, shape (n,)."""
    pour = data.pours[index]
    found = {
        "frame index": np.arange(len(pour), dtype=np.float64),
        DIFFERENCE: data.signals[index].max(axis=1).astype(np.float64),
    }
    if has_truth(pour.sensor.channels):
        poured = truth_of(pour)[:, TRUTH_CHANNELS.index("poured")]
        found["pour started (not seen by the sensor)"] = (poured > 0).astype(np.float64)
    return found
