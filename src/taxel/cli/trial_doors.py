"""Camera trials given to a verb of arrays: the verb for trials takes them.

Only looks at what the words name; knows nothing about options.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

VERBS_OF_TRIALS = {"train": "train-trials", "evaluate": "evaluate-trials"}
"""Verb of arrays → that of camera trials."""


def trial_door(verb: str, words: Sequence[str]) -> str:
    """Return the verb that suits what the words name.

    Args:
        verb: As typed.
        words: What was typed behind it.
    """
    if verb not in VERBS_OF_TRIALS:
        return verb
    paths = [Path(word) for word in words if not word.startswith("-")]
    if any(_of_trials(path) for path in paths):
        return VERBS_OF_TRIALS[verb]
    return verb


def _of_trials(path: Path) -> bool:
    try:
        if not path.exists():
            return False
        from taxel.bundles.trials import is_trial_bundle
        from taxel.windows.camera_trials import are_camera_trials
    except (OSError, ValueError, ModuleNotFoundError):  # no path; no OpenCV, so no cameras
        return False
    return (path.is_file() and is_trial_bundle(path)) or are_camera_trials(path)
