"""The first of numbered trials, a share of them, against the later ones. Knows nothing about folds.

Background of our choices: docs/decisions/0040.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from taxel.errors import BadSplit


def first_share(
    key: str, values: NDArray[np.str_], y: NDArray[np.generic], text: str
) -> tuple[NDArray[np.bool_], str]:
    """Return which trials are the first by a group's numbers, shape (n,), and the split's name.

    Trials of one number stay together. Where a class would stand on one side only, as where classes
    were recorded one after another, each class's own first are taken.

    Args:
        key: The group's name, for messages.
        values: Each trial's, shape (n,).
        y: Each trial's class, shape (n,).
        text: The share, such as "70%".

    Raises:
        BadSplit: The group is not a number, the share not between 0 and 100 %, or one side is
            empty.
    """
    try:
        share = float(text.removesuffix("%")) / 100.0
    except ValueError:
        share = 0.0
    if not 0.0 < share < 1.0:
        raise BadSplit("a share between 0% and 100%, such as 70%", repr(text), "correct it")
    try:
        numbers = values.astype(float)
    except ValueError as error:
        raise BadSplit(f"numbers in the group {key!r}", f"text ({error})", "choose another group") \
            from error  # fmt: skip
    first = _first(numbers, share)
    name = f"{key}, first {100 * share:g} % → later"
    if any(len(set(first[y == own])) < 2 for own in set(y.tolist())):
        name = f"{key}, first {100 * share:g} % of each class → later"
        for own in set(y.tolist()):
            first[y == own] = _first(numbers[y == own], share)
    if first.all():
        raise BadSplit(f"two or more numbers in the group {key!r}", "one in each class",
                       "choose another group")  # fmt: skip
    return first, name


def _first(numbers: NDArray[np.float64], share: float) -> NDArray[np.bool_]:
    """Return which trials come first, at least one of several numbers on either side."""
    found = np.unique(numbers)
    if len(found) < 2:
        return np.ones(len(numbers), bool)
    last = np.sort(numbers)[max(round(share * len(numbers)), 1) - 1]
    return np.asarray(numbers <= min(last, found[-2]))
