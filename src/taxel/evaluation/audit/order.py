"""Order: what changed from the earlier trials of a class to its later ones.

Trained on earlier trials and tested on later ones, the same trees are compared with trees that were
trained on as many trials of any time; and later trials differ from earlier ones. Where sessions
are named, both halves are those of a class within one session, so that a session's own level does
not count. Knows nothing about files.

Background of our choices: docs/decisions/0040.
"""

from __future__ import annotations

import re

import numpy as np
from numpy.typing import NDArray

from taxel.evaluation.audit.case import Case, Reading
from taxel.evaluation.audit.evidence import Array, Fold, evidence_of, gap_p, predict, trial_folds
from taxel.evaluation.audit.finding import Finding, Verdict
from taxel.evaluation.audit.gaps import Gap
from taxel.evaluation.audit.nuisances import sum_up
from taxel.evaluation.audit.origins import recorded_order
from taxel.evaluation.audit.touch_set import SESSIONS, TouchSet
from taxel.labels.trials import TIME

LEAST_CELL, LEAST_LATE = 4, 8
"""Trials of a class (in a session) that can be halved, and later trials in all, at least. Source:
our choice, docs/decisions/0040."""
DRAWS = 6
"""Halves dealt out at random, whose mean stands beside the halves by order. Our choice."""


def measure_order(case: Case) -> list[Gap | Reading] | Finding:
    """Return the cost of order and whether order shows, or why that was not looked at."""
    touch = case.touch
    order, how = _order(touch)
    if order is None:
        return Finding(
            kind="order effect", verdict="not checked",
            message="The recordings do not say in which order they were made.",
            mend="give them a number as a group, such as group:trial_number",
        )  # fmt: skip
    cells = _cells(touch)
    late, kept = _halves(order, cells)
    if late.sum() < LEAST_LATE or len(set(touch.y[late])) < 2:
        return Finding(
            kind="order effect", verdict="too few", mend="record more trials of each class",
            message=f"Fewer than {LEAST_LATE} later trials, in classes (and sessions) of at least "
                    f"{LEAST_CELL} trials: earlier ones cannot be set against them.",
        )  # fmt: skip
    values = np.stack([sum_up(rows) for rows in touch.rows])
    mixes = _mixes(case, order, kept, cells)
    return [_cost(case, values, late, kept, cells, how, mixes),
            _drift(case, values, late, kept, cells, how)]  # fmt: skip


def _order(touch: TouchSet) -> tuple[Array | None, str]:
    """Return each trial's place in the order of recording, shape (trials,), and how it is known."""
    known = recorded_order(touch)
    if known is not None:
        return known, "the order of recording"
    numbers = [re.findall(r"\d+", trial.recording.removesuffix(".mcap")) for trial in touch.trials]
    if not all(numbers):
        return None, ""
    return np.array(
        [float(own[-1][-15:]) for own in numbers]
    ), "the last number of each file's name"


def _cells(touch: TouchSet) -> NDArray[np.intp]:
    """Return each trial's cell, shape (trials,): its class, within its session where one is."""
    keys = touch.keys(SESSIONS)
    names = [
        (int(c), *(trial.groups[key] for key in keys[:1]))
        for c, trial in zip(touch.y, touch.trials, strict=True)
    ]
    index = {name: number for number, name in enumerate(dict.fromkeys(names))}
    return np.array([index[name] for name in names], np.intp)


def _halves(order: Array, cells: NDArray[np.intp]) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
    """Return which trials are later ones of their cell, and which are in a cell that is halved."""
    late, kept = np.zeros(len(order), bool), np.zeros(len(order), bool)
    for cell in np.unique(cells):
        own = np.flatnonzero(cells == cell)
        if len(own) < LEAST_CELL or len(set(order[own])) < len(own):
            continue  # equal numbers say nothing of what came first
        ranked = own[np.argsort(order[own])]
        kept[own] = True
        late[ranked[(len(own) + 1) // 2 :]] = True
    return late, kept


def _cost(
    case: Case, values: NDArray[np.float32], late: NDArray[np.bool_], kept: NDArray[np.bool_],
    cells: NDArray[np.intp], how: str, mixes: bool | None,
) -> Gap:  # fmt: skip
    """Return later trials predicted from earlier ones alone, beside trials of any time."""
    y = case.touch.y
    by_order: Fold = (np.flatnonzero(kept & ~late), np.flatnonzero(late))
    strict = (predict(values, y, [by_order], case.seed)[late].argmax(axis=1) == y[late]).astype(
        float
    )
    right, count = np.zeros(len(y)), np.zeros(len(y))
    for draw in range(DRAWS):
        first, second = _random_halves(kept, cells, case.seed + draw)
        found = predict(values, y, [(first, second), (second, first)], case.seed).argmax(axis=1)
        right[kept] += found[kept] == y[kept]
        count[kept] += 1
    loose = right[late] / count[late]
    high, low = float(loose.mean()), float(strict.mean())
    return Gap(
        kind="order effect", of="later trial", high=high, low=low,
        majority=float(np.bincount(y[late]).max() / late.sum()), p=gap_p(loose - strict, case.seed),
        loosely="trials of any time to learn from",
        strictly=f"as many earlier ones only, tested on later ones (by {how})",
        mend="record classes in mixed order over several sessions, and test on what was recorded "
             f"later, as with {_later_split(case.touch)}",
        split_does=mixes, units=int(late.sum()),
    )  # fmt: skip


def _drift(
    case: Case, values: NDArray[np.float32], late: NDArray[np.bool_], kept: NDArray[np.bool_],
    cells: NDArray[np.intp], how: str,
) -> Reading:  # fmt: skip
    """Return how well later trials differ from earlier ones of their class."""
    used = np.flatnonzero(kept)
    centred = values[used].astype(np.float64)
    for cell in np.unique(cells[used]):
        inside = cells[used] == cell
        centred[inside] -= centred[inside].mean(axis=0)
    y = late[used].astype(np.intp)
    folds = trial_folds(y, None, case.seed)
    evidence = evidence_of(
        predict(centred, y, folds, case.seed), y, np.arange(len(used)), None, folds
    )

    def decide(counts: bool) -> tuple[Verdict, str, str]:
        if not counts:
            return "clear", "Later trials of a class cannot be distinguished from earlier ones.", ""
        return (
            "note",
            f"Later trials of a class differ from earlier ones (by {how}): something drifts "
            "while they are recorded.",
            f"test on what was recorded later, as with {_later_split(case.touch)}, and tare if it "
            "is a level that drifts",
        )

    return Reading(kind="drift", evidence=evidence, decide=decide)


def _later_split(touch: TouchSet) -> str:
    """Return the option that tests later trials: by time where one recording holds them all."""
    alone = len({trial.recording for trial in touch.trials}) == 1
    return f"--split order:{TIME if alone and touch.group(TIME) is None else 'KEY'}:70%"


def _random_halves(
    kept: NDArray[np.bool_], cells: NDArray[np.intp], seed: int
) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Return two halves of every cell, dealt out at random."""
    rng = np.random.default_rng(seed)
    first, second = [], []
    for cell in np.unique(cells[kept]):
        own = rng.permutation(np.flatnonzero(kept & (cells == cell)))
        first.append(own[: (len(own) + 1) // 2])
        second.append(own[(len(own) + 1) // 2 :])
    return np.concatenate(first), np.concatenate(second)


def _mixes(
    case: Case, order: Array, kept: NDArray[np.bool_], cells: NDArray[np.intp]
) -> bool | None:
    """Return whether the split given trains on trials of a cell that are no earlier than one that
    it tests; testing only what was recorded later than all of the cell's training is no leak.
    """
    if case.sides is None:
        return None
    for train, test in case.sides.folds:
        learned, tested = (_own(case.pieces.trial[side], kept) for side in (train, test))
        for cell in set(cells[learned]) & set(cells[tested]):
            last = order[learned[cells[learned] == cell]].max()
            if last >= order[tested[cells[tested] == cell]].min():
                return True
    return False


def _own(trials: NDArray[np.intp], kept: NDArray[np.bool_]) -> NDArray[np.intp]:
    """Return the distinct trials, without those whose cell is not halved."""
    once = np.unique(trials)
    return once[kept[once]]
