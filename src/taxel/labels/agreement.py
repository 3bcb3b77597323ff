"""How far label rules agree: frames, chance-corrected frames, and which one comes first.

Knows nothing about where labels come from, files or models.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from taxel.errors import BadInput

Labels = NDArray[np.int8]


def onset_s(labels: Labels, time_s: NDArray[np.float64]) -> float | None:
    """Return the first unstable moment, seconds, or None where all are stable.

    Args:
        labels: Shape (n,): 0 stable, 1 unstable.
        time_s: Shape (n,), seconds.

    Raises:
        BadInput: There are not as many times as labels.
    """
    if len(labels) != len(time_s):
        raise BadInput("one time a label", f"{len(time_s)} for {len(labels)}", "give both alike")
    unstable = np.flatnonzero(labels)
    return float(time_s[unstable[0]]) if len(unstable) else None


def cohens_kappa(first: Labels, second: Labels) -> float:
    """Return agreement beyond chance, at most 1; NaN where both rules say one thing only.

    Args:
        first: One rule's labels, shape (n,): 0 stable, 1 unstable.
        second: The other's of the same frames, shape (n,).

    Source: Cohen, Educational and Psychological Measurement 20 (1960) 37.
    """
    equal = float((first == second).mean())
    a, b = float(first.mean()), float(second.mean())
    chance = a * b + (1 - a) * (1 - b)
    return float("nan") if chance == 1.0 else (equal - chance) / (1 - chance)


@dataclass(frozen=True, slots=True, kw_only=True)
class Agreement:
    """Two rules, side by side over the same runs."""

    first: str
    """Name of the one rule."""
    second: str
    """Name of the other rule."""
    frames: int
    """Frames compared."""
    equal: float
    """Share of frames with the same label, 0…1."""
    kappa: float
    """Cohen's kappa over all frames; NaN where both rules are constant and alike."""
    runs_both: int
    """Runs in which both rules find an onset."""
    runs_first_only: int
    """Runs in which only the first rule finds one."""
    runs_second_only: int
    """Runs in which only the second rule finds one."""
    first_earlier: float
    """Share of runs with both onsets in which the first rule's comes strictly earlier, 0…1;
    NaN without such runs."""
    lead_s: float
    """Median time by which the first rule's onset comes before the second's, seconds;
    negative where it comes after; NaN without runs that have both."""

    def as_dict(self) -> dict[str, object]:
        """Return the fields by name, NaN as None, as JSON wants them."""
        return {
            name: None if isinstance(value, float) and np.isnan(value) else value
            for name, value in asdict(self).items()
        }


def agreement(
    labels_by_rule: Mapping[str, Sequence[Labels]], time_s: Sequence[NDArray[np.float64]]
) -> list[Agreement]:
    """Return one row for each pair of rules, in the order of the mapping.

    Args:
        labels_by_rule: For each rule one array of labels a run, shape (n,).
        time_s: One array of times a run, shape (n,), seconds.

    Raises:
        BadInput: The rules do not label the same frames of the same runs.
    """
    shape = [len(run) for run in time_s]
    for name, runs in labels_by_rule.items():
        if [len(run) for run in runs] != shape:
            raise BadInput(
                "labels for the same frames by every rule",
                f"other lengths by {name!r}",
                "label each run with all rules",
            )
    return [
        _pair(first, second, labels_by_rule, time_s)
        for first, second in combinations(labels_by_rule, 2)
    ]


def _pair(
    first: str,
    second: str,
    labels_by_rule: Mapping[str, Sequence[Labels]],
    time_s: Sequence[NDArray[np.float64]],
) -> Agreement:
    a, b = labels_by_rule[first], labels_by_rule[second]
    joined_a, joined_b = np.concatenate([*a]), np.concatenate([*b])
    onsets = [
        (onset_s(first, time), onset_s(other, time))
        for first, other, time in zip(a, b, time_s, strict=True)
    ]
    leads = np.array([y - x for x, y in onsets if x is not None and y is not None])
    return Agreement(
        first=first,
        second=second,
        frames=len(joined_a),
        equal=float((joined_a == joined_b).mean()),
        kappa=cohens_kappa(joined_a, joined_b),
        runs_both=len(leads),
        runs_first_only=sum(x is not None and y is None for x, y in onsets),
        runs_second_only=sum(x is None and y is not None for x, y in onsets),
        first_earlier=float((leads > 0).mean()) if len(leads) else float("nan"),
        lead_s=float(np.median(leads)) if len(leads) else float("nan"),
    )
