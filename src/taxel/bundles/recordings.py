"""Recordings as a bundle sees them: its window, at the level that its scaling holds for.

Knows nothing about networks or boards.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np

from taxel.bundles.contract import Contract
from taxel.windows.dataset import Dataset, load_dataset
from taxel.windows.reference import to_usual


def load_at_level(path: Path, contract: Contract, *, target: str | None = None) -> Dataset:
    """Cut recordings into a bundle's windows, brought to the level of its own reference touches.

    `load_dataset` brings sessions to the level that is usual among them; a bundle's scaling
    holds for the level that it was trained or adapted at.

    Args:
        path: A folder of recordings, or one.
        contract: What the bundle or run says of itself.
        target: The label that every trial must have; none unless given.

    Raises:
        BadDataset: There is no window, a trial lacks the target, or a session lacks its
            reference touches.
        BadRecording: A recording is damaged.
    """
    dataset = load_dataset(path, contract.window, target=target)
    if dataset.reference is None or contract.reference is None:
        return dataset
    factor = to_usual(dataset.reference.level, contract.reference.level)
    values = np.asarray(dataset.windows.values * factor, np.float32)
    return replace(
        dataset,
        windows=replace(dataset.windows, values=values),
        reference=contract.reference,
        to_level=None if dataset.to_level is None else dataset.to_level * factor,
    )
