"""The order of classes: as numbers where all of them are numbers, else as text.

Knows nothing about models or trials.
"""

from __future__ import annotations

import math
from collections.abc import Iterable


def in_order(classes: Iterable[str]) -> tuple[str, ...]:
    """Return class names in order: 2 before 10, and b after a."""
    names = sorted(set(classes))
    try:
        values = {name: float(name) for name in names}
    except ValueError:
        return tuple(names)
    if not all(map(math.isfinite, values.values())):
        return tuple(names)
    return tuple(sorted(names, key=lambda name: (values[name], name)))
