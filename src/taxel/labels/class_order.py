"""The order of classes: as numbers where all of them are numbers, else as text.

Knows nothing about models or trials.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence

from taxel.errors import BadDataset

RESERVED = "UNKNOWN"
"""What stands for no answer, and so is no class's name. Source: our choice, docs/decisions/0040."""
_FEWEST_FIGURES = 10
"""Fewer numbers are classes even where each has a single trial or two, and so is a label with
under half as many values as trials. Source: our choice, docs/decisions/0040."""


def in_order(classes: Iterable[str]) -> tuple[str, ...]:
    """Return class names in order: 2 before 10, and b after a.

    A name such as 1_10, a day and a run, is text, though Python reads it as 110.
    """
    names = sorted(set(classes))
    if any("_" in name for name in names):
        return tuple(names)
    try:
        values = {name: float(name) for name in names}
    except ValueError:
        return tuple(names)
    if not all(map(math.isfinite, values.values())):
        return tuple(names)
    return tuple(sorted(names, key=lambda name: (values[name], name)))


def refuse_reserved(classes: Iterable[str], target: str) -> None:
    """Refuse a class to learn whose name stands for no answer.

    Raises:
        BadDataset: There is one.
    """
    if RESERVED in classes:
        raise BadDataset(
            f"classes of {target!r} with names of their own",
            f"{RESERVED}, which stands for no answer",
            "give it another name in the table, such as other, and import again",
        )


def figures_as_classes(labels: Sequence[str], target: str) -> str | None:
    """Return a warning where measured figures are treated as classes, else nothing.

    Args:
        labels: The label of each trial.
        target: Its name.
    """
    classes = in_order(labels)
    try:
        figures = [float(name) for name in classes]
    except ValueError:
        return None
    if any("_" in name for name in classes):  # 1_10 is a name, though Python reads it as 110
        return None
    if not all(map(math.isfinite, figures)) or len(classes) < max(_FEWEST_FIGURES, len(labels) / 2):
        return None
    return (
        f"{target!r} looks like a measured figure: its {len(classes)} values in {len(labels)} "
        "trials are treated as classes, since taxel has no regression; sort them into a few "
        "ranges to learn them"
    )
