"""What `taxel info` says of a table of camera trials: trials, labels and groups, read in place.

Knows nothing about splits, crops or models.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from taxel.cli.long_work import LongWork
from taxel.cli.printing import command, progress
from taxel.labels.class_order import in_order
from taxel.plain_text import number_of, visible, visible_names

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
            lines.append(f"{kind} {visible(name)}: {_named(counts)}")
    target = next((name for name, counts in found["labels"].items() if len(counts) > 1), None)
    if target is not None:
        lines.append(f"next: {command('taxel', 'evaluate-trials', path, '--target', target)}")
    return lines


def _named(counts: dict[str, int]) -> str:
    """Return values with how many trials have each; of many values how many there are."""
    if len(counts) > _MOST_NAMED:
        least, most = min(counts.values()), max(counts.values())
        each = f"{least}" if least == most else f"{least} to {most}"
        return f"{len(counts)} values of {each} trial{'s' * (most > 1)} each"
    return ", ".join(f"{visible(value)} ({count})" for value, count in counts.items())
