"""Mechanical fatigue: how a pad's output falls with the presses that it has behind it.

The thesis names fatigue (section 2.6) and gives no number. Ours: each full press costs a pad the
same share of what it still gives, so output falls as (1 − fatigue)^(presses / 10,000); a pad that
is pressed harder wears faster. Our choice, docs/decisions/0047. Knows nothing about time or volts.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

PRESSES = 10_000.0
"""Presses that a fatigue is stated for. Source: the order of durability tests of such pads; our
choice, docs/decisions/0047."""


class Wear:
    """What pads have behind them.

    Args:
        fatigue: Share of its output that a pad loses in `PRESSES` full presses, 0…1.
        presses: Full presses behind every pad at the start.
        pads: How many.
    """

    def __init__(self, fatigue: float, presses: float, pads: int) -> None:
        self._kept = 1.0 - fatigue
        self._presses = np.full(pads, presses, np.float64)

    @property
    def left(self) -> NDArray[np.float64]:
        """Share of the first output that each pad still gives, shape (pads,), 0…1."""
        return np.asarray(self._kept ** (self._presses / PRESSES))

    def add(self, presses: NDArray[np.float64]) -> None:
        """Wear the pads.

        Args:
            presses: Full presses of each pad, shape (pads,).
        """
        self._presses += presses
