"""Trials of the same rows, which are constant or change seldom.

Copies are searched among rows that change, since a sensor at rest gives the same again. Equal
trials of constant rows are counted here, so that they are not denied; whether they were copied
their rows do not show. Knows nothing about how copies are found.

Background of our choices: docs/decisions/0023.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Collection, Sequence

import numpy as np
from numpy.typing import NDArray

from taxel.evaluation.audit.case import Case
from taxel.evaluation.audit.copies import changing_runs, overlap, row_numbers
from taxel.evaluation.audit.finding import Finding
from taxel.evaluation.audit.touch_set import TouchSet

KIND = "constant rows"
_SHOWN = 3


def constant_rows(case: Case, copied: Collection[tuple[int, int]]) -> Finding:
    """Return the finding on trials that are equal, but hold too little change to prove a copy.

    Args:
        case: The audit.
        copied: Pairs that are reported as copies already.
    """
    touch = case.touch
    numbers = row_numbers(touch.rows)
    sets = _equal_sets(touch, numbers, copied)
    if not sets:
        return Finding(kind=KIND, verdict="clear",
                       message="No two trials hold the same constant rows.")  # fmt: skip
    constant = sum(len(own) for own in sets if _constant(numbers[own[0]]))
    seldom = sum(map(len, sets)) - constant
    counts = []
    if constant:
        counts = [f"{constant} trials hold the same constant rows as another"]
    if seldom:
        same = "the same" if constant else "hold the same"
        counts += [f"{seldom} trials {same} seldom changing rows"]
    odd = sum(len(set(touch.y[own].tolist())) > 1 for own in sets)
    message = f"{' and '.join(counts)}, which is no proof of a copy: a sensor at rest, or one " \
              "of coarse steps, gives the same again."  # fmt: skip
    if odd:
        some = f"{odd} of {len(sets)} sets of them have" if len(sets) > 1 else "They have"
        message += f" {some} several labels, which no model can distinguish."
    if case.sides is not None:
        message += f" Tested trials with such a counterpart in training: {_crossing(case, sets)}."
    return Finding(
        kind=KIND, verdict="note", message=message,
        mend="check that the sensor was read and touched; where trials were copied, keep one of "
             "each",
        examples=tuple(_named(touch, own) for own in sets[:_SHOWN]),
    )  # fmt: skip


def _equal_sets(
    touch: TouchSet, numbers: Sequence[NDArray[np.uint64]], copied: Collection[tuple[int, int]]
) -> list[list[int]]:
    """Return sets of trials that are equal, with hardly a change; the largest first."""
    equal: dict[bytes, list[int]] = defaultdict(list)
    for trial, own in enumerate(numbers):
        equal[own.tobytes()].append(trial)
    known = {trial for pair in copied for trial in pair}
    found = []
    for trials in equal.values():
        if len(trials) < 2 or len(changing_runs(numbers[trials[0]])):
            continue
        left = [trial for trial in trials if trial not in known]
        apart = [a for a in left if any(a != b and not overlap(touch, a, b) for b in left)]
        if apart:
            found.append(apart)
    return sorted(found, key=len, reverse=True)


def _constant(of_row: NDArray[np.uint64]) -> bool:
    return bool((of_row == of_row[0]).all())


def _crossing(case: Case, sets: Sequence[Sequence[int]]) -> int:
    """Return how many tested trials have an equal one in training."""
    assert case.sides is not None
    trial, found = case.pieces.trial, set[int]()
    for train, test in case.sides.folds:
        in_training, in_test = set(trial[train].tolist()), set(trial[test].tolist())
        for own in map(set, sets):
            tested, trained = own & in_test, own & in_training
            found |= {t for t in tested if trained - {t}}
    return len(found)


def _named(touch: TouchSet, trials: Sequence[int]) -> str:
    names = [touch.trials[trial].groups["trial"] for trial in trials]
    more = f" and {len(names) - 2} more" if len(names) > 2 else ""
    return f"{names[0]}{' and ' if not more else ', '}{names[1]}{more}"
