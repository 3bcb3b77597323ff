"""Accuracy of the parts of a test: each class, and each value of every group, such as an object.

UNKNOWN counts as wrong, as a class number of −1. Knows nothing about models, splits or files.

Background of our choices: docs/decisions/0040.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from taxel.labels.class_order import in_order
from taxel.labels.trials import USUAL_GROUPS, Trial

MOST_VALUES = 40
"""A group with more values than this is listed only where it is an object or a session. Source:
our choice, as in run_scores."""


@dataclass(frozen=True, slots=True, kw_only=True, order=True)
class PartScore:
    """The test windows and trials of one part."""

    name: str
    windows: int
    accuracy: float
    """Share of its windows predicted correctly, 0…1."""
    trials: int
    trial_accuracy: float
    """Share of its trials predicted correctly by all of their windows, 0…1."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Parts:
    """A test, part by part."""

    classes: tuple[PartScore, ...]
    """Each true class: its recall."""
    groups: Mapping[str, tuple[PartScore, ...]]
    """Group → its values; only groups that part the tested trials."""


def score_parts(
    trials: Sequence[Trial],
    target: str,
    trial: NDArray[np.intp],
    right: NDArray[np.bool_],
    trial_numbers: NDArray[np.intp],
    trial_right: NDArray[np.bool_],
) -> Parts:
    """Return what each part of a test is worth.

    Args:
        trials: All trials.
        target: The label that was predicted.
        trial: Each test window's index into `trials`, shape (n,).
        right: Whether each window was predicted correctly, shape (n,).
        trial_numbers: The tested trials, as indices into `trials`, shape (m,).
        trial_right: Whether each was predicted correctly by all of its windows, shape (m,).
    """

    def parts(names: Mapping[int, str]) -> tuple[PartScore, ...]:
        of_window = np.array([names[int(i)] for i in trial])
        of_trial = np.array([names[int(i)] for i in trial_numbers])
        return tuple(
            PartScore(
                name=name,
                windows=int((of_window == name).sum()),
                accuracy=float(right[of_window == name].mean()),
                trials=int((of_trial == name).sum()),
                trial_accuracy=float(trial_right[of_trial == name].mean()),
            )
            for name in in_order(of_trial)
        )

    tested = [int(i) for i in trial_numbers]
    groups = {}
    for key in sorted({key for i in tested for key in trials[i].groups}):
        if _parts_trials(key, [trials[i].groups.get(key) for i in tested]):
            groups[key] = parts({i: trials[i].groups[key] for i in tested})
    return Parts(classes=parts({i: trials[i].labels[target] for i in tested}), groups=groups)


def _parts_trials(key: str, values: Sequence[str | None]) -> bool:
    """Return whether a group is worth listing: every trial has it, and several share a value."""
    if key in ("trial", "recording", "file") or None in values:
        return False
    count = len(set(values))
    return 1 < count < len(values) and (count <= MOST_VALUES or key in USUAL_GROUPS)
