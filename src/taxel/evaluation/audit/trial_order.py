"""In which order trials stand: how that is known, whether it is one of time, and which split tests
the later ones.

Knows nothing about what changes along the order.

Background of our choices: docs/decisions/0040.
"""

from __future__ import annotations

import re
from contextlib import suppress
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from taxel.errors import BadSplit
from taxel.evaluation.audit.sides import Sides
from taxel.evaluation.audit.touch_set import Pieces, TouchSet
from taxel.evaluation.first_share import BY_CLASS, first_share
from taxel.labels.trials import TIME, as_numbers

NUMBERS = ("trial_number", "number", "index", "order", "attempt", "repetition", "rep", "repeat",
           "take")  # fmt: skip
"""Groups that count trials in the order in which they were recorded."""
_OF_ONE_FILE = ("detail imported_from", "detail trial")
"""What a recording keeps of the file of many trials that it was imported from."""
_SHARE = "70%"


@dataclass(frozen=True, slots=True, kw_only=True)
class Order:
    """Each trial's place in an order."""

    places: NDArray[np.float64]
    """Shape (trials,), the lower the earlier; equal ones say nothing of each other."""
    how: str
    """What it follows, for the reader."""
    key: str = ""
    """The group that holds it; empty where none does."""
    is_time: bool = True
    """Whether it is one of recording; False for places in a file, which may be sorted."""


def order_of(touch: TouchSet) -> Order | None:
    """Return the order of recording, else that of the last number in names; None if unknown.

    Imports number the trials of one file themselves, or take what they are called there. Such a
    file may be sorted by anything: class, person, run.
    """
    known = recorded_order(touch)
    if known is not None:
        return known
    numbers = [re.findall(r"\d+", trial.recording.removesuffix(".mcap")) for trial in touch.trials]
    if not all(numbers):
        return None
    places = np.array([float(own[-1][-15:]) for own in numbers])
    if any(all(own.get(key) for key in _OF_ONE_FILE) for own in touch.files):
        how = "their numbers in the file that they were imported from"
        return Order(places=places, how=how, is_time=False)
    return Order(places=places, how="the last number of each file's name")


def recorded_order(touch: TouchSet) -> Order | None:
    """Return the order of recording; None if unknown.

    A trial's time counts from where its own recording's clock does: it orders trials of one.
    """
    several = len({trial.recording for trial in touch.trials}) < len(touch)
    known = all(touch.created) and len(set(touch.created)) > 1
    how = "the order of recording"
    if known or (several and len({t.recording for t in touch.trials}) == 1):
        pairs = [(made, trial.start_s) for made, trial in zip(touch.created, touch.trials,
                                                              strict=True)]  # fmt: skip
        ranks = {pair: float(i) for i, pair in enumerate(sorted(set(pairs)))}
        key = "" if known or touch.group(TIME) is not None else TIME
        return Order(places=np.array([ranks[pair] for pair in pairs]), how=how, key=key)
    for key in touch.keys(NUMBERS):
        values = touch.group(key)
        if values is None:
            return None
        with suppress(ValueError):
            return Order(places=as_numbers(values), how=f"the group {key}", key=key)
    return None


def tests_later(
    sides: Sides, pieces: Pieces, y: NDArray[np.intp], places: NDArray[np.float64]
) -> bool:
    """Return whether a split tests, of each class, only what comes after all that it trains on.

    Args:
        sides: The split.
        pieces: What it moves.
        y: Each trial's class, shape (trials,).
        places: Each trial's place in an order, shape (trials,).
    """
    compared = False
    for train, test in sides.folds:
        learned, tested = (np.unique(pieces.trial[own]) for own in (train, test))
        for c in set(y[learned].tolist()) & set(y[tested].tolist()):
            if places[learned[y[learned] == c]].max() >= places[tested[y[tested] == c]].min():
                return False
            compared = True
    return compared


def later_split(touch: TouchSet, order: Order) -> str:
    """Return the option that tests later trials, in words, each class's own ones where the numbers
    of classes differ so that some would not be tested, or not be trained on.
    """
    option = f"--split order:{order.key or 'KEY'}:{_SHARE}"
    if order.key != TIME and not _tests_all(touch, order, by_class=False) and _tests_all(
        touch, order, by_class=True
    ):  # fmt: skip
        option = f"{option}:{BY_CLASS}"
    return option


def _tests_all(touch: TouchSet, order: Order, *, by_class: bool) -> bool:
    """Return whether each class would be trained on, and tested."""
    texts = np.array([f"{place:.17g}" for place in order.places])
    try:
        early, _ = first_share(order.key or "number", texts, touch.y, _SHARE, by_class=by_class)
    except BadSplit:
        return False
    return all(len(set(touch.y[side])) == len(set(touch.y)) for side in (early, ~early))
