"""What `taxel info` says of a table of camera trials: trials, labels and groups, read in place.

Knows nothing about splits, crops or models.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from taxel.bundles.contract import RATE_RANGE
from taxel.cli.long_work import LongWork
from taxel.cli.printing import command, progress
from taxel.labels.class_order import in_order
from taxel.plain_text import number_of, visible, visible_names
from taxel.recordings.imports.video_rows import SPLIT

if TYPE_CHECKING:
    from taxel.windows.camera_trials import CameraTrial


def is_trial_table(path: Path) -> bool:
    """Return whether a path is a table of camera trials."""
    if not path.is_file() or path.suffix == ".mcap":
        return False
    try:
        from taxel.windows.camera_trials import TABLES, are_camera_trials
    except ModuleNotFoundError:  # no OpenCV, so no cameras
        return False
    return path.suffix.lower() in TABLES and are_camera_trials(path)


def describe_table(path: Path) -> tuple[list[str], dict[str, Any]]:
    """Return what a table of camera trials holds, as lines and as plain values.

    Raises:
        BadTable: The table or one of its files is not as it should be.
        BadDataset: Trials differ in their number of cameras.
    """
    from taxel.windows.camera_trials import read_camera_trials

    with progress() as bar:
        LongWork(bar).step("reading trials", "reading trials")
        trials = read_camera_trials(path)
    found = _values(path, trials)
    return _lines(path, found), found


def _values(path: Path, trials: Sequence[CameraTrial]) -> dict[str, Any]:
    labels = sorted({name for trial in trials for name in trial.labels})
    groups = sorted({name for trial in trials for name in trial.groups} - _OWN)
    twins = Counter(min(trial.digest, trial.turned) for trial in trials)
    lengths = [trial.frames for trial in trials]
    return {
        "path": str(path),
        "trials": len(trials),
        "cameras": list(trials[0].cameras),
        "sizes": sorted({f"{trial.width}×{trial.height}" for trial in trials}),
        "rates_hz": sorted({trial.rate_hz for trial in trials}),
        "frames": [min(lengths), max(lengths)],
        "labels": {name: _counts([t.labels.get(name, "") for t in trials]) for name in labels},
        "groups": {name: _counts([t.groups.get(name, "") for t in trials]) for name in groups},
        "twins": sum(count for count in twins.values() if count > 1),
    }


_OWN = {"file", "recording"}
"""Groups that every trial has for itself."""
_MOST_NAMED = 12
"""Values of a label or group that are named. Source: our choice, decision 41: a screen's line or
two."""


def _counts(values: Sequence[str]) -> dict[str, int]:
    count = Counter(value or "none" for value in values)
    return {value: count[value] for value in in_order(count)}


def _lines(path: Path, found: dict[str, Any]) -> list[str]:
    least, most = found["frames"]
    frames = number_of(most, "frame") if least == most else f"{least} to {most} frames"
    rates = " and ".join(f"{rate:g}" for rate in found["rates_hz"][:3])
    lines = [
        f"{path}: {number_of(found['trials'], 'camera trial')} of "
        f"{number_of(len(found['cameras']), 'camera')} ({visible_names(found['cameras'])}), "
        f"{' and '.join(found['sizes'][:3])}, {frames}"
        + ("" if most == 1 else f", {rates} frames/s"),
    ]
    for kind in ("label", "group"):
        for name, counts in found[f"{kind}s"].items():
            what = name if (kind, name) == ("group", SPLIT) else f"{kind} {visible(name)}"
            lines.append(f"{what}: {_named(counts)}")
    return [*lines, *_what_next(path, found)]


def _what_next(path: Path, found: dict[str, Any]) -> list[str]:
    """Return what stands in the way of training; the verb that comes next where nothing does."""
    notes = []
    if found["twins"]:
        notes.append(f"note: {number_of(found['twins'], 'trial')} of the same images as another")
    if len(found["sizes"]) > 1:
        return [*notes, "note: a recogniser needs images of one size: make a table of each size"]
    rates = found["rates_hz"]
    if found["frames"][1] > 1 and rates[-1] > rates[0] * RATE_RANGE[1]:
        return [*notes, "note: a recogniser needs trials of about one rate: correct the table's "
                "column rate, or make a table of each rate"]  # fmt: skip
    if not found["labels"]:
        return [*notes, "note: no label: add a column label:NAME that says what to predict"]
    repeated = [
        name for name, counts in found["labels"].items()
        if len(counts) > 1 and min(counts.values()) > 1
    ]  # fmt: skip
    if repeated:
        which = "" if len(repeated) == 1 else ", or another label"
        line = command("taxel", "evaluate-trials", path, "--target", repeated[0])
        notes.append(f"next: {line}{which}")
    return notes


def _named(counts: dict[str, int]) -> str:
    """Return values with how many trials have each; of many values how many there are."""
    if len(counts) > _MOST_NAMED:
        least, most = min(counts.values()), max(counts.values())
        each = f"{least}" if least == most else f"{least} to {most}"
        return f"{len(counts)} values of {each} trial{'s' * (most > 1)} each"
    return ", ".join(f"{visible(value)} ({count})" for value, count in counts.items())
