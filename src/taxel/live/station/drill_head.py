"""A stand-in for a model, for drills. Knows nothing about rings or monitors."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray


class FixedHead:
    """Always gives one value.

    Args:
        value: What it gives; NaN too.
    """

    def __init__(self, value: float) -> None:
        self._value = value

    def run(self, **_: NDArray[np.float32]) -> NDArray[np.float32]:
        return np.full(1, self._value, np.float32)
