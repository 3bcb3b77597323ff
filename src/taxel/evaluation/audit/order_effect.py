"""What changed from the earlier trials of a class to its later ones; `trial_order` says which those
are.

Trained on earlier trials and tested on later ones, the same trees are compared with trees that were
trained on as many trials of any time; and later trials differ from earlier ones. Where sessions
are named, both halves are those of a class within one session, so that a session's own level does
not count. Knows nothing about files.

Background of our choices: docs/decisions/0040.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from taxel.evaluation.audit.case import Case, Reading
from taxel.evaluation.audit.evidence import Array, Fold, evidence_of, gap_p, predict, trial_folds
from taxel.evaluation.audit.finding import Finding, Verdict
from taxel.evaluation.audit.gaps import Gap
from taxel.evaluation.audit.nuisances import sum_up, taring_helps
from taxel.evaluation.audit.trial_order import Order, later_split, order_of, tests_later
from taxel.labels.trials import SESSIONS

LEAST_CELL, LEAST_LATE = 4, 8
"""Trials of a class (in a session) that can be halved, and later trials in all, at least. Source:
our choice, docs/decisions/0040."""
_Tested = Literal["mixed", "later", "apart"] | None
DRAWS = 6
"""Halves dealt out at random, whose mean stands beside the halves by order. Our choice."""


def measure_order(case: Case) -> list[Gap | Reading] | Finding:
    """Return the cost of order and whether order shows, or why that was not looked at."""
    touch = case.touch
    order = order_of(touch)
    if order is None:
        return Finding(
            kind="order effect", verdict="not checked",
            message="The recordings do not say in which order they were made.",
            mend="give them a number as a group, such as group:trial_number",
        )  # fmt: skip
    cells = _cells(case, order)
    late, kept = _halves(order.places, cells)
    if late.sum() < LEAST_LATE or len(set(touch.y[late])) < 2:
        return Finding(
            kind="order effect", verdict="too few", mend="record more trials of each class",
            message=f"Fewer than {LEAST_LATE} later trials, in classes (and sessions) of at least "
                    f"{LEAST_CELL} trials: earlier ones cannot be set against them.",
        )  # fmt: skip
    values = np.stack([sum_up(rows) for rows in touch.rows])
    found = _Halved(order=order, late=late, kept=kept, cells=cells)
    side = _tested(case, found)
    return [_cost(case, values, found, side), _drift(case, values, found, side)]


@dataclass(frozen=True, slots=True, kw_only=True)
class _Halved:
    """Trials by their order: which are later ones; all of shape (trials,)."""

    order: Order
    late: NDArray[np.bool_]
    kept: NDArray[np.bool_]
    """Which are in a cell that is halved."""
    cells: NDArray[np.intp]


def _cells(case: Case, order: Order) -> NDArray[np.intp]:
    """Return each trial's cell, shape (trials,): its class, within its session where one is.

    In an order that need not be one of time, also within what the split holds out: a file that is
    sorted by persons says nothing against persons held out.
    """
    touch = case.touch
    keys = touch.keys(SESSIONS)[:1]
    if not order.is_time and case.sides is not None:
        keys = [*keys, *(key for key in case.sides.claimed if touch.group(key) is not None)]
    names = [
        (int(c), *(trial.groups[key] for key in keys))
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


def _cost(case: Case, values: NDArray[np.float32], found: _Halved, side: _Tested) -> Gap:
    """Return later trials predicted from earlier ones alone, beside trials of any time."""
    late, kept, cells, order = found.late, found.kept, found.cells, found.order
    y = case.touch.y
    by_order: Fold = (np.flatnonzero(kept & ~late), np.flatnonzero(late))
    strict = (predict(values, y, [by_order], case.seed)[late].argmax(axis=1) == y[late]).astype(
        float
    )
    right, count = np.zeros(len(y)), np.zeros(len(y))
    for draw in range(DRAWS):
        first, second = _random_halves(kept, cells, case.seed + draw)
        named = predict(values, y, [(first, second), (second, first)], case.seed).argmax(axis=1)
        right[kept] += named[kept] == y[kept]
        count[kept] += 1
    loose = right[late] / count[late]
    high, low = float(loose.mean()), float(strict.mean())
    early, later = ("earlier", "later") if order.is_time else ("lower", "higher")
    return Gap(
        kind="order effect", of="later trial" if order.is_time else "stretch of such a file",
        high=high, low=low, majority=float(np.bincount(y[late]).max() / late.sum()),
        p=gap_p(loose - strict, case.seed),
        loosely=f"trials of any {'time' if order.is_time else 'number'} to learn from",
        strictly=f"as many {early} ones only, tested on {later} ones (by {order.how})",
        mend="; ".join([*(["record classes in mixed order over several sessions"]
                          if order.is_time else []), *_mends(case, order, side)]),
        split_does=None if side is None else side == "mixed", units=int(late.sum()),
    )  # fmt: skip


def _drift(case: Case, values: NDArray[np.float32], found: _Halved, side: _Tested) -> Reading:
    """Return how well later trials differ from earlier ones of their class."""
    late, kept, cells, order = found.late, found.kept, found.cells, found.order
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
        if order.is_time:
            message = f"Later trials of a class differ from earlier ones (by {order.how}): " \
                      "something drifts while they are recorded."  # fmt: skip
            mends = _mends(case, order, side)
            if min(map(len, case.touch.rows)) > 1 and taring_helps(case):
                mends.append("tare if it is a level that drifts")
        else:
            message = f"Trials of a class differ from those before them (by {order.how}). That " \
                      "need not be an order of time: what the file is sorted by may change, such " \
                      "as the person or the run, or something drifts."  # fmt: skip
            mends = _mends(case, order, side)
        return "note", message, "; ".join(mends)

    return Reading(kind="drift", evidence=evidence, decide=decide)


def _mends(case: Case, order: Order, side: _Tested) -> list[str]:
    """Return what to do about an order, without the split that is in use."""
    if not order.is_time:
        return ["find out what the file is sorted by, and hold that out as a group; if its trials "
                "stand in the order of recording, number them in a group such as "
                "group:trial_number"]  # fmt: skip
    if side == "later" or (
        case.sides is not None and tests_later(case.sides, case.pieces, case.touch.y, order.places)
    ):
        return ["keep this split, which tests what was recorded later"]
    option = later_split(case.touch, order)
    these = ", with these numbers as a group KEY" if "KEY" in option else ""
    return [f"test on what was recorded later, as with {option}{these}"]


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


def _tested(case: Case, found: _Halved) -> _Tested:
    """Return what the split given tests: "mixed" if it trains on trials of a cell that are no
    earlier than one that it tests, "later" if on earlier ones only, which is no leak, "apart" if on
    none of the cells that it tests; None without a split.
    """
    if case.sides is None:
        return None
    kept, cells, places = found.kept, found.cells, found.order.places
    side: _Tested = "apart"
    for train, test in case.sides.folds:
        learned, tested = (_own(case.pieces.trial[own], kept) for own in (train, test))
        for cell in set(cells[learned]) & set(cells[tested]):
            last = places[learned[cells[learned] == cell]].max()
            if last >= places[tested[cells[tested] == cell]].min():
                return "mixed"
            side = "later"
    return side


def _own(trials: NDArray[np.intp], kept: NDArray[np.bool_]) -> NDArray[np.intp]:
    """Return the distinct trials, without those whose cell is not halved."""
    once = np.unique(trials)
    return once[kept[once]]
