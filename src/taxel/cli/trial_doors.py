"""Camera trials given to a verb of arrays: the verb for trials takes them.

Only looks at what the words name, and which options the verb for trials has.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import fields
from pathlib import Path

from taxel.cli.options.rules import typed_options
from taxel.errors import BadInput

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


def takes_option(door: str, option: str) -> bool:
    """Return whether a verb for camera trials has an option; False of any other verb.

    Args:
        door: The verb.
        option: Without dashes.
    """
    return door in VERBS_OF_TRIALS.values() and option in _options(door)


def refuse_options_of_arrays(verb: str, door: str, words: Sequence[str]) -> None:
    """Refuse options of a verb of arrays that the verb for camera trials does not have.

    Args:
        verb: As typed.
        door: The verb that suits what the words name.
        words: What was typed behind it.

    Raises:
        BadInput: There is such an option.
    """
    if door == verb or VERBS_OF_TRIALS.get(verb) != door:
        return
    typed = [name for name in typed_options(words) if name != "help"]
    lacking = [f"--{name}" for name in typed if not takes_option(door, name.removeprefix("no-"))]
    if lacking:
        raise BadInput(
            f"options of taxel {door}, which takes camera trials as these are",
            f"{' and '.join(lacking)}, which it does not have",
            f"leave out what is of arrays only, and see taxel {door} --help",
        )


def _options(door: str) -> set[str]:
    from taxel.cli.evaluation.evaluate_trials import EvaluateTrials
    from taxel.cli.options.trials import TrialOptions
    from taxel.cli.training.train_trials import TrainTrials

    own = TrainTrials if door == "train-trials" else EvaluateTrials
    names = {field.name for kind in (own, TrialOptions) for field in fields(kind)}
    return {name.replace("_", "-") for name in names}


def _of_trials(path: Path) -> bool:
    try:
        if not path.exists():
            return False
        from taxel.bundles.envelope import is_trial_bundle
        from taxel.windows.camera_trials import are_camera_trials
    except (OSError, ValueError, ModuleNotFoundError):  # no path; no OpenCV, so no cameras
        return False
    return (path.is_file() and is_trial_bundle(path)) or are_camera_trials(path)
