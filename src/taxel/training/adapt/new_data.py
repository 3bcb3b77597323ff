"""A recording's grasps as a run sees them: its window, its level, its labels.

Knows nothing about networks.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from datetime import datetime
from hashlib import sha256
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from taxel.bundles.contract import Contract, fingerprint_of
from taxel.bundles.levels import TouchLevel
from taxel.bundles.recordings import load_at_level, load_by_session
from taxel.bundles.versions import OF_ALL, OF_KNOWN, class_key
from taxel.errors import BadDataset, BadInput
from taxel.labels.joined import joined_label, with_joined_labels
from taxel.labels.trials import trials_of
from taxel.recordings.reader import list_recordings, read_manifest, read_recording
from taxel.windows.windower import Windows

_DIGEST_LETTERS = 12
"""Characters of a digest that identify data: one chance in 10^14 of a collision."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Grasps:
    """Labelled grasps, oldest first."""

    windows: Windows
    """Unscaled, at the run's own level; n of them."""
    label: tuple[str, ...]
    """Each window's class by name."""
    grasp: tuple[str, ...]
    """Each window's grasp, a name of its own across all data."""
    session: tuple[str, ...]
    """Each window's session, or recording; the training's only where the data are the same."""
    start_s: tuple[float, ...]
    """Each window's grasp's start on its recording's clock, seconds."""
    recording: tuple[str, ...]
    """The fingerprint of each window's recording, see `bundles.contract.fingerprint_of`."""
    digest: str
    """SHA-256 over the recordings' values, hexadecimal."""

    def __len__(self) -> int:
        return len(self.windows)

    def only(self, part: NDArray[np.intp]) -> Grasps:
        """Return the windows at these indices, shape (m,)."""
        return Grasps(
            windows=self.windows[part],
            label=tuple(self.label[i] for i in part),
            grasp=tuple(self.grasp[i] for i in part),
            session=tuple(self.session[i] for i in part),
            start_s=tuple(self.start_s[i] for i in part),
            recording=tuple(self.recording[i] for i in part),
            digest=self.digest,
        )

    def first(self, count: int) -> Grasps:
        """Return the first `count` grasps of each class."""
        kept: set[str] = set()
        for name in sorted(set(self.label)):
            own = [g for g, label in zip(self.grasp, self.label, strict=True) if label == name]
            kept |= set(list(dict.fromkeys(own))[:count])
        return self.only(np.flatnonzero([g in kept for g in self.grasp]))

    def count(self, label: str) -> int:
        """Return how many grasps of a class there are."""
        return len({g for g, own in zip(self.grasp, self.label, strict=True) if own == label})


def read_grasps(
    paths: Sequence[Path],
    contract: Contract,
    touches: TouchLevel | None = None,
    *,
    by_session: bool = False,
) -> Grasps:
    """Cut labelled recordings into windows of a run, at its level.

    Files of one name and sessions of one name in different `paths` are different ones; so are
    those of the training, unless the data are its very own.

    Args:
        paths: Recordings, or folders of them. Where the run has reference touches and
            `touches` is not given, each session must hold its own.
        contract: The run's.
        touches: The level of all these recordings.
        by_session: `touches` are for sessions that hold none of their own.

    Raises:
        BadDataset: There is no window, a trial lacks the run's target, or a session lacks its
            reference touches.
        BadBundle: The sensor is another.
        BadRecording: A recording is damaged.
    """
    parts = [_read(path, contract, touches, by_session) for path in paths]
    return Grasps(
        windows=Windows.join(part.windows for part in parts),
        label=tuple(name for part in parts for name in part.label),
        grasp=tuple(name for part in parts for name in part.grasp),
        session=tuple(name for part in parts for name in part.session),
        start_s=tuple(start for part in parts for start in part.start_s),
        recording=tuple(name for part in parts for name in part.recording),
        digest=" ".join(part.digest for part in parts),
    )


def check_apart(learned: Sequence[Path], test: Path) -> None:
    """Refuse to test on grasps that are learned from: their accuracy would say nothing.

    Args:
        learned: Recordings, or folders of them.
        test: The same.

    Raises:
        BadInput: A grasp of `test` has, value for value, the scans of one of `learned`.
        BadRecording: A recording is damaged.
    """
    known = {
        content for path in learned for file in list_recordings(path) for content in _contents(file)
    }
    for file in list_recordings(test):
        own = _contents(file)
        shared = sum(name in known for name in own)
        if shared:
            raise BadInput(
                "grasps for --test that are not learned",
                f"{file.name}, where {shared} of {len(own)} are to be learned",
                "record others, best in another session",
            )


def clock_time(path: Path, grasp: str, start_s: float) -> str:
    """Return when a grasp began, as a clock on the wall had it; seconds where that is unknown.

    Args:
        path: The recording, or a folder of them; each has a clock of its own.
        grasp: Its name, DATA/STEM#NUMBER, which says which.
        start_s: When it began on that recording's clock, seconds.
    """
    stem = grasp.rpartition("#")[0].rpartition("/")[2]
    anchor_ns = read_manifest(path / f"{stem}.mcap" if path.is_dir() else path).wall_anchor_ns
    if not anchor_ns:
        return f"{start_s:.0f} s"
    return datetime.fromtimestamp(anchor_ns / 1e9 + start_s).strftime("%H:%M")


def _contents(file: Path) -> list[bytes]:
    """Return a digest of each grasp's scans."""
    recording = read_recording(file)
    samples = recording.samples
    if not len(samples):
        return []
    time_s = samples.fitted_s
    trials = trials_of(
        file, recording.manifest, recording.marks, float(time_s[0]), float(time_s[-1])
    )
    grasps = [
        samples.values[(time_s >= trial.start_s) & (time_s <= trial.end_s)] for trial in trials
    ]
    # Grasps without a scan, or in which nothing moves, are alike by chance.
    return [sha256(rows.tobytes()).digest() for rows in grasps if (rows != rows[:1]).any()]


def _read(path: Path, contract: Contract, touches: TouchLevel | None, by_session: bool) -> Grasps:
    if by_session and touches is not None:
        dataset = load_by_session(path, contract, touches)
    else:
        dataset = load_at_level(path, contract, touches)
    with_joined_labels(dataset.trials, contract.target, path)
    labels = [joined_label(trial.labels, contract.target) for trial in dataset.trials]
    for trial, label in zip(dataset.trials, labels, strict=True):
        if label is None:
            raise BadDataset(
                f"the label {contract.target!r} on every grasp",
                f"{trial.groups['trial']} with the labels {', '.join(trial.labels) or 'none'}",
                "label the recording",
            )
    key = "session" if all("session" in trial.groups for trial in dataset.trials) else "recording"
    trials = [dataset.trials[i] for i in dataset.trial]
    own_data = dataset.digest == contract.data_digest
    origin = "" if own_data else f"{dataset.digest[:_DIGEST_LETTERS]}/"
    return Grasps(
        windows=dataset.windows,
        label=tuple(labels[i] or "" for i in dataset.trial),
        grasp=tuple(origin + trial.groups["trial"] for trial in trials),
        session=tuple(origin + trial.groups[key] for trial in trials),
        start_s=tuple(trial.start_s for trial in trials),
        recording=tuple(fingerprint_of(dataset.fingerprints[t.recording]) for t in trials),
        digest=dataset.digest,
    )


def measured_at(
    predict: Callable[[Windows], NDArray[np.floating]],
    contract: Contract,
    test: Path,
    touches: TouchLevel,
) -> tuple[dict[str, float], dict[str, float]]:
    """Return class → accuracy, 0…1, at the old level and at the level of the touches.

    Args:
        predict: (unscaled windows at the level as it was, n of them) → probabilities (n, classes).
        contract: What the bundle or run says of itself.
        test: Labelled recordings of the touches' session.
        touches: Its level.

    Raises:
        BadDataset, BadBundle, BadRecording: As `read_grasps` says.
    """
    grasps, known = read_grasps([test], contract, touches), contract.classes
    as_it_was = replace(grasps.windows, values=grasps.windows.values * touches.change)
    before, after = (
        by_class(predict(windows), known, grasps.label, known)
        for windows in (as_it_was, grasps.windows)
    )
    return before, after


def by_class(
    found: NDArray[np.floating], classes: Sequence[str], label: Sequence[str], known: Sequence[str]
) -> dict[str, float]:
    """Return what is measured → share of its windows predicted correctly, 0…1.

    All windows come first, under `OF_ALL`, and those of all classes known before where there are
    others too, under `OF_KNOWN`; then each class under its `class_key`.

    Args:
        found: Probabilities, shape (n, classes).
        classes: Their names.
        label: Each window's right class; one that is not among `classes` is never predicted.
        known: The classes known before adapting.
    """
    names = np.array(label)
    right = np.array(classes)[found.argmax(axis=1)] == names
    shares = {OF_ALL: float(right.mean())}
    old = np.isin(names, known)
    if old.any() and not old.all():
        shares[OF_KNOWN] = float(right[old].mean())
    return shares | {
        class_key(name): float(right[names == name].mean()) for name in sorted(set(label))
    }
