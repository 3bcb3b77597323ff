"""Presses of one or all sensors as columns, and which of them a curve may be fitted on.

Knows nothing about scans, curves or files.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from taxel.calibration.fitting import FEWEST_FORCES, FEWEST_PRESSES, bands_of, distinct
from taxel.calibration.responses import Responses
from taxel.plain_text import number_of

MOST_AT_END = 0.1
"""Share of a force's presses at the converter's end from which on that force is left out whole,
and all above it. Our choice, docs/decisions/0022."""

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True, kw_only=True)
class PressTable:
    """The columns; saturated and unusable presses are still in those whose names begin with all."""

    channel: NDArray[np.int64]
    all_force_n: Array
    all_volts: Array
    all_rising: NDArray[np.bool_]
    all_rounds: NDArray[np.int64]
    saturated: NDArray[np.bool_]
    rise_s: Array
    fall_s: Array
    recovery_s: Array
    ghost: Array

    @staticmethod
    def of(measured: Sequence[Responses]) -> PressTable:
        presses = [press for channel in measured for press in channel.presses]
        return PressTable(
            channel=np.array([press.channel for press in presses], np.int64),
            all_force_n=np.array([press.force_n for press in presses]),
            all_volts=np.concatenate([channel.height for channel in measured]),
            all_rising=np.array([press.rising for press in presses], bool),
            # Rounds of two recordings are not the same rounds.
            all_rounds=np.array(
                [
                    10**10 * i + press.round
                    for i, channel in enumerate(measured)
                    for press in channel.presses
                ],
                np.int64,
            ),
            saturated=np.concatenate([channel.saturated for channel in measured]),
            rise_s=np.concatenate([channel.rise_s for channel in measured]),
            fall_s=np.concatenate([channel.fall_s for channel in measured]),
            recovery_s=np.concatenate([channel.recovery_s for channel in measured]),
            ghost=np.concatenate([channel.ghost for channel in measured]),
        )

    def only(self, mask: NDArray[np.bool_]) -> PressTable:
        """Return some of the presses; `mask` has the shape (presses,)."""
        names = ("channel", "all_force_n", "all_volts", "all_rising", "all_rounds", "saturated",
                 "rise_s", "fall_s", "recovery_s", "ghost")  # fmt: skip
        return PressTable(**{name: getattr(self, name)[mask] for name in names})

    @property
    def good(self) -> NDArray[np.bool_]:
        """Presses of one sensor to fit on, shape (presses,).

        From the force on at which the converter is at its end in a tenth of the presses, all are
        left out: those below the end would be the weak ones.
        """
        good = np.asarray(~self.saturated & np.isfinite(self.all_volts))
        if not self.saturated.any():
            return good
        bands = bands_of(self.all_force_n)
        ended = [b for b in np.unique(bands) if self.saturated[bands == b].mean() >= MOST_AT_END]
        if not ended:
            return good
        limit_n = float(self.all_force_n[bands == min(ended)].min())
        return np.asarray(good & (self.all_force_n < limit_n))

    @property
    def force_n(self) -> Array:
        """Forces of the presses to fit on, newtons, shape (good presses,), as the three below."""
        return np.asarray(self.all_force_n[self.good])

    @property
    def volts(self) -> Array:
        """Their volts above the baseline, shape (good presses,)."""
        return np.asarray(self.all_volts[self.good])

    @property
    def rising(self) -> NDArray[np.bool_]:
        """Whether they were part of a rising series, shape (good presses,)."""
        return np.asarray(self.all_rising[self.good])

    @property
    def rounds(self) -> NDArray[np.int64]:
        """Which round each belongs to, shape (good presses,)."""
        return np.asarray(self.all_rounds[self.good])

    @property
    def too_few(self) -> str:
        """Why no curve can be fitted; empty where one can."""
        if len(self.channel) == 0:
            return "never pressed"
        if len(self.force_n) >= FEWEST_PRESSES and distinct(self.force_n) >= FEWEST_FORCES:
            return ""
        what = (
            f"{number_of(len(self.force_n), 'usable press')} at "
            f"{number_of(distinct(self.force_n), 'force')}"
        )
        at_end = int(self.saturated.sum())
        return what + (f", {at_end} at the converter's end" if at_end else "")

    def splits(self) -> list[tuple[str, NDArray[np.int64]]]:
        """Return how the good presses are held out: name → folds, shape (good presses,)."""
        ways = []
        if len(np.unique(self.rounds)) > 1:
            ways.append(("whole rounds", self.rounds))
        ways.append(("whole forces", bands_of(self.force_n)))
        return ways
