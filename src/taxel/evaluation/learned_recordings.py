"""Which recordings of an array a bundle was trained on, by fingerprints of their values.

Knows nothing about models or screens.
"""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from pathlib import Path

from taxel.bundles.contract import Contract, fingerprint_of
from taxel.errors import BadRecording
from taxel.recordings.reader import read_recording


def recordings_trained_on(contract: Contract, files: Sequence[Path]) -> tuple[str, ...]:
    """Return the names of the recordings whose very values a bundle was trained on, sorted.

    Empty for an older bundle, which does not say what it was trained on.

    Args:
        contract: The bundle's.
        files: Recordings of an array, read one after another.
    """
    known = set(contract.learned)
    return tuple(sorted(file.name for file in files if known and _fingerprint(file) in known))


def _fingerprint(file: Path) -> str:
    try:
        values = read_recording(file).samples.values
    except BadRecording:  # training refuses it, so that no bundle learned from it
        return ""
    return fingerprint_of(hashlib.sha256(values.tobytes()).hexdigest())
