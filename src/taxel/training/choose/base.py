"""Recordings before they are cut into windows: their trials, and how long these are.

Knows nothing about windows, features or models.

Source: docs/decisions/0039.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from taxel.errors import BadDataset
from taxel.labels.joined import with_joined_label
from taxel.labels.trials import Trial
from taxel.plain_text import number_of
from taxel.windows.config import WindowConfig
from taxel.windows.dataset import Dataset, load_dataset
from taxel.windows.joining import TEST_PREFIX, join_datasets
from taxel.windows.rates import with_common_grid

ROWS = WindowConfig(steps=1, stride=1, grid_hz=None)
"""Each scan as a window of its own: what recordings hold before they are cut."""


@dataclass(frozen=True, slots=True)
class Base:
    """What is known of recordings before they are cut: their trials and how long these are."""

    path: Path
    dataset: Dataset
    """Windows of one row: each usable scan."""
    target: str
    rows: NDArray[np.intp]
    """Rows of each trial, shape (trials,); unusable ones too."""
    test: Path | None = None
    """Another folder, whose trials follow and are tested only."""
    notes: tuple[str, ...] = ()
    """What a reader must know of all recordings, however they are cut."""
    unseen: frozenset[int] = frozenset()
    """Trials that nothing is learned from, though they are tested: no level of theirs is usual."""

    @property
    def trials(self) -> tuple[Trial, ...]:
        """Return all trials; splits count them."""
        return self.dataset.trials

    @property
    def alone(self) -> bool:
        """Return whether each trial is a recording of its own; else marks part recordings."""
        own = [self.trials[i] for i in self.own]
        return len({trial.recording for trial in own}) == len(own)

    @property
    def own(self) -> list[int]:
        """Return the trials that may be learned from in the end: those of the first folder."""
        return [i for i, trial in enumerate(self.trials)
                if self.test is None or not trial.recording.startswith(TEST_PREFIX)]  # fmt: skip

    @property
    def y(self) -> NDArray[np.intp]:
        """Return each trial's class number, shape (trials,)."""
        names = {name: number for number, name in enumerate(self.dataset.classes(self.target))}
        return np.array([names[trial.labels[self.target]] for trial in self.trials], np.intp)


def load_base(
    path: Path, target: str, channels: tuple[str, ...] | None = None, test: Path | None = None
) -> Base:
    """Read recordings row by row: each scan, or on one grid where their own rates differ.

    Args:
        path: A folder of recordings, or one.
        target: The label to predict.
        channels: Those to use; all unless given.
        test: Another folder, to test on only.

    Raises:
        BadDataset: There is no usable row, or no trial has the target.
    """
    folders = (path,) if test is None else (path, test)
    config = with_common_grid(replace(ROWS, channels=channels), *folders)
    training = dataset = load_dataset(path, config, target=target)
    if test is not None:
        dataset = join_datasets(training, test, target)
    rows = np.bincount(dataset.trial, minlength=len(dataset.trials)).astype(np.intp)
    notes = _constant(dataset)
    if training.missing or config.grid_hz is not None:  # on a grid, rows may be too old as well
        whole = load_dataset(path, config, unusable=True)
        rows[: len(training.trials)] = _all_rows(whole, training)
        notes += _without_a_row(whole, training, target)
    return Base(path, dataset, target, rows, test, notes=notes)


def _all_rows(whole: Dataset, usable: Dataset) -> NDArray[np.intp]:
    """Return how many scans each trial has, unusable ones too: lost scans do not shorten it."""
    counts = np.bincount(whole.trial, minlength=len(whole.trials))
    known = {(trial.recording, trial.start_s): counts[i] for i, trial in enumerate(whole.trials)}
    return np.array([known[trial.recording, trial.start_s] for trial in usable.trials], np.intp)


def _without_a_row(whole: Dataset, usable: Dataset, target: str) -> tuple[str, ...]:
    """Return a warning on trials that are left out, as no scan of theirs is usable."""
    known = {(trial.recording, trial.start_s) for trial in usable.trials}
    labelled = [with_joined_label(trial, target) for trial in whole.trials]
    lost = [own for own in labelled
            if target in own.labels and (own.recording, own.start_s) not in known]  # fmt: skip
    if not lost:
        return ()
    are = "is" if len(lost) == 1 else "are"
    return (
        f"{len(lost)} of {number_of(len(known) + len(lost), 'trial')} {are} left out, such as "
        f"{lost[0].groups['trial']}: in none of their rows has every channel a fresh value",
    )


def _constant(dataset: Dataset) -> tuple[str, ...]:
    """Return a warning on channels that never change.

    Raises:
        BadDataset: None changes.
    """
    values = dataset.windows.values[:, 0]
    same = np.ptp(values, axis=0) == 0
    names = [name for name, still in zip(dataset.sensor.channels, same, strict=True) if still]
    if len(values) > 1 and same.all():
        raise BadDataset(
            "channels whose values change", "the same values in all rows of all recordings",
            "look at the sensor and at: taxel info",
        )  # fmt: skip
    listed = f"{', '.join(names[:8])}{' …' if len(names) > 8 else ''}"
    return (f"channels that never change: {listed}",) if names else ()
