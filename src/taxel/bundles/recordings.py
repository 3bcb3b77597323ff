"""Recordings as a bundle sees them: its window, at the level that its scaling holds for.

Knows nothing about networks or boards.
"""

from __future__ import annotations

from collections import Counter
from dataclasses import replace
from pathlib import Path

import numpy as np

from taxel.bundles.contract import Contract
from taxel.bundles.levels import TouchLevel
from taxel.errors import BadDataset
from taxel.plain_text import number_of
from taxel.windows.dataset import Dataset, load_dataset
from taxel.windows.reference import parse_reference, session_levels, to_usual


def load_at_level(
    path: Path, contract: Contract, touches: TouchLevel | None = None, *, target: str | None = None
) -> Dataset:
    """Cut recordings into a bundle's windows, brought to the level of its own reference touches.

    `load_dataset` brings sessions to the level that is usual among them; a bundle's scaling
    holds for the level that it was trained or adapted at.

    Args:
        path: A folder of recordings, or one.
        contract: What the bundle or run says of itself.
        touches: The level of all of them; taken from each session's own touches unless given.
        target: The label; trials without it are left out. None keeps all.

    Raises:
        BadDataset: There is no window, no trial has the target, or a session lacks its
            reference touches.
        BadBundle: The array is another than the bundle's.
        BadRecording: A recording is damaged.
    """
    window = contract.window if touches is None else replace(contract.window, reference=None)
    dataset = load_dataset(path, window, target=target, usual=contract.followed_from)
    contract.check_sensor(dataset.sensor)
    own = dataset.reference.level if dataset.reference is not None else None
    level = own if touches is None else touches.level
    if level is None or contract.reference is None:
        return dataset
    factor = to_usual(level, contract.reference.level)
    values = np.asarray(dataset.windows.values * factor, np.float32)
    return replace(
        dataset,
        windows=replace(dataset.windows, values=values),
        reference=contract.reference,
        to_level=None if dataset.to_level is None else dataset.to_level * factor,
    )


def load_by_session(path: Path, contract: Contract, touches: TouchLevel) -> Dataset:
    """Cut recordings as `load_at_level` does; sessions without touches of their own have `touches`.

    Args:
        path: A folder of recordings, or one.
        contract: What a bundle or run with reference touches says of itself.
        touches: The level of its own session, and of recordings that name none.

    Raises:
        BadDataset: There is no window beside the touches, or a session with a name of its own
            lacks its reference touches.
        BadBundle: The array is another than the bundle's.
        BadRecording: A recording is damaged.
    """
    assert contract.window.reference is not None
    assert contract.reference is not None
    dataset = load_dataset(path, replace(contract.window, reference=None))
    contract.check_sensor(dataset.sensor)
    reference = parse_reference(contract.window.reference)
    trials = dataset.trials
    named = all("session" in trial.groups for trial in trials)
    session = dataset.group("session" if named else "recording")
    held = Counter(
        name for name, trial in zip(session, trials, strict=True) if reference.matches(trial)
    )
    for name in sorted(set(session)):
        if held[name] < reference.count and named and name not in touches.sessions:
            raise BadDataset(
                f"{number_of(reference.count, 'touch')} of {reference.key}={reference.value} "
                "in each session but that of --touches "
                f"({', '.join(sorted(touches.sessions)) or 'which name none'})",
                f"{held[name]} in {name}", "leave it out, or give its own touches",
            )  # fmt: skip
    levelled = np.flatnonzero([held[name] >= reference.count for name in session])
    level = np.tile(touches.level, (len(trials), 1))
    used = np.zeros(len(trials), bool)
    there = np.isin(dataset.trial, levelled)
    if len(levelled):
        level[levelled], used[levelled] = session_levels(
            dataset.windows.values[there], dataset.windows.mask[there],
            np.searchsorted(levelled, dataset.trial[there]), [trials[i] for i in levelled],
            reference,
        )  # fmt: skip
    factor = to_usual(level, contract.reference.level)
    left = ~used[dataset.trial]
    if not left.any():
        raise BadDataset("windows beside the reference touches", f"none in {path}", "record grasps")
    kept, owner = np.unique(dataset.trial[left], return_inverse=True)
    windows = dataset.windows[left]
    values = windows.values * factor[dataset.trial[left], None, :]
    return replace(
        dataset, windows=replace(windows, values=values), trial=owner.astype(np.intp),
        trials=tuple(trials[i] for i in kept), reference=contract.reference, to_level=factor[kept],
    )  # fmt: skip
