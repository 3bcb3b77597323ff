"""What a warning learns from: the slip signal, how rim and rings lag, and how a turn quickens.

A pour's rows, as a live monitor computes them (`taxel.gel.rim_slip`, `taxel.gel.ring_slip`). Knows
nothing about images, noise or heads.

Source: docs/decisions/0037.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from taxel.gel.rim_slip import RimSlip
from taxel.gel.slip_signal import PAIR_FEATURES
from taxel.sim.pour.cup_pour import Gel
from taxel.training.slip.cups import PourRows, by_rim
from taxel.training.slip.heads import PourFeatures, features_of

_RIM, _SLIP = (PAIR_FEATURES.index(name) for name in ("gel_turn_mean", "slip_turn_mean"))


def rim_features(pours: Sequence[PourRows], gel: Gel = 1) -> list[PourFeatures]:
    """Return pours' features, shape (n, 74): `PAIR_FEATURES`, then `RIM_FEATURES`.

    Args:
        pours: Poses of object, gel and rim.
        gel: How the gels shear; no feature depends on it.
    """
    return [
        replace(_features(inside, rim), gel=gel)
        for inside, rim in zip(pours, by_rim(pours), strict=True)
    ]


def ring_features(pours: Sequence[PourRows], gel: Gel = 1) -> list[PourFeatures]:
    """Return pours' features, shape (n, 92): those of `rim_features`, then `RING_FEATURES`.

    Args:
        pours: Followed in images.
        gel: How the gels shear; no feature depends on it.
    """
    return [
        replace(found, rows=np.hstack([found.rows, _rings(found)]))
        for found in rim_features(pours, gel)
    ]


def _rings(found: PourFeatures) -> NDArray[np.float32]:
    """Return the rings' columns of the images that the gels show at each row, their mean."""
    first = np.searchsorted(found.at, np.arange(len(found.rows)))
    shown = [gel.rings[gel.shown[first]] for gel in found.pour.gels]
    return np.asarray(np.mean(shown, axis=0), np.float32)


def _features(inside: PourRows, rim: PourRows) -> PourFeatures:
    found, around = features_of(inside), features_of(rim)
    trend = RimSlip()
    more = [
        trend.push(row, float(at_rim[_RIM]), float(at_rim[_SLIP]), float(time_s))
        for row, at_rim, time_s in zip(found.rows, around.rows, found.row_s(), strict=True)
    ]
    return replace(found, rows=np.hstack([found.rows, np.stack(more)]))
