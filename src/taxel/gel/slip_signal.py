"""Slip as a signal: how far the object has slipped over the gel, how fast, how readily.

Distance is that of the object's motion less the gel's; a turn counts by the mean lever of a
contact patch. Rates go by the times at which images were taken, so that a repeated frame
changes nothing. Causal: the same class runs live and over recordings, so batch equals live to
the last bit. Knows nothing about images, models, thresholds or what was touched.

Source: docs/decisions/0036.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from math import inf, isfinite, nan
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

TURN_MM: Final = 4.0
"""Lever at which a turn counts as slip: the mean distance of a handle's patch from its middle,
0.62 × 6.3 mm. Source: docs/explanation/physics-gel, limit surface of a handle's patch."""

_SOFT_MM: Final = 0.05
"""Added to the gel's motion before slip is divided by it: below it there is only noise."""
_LAGS: Final = (1, 2, 4, 8, 16)
"""Images over which rates are taken."""
_READY_FROM: Final = 4
"""Lag from which on slip over the gel's motion is taken too."""
_RATE_LAG: Final = 4
"""Images over which the rate is taken: 0.16 s at 25 images a second. Source: our choice."""
_READY_LAG: Final = 8
"""Images over which compliance is taken: 0.32 s at 25 images a second. Source: our choice."""
_SPREAD_FACTOR: Final = 1.5
"""Error of a pose over what the fit's own residuals say. Source: training cups, decision 36."""
_GAIN_ERROR: Final = 0.04
"""Standard deviation of the slip's gain. Source: training cups, decision 36."""
_DRIFT_MM: Final = 0.006
"""What grain and JPEG add to all pixels alike, which no residual shows: standard deviation over a
pour. Source: training cups, decision 36."""

_STATE: Final = (
    "slip", "gel", "slip_over_gel", "largest_slip", "object_shift", "gel_shift", "slip_turn",
    "gel_turn", "gel_down", "object_turn",
)  # fmt: skip
TREND_FEATURES: Final[tuple[str, ...]] = (
    *_STATE,
    *(f"{name}_rate_{lag}" for lag in _LAGS for name in ("slip", "gel", "slip_turn",
                                                         "object_turn")),
    *(f"readiness_{lag}" for lag in _LAGS if lag >= _READY_FROM),
)  # fmt: skip
"""Columns of one gel: lengths in mm, turns in rad (sizes, so that neither the side nor the
lever's direction matters), rates a second over so many images; readiness: slip a mm of gel."""
PAIR_FEATURES: Final[tuple[str, ...]] = (
    *(f"{name}_max" for name in TREND_FEATURES),
    *(f"{name}_mean" for name in TREND_FEATURES),
)
"""Columns of all gels together."""


@dataclass(frozen=True, slots=True)
class Slip:
    """The slip at one moment; each value with its standard deviation."""

    distance_mm: float
    """Of the object over the gel since the grasp."""
    rate_mm_s: float
    """Change of the distance; negative where the object comes back."""
    compliance: float
    """Slip a millimetre that the gel gives, over the last third of a second, unitless: near 0
    while the object sticks, 1 where it slips as much as the gel is sheared."""
    distance_sd_mm: float
    rate_sd_mm_s: float
    compliance_sd: float
    seen: bool
    """False where the last image could not be followed: values are then older."""

    @property
    def words(self) -> str:
        """Such as "slip 0.12 mm, 0.3 mm/s"."""
        if not self.seen:
            return "slip unknown"
        return f"slip {self.distance_mm:.2f} mm, {self.rate_mm_s:z.1f} mm/s"

    @staticmethod
    def from_dict(values: Mapping[str, Any]) -> Slip:
        """Return what `as_dict` gave.

        Raises:
            KeyError: A value is missing.
        """
        return Slip(
            distance_mm=_number(values["slip_mm"]),
            rate_mm_s=_number(values["slip_rate_mm_s"]),
            compliance=_number(values["slip_compliance"]),
            distance_sd_mm=_number(values["slip_sd_mm"]),
            rate_sd_mm_s=_number(values["slip_rate_sd_mm_s"]),
            compliance_sd=_number(values["slip_compliance_sd"]),
            seen=bool(values["slip_seen"]),
        )

    def as_dict(self) -> dict[str, float | bool | None]:
        """Return the values by name, rounded to what they are worth; infinity as None."""
        return {
            "slip_mm": _rounded(self.distance_mm, 4),
            "slip_sd_mm": _rounded(self.distance_sd_mm, 4),
            "slip_rate_mm_s": _rounded(self.rate_mm_s, 3),
            "slip_rate_sd_mm_s": _rounded(self.rate_sd_mm_s, 3),
            "slip_compliance": _rounded(self.compliance, 3),
            "slip_compliance_sd": _rounded(self.compliance_sd, 3),
            "slip_seen": self.seen,
        }


NO_SLIP: Final = Slip(0.0, 0.0, 0.0, 0.0, 0.0, 0.0, False)
"""Before anything was followed."""


class _Moment(NamedTuple):
    """What one image showed since the grasp; sizes, so that no side matters."""

    taken_s: float
    slip_mm: float
    """Of the object over the gel, a turn at its lever included."""
    gel_mm: float
    """Of the gel, a turn at its lever included."""
    slip_turn: float
    """Turn of the object over the gel, rad."""
    object_turn: float
    """Turn of the object, rad."""
    sd_mm: float
    """Standard deviation of the slip."""

    def rates(self, before: _Moment) -> list[float]:
        """Return the change a second of slip, gel, slip's turn and object's turn."""
        elapsed_s = self.taken_s - before.taken_s
        per_s = 1 / elapsed_s if elapsed_s > 0 else 0.0
        return [
            (self.slip_mm - before.slip_mm) * per_s,
            (self.gel_mm - before.gel_mm) * per_s,
            (self.slip_turn - before.slip_turn) * per_s,
            (self.object_turn - before.object_turn) * per_s,
        ]


class GelSlip:
    """Slip of the object over one gel, image by image."""

    def __init__(self) -> None:
        self._past: deque[_Moment] = deque(maxlen=max(_LAGS) + 1)
        self._largest = 0.0
        self.slip: Slip = NO_SLIP
        """After the last image."""
        self.features: NDArray[np.float64] = np.zeros(len(TREND_FEATURES))
        """Shape (33,), as `TREND_FEATURES`, after the last image."""

    @property
    def measured_s(self) -> float:
        """When the last image in which slip was measured was taken, seconds; NaN before any."""
        return self._past[-1].taken_s if self._past else nan

    def push(
        self,
        moved: NDArray[np.float64],
        gel: NDArray[np.float64],
        spread: NDArray[np.float64],
        taken_s: float,
        seen: bool = True,
    ) -> bool:
        """Take in an image's poses; return whether slip was measured in it.

        Args:
            moved: Shape (3,): the object's x, y (mm) and turn (rad) since the grasp.
            gel: Shape (3,): the same of the gel in contact.
            spread: Shape (3,): standard deviation of the object's less the gel's.
            taken_s: When the image was taken, seconds; it changes nothing where this has not grown.
            seen: False where the poses could not be followed: they change nothing then.
        """
        if not seen or (self._past and taken_s <= self._past[-1].taken_s):
            self.slip = self.slip if seen else replace(self.slip, seen=False)
            return False
        x, y, turn = moved - gel
        distance = float(np.sqrt(x * x + y * y + (TURN_MM * turn) ** 2))
        give = float(np.sqrt(gel[0] ** 2 + gel[1] ** 2 + (TURN_MM * gel[2]) ** 2))
        noise = _spread_of(np.array([x, y, TURN_MM * turn]), spread)
        self._largest = max(self._largest, distance)
        now = _Moment(
            taken_s=taken_s,
            slip_mm=distance,
            gel_mm=give,
            slip_turn=abs(float(turn)),
            object_turn=abs(float(moved[2])),
            sd_mm=noise,
        )
        self._past.append(now)
        state = (
            distance,
            give,
            distance / (give + _SOFT_MM),
            self._largest,
            float(np.hypot(x, y)),
            float(np.hypot(gel[0], gel[1])),
            now.slip_turn,
            abs(float(gel[2])),
            abs(float(gel[1])),
            now.object_turn,
        )
        self.features = np.array([*state, *self._rates()])
        self.slip = self._slip_now()
        return True

    def _rates(self) -> list[float]:
        """Return rates over each lag, then readiness; over what there is where that is less."""
        rates: list[float] = []
        ready: list[float] = []
        now = self._past[-1]
        for lag in _LAGS:
            then = self._before(lag)
            rates += now.rates(then)
            if lag >= _READY_FROM:
                ready.append(
                    (now.slip_mm - then.slip_mm) / (abs(now.gel_mm - then.gel_mm) + _SOFT_MM)
                )
        return rates + ready

    def _before(self, lag: int) -> _Moment:
        """Return the moment so many images ago, or the oldest that there is."""
        return self._past[max(len(self._past) - 1 - lag, 0)]

    def _slip_now(self) -> Slip:
        now = self._past[-1]
        then, before = self._before(_RATE_LAG), self._before(_READY_LAG)
        elapsed_s = now.taken_s - then.taken_s
        rate = (now.slip_mm - then.slip_mm) / elapsed_s if elapsed_s > 0 else 0.0
        rate_sd = float(np.hypot(now.sd_mm, then.sd_mm)) / elapsed_s if elapsed_s > 0 else 0.0
        gave = abs(now.gel_mm - before.gel_mm) + _SOFT_MM
        compliance = (now.slip_mm - before.slip_mm) / gave
        gave_sd = float(np.hypot(now.sd_mm, before.sd_mm))
        gain_sd = _GAIN_ERROR * now.slip_mm
        return Slip(
            distance_mm=now.slip_mm,
            rate_mm_s=rate,
            compliance=compliance,
            distance_sd_mm=float(np.sqrt(now.sd_mm**2 + gain_sd**2 + _DRIFT_MM**2)),
            rate_sd_mm_s=float(np.hypot(rate_sd, _GAIN_ERROR * rate)),
            compliance_sd=gave_sd / gave * float(np.hypot(1.0, compliance)),
            seen=True,
        )


class PairSlip:
    """Slip of one object held between several gels.

    Args:
        gels: How many there are.
    """

    def __init__(self, gels: int = 2) -> None:
        self.gels: tuple[GelSlip, ...] = tuple(GelSlip() for _ in range(gels))

    @property
    def slip(self) -> Slip:
        """The slip over the gel on which the object has slipped further."""
        seen = [gel.slip for gel in self.gels if gel.slip.seen]
        return max(seen or [NO_SLIP], key=lambda slip: slip.distance_mm)

    def features(self) -> NDArray[np.float32]:
        """Return shape (66,), as `PAIR_FEATURES`: the largest over all gels, then the mean."""
        rows = np.stack([gel.features for gel in self.gels])
        both = np.concatenate([rows.max(axis=0), rows.mean(axis=0)])
        return np.asarray(both, np.float32)


def pair_features(
    taken_s: Sequence[NDArray[np.float64]],
    moved: Sequence[NDArray[np.float64]],
    gel: Sequence[NDArray[np.float64]],
    shown: Sequence[NDArray[np.int64]],
) -> tuple[NDArray[np.float32], NDArray[np.int64]]:
    """Return the features of a whole pour and which row each moment sees.

    Args:
        taken_s: A gel each, shape (images,): when its images were taken, seconds.
        moved: A gel each, shape (images, 3): the object's motion, mm, mm, rad.
        gel: A gel each, shape (images, 3): the gel's.
        shown: A gel each, shape (moments,): which image a moment shows.

    Returns:
        Shapes (rows, 66) and (moments,): a row for each moment at which some gel showed another
        image, exactly what `PairSlip` gives there.
    """
    pair = PairSlip(len(taken_s))
    nothing = np.zeros(3)
    before = [-1] * len(taken_s)
    rows: list[NDArray[np.float32]] = []
    at = np.zeros(len(shown[0]), np.int64)
    for moment in range(len(shown[0])):
        fresh = False
        for side, images in enumerate(shown):
            image = int(images[moment])
            if image != before[side]:
                pair.gels[side].push(
                    moved[side][image], gel[side][image], nothing, float(taken_s[side][image])
                )
                before[side], fresh = image, True
        if fresh or not rows:
            rows.append(pair.features())
        at[moment] = len(rows) - 1
    return np.stack(rows), at


def _spread_of(moved: NDArray[np.float64], spread: NDArray[np.float64]) -> float:
    """Return the standard deviation of the length of (x, y, lever × turn), mm."""
    each = _SPREAD_FACTOR * spread * (1.0, 1.0, TURN_MM)
    if not np.isfinite(each).all():
        return float("inf")
    length = float(np.linalg.norm(moved))
    if length <= float(np.linalg.norm(each)):  # within the noise no direction is known
        return float(np.linalg.norm(each) / np.sqrt(3))
    return float(np.linalg.norm(moved / length * each))


def _rounded(value: float, digits: int) -> float | None:
    return round(value, digits) if isfinite(value) else None


def _number(value: float | None) -> float:
    return inf if value is None else float(value)
