"""A contact gate that follows each channel's rest level and noise, and reports each change.

A gate is stated for channels that rest at 0 with little noise. Here each channel's own gate stands
that much above where the channel rests now, and never within six deviations of its noise. Both are
measured on the last rows alone, touched or not, so that nothing waits for a rest, and a gate that
is too low or too high is put right by itself. Knows nothing about windows, files or models.

Background of our choices: docs/decisions/0047.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator
from copy import copy
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from taxel.windows.gate import NOISE_SIGMAS
from taxel.windows.grid import Rows

_EVERY_S = 1.0
"""How often the gates are looked at, seconds. Our choice, docs/decisions/0047."""
_LEAST_S = 10.0
"""Until so much was seen the stated gate holds, seconds: two grasps. Our choice, 0047."""
_LEAST_MOVE = 0.02
"""A gate moves once it is off by this share of the stated one, so that each move can be shown. Our
choice, docs/decisions/0047."""
LIMITS = (0.5, 2.0)
"""A gate never leaves these shares of the stated one: beyond them is a fault, no drift. Our
choice, docs/decisions/0047."""
_SIGMA_PER_MAD = 1.4826
"""Standard deviation over median absolute deviation, for a normal distribution."""

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True, kw_only=True)
class GateMove:
    """One channel's gate was moved."""

    time_s: float
    """Of the row after which the new gate holds, fitted clock, seconds."""
    channel: str
    before: float
    """Gate until then, in the channel's unit."""
    after: float
    """Gate from then on."""
    rest: float
    """Where the channel rests now, in its unit."""
    noise: float
    """Standard deviation of its noise, in its unit."""
    limited: bool
    """The gate would lie further off, but for `LIMITS`."""

    def words(self) -> str:
        """Return the move as a line of a log."""
        end = "; it goes no further" if self.limited else ""
        return (
            f"gate of {self.channel} moved from {self.before:.3g} to {self.after:.3g}: it rests at "
            f"{self.rest:.3g}, noise {self.noise:.2g}{end}"
        )


class RecentRest:
    """Rest and noise of the last seconds, measured anew every second; the same however rows come.

    Args:
        follow_s: How many of the last seconds are looked at.
        rate_hz: Rows a second.
    """

    def __init__(self, follow_s: float, rate_hz: float) -> None:
        self._every = max(1, round(_EVERY_S * rate_hz))
        self._least = round(min(_LEAST_S, follow_s) * rate_hz)
        self._kept: deque[Array] = deque(maxlen=max(1, round(follow_s / _EVERY_S)))
        self._since: list[Array] = []
        self._counted = 0

    def slices(self, rows: int) -> Iterator[slice]:
        """Yield parts of so many rows, each to be added before the next is asked for."""
        start = 0
        while start < rows:
            end = min(rows, start + self._every - self._counted)
            yield slice(start, end)
            start = end

    def add(self, values: Array) -> tuple[Array, Array] | None:
        """Take in a part's rows; return rest and noise, shape (channels,) each, where due.

        Args:
            values: Shape (n, channels), NaN where not usable.
        """
        self._since.append(values)
        self._counted += len(values)
        if self._counted < self._every:
            return None
        self._kept.append(np.concatenate(self._since))
        self._since, self._counted = [], 0
        seen = np.concatenate(self._kept)
        return rest_and_noise(seen) if len(seen) >= self._least else None

    def still(self) -> RecentRest:
        """Return a twin whose rows change nothing here, and that never finds a new rest."""
        twin = copy(self)
        twin._since, twin._every = [], 1 << 60
        return twin


class GateFollower:
    """Gates of all channels.

    Args:
        gate: The stated gate, above 0, in the channels' unit.
        follow_s: How many of the last seconds rest and noise are measured on: more than twice the
            longest touch.
        rate_hz: Rows a second.
        channels: Their names.
    """

    def __init__(
        self, gate: float, follow_s: float, rate_hz: float, channels: tuple[str, ...]
    ) -> None:
        self._stated = gate
        self._channels = channels
        self._gates = np.full(len(channels), gate)
        self._recent = RecentRest(follow_s, rate_hz)
        self._moves: list[GateMove] = []

    def parts(self, rows: Rows) -> Iterator[tuple[Rows, NDArray[np.float32]]]:
        """Yield the rows in parts, each with its gates, shape (channels,)."""
        for at in self._recent.slices(len(rows)):
            part = Rows(rows.time_s[at], rows.values[at], rows.flags[at])
            yield part, self._gates.astype(np.float32)
            found = self._recent.add(np.where(part.usable, part.values, np.nan))
            if found is not None:
                self._follow(float(part.time_s[-1]), *found)

    def still(self) -> GateFollower:
        """Return a twin whose rows change nothing here."""
        twin = copy(self)
        twin._recent, twin._moves = self._recent.still(), []
        return twin

    def take_moves(self) -> list[GateMove]:
        """Return the moves since the last call, oldest first."""
        moves, self._moves = self._moves, []
        return moves

    def _follow(self, time_s: float, rest: Array, noise: Array) -> None:
        """Move the gates that are off."""
        wanted = rest + np.maximum(self._stated, NOISE_SIGMAS * noise)
        low, high = (share * self._stated for share in LIMITS)
        allowed = np.where(np.isfinite(wanted), np.clip(wanted, low, high), self._gates)
        for index in np.flatnonzero(np.abs(allowed - self._gates) >= _LEAST_MOVE * self._stated):
            self._moves.append(
                GateMove(
                    time_s=time_s, channel=self._channels[index],
                    before=float(self._gates[index]), after=float(allowed[index]),
                    rest=float(rest[index]), noise=float(noise[index]),
                    limited=bool(allowed[index] != wanted[index]),
                )
            )  # fmt: skip
            self._gates[index] = allowed[index]


def rest_and_noise(values: Array) -> tuple[Array, Array]:
    """Return where each channel rests and the deviation of its noise, shape (channels,) each.

    Rest is the median, which stays at rest while touch takes less than half of the time. Noise is
    the median step from row to row, over √2: touch is slow beside noise, so it hardly shows in
    steps. NaN for a channel without usable values.

    Args:
        values: Shape (n, channels), n ≥ 2, NaN where not usable.

    Source: von Neumann's mean successive difference, with a median; docs/decisions/0047.
    """
    known = np.isfinite(values).any(axis=0)
    filled = np.where(known, values, 0.0)
    middle = np.nanmedian if np.isnan(filled).any() else np.median
    rest = middle(filled, axis=0)
    steps = np.abs(np.diff(filled, axis=0))
    stepped = np.isfinite(steps).any(axis=0)
    noise = middle(np.where(stepped, steps, 0.0), axis=0) * _SIGMA_PER_MAD / np.sqrt(2.0)
    return np.where(known, rest, np.nan), np.where(known & stepped, noise, np.nan)
