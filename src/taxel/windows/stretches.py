"""Which trial a window lies in, and how long the stretches of whole rows within trials are.

Knows nothing about labels' meaning or how windows are learned from.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from taxel.labels.trials import Trial, ends_of_rows
from taxel.recordings.reader import read_recording
from taxel.windows.config import WindowConfig
from taxel.windows.windower import Windows, cut_windows

_TIME_SLACK_S = 1e-6
"""A window this little outside its trial still belongs to it, seconds: hides float rounding."""


def owners_of(windows: Windows, trials: Sequence[Trial]) -> NDArray[np.intp]:
    """Return the trial that each window lies in as a whole, or -1, shape (n,).

    Args:
        windows: Of one recording.
        trials: Its trials, in the order of their starts; no row is in windows of two.
    """
    starts = np.array([trial.start_s for trial in trials]) - _TIME_SLACK_S
    ends = ends_of_rows(trials, _TIME_SLACK_S)
    owner = np.searchsorted(starts, windows.start_s, side="right") - 1
    inside = (owner >= 0) & (windows.end_s <= ends[np.maximum(owner, 0)])
    return np.where(inside, owner, -1).astype(np.intp)


def whole_stretches(
    paths: Sequence[Path], config: WindowConfig, trials: Sequence[Trial]
) -> list[int]:
    """Return each trial's longest stretch of rows without a missing, stale or NaN value, in rows.

    Args:
        paths: The recordings, which are read again.
        config: How windows are cut; its grid, gate and channels decide what a row is.
        trials: Stretches of those recordings, in the order of time; others' are passed over.

    Raises:
        BadRecording: A recording is damaged.
    """
    rows_only = replace(config, steps=1, stride=1, wavelet=None)
    found = []
    for path in paths:
        own = [trial for trial in trials if trial.recording == path.name]
        if not own:
            continue
        recording = read_recording(path)
        rows = cut_windows(recording.samples, rows_only, recording.manifest.sensor)
        owner = owners_of(rows, own)
        pause = np.diff(rows.start_s, prepend=0.0) > config.max_gap_s
        for number in range(len(own)):
            whole = rows.ready & (owner == number)
            found.append(_longest(whole, pause))
    return found


def _longest(whole: NDArray[np.bool_], pause: NDArray[np.bool_]) -> int:
    """Return the length of the longest run of True within which no pause begins."""
    run = longest = 0
    for is_whole, begins in zip(whole.tolist(), pause.tolist(), strict=True):
        run = (1 if begins else run + 1) if is_whole else 0
        longest = max(longest, run)
    return longest
