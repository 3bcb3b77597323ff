"""Which of some camera trials a bundle was trained on, by fingerprints of their images.

Knows nothing about models or screens.
"""

from __future__ import annotations

from collections.abc import Sequence

from taxel.bundles.contract import fingerprint_of
from taxel.bundles.trials import TrialContract
from taxel.recordings.imports.spelling import by_numbers
from taxel.windows.camera_trials import CameraTrial


def fingerprints(trials: Sequence[CameraTrial]) -> tuple[str, ...]:
    """Return what a contract keeps of its training trials, sorted.

    Raises:
        BadTable: A video cannot be read.
    """
    return tuple(sorted({fingerprint_of(own) for trial in trials for own in trial.digests()}))


def trained_on(contract: TrialContract, trials: Sequence[CameraTrial]) -> tuple[str, ...]:
    """Return the names of the trials that a bundle was trained on, 1000 behind 101.

    Empty for an older bundle, which does not say what it was trained on.

    Raises:
        BadTable: A video cannot be read.
    """
    known = set(contract.learned)
    names = (trial.name for trial in trials if known and _among(trial, known))
    return tuple(sorted(names, key=by_numbers))


def _among(trial: CameraTrial, known: set[str]) -> bool:
    as_read = {fingerprint_of(trial.digest), fingerprint_of(trial.turned)}
    return not known.isdisjoint(as_read) or any(
        fingerprint_of(own) in known for own in trial.digests(turned=True)
    )
