"""What the contact's rim says of slip, moment by moment: where a gel shears, slip begins there.

On a layer the dots inside the contact stay with the object until gross slip, so that the
difference between object and gel hardly changes before it. The signs of slip are how far the rim
lags behind, and how much faster the object turns than before. Each is a ratio or a turn, so that no
column knows the time. Causal: the same class runs live and over whole pours, so batch equals live
to the last bit. Knows nothing about images, noise, heads or thresholds.

Source: docs/decisions/0037.
"""

from __future__ import annotations

from collections import deque
from typing import Final

import numpy as np
from numpy.typing import NDArray

from taxel.gel.slip_signal import PAIR_FEATURES

RIM_FEATURES: Final[tuple[str, ...]] = (
    "turn_quickens", "rim_share", "rim_share_lost", "rim_share_now", "gel_share_now", "gel_share",
    "object_turn_ahead", "rim_slip_ahead",
)  # fmt: skip
"""Columns after `PAIR_FEATURES`, means over the gels. quickens: rate of the object's turn over what
it was before; share: of the object's turn that rim or gel has made, since the grasp, lost since it
was largest, or now; ahead: rad, at the present rate in half a second."""
WITH_RIM: Final[tuple[str, ...]] = (*PAIR_FEATURES, *RIM_FEATURES)
"""Columns of all gels together where the rim is looked at too."""
_NOW_S, _LATELY_S, _BEFORE_S, _AHEAD_S = 0.3, 0.4, 1.0, 0.5
"""Spans of the present rate, of shares "now", of the rate before, and ahead. Source: our choice."""
_SOFT_RAD, _SOFT_NOW_RAD, _SOFT_RAD_S = 0.02, 0.01, 0.02
"""Added to what is divided by: below it there is only noise. Source: our choice."""
_TURNED_RAD: Final = 0.03
"""Turn from which a rim's share counts towards its largest."""
_OBJECT, _GEL = (PAIR_FEATURES.index(name) for name in ("object_turn_mean", "gel_turn_mean"))
_TIME, _TURN, _INSIDE, _RIM, _SLIP = range(5)


class RimSlip:
    """The columns of `RIM_FEATURES` since the grasp, over the last second."""

    def __init__(self) -> None:
        self._past: deque[tuple[float, float, float, float, float]] = deque()
        self._largest = 0.0
        self.features: NDArray[np.float32] = np.zeros(len(RIM_FEATURES), np.float32)
        """Shape (8,), as `RIM_FEATURES`, after the last moment."""

    def push(
        self, pair: NDArray[np.float32], rim_rad: float, slip_rad: float, time_s: float
    ) -> NDArray[np.float32]:
        """Take in a moment at which some gel shows another image; return `features`.

        Args:
            pair: Shape (66,): `PairSlip.features` at this moment.
            rim_rad: Size of the rim's turn since the grasp, mean over the gels, rad.
            slip_rad: Size of the object's turn less the rim's, mean over the gels, rad.
            time_s: This moment on a clock that the cameras share, seconds; it changes nothing
                where this has not grown.
        """
        if self._past and time_s <= self._past[-1][_TIME]:
            return self.features
        turn, gel = float(pair[_OBJECT]), float(pair[_GEL])
        self._past.append((time_s, turn, gel, rim_rad, turn - rim_rad))
        while len(self._past) > 2 and self._past[1][_TIME] <= time_s - _BEFORE_S:
            self._past.popleft()
        past = np.array(self._past).T

        def since(column: int, span_s: float) -> float:
            """Return how far a value has changed in a span, from the grasp on."""
            values = past[column]
            return float(values[-1] - np.interp(time_s - span_s, past[_TIME], values))

        rate = since(_TURN, _NOW_S) / _NOW_S
        before = (since(_TURN, _BEFORE_S) - since(_TURN, _NOW_S)) / (_BEFORE_S - _NOW_S)
        share = rim_rad / (turn + _SOFT_RAD)
        lately = since(_TURN, _LATELY_S) + _SOFT_NOW_RAD
        if turn > _TURNED_RAD:
            self._largest = max(self._largest, share)
        columns = (
            rate / (abs(before) + _SOFT_RAD_S),
            share,
            share - self._largest,
            since(_RIM, _LATELY_S) / lately,
            since(_INSIDE, _LATELY_S) / lately,
            gel / (turn + _SOFT_RAD),
            turn + _AHEAD_S * rate,
            slip_rad + _AHEAD_S * since(_SLIP, _NOW_S) / _NOW_S,
        )
        self.features = np.array(columns, np.float32)
        return self.features
