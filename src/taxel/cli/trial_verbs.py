"""`taxel train` and `taxel evaluate` given camera trials: the verbs for camera trials run instead.

Looks only at which files the words name, and which options the verbs for camera trials have.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import fields
from pathlib import Path

from taxel.cli.options.rules import typed_options
from taxel.errors import BadInput, BadRecording

VERBS_OF_TRIALS = {"train": "train-trials", "evaluate": "evaluate-trials"}
"""Verb for recordings of an array → the verb for camera trials."""
_MOST_COLUMNS, _LONGEST_COLUMN = 6, 40
"""Columns of another table that are named, and characters of each. Our choice: a screen's line or
two, as in decision 41."""


def verb_for_data(verb: str, words: Sequence[str]) -> str:
    """Return the verb for the kind of data that the words name: camera trials, or any other.

    Args:
        verb: The verb that was typed.
        words: What was typed behind it.
    """
    if verb not in VERBS_OF_TRIALS:
        return verb
    paths = [Path(word) for word in words if not word.startswith("-")]
    if any(watches_grasps(path) for path in paths):  # scored on the same recordings, by `evaluate`
        return verb
    return VERBS_OF_TRIALS[verb] if any(of_trials(path) for path in paths) else verb


def takes_option(verb: str, option: str) -> bool:
    """Return whether a verb for camera trials has an option; False for any other verb.

    Args:
        verb: The verb.
        option: Without dashes.
    """
    return verb in VERBS_OF_TRIALS.values() and option in _options(verb)


def refuse_options_of_arrays(typed: str, verb: str, words: Sequence[str]) -> None:
    """Refuse options of a verb of arrays that the verb for camera trials does not have.

    Args:
        typed: The verb that was typed.
        verb: The verb that runs instead, or the same one.
        words: What was typed behind it.

    Raises:
        BadInput: There is such an option.
    """
    if verb == typed or VERBS_OF_TRIALS.get(typed) != verb:
        return
    options = [name for name in typed_options(words) if name != "help"]
    lacking = [f"--{name}" for name in options if not takes_option(verb, name.removeprefix("no-"))]
    if lacking:
        raise BadInput(
            f"options of taxel {verb}, which takes camera trials as these are",
            f"{' and '.join(lacking)}, which it does not have",
            f"leave out what is of arrays only, and see taxel {verb} --help",
        )


def _options(verb: str) -> set[str]:
    from taxel.cli.evaluation.evaluate_trials import EvaluateTrials
    from taxel.cli.options.trials import TrialOptions
    from taxel.cli.options.work import WorkOptions
    from taxel.cli.training.train_trials import TrainTrials

    own = TrainTrials if verb == "train-trials" else EvaluateTrials
    names = {field.name for kind in (own, TrialOptions, WorkOptions) for field in fields(kind)}
    return {name.replace("_", "-") for name in names}


def watches_grasps(path: Path) -> bool:
    """Return whether a path is a bundle that watches a grasp, such as slip-both-gels."""
    from taxel.bundles.envelope import is_grasp_bundle
    from taxel.bundles.shipped import find_bundle
    from taxel.errors import BadBundle

    try:
        bundle = find_bundle(path)
        return bundle.is_file() and is_grasp_bundle(bundle)
    except (BadBundle, OSError, ValueError):  # a former name, or no path
        return False


def of_trials(path: Path) -> bool:
    """Return whether a path holds camera trials, or a bundle for them; False if it is not there."""
    try:
        if not path.exists():
            return False
        from taxel.bundles.envelope import is_trial_bundle
        from taxel.windows.camera_trials import are_camera_trials
    except (OSError, ValueError, ModuleNotFoundError):  # no path; no OpenCV, so no cameras
        return False
    return (path.is_file() and is_trial_bundle(path)) or are_camera_trials(path)


def refuse_other_table(path: Path) -> None:
    """Refuse a table that is none of camera trials, by the columns that it would need.

    Raises:
        BadTable: It cannot be read, as in another encoding than UTF-8.
        BadRecording: Its columns are others.
    """
    from taxel.recordings.imports.value_tables.table_columns import LARGEST_LIST, read_cells
    from taxel.recordings.imports.video_rows import names_videos

    if not path.is_file() or path.suffix.lower() not in (".csv", ".tsv"):
        return
    if path.stat().st_size > LARGEST_LIST:  # a table of data, not of trials
        return
    columns = next(iter(read_cells(path)), [])
    if not any(columns) or names_videos(columns):
        return
    shown = ", ".join(repr(name.strip()[:_LONGEST_COLUMN]) for name in columns[:_MOST_COLUMNS])
    more = len(columns) - _MOST_COLUMNS
    raise BadRecording(
        "a recording (MCAP), or a table of camera trials with the columns left, right (or "
        "camera:NAME), label:NAME and group:NAME",
        f"the columns {shown}{f' and {more} more' if more > 0 else ''} in {path}, line 1",
        "mend that line, or import tables with: taxel import",
    )
