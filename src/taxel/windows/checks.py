"""What the recordings of one data set must have in common, and what is said of odd ones.

Knows nothing about how windows are cut.

Background of our choices: docs/decisions/0003.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from statistics import median_high

import numpy as np
from numpy.typing import NDArray

from taxel.errors import BadDataset
from taxel.labels.class_order import refuse_reserved
from taxel.labels.trials import Trial
from taxel.plain_text import number_of
from taxel.signals import SensorInfo
from taxel.windows.config import MOST_RATE_CHANGE, SLOW_GRID, WindowConfig
from taxel.windows.windower import Windows

MORE_WINDOWS = (
    "choose fewer steps, a lower gate or another --window grid=; taxel info shows what is missing"
)
"""What helps where trials gave no window, for messages."""
OUTSIDE = "across a trial's border or between trials"
"""Of windows that belong to no one trial."""
_UNEVEN = 5
"""A class with so many times fewer trials than the commonest is rare. Source: our choice."""

LARGEST = 2e18
"""Largest size of a value, in its unit: models square values in 32 bits, and nanoseconds since 1970
are as large. Source: our choice, docs/decisions/0024."""


def check_sensor(first: SensorInfo, own: SensorInfo, file: Path, config: WindowConfig) -> None:
    """Refuse a recording that does not belong to the first one's data set.

    Args:
        first: The sensor of the first recording.
        own: That of this one.
        file: This one, for the message.
        config: How windows are cut.

    Raises:
        BadDataset: It holds no array, channels or units differ, a channel that windows take is
            missing, or the rates differ where the sensor's own scans are rows.
    """
    if not own.channels:
        raise BadDataset(
            "recordings of an array", f"{file.name}, which holds none, as of tactile cameras",
            "camera trials: taxel train-trials or evaluate-trials; grasps: taxel train-monitor",
        )  # fmt: skip
    if (own.channels, own.units) != (first.channels, first.units):
        raise BadDataset(
            f"the channels {_with_units(first)} in every recording",
            f"{_with_units(own)} in {file.name}",
            "put recordings of different sensors into different folders",
        )
    low_hz, high_hz = sorted((first.rate_hz, own.rate_hz))
    several = config.steps > 1  # one row lasts no time
    if config.grid_hz is None and several and high_hz > MOST_RATE_CHANGE * low_hz > 0:
        raise BadDataset(
            f"about {first.rate_hz:g} scans/s in every recording, for their own scans are rows",
            f"{own.rate_hz:g} in {file.name}",
            f"choose a common grid, such as --window grid={low_hz:.3g}, or separate the rates",
        )
    missing = [name for name in config.channels or () if name not in own.channels]
    if missing:
        raise BadDataset(
            f"the channels {', '.join(config.channels or ())}",
            f"recordings without {', '.join(missing)}; they have {', '.join(own.channels)}",
            "name channels that the recordings have",
        )


def _with_units(sensor: SensorInfo) -> str:
    return ", ".join(
        f"{name} [{unit}]" for name, unit in zip(sensor.channels, sensor.units, strict=True)
    )


def nothing_found(path: Path, config: WindowConfig, where: Mapping[str, str] | None) -> BadDataset:
    """Return the refusal of recordings that give no window."""
    gate = f" above the gate of {config.gate:g}" if config.gate is not None else ""
    chosen = f" where {', '.join(f'{k}={v}' for k, v in where.items())}" if where else ""
    return BadDataset(
        f"at least one window of {config.steps} rows{gate} inside a trial{chosen}",
        f"none in {path}",
        "look at the recordings with taxel info, or choose fewer steps or a lower gate",
    )


def nothing_usable(
    windows: int, stale: int, config: WindowConfig, stretches: Sequence[int]
) -> BadDataset:
    """Return the refusal of windows none of which may be used.

    Args:
        windows: How many there are.
        stale: How many for the age of their scans alone.
        config: How they were cut.
        stretches: Rows of each trial's longest stretch without a missing, stale or NaN value.
    """
    if stale < windows:
        got = f"each window of {number_of(config.steps, 'row')} holds missing, stale or NaN values"
        mend = _shorter(config, stretches)
    else:
        got = f"in every window ({windows}) a row's latest scan is {too_old(config)}"
        mend = ", or take each scan as a row: --window grid=own"
    return BadDataset(
        "at least one window of usable values",
        f"none: {got}",
        f"look at the recordings with: taxel info{mend}",
    )


def _shorter(config: WindowConfig, stretches: Sequence[int]) -> str:
    """Return whether shorter windows would hold usable values only, and which; empty if nothing
    is known of that.

    A stretch of n rows holds a whole window of (n + 1) // 2, wherever the first window began.
    """
    if config.steps <= 2 or config.layout == "A" or not stretches:
        return ""
    usual = median_high(stretches)
    steps = min((usual + 1) // 2, config.steps - 1)
    if steps < 2:
        return (
            f", and record again: half of the trials or more have at most {usual} rows in a row "
            "that are whole, too few for shorter windows"
        )
    return (
        f", or choose shorter windows: half of the trials or more have {usual} rows in a row that "
        f"are whole, enough for --window steps={steps}"
    )


def too_old(config: WindowConfig) -> str:
    """Return when a scan is too old for a row, in words."""
    age_s = config.max_age_s or 0.0
    return f"over {age_s:.3g} s old" if age_s >= 1.0 else f"over {1000 * age_s:.3g} ms old"


def check_size(
    values: NDArray[np.float32], channels: Sequence[str], where: Callable[[int], str]
) -> None:
    """Refuse values so large that they stand for something else, as an overload's 9.9e37 does.

    Args:
        values: Finite ones, shape (n, …, channels).
        channels: Their names.
        where: Says where the one of n is, for the message.

    Raises:
        BadDataset: A value is larger than models can compute with.
    """
    if not values.size:
        return
    least, most = float(values.min()), float(values.max())
    if max(-least, most) <= LARGEST:
        return
    at = values.argmax() if most >= -least else values.argmin()
    index = np.unravel_index(at, values.shape)
    raise BadDataset(
        f"values up to {LARGEST:g} in size, as models square them",
        f"{values[index]:g} of channel {channels[int(index[-1])]!r} in {where(int(index[0]))}",
        "such numbers mostly stand for an overload or a missing value: empty those cells and "
        "import again with --missing keep, or leave the channel or trial out",
    )


def labels_of(trials: Sequence[Trial], target: str) -> list[str]:
    """Return each trial's value of a label.

    Raises:
        BadDataset: A trial lacks it.
    """
    lacking = sum(target not in trial.labels for trial in trials)
    if lacking:
        known = ", ".join(sorted({name for trial in trials for name in trial.labels})) or "none"
        raise BadDataset(
            f"the label {target!r} on every trial",
            f"{lacking} of {len(trials)} without it; the labels are {known}",
            "name one of those, or load with target=, which leaves such trials out",
        )
    return [trial.labels[target] for trial in trials]


def check_indices(index: NDArray[np.intp], trials: int) -> None:
    """Refuse trials that a data set does not have.

    Args:
        index: Shape (n,), ascending.
        trials: How many it has.

    Raises:
        BadDataset: There is such an index.
    """
    if len(index) and not 0 <= index[0] <= index[-1] < trials:
        raise BadDataset(
            f"indices of trials from 0 to {trials - 1}", f"{index[0]} to {index[-1]}",
            "take those of this data set",
        )  # fmt: skip


def check_classes(trials: Sequence[Trial], target: str, empty: Sequence[Trial] = ()) -> None:
    """Refuse trials that are all of one class.

    Args:
        trials: Each with the target's label.
        target: The label.
        empty: Trials that gave no window: they are not counted, and not hidden either.

    Raises:
        BadDataset: So it is, or a class has the name that stands for no answer.
    """
    classes = {trial.labels[target] for trial in trials}
    refuse_reserved(classes, target)
    if len(classes) >= 2:
        return
    lost = [trial for trial in empty if trial.labels.get(target, *classes) not in classes]
    if lost:
        raise BadDataset(
            f"windows of at least two classes of {target!r}",
            f"windows of one class only ({', '.join(classes)}): {no_window(lost, 'other classes')}",
            MORE_WINDOWS,
        )
    raise BadDataset(
        f"at least two classes of {target!r}",
        f"one class only ({', '.join(classes)})",
        "record or import the other classes too",
    )


def no_window(trials: Sequence[Trial], which: str) -> str:
    """Return that trials are there and gave no window, in words.

    Args:
        trials: At least one.
        which: What they are of, such as "other classes".
    """
    count = f"{len(trials)} trial" + "s" * (len(trials) > 1)
    return f"{count} of {which} gave no window: too short, below the gate or not usable"


def grid_note(sensor: SensorInfo, config: WindowConfig) -> list[str]:
    """Return a note where the grid is far slower than the sensor, for it has no filter."""
    if config.grid_hz is None or config.grid_hz >= SLOW_GRID * sensor.rate_hz:
        return []
    return [
        f"the grid takes {config.grid_hz:g} of {sensor.rate_hz:g} scans/s, with no filter: "
        f"vibration above {config.grid_hz / 2:g} Hz turns up as slower motion; --window grid=own "
        "takes "
        "every scan"
    ]


def filled_note(windows: Windows) -> list[str]:
    """Return a note where values of short gaps were filled in."""
    filled = windows.filled[windows.filled > 0]
    if not len(filled):
        return []
    return [
        f"{len(filled)} of {number_of(len(windows), 'window')} with short gaps, filled in between "
        f"their neighbours: {100 * float(filled.mean()):.2g} % of their values in the mean, "
        f"{100 * float(filled.max()):.2g} % at most"
    ]


def rare_note(trials: Sequence[Trial], target: str) -> list[str]:
    """Return a note of the classes that have hardly any trials beside the commonest."""
    counts = Counter(trial.labels[target] for trial in trials)
    most = max(counts.values())
    rare = [f"{count} of {name}" for name, count in sorted(counts.items())
            if _UNEVEN * count <= most or count == 1 < most]  # fmt: skip
    if not rare:
        return []
    return [
        f"of {len(trials)} trials only {', '.join(rare)}: the accuracy hardly counts them; look "
        "at their rows of the confusion, and record more"
    ]
