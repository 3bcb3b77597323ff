"""Groups that are numbers, and the first of such trials against the later ones. Knows nothing about
folds.

Background of our choices: docs/decisions/0040.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from taxel.errors import BadSplit
from taxel.labels.trials import TOGETHER, as_numbers

BY_CLASS = "by-class"
"""Behind a share: of each class the first trials, by its own numbers."""


def names_share(words: Sequence[str]) -> bool:
    """Return whether a split's words are order:KEY:70% or order:KEY:70%:by-class."""
    return (
        len(words) in (3, 4)
        and words[0] == "order"
        and words[2].endswith("%")
        and list(words[3:]) in ([], [BY_CLASS])
    )


def by_class_too(key: str) -> str:
    """Return the end of a message on a class that is only later: the split that tests each class;
    nothing where it would be refused, since trials of one value belong together.
    """
    if key.casefold() in TOGETHER:
        return ""
    return f"; order:{key}:70%:{BY_CLASS} tests the later trials of each class"


def first_share(
    key: str,
    values: NDArray[np.str_],
    y: NDArray[np.generic],
    text: str,
    *,
    by_class: bool = False,
) -> tuple[NDArray[np.bool_], str]:
    """Return which trials are the first by a group's numbers, shape (n,), and the split's name.

    Trials of one number stay together. Where classes were recorded one after another, each in one
    stretch, or where the first trials lack a class that would be tested and no two classes share
    a number, each class's own first are taken.

    Args:
        key: The group's name, for messages.
        values: Each trial's, shape (n,).
        y: Each trial's class, shape (n,).
        text: The share, such as "70%".
        by_class: Whether each class's own first are taken in any case. A number that two classes
            share may then be on both sides, which is refused of sessions, objects and the like.

    Raises:
        BadSplit: The group is not a number, the share not between 0 and 100 %, one side is empty,
            or a class is tested that is not among the first; by class, one has no later trials, or
            a session is on both sides.
    """
    try:
        share = float(text.removesuffix("%")) / 100.0
    except ValueError:
        share = 0.0
    if not 0.0 < share < 1.0:
        raise BadSplit("a share between 0% and 100%, such as 70%", repr(text), "correct it")
    numbers = group_numbers(key, values)
    early = _first(numbers, share)
    lacking = _lacking(y, early)
    if by_class or (
        _apart(numbers, y) and (lacking or _stretches(numbers, y) == len(set(y.tolist())))
    ):
        early = np.zeros(len(y), bool)
        for own in set(y.tolist()):
            early[y == own] = _first(numbers[y == own], share)
        if by_class:
            _check_by_class(key, numbers, y, early)
        words = f"{key}, first {100 * early.mean():.0f} %, of each class → later"
    else:
        words = f"{key} up to {numbers[early].max():g} ({100 * early.mean():.0f} %) → above"
    if early.all():
        raise BadSplit(f"two or more numbers in the group {key!r}", f"{numbers[0]:g} only",
                       "choose another group")  # fmt: skip
    if lacking := _lacking(y, early):
        raise BadSplit(
            f"each class that is tested among the first {text} by {key!r}",
            f"none of {', '.join(map(str, lacking))}",
            f"choose a larger share, or another group{by_class_too(key)}",
        )  # fmt: skip
    return early, words


def _check_by_class(
    key: str, numbers: NDArray[np.float64], y: NDArray[np.generic], early: NDArray[np.bool_]
) -> None:
    """Refuse a class without later trials, and a session or the like on both sides."""
    for own in sorted(set(y.tolist()), key=str):
        if early[y == own].all():
            only = numbers[y == own]
            raise BadSplit(
                f"two or more numbers in the group {key!r} in every class",
                f"{only[0]:g} only for {own}", "record more of it, or leave it out",
            )  # fmt: skip
    both = sorted(set(numbers[early].tolist()) & set(numbers[~early].tolist()))
    if both and key.casefold() in TOGETHER:
        raise BadSplit(
            f"each {key} on one side", f"{both[0]:g} on both, as classes are parted by themselves",
            f"leave {BY_CLASS} out, or number the trials of each class in another group",
        )  # fmt: skip


def _apart(numbers: NDArray[np.float64], y: NDArray[np.generic]) -> bool:
    """Return whether no number stands in two classes, and some class has several."""
    pairs = set(zip(numbers.tolist(), y.tolist(), strict=True))
    return len(pairs) == len(set(numbers.tolist())) > len(set(y.tolist())) > 1


def _stretches(numbers: NDArray[np.float64], y: NDArray[np.generic]) -> int:
    """Return in how many stretches of one class the trials follow each other."""
    ordered = y[np.argsort(numbers, kind="stable")]
    return int((ordered[1:] != ordered[:-1]).sum()) + 1


def _lacking(y: NDArray[np.generic], first: NDArray[np.bool_]) -> list[object]:
    """Return the classes that would be tested and are not among the first."""
    return sorted(set(y[~first].tolist()) - set(y[first].tolist()), key=str)


def group_numbers(key: str, values: NDArray[np.str_]) -> NDArray[np.float64]:
    """Return a group's values as numbers, shape (n,).

    Args:
        key: The group's name, for messages.
        values: Each trial's, shape (n,).

    Raises:
        BadSplit: One is text, or no finite number.
    """
    try:
        numbers = as_numbers(values)
    except ValueError as error:
        raise BadSplit(f"numbers in the group {key!r}", f"text ({error})", "choose another group") \
            from error  # fmt: skip
    if not np.isfinite(numbers).all():
        odd = values[~np.isfinite(numbers)][0]
        raise BadSplit(f"numbers in the group {key!r}", f"{str(odd)!r}",
                       "choose another group, or import again with a number there")  # fmt: skip
    return numbers


def _first(numbers: NDArray[np.float64], share: float) -> NDArray[np.bool_]:
    """Return which trials come first, at least one of several numbers on either side."""
    found = np.unique(numbers)
    if len(found) < 2:
        return np.ones(len(numbers), bool)
    last = np.sort(numbers)[max(round(share * len(numbers)), 1) - 1]
    return np.asarray(numbers <= min(last, found[-2]))
