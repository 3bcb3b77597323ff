"""Where a board's count and its clock stand, and what would continue them.

Counts and clock of one boot rise alike. What does not is damage, a frame that had come before, or
another boot: `stream` decides which. Knows nothing about frames, hellos or ports.

Background of our choices: docs/decisions/0014.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from taxel.wire.counters import unwrap

_SLACK_US = 5000
_SLACK_SHARE = 0.1
"""seq and t_us must advance alike, within 5 ms and a tenth. Our choice: far above any
resonator's error (0.5 %), far below what damage makes of a number."""
_AFTER_HELLO = -2
"""A hello may overtake the scans of two ticks before its own: one is being converted, one waits to
be sent (`scans` in firmware/teng_daq/daq_board.c). Source: docs/decisions/0035."""
_AHEAD_US = 20_000
_AHEAD_PERIODS = 5
"""Behind a hole a board's clock may have gone on by so much more than the arrivals, microseconds
and scans: more is a jump, and needs a hello. Source: as above."""
_LONG_S = 4.0
"""A jump that no buffer of 64 kB explains: the host slept, seconds. Source: as above."""
_RETURN_US = 50_000
_RETURN_SHARE = 0.01
"""After a port's return the board's clock must have gone on like the host's, within 50 ms and 1 %:
its buffers were lost with it. Source: as above."""


@dataclass(slots=True)
class Line:
    """The last scan of one boot, or the hello that it begins with."""

    seq: int
    """Unwrapped."""
    t_us: int
    """The board's clock, unwrapped, microseconds."""
    arrival_s: float
    """When it came, host monotonic, seconds."""
    rate_hz: float
    begun: bool = False
    """False while this is a hello's place: scans of up to two ticks before may still follow."""

    def placed(
        self, raw_seq: NDArray[np.uint32], raw_us: NDArray[np.uint32], arrival_s: float
    ) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        """Return wrapped counts and clocks as whole numbers, nearest to where they should stand.

        Args:
            raw_seq: Shape (n,), as on the wire.
            raw_us: Shape (n,), as on the wire.
            arrival_s: When the first of them came, host monotonic, seconds.
        """
        passed_s = arrival_s - self.arrival_s
        return (
            unwrap(raw_seq, self.seq + round(passed_s * self.rate_hz)),
            unwrap(raw_us, self.t_us + round(passed_s * 1e6)),
        )

    def goes_on(
        self,
        seq: NDArray[np.int64],
        t_us: NDArray[np.int64],
        arrival_s: NDArray[np.float64],
        *,
        returned: bool = False,
    ) -> bool:
        """Return whether these continue the line: rising, alike, and not from the future.

        Args:
            seq: Shape (n,), unwrapped.
            t_us: Shape (n,), unwrapped, microseconds.
            arrival_s: Shape (n,): when they came, host monotonic, seconds.
            returned: Whether the port was lost in between.
        """
        steps = np.diff(seq, prepend=self.seq)
        passed_us = np.diff(t_us, prepend=self.t_us)
        if steps[0] < (1 if self.begun else _AFTER_HELLO) or (steps[1:] < 1).any():
            return False
        alike = self._alike(steps, passed_us)
        if not self.begun:
            alike[:1] = self._alike(steps[:1], passed_us[:1], loose=True)
        if not alike.all():
            return False
        early_us = passed_us - np.diff(arrival_s, prepend=self.arrival_s) * 1e6
        if returned:
            first_us = float(early_us[0])
            return abs(first_us) <= _RETURN_US + _RETURN_SHARE * abs(float(passed_us[0]))
        most_us = _AHEAD_US + _AHEAD_PERIODS * 1e6 / self.rate_hz
        return bool(((steps <= 1) | (early_us <= most_us)).all())

    def leaps(self, seq: int, arrival_s: float) -> bool:
        """Return whether the board's count went on by far more than the host's clock."""
        return (seq - self.seq) / self.rate_hz - (arrival_s - self.arrival_s) > _LONG_S

    def allows(self, seq: int, t_us: int, arrival_s: float) -> bool:
        """Return whether a hello of this count and clock, as on the wire, can be of this line."""
        raw_seq, raw_us = np.array([seq], np.uint32), np.array([t_us], np.uint32)
        placed, placed_us = self.placed(raw_seq, raw_us, arrival_s)
        steps, passed_us = placed - self.seq, placed_us - self.t_us
        return bool(steps[0] >= 0 and self._alike(steps, passed_us, loose=True)[0])

    def had(self, seq: int, t_us: int) -> bool:
        """Return whether a scan of this count and clock had come before, by this line."""
        steps, passed_us = np.array([seq - self.seq]), np.array([t_us - self.t_us])
        return bool(steps[0] <= 0 and self._alike(steps, passed_us)[0])

    def move(self, seq: int, t_us: int, arrival_s: float, *, begun: bool = True) -> None:
        """Put the line's end to a scan, or (not `begun`) to a hello."""
        self.seq, self.t_us, self.arrival_s, self.begun = seq, t_us, arrival_s, begun

    def _alike(
        self, steps: NDArray[np.int64], passed_us: NDArray[np.int64], *, loose: bool = False
    ) -> NDArray[np.bool_]:
        """Return where counts and clocks advance alike; a hello's clock is not that of a tick."""
        period_us = 1e6 / self.rate_hz
        due_us = steps * period_us
        slack_us = _SLACK_US + _SLACK_SHARE * np.abs(due_us) + (period_us if loose else 0.0)
        near: NDArray[np.bool_] = np.abs(passed_us - due_us) <= slack_us
        return near
