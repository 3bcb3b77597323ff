"""Trials that were cut from one stream with overlap: one goes on where another has begun.

A window's last rows are the first rows of the next, which then goes on with rows of its own.
Copies that start elsewhere end with their original, and are no such windows. Knows nothing about
splits.

Background of our choices: docs/decisions/0023.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator, Sequence

import numpy as np
from numpy.typing import NDArray

from taxel.evaluation.audit.copies import RUN, SHARED, Pairs, overlap, row_numbers, runs_of
from taxel.evaluation.audit.touch_set import TouchSet

Numbers = NDArray[np.uint64]
BY_CHANCE = 4
"""Trials that go on where others begin must be so many times as frequent as the same among trials
run backwards, where values are too coarse to exclude chance. Source: our choice,
docs/decisions/0023."""
_MANY = 10
_CHANGING = 0.5
"""Share of the rows in common that must differ from the row before: rest is alike everywhere.
Source: our choice, docs/decisions/0023."""


def cut_windows(touch: TouchSet) -> Pairs:
    """Return pairs of trials of which one goes on where the other has begun → share in common.

    Pairs of stretches of one recording that overlap by their times are left to the split.

    Args:
        touch: The trials.

    Returns:
        Pairs (lower number first) → rows in common over rows of the shorter one, `SHARED`…1.
    """
    numbers = row_numbers(touch.rows)
    backwards = [own[::-1] for own in numbers]
    found: Pairs = {}
    for a, b, share in _going_on(numbers, numbers):
        pair = min(a, b), max(a, b)
        if not overlap(touch, *pair):
            found[pair] = max(share, found.get(pair, 0.0))
    chance = {(min(a, b), max(a, b)) for a, b, _ in _going_on(numbers, backwards)}
    return found if len(found) >= BY_CHANCE * len(chance) else {}


def beside_windows(touch: TouchSet, same: Pairs, cut: Pairs) -> Pairs:
    """Return pairs that share rows though they are no windows of one stream, or are equal.

    Args:
        touch: The trials.
        same: All pairs that share rows.
        cut: Pairs of which one goes on where the other has begun, from `cut_windows`.
    """
    of = _streams(cut, len(touch))
    return {
        (a, b): share for (a, b), share in same.items()
        if of[a] != of[b] or np.array_equal(touch.rows[a], touch.rows[b])
    }  # fmt: skip


def _streams(pairs: Pairs, trials: int) -> NDArray[np.intp]:
    """Return for each trial the lowest number of those that it is joined with, shape (trials,)."""
    of = np.arange(trials)
    neighbours: dict[int, list[int]] = defaultdict(list)
    for a, b in pairs:
        neighbours[a].append(b)
        neighbours[b].append(a)
    seen: set[int] = set()
    for first in sorted(neighbours):
        waiting = [] if first in seen else [first]
        while waiting:
            trial = waiting.pop()
            if trial not in seen:
                seen.add(trial)
                of[trial] = first
                waiting += neighbours[trial]
    return of


def _going_on(
    numbers: Sequence[Numbers], others: Sequence[Numbers]
) -> Iterator[tuple[int, int, float]]:
    """Yield a trial, another that begins within it and ends after it, and the share in common.

    Args:
        numbers: One number for each row of each trial, each shape (rows,).
        others: The same of those that may begin within it, in the same order.
    """
    run = max(1, min(RUN, min(map(len, numbers)) - 1))
    begin: dict[int, list[int]] = defaultdict(list)
    for b, other in enumerate(others):
        begin[int(runs_of(other[:run], run)[0])].append(b)
    # What many trials begin with is rest.
    known = np.array(sorted(k for k, own in begin.items() if len(own) <= _MANY), np.uint64)
    for a, own in enumerate(numbers):
        runs = runs_of(own, run)
        for k in np.flatnonzero(np.isin(runs, known)):
            tail = own[k:]
            for b in begin[int(runs[k])] if k and _changes(tail) else ():
                other, shorter = others[b], min(len(own), len(others[b]))
                if (a != b and len(other) > len(tail) >= SHARED * shorter
                        and np.array_equal(tail, other[: len(tail)])):  # fmt: skip
                    yield a, b, len(tail) / shorter


def _changes(rows: Numbers) -> bool:
    """Return whether enough rows differ from the one before."""
    return len(rows) > 1 and float((rows[1:] != rows[:-1]).mean()) >= _CHANGING
