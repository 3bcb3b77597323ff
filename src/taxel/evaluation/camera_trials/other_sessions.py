"""Whether trials of sessions are to come that no inner fold can hold out.

Where a class has one session only, or no session is named, inner folds hold out single trials
beside others of their own session. Knows nothing about images or models.

Source: docs/decisions/0041, "Copies of a camera that sits a little differently".
"""

from __future__ import annotations

import numpy as np

from taxel.evaluation.camera_trials.sides import RANDOM, TrialSplit, order_of
from taxel.evaluation.camera_trials.trial_set import LabelledTrials
from taxel.training.camera_trials.inner_folds import held_out_parts


def others_to_come(trials: LabelledTrials, split: TrialSplit, seed: int) -> bool:
    """Return whether some training side's inner folds can hold out single trials only, though not
    single trials of known sessions are tested.

    Args:
        trials: All of them.
        split: How they are parted.
        seed: Of the inner folds.
    """
    if split.name == RANDOM:
        return False
    order = order_of(split, trials.groups, trials.y)
    groups = trials.values_of(split.group)
    sides = [fold.train_rows for fold in split.folds]
    if len(sides) > 1:  # all are learned from in the end
        sides.append(np.arange(len(trials.y), dtype=np.intp))
    return any(
        held_out_parts(
            trials.y[side], groups[side], None if order is None else order[side], seed
        ).single
        for side in sides
    )
