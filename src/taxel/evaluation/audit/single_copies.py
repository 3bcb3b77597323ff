"""Copies among trials of a single reading, where there is no course in time to compare.

What a trial shows is one value a channel. Equal ones are copies where enough channels say
something and nearly equal ones are rare; so are those that differ by scale and offset alone, with
nothing left but rounding. Knows nothing about labels.

Background of our choices: docs/decisions/0023.
"""

from __future__ import annotations

from collections import defaultdict
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from taxel.evaluation.audit.affine import CLEAR, LEAST, scaled_over_channels, small_steps
from taxel.evaluation.audit.case import Case
from taxel.evaluation.audit.copies import Pairs, overlap
from taxel.evaluation.audit.copy_findings import shared_copies
from taxel.evaluation.audit.finding import Finding
from taxel.evaluation.audit.noise import MANY
from taxel.evaluation.audit.touch_set import LEAST_ROWS, TouchSet

RARE = 0.1
"""Share of the trials that hold a value, at most, where it says something: what more hold is rest.
Source: our choice, docs/decisions/0023."""
ALMOST = 10
"""Two trials almost meet if at most one channel in so many differs, one at least. Source: our
choice, docs/decisions/0023."""
_ALIKE = 0.999
"""Correlation over channels from which on two trials are compared channel by channel. Source: our
choice."""
_BLOCK = 64
"""Trials that are compared with all others at a time: bounds memory."""

Table = NDArray[np.float32]


def is_single(touch: TouchSet) -> bool:
    """Return whether all trials are too short for a course in time."""
    return max(map(len, touch.rows)) < LEAST_ROWS


def single_facts(case: Case) -> list[Finding]:
    """Return the findings on copies of single readings."""
    touch = case.touch
    values = np.stack([rows.mean(axis=0, dtype=np.float64) for rows in touch.rows])
    values = values.astype(np.float32)
    chosen = np.unique(np.linspace(0, len(touch) - 1, min(len(touch), MANY)).round().astype(int))
    unseen = "" if len(chosen) == len(touch) else (
        f"Of {len(touch)} trials {len(chosen)} are compared.")  # fmt: skip
    same = same_readings(values, chosen)
    found = [_FEW_SAY if same is None else
             shared_copies(case, "duplicates", _apart(touch, same),
                           "hold the same values")]  # fmt: skip
    if values.shape[1] < LEAST + 2:
        return [*found, _FEW_CHANNELS]
    scaled = scaled_readings(values, chosen)
    near = {pair: alike for pair, alike in scaled.items() if pair not in (same or {})}
    return [*found, shared_copies(case, "near-duplicates", _apart(touch, near),
                                  "are copies but for scale or offset", unseen)]  # fmt: skip


def _apart(touch: TouchSet, pairs: Pairs) -> Pairs:
    """Return the pairs that are no overlapping stretches of one recording."""
    return {pair: alike for pair, alike in pairs.items() if not overlap(touch, *pair)}


_FEW_SAY = Finding(
    kind="duplicates", verdict="not checked",
    message=f"Too few channels (of at least {LEAST}) hold values fine enough to distinguish copies "
            "of single readings from chance.",
    mend="record finer steps, more channels, or several rows a trial",
)  # fmt: skip
_FEW_CHANNELS = Finding(
    kind="near-duplicates", verdict="not checked",
    message=f"Single readings of fewer than {LEAST + 2} channels are met by scale and offset "
            "alone.",
    mend="record more channels, or several rows a trial",
)  # fmt: skip


def same_readings(values: Table, chosen: NDArray[np.intp]) -> Pairs | None:
    """Return pairs of trials of the same values; None where chance cannot be ruled out.

    Args:
        values: One reading a trial, shape (trials, channels).
        chosen: Trials that are compared for nearly equal ones, shape (m,).
    """
    says = _says(values)
    holders: dict[bytes, list[int]] = defaultdict(list)
    for trial in np.flatnonzero(says >= LEAST).tolist():
        holders[values[trial].tobytes()].append(trial)
    same = dict.fromkeys((pair for own in holders.values() for pair in combinations(own, 2)), 1.0)
    if not same:
        return {} if np.median(says) >= LEAST else None
    equal, almost = _meetings(values[chosen[says[chosen] >= LEAST]])
    return same if almost <= equal else None


def scaled_readings(values: Table, chosen: NDArray[np.intp]) -> Pairs:
    """Return pairs of which one is the other scaled and offset, all channels alike.

    Args:
        values: One reading a trial, shape (trials, channels).
        chosen: Trials that are compared, shape (m,).
    """
    steps = small_steps((values,))
    # At rest or lightly touched, all readings are alike: their channels' own levels.
    moved = np.abs(values[chosen] - np.median(values, axis=0)) > CLEAR * steps
    chosen = chosen[np.count_nonzero(moved, axis=1) >= LEAST]
    own = values[chosen].astype(np.float64)
    own -= own.mean(axis=1, keepdims=True)
    size = np.linalg.norm(own, axis=1, keepdims=True)
    own /= np.where(size > 0, size, 1.0)
    found: Pairs = {}
    for a, b in np.argwhere(np.triu(np.abs(own @ own.T) >= _ALIKE, 1)):
        first, other = int(chosen[a]), int(chosen[b])
        if scaled_over_channels(values[first], values[other], steps):
            found[first, other] = float(abs(own[a] @ own[b]))
    return found


def _says(values: Table) -> NDArray[np.intp]:
    """Return how many channels of each trial hold a value that few trials hold, shape (trials,)."""
    found = np.zeros(len(values), np.intp)
    for channel in values.T:
        _, index, count = np.unique(channel, return_inverse=True, return_counts=True)
        found += count[index] <= max(2, int(RARE * len(values)))
    return found


def _meetings(values: Table) -> tuple[int, int]:
    """Return how many pairs are equal, and how many almost are."""
    allowed = max(1, values.shape[1] // ALMOST)
    equal = almost = 0
    for start in range(0, len(values), _BLOCK):
        differing = np.zeros((len(values[start : start + _BLOCK]), len(values)), np.int32)
        for channel in values.T:
            differing += channel[start : start + _BLOCK, None] != channel[None]
        differing = differing[np.triu(np.ones(differing.shape, bool), start + 1)]
        equal += int(np.count_nonzero(differing == 0))
        almost += int(np.count_nonzero((differing > 0) & (differing <= allowed)))
    return equal, almost
