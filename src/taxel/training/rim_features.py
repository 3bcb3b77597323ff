"""What a warning learns from where gels shear as layers: the slip signal, and how the rim lags.

On a layer the dots inside the contact stay with the object until gross slip, so that object less
gel says little. What tells is the contact's rim, where slip begins, and how much faster the object
turns than it did. All is causal and a ratio or a turn, so that no column knows the time. Knows
nothing about images, noise or heads.

Source: docs/decisions/0037.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Final

import numpy as np
from numpy.typing import NDArray

from taxel.gel.slip_signal import PAIR_FEATURES
from taxel.training.slip_cups import PourRows, by_rim
from taxel.training.slip_heads import PourFeatures, features_of

Column = NDArray[np.float64]

RIM_FEATURES: Final[tuple[str, ...]] = (
    "turn_quickens", "rim_share", "rim_share_lost", "rim_share_now", "gel_share_now", "gel_share",
    "object_turn_ahead", "rim_slip_ahead",
)  # fmt: skip
"""Columns after `PAIR_FEATURES`, means over the gels. quickens: rate of the object's turn over what
it was before; share: of the object's turn that rim or gel has made, since the grasp, lost since it
was largest, or now; ahead: rad, at the present rate in half a second."""
_NOW_S, _LATELY_S, _BEFORE_S, _AHEAD_S = 0.3, 0.4, 1.0, 0.5
"""Spans of the present rate, of shares "now", of the rate before, and ahead. Source: our choice."""
_SOFT_RAD, _SOFT_NOW_RAD, _SOFT_RAD_S = 0.02, 0.01, 0.02
"""Added to what is divided by: below it there is only noise. Source: our choice."""
_TURNED_RAD: Final = 0.03
"""Turn from which a rim's share counts towards its largest."""


def rim_features(pours: Sequence[PourRows]) -> list[PourFeatures]:
    """Return pours' features, shape (n, 74): `PAIR_FEATURES`, then `RIM_FEATURES`."""
    return [_features(inside, rim) for inside, rim in zip(pours, by_rim(pours), strict=True)]


def _features(inside: PourRows, rim: PourRows) -> PourFeatures:
    found, around = features_of(inside), features_of(rim)
    time_s = found.row_s()
    turn, gel, rim_turn = (
        _column(each, name)
        for each, name in (
            (found, "object_turn_mean"), (found, "gel_turn_mean"), (around, "gel_turn_mean")
        )
    )  # fmt: skip

    def since(values: Column, span_s: float) -> Column:
        """Return how far values have changed in a span, from the grasp on."""
        return np.asarray(values - np.interp(time_s - span_s, time_s, values))

    rate = since(turn, _NOW_S) / _NOW_S
    before = (since(turn, _BEFORE_S) - since(turn, _NOW_S)) / (_BEFORE_S - _NOW_S)
    share = rim_turn / (turn + _SOFT_RAD)
    lately = since(turn, _LATELY_S) + _SOFT_NOW_RAD
    columns = (
        rate / (np.abs(before) + _SOFT_RAD_S),
        share,
        share - np.maximum.accumulate(np.where(turn > _TURNED_RAD, share, 0.0)),
        since(rim_turn, _LATELY_S) / lately,
        since(gel, _LATELY_S) / lately,
        gel / (turn + _SOFT_RAD),
        turn + _AHEAD_S * rate,
        _column(around, "slip_turn_mean") + _AHEAD_S * since(turn - rim_turn, _NOW_S) / _NOW_S,
    )
    more = np.stack(columns, axis=1).astype(np.float32)
    return replace(found, rows=np.hstack([found.rows, more]))


def _column(found: PourFeatures, name: str) -> Column:
    return found.rows[:, PAIR_FEATURES.index(name)].astype(np.float64)
