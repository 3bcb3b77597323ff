"""A data set's trials cut again in another way.

Knows nothing about splits, scaling or models.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np

from taxel.windows.dataset import Dataset, load_dataset


def recut(path: Path, dataset: Dataset, stride: int, steps: int) -> Dataset:
    """Return the same trials cut again, as for overlapping training windows.

    Each trial is brought to the level that it has in `dataset`.

    Args:
        path: Where the data set was loaded from.
        dataset: Its trials are kept, in their order.
        stride: Rows from one window's start to the next.
        steps: Rows in a window.
    """
    config = replace(dataset.config, stride=stride, steps=steps)
    again = load_dataset(path, replace(config, reference=None, level_follow=None))
    order = {(t.recording, t.start_s): i for i, t in enumerate(dataset.trials)}
    index = np.array([order.get((t.recording, t.start_s), -1) for t in again.trials], np.intp)
    owner = index[again.trial]
    kept = owner >= 0
    windows, owner = again.windows[kept], owner[kept]
    if dataset.to_level is not None:
        windows = replace(windows, values=windows.values * dataset.to_level[owner, None, :])
    return replace(dataset, windows=windows, trial=owner, config=config)
