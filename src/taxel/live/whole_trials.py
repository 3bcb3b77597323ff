"""Verdicts on whole camera trials that are at hand, as the live path gives them at a trial's end.

Knows nothing about screens or training frameworks.

Background of our choices: docs/decisions/0041.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from functools import lru_cache, partial
from pathlib import Path
from typing import TypeVar

import numpy as np

from taxel.bundles.trials import TrialBundle, TrialContract, read_trial_bundle
from taxel.bundles.versions import digest_of
from taxel.decisions.trial_verdict import Verdict, VerdictConfig, join_crops, no_verdict
from taxel.errors import BadBundle
from taxel.jobs.running import as_done, shared_out
from taxel.live.trial_watch import predict_crop, verdict_config
from taxel.windows.camera_trials import CameraTrial, check_unchanged
from taxel.windows.trial_stretch import changes_of, part_of

Result = TypeVar("Result")


def predict_side_by_side(
    bundle: TrialBundle,
    file: tuple[Path, str],
    trials: Sequence[CameraTrial],
    on_trial: Callable[[int, int], None] = lambda done, of: None,
) -> list[Verdict]:
    """Return the verdict on each whole trial; several at a time where an engine is in use.

    Args:
        bundle: What is recognised.
        file: Where it lies, for other processes, and the file's SHA-256, hexadecimal.
        trials: Each is read once.
        on_trial: Called with trials done and in all.

    Raises:
        BadBundle: The bundle was not made for such cameras, or is another by now.
        BadTable: A video cannot be read.
    """
    if not shared_out():
        found = []
        for verdict in predict_trials(bundle, trials):
            found.append(verdict)
            on_trial(len(found), len(trials))
        return found
    return share_out(_predict, bundle.contract, file, trials, on_trial)


def share_out(
    look: Callable[[Path, str, CameraTrial], Result],
    contract: TrialContract,
    file: tuple[Path, str],
    trials: Sequence[CameraTrial],
    on_trial: Callable[[int, int], None],
) -> list[Result]:
    """Return what a look at each trial gives, in their order; several at a time where an engine is
    in use.

    Args:
        look: From a bundle's file, its SHA-256 and a trial; a job for any worker.
        contract: Of the bundle.
        file: Where it lies, for other processes, and the file's SHA-256, hexadecimal.
        trials: Each is read once.
        on_trial: Called with trials done and in all.

    Raises:
        BadBundle: The bundle was not made for such cameras, or is another by now.
        BadTable: A video cannot be read.
    """
    check_trials(contract, trials)
    path, digest = file
    jobs = [(path.absolute(), digest, replace(trial, slip_um=None)) for trial in trials]
    found: dict[int, Result] = {}
    for number, result in as_done(look, jobs, names=[trial.name for trial in trials]):
        found[number] = result
        on_trial(len(found), len(trials))
    return [found[number] for number in range(len(trials))]


def _predict(file: Path, digest: str, trial: CameraTrial) -> Verdict:
    """Return the verdict on one trial; a job for any worker."""
    check_unchanged(trial)
    return next(predict_trials(open_unchanged(file, digest), [trial]))


@lru_cache(maxsize=1)
def open_unchanged(file: Path, digest: str) -> TrialBundle:
    """Return a bundle, once for each process.

    Args:
        file: Where it lies.
        digest: The file's SHA-256 when the command began, hexadecimal.

    Raises:
        BadBundle: It is another file by now, or cannot be read.
    """
    if digest_of(file) != digest:
        raise BadBundle(f"the bundle {file} as it was when the command began", "another",
                        "run it again once the file no longer changes")  # fmt: skip
    return read_trial_bundle(file)


def predict_trials(
    bundle: TrialBundle, trials: Sequence[CameraTrial], least_confidence: float = 0.5
) -> Iterator[Verdict]:
    """Yield the verdict on each whole trial; UNKNOWN for one shorter than a crop.

    Args:
        bundle: What is recognised.
        trials: Read one after another.
        least_confidence: Below this probability the verdict is UNKNOWN, 0…1.

    Raises:
        BadBundle: The bundle was not made for such cameras.
        BadTable: A video cannot be read.
    """
    config = verdict_config(bundle, least_confidence)
    check_trials(bundle.contract, trials)
    for trial in trials:
        yield _verdict(bundle, config, trial)


def _verdict(bundle: TrialBundle, config: VerdictConfig, trial: CameraTrial) -> Verdict:
    classes, layout = bundle.contract.classes, bundle.contract.layout
    if trial.frames < layout.span:
        count = f"{trial.frames} frame{'s' * (trial.frames != 1)}"
        return no_verdict(classes, f"{count}, fewer than a crop")
    part = part_of(layout, trial.frames, lambda: changes_of(trial.moments(), layout.step))
    # map lets go of each crop before the next is read
    crops = trial.crops(layout.starts(part), layout.span, layout.step)
    answers = list(map(partial(predict_crop, bundle), crops))
    return join_crops(
        np.stack([own for own, _ in answers]),
        np.array([score for _, score in answers]),
        classes,
        config,
    )


def check_trials(contract: TrialContract, trials: Sequence[CameraTrial]) -> None:
    """Refuse trials of other cameras than a bundle was made for, before the first is looked at.

    Raises:
        BadBundle: There is one; it is named.
    """
    for trial in trials:
        try:
            sizes = [(trial.width, trial.height)] * len(trial.cameras)
            contract.check(trial.cameras, sizes, [trial.rate_hz])
        except BadBundle as error:
            raise BadBundle(error.needed, f"{error.got} in {trial.name}", error.mend) from error
