"""What a recogniser answers while camera trials that are at hand run, as the live path gives it.

Its crops are those that live looks at, and its maths is live's; a camera's health is not looked
after. Knows nothing about screens or training frameworks.

Background of our choices: docs/decisions/0041.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np

from taxel.bundles.trials import TrialBundle, TrialContract
from taxel.decisions.trial_course import TrialCourse
from taxel.live.trial_watch import VerdictSoFar, predict_crop, verdict_config
from taxel.live.whole_trials import open_unchanged, share_out
from taxel.windows.camera_trials import CameraTrial, check_unchanged


def watch_side_by_side(
    contract: TrialContract,
    file: tuple[Path, str],
    trials: Sequence[CameraTrial],
    on_trial: Callable[[int, int], None] = lambda done, of: None,
) -> list[TrialCourse]:
    """Return what a recogniser answers while each trial runs, several trials at a time.

    Args:
        contract: Of the bundle.
        file: Where it lies, for other processes, and the file's SHA-256, hexadecimal.
        trials: Each is read once.
        on_trial: Called with trials done and in all.

    Raises:
        BadBundle: The bundle was not made for such cameras, or is another by now.
        BadTable: A video cannot be read.
    """
    return share_out(_watch, contract, file, trials, on_trial)


def _watch(file: Path, digest: str, trial: CameraTrial) -> TrialCourse:
    """Return one trial's course; a job for any worker."""
    check_unchanged(trial)
    return watch_trial(open_unchanged(file, digest), trial)


def watch_trial(bundle: TrialBundle, trial: CameraTrial) -> TrialCourse:
    """Return what a recogniser answers while a trial runs, whose cameras all work.

    No least confidence is asked for: whoever reads a course weighs its confidences. A trial shorter
    than a crop has no verdict.

    Args:
        bundle: What is recognised.
        trial: It is read once.

    Raises:
        BadTable: A video cannot be read.
    """
    contract = bundle.contract
    layout = contract.layout
    so_far = VerdictSoFar(bundle, verdict_config(bundle, least_confidence=0.0))
    starts = range(0, trial.frames - layout.span + 1, layout.every)
    crops = trial.crops(starts, layout.span, layout.step)
    verdicts = [so_far.add(*predict_crop(bundle, crop)) for crop in crops]
    shape = len(verdicts), len(contract.classes)
    return TrialCourse(
        time_s=np.array([start + layout.span - 1 for start in starts]) / trial.rate_hz,
        labels=tuple(verdict.label for verdict in verdicts),
        probabilities=np.array([own.probabilities for own in verdicts], float).reshape(shape),
        length_s=(trial.frames - 1) / trial.rate_hz,
    )
