"""A second folder's windows beside a data set's, cut alike: to train on the one and test the other.

Knows nothing about splits or models.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from taxel.errors import BadDataset
from taxel.labels.joined import refuse_merged
from taxel.labels.trials import Trial
from taxel.windows.dataset import LABEL_THEM, Dataset, follow_levels, load_dataset, only_labelled
from taxel.windows.level_follow import parse_level_follow
from taxel.windows.rates import differ
from taxel.windows.reference import to_usual
from taxel.windows.windower import Windows

TEST_PREFIX = "test/"
"""Stands before the recordings' and trials' names of the second folder, so that files that are
called alike stay apart."""


def join_datasets(first: Dataset, folder: Path, target: str) -> Dataset:
    """Return a data set's trials, followed by those of another folder.

    Args:
        first: A data set; its windows say how the others are cut.
        folder: The other recordings.
        target: The label; trials of the folder without it are left out.

    Raises:
        BadDataset: A recording is in both, the sensors differ, or their rates where their own
            scans are rows, no trial of the folder has the label, values of "a+b" that differ would
            be joined to one, or there is no window.
    """
    second = only_labelled(
        load_dataset(folder, first.config, usual=first.usual),
        target,
        folder,
        f"{LABEL_THEM}; or test on others",
    )
    _check_alike(first, second, folder)
    refuse_merged((*first.trials, *second.trials), target, folder)
    levels = tested = None
    if first.reference is not None and second.reference is not None:
        change = to_usual(second.reference.level, first.reference.level)
        windows = replace(second.windows, values=second.windows.values * change)
        to_level = None if second.to_level is None else second.to_level * change
        second = replace(second, windows=windows, to_level=to_level)
    if first.to_level is not None and second.to_level is not None:
        levels = np.concatenate([first.to_level, second.to_level])
    if first.tested_level is not None and second.tested_level is not None:
        tested = np.concatenate([first.tested_level, second.tested_level])
    return replace(
        first,
        windows=Windows.join([first.windows, second.windows]),
        trial=np.concatenate([first.trial, second.trial + len(first.trials)]),
        trials=(*first.trials, *map(renamed, second.trials)),
        notes=(*first.notes, *(f"{folder.name}: {note}" for note in second.notes)),
        to_level=levels,
        tested_level=tested,
        fingerprints={
            **first.fingerprints,
            **{f"{TEST_PREFIX}{name}": own for name, own in second.fingerprints.items()},
        },
    )


def follow_apart(dataset: Dataset, text: str, unseen: NDArray[np.bool_] | None) -> Dataset:
    """Return a data set whose levels are followed, of which some trials are only tested.

    Those have no part in what is learned, and are followed as where a bundle is scored. A session
    of the second folder is none of the first one's, though they be called alike.

    Args:
        dataset: As measured.
        text: As `WindowConfig.level_follow` has it.
        unseen: The trials that are only tested, shape (trials,); None: none.

    Raises:
        BadDataset: A trial lacks the group.
    """
    if unseen is None:
        return follow_levels(dataset, text)
    learned = follow_levels(dataset.only_trials(np.flatnonzero(~unseen).tolist()), text)
    key = parse_level_follow(text).key
    trials = [
        replace(own, groups={**own.groups, key: TEST_PREFIX + own.groups[key]})
        if own.recording.startswith(TEST_PREFIX) and key in own.groups else own
        for own in dataset.trials
    ]  # fmt: skip
    scored = follow_levels(replace(dataset, trials=tuple(trials)), text, learned.usual)
    assert scored.to_level is not None
    assert scored.tested_level is not None
    factor, tested = scored.to_level.copy(), scored.tested_level.copy()
    factor[~unseen], tested[~unseen] = learned.to_level, learned.tested_level
    values = dataset.windows.values * factor[dataset.trial, None, :]
    return replace(
        scored, trials=dataset.trials, to_level=factor, tested_level=tested,
        windows=replace(dataset.windows, values=values),
    )  # fmt: skip


def _check_alike(first: Dataset, second: Dataset, folder: Path) -> None:
    ours, theirs = first.sensor, second.sensor
    if ours.channels != theirs.channels:
        mend = "name recordings of this sensor"
        if sorted(ours.channels) == sorted(theirs.channels):
            mend = "import them again with the channels in this order"
        raise BadDataset(
            f"the channels {', '.join(ours.channels)}, in this order, in the folder to test on too",
            f"{', '.join(theirs.channels)} in {folder}", mend,
        )  # fmt: skip
    if ours.units != theirs.units:
        raise BadDataset(
            f"channels in {', '.join(dict.fromkeys(ours.units))} in the folder to test on too",
            next(f"{name} in {got} (not {needed}) in {folder}" for name, needed, got
                 in zip(ours.channels, ours.units, theirs.units, strict=True) if needed != got),
            "import them again with this unit if it is mistaken; or name others",
        )  # fmt: skip
    rates_hz = first.sensor.rate_hz, second.sensor.rate_hz
    if first.config.grid_hz is None and min(rates_hz) > 0 and differ(rates_hz):
        raise BadDataset(
            f"about {rates_hz[0]:g} scans/s in the folder to test on too, for own scans are rows",
            f"{rates_hz[1]:g} in {folder}, where a window would last another time",
            "test on recordings of that rate; or, with a recipe, choose a common grid, such as "
            f"--window grid={min(rates_hz):.3g}",
        )
    known = {own: name for name, own in first.fingerprints.items()}
    for name, own in second.fingerprints.items():
        if own in known:
            raise BadDataset(
                "other recordings to test on than to train on",
                f"{name} in {folder}, which holds the values of {known[own]}",
                "take it out of one of the folders",
            )  # fmt: skip


def renamed(trial: Trial) -> Trial:
    """Return a trial of the second folder under names of its own."""
    names = {key: f"{TEST_PREFIX}{trial.groups[key]}" for key in ("recording", "trial")}
    return replace(trial, recording=f"{TEST_PREFIX}{trial.recording}",
                   groups={**trial.groups, **names})  # fmt: skip
