"""Scans of several boards on one grid: a row is one scan of all of them.

The first board's scans are the ticks; each other board gives, at each tick, the scan
nearest to it by fitted time. What is not there is flagged, never waited for
longer than a board may take. Knows nothing about ports or frames; takes the present time.

Background of our choices: docs/decisions/0014.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from taxel.signals import Samples, Validity
from taxel.sources.boards.ledger import BoardLedger, Scans

WAIT_S = 0.03
"""How long a row waits for the boards that are late, seconds; older scans would count as
stale in the window's grid anyway. Source: docs/decisions/0003, 0014."""
WAIT_ALONE_S = 0.1
"""The same for a single board: nothing else is held up. Source: docs/decisions/0014."""
_SLIP = 0.75
"""A board is moved to the next tick when its scan lies this far from its own, ticks: more than
half, so that jitter at the border does not send it to and fro. Our choice."""
_PIECE = 64
"""Scans placed at once: resonators 1 % apart move by less than a tick in so many."""
_MOST_OFF = 0.05
"""A period this much off the nominal one is not believed, as a fraction: a fit may still be
learning. Our choice: ten times a resonator's error."""
_MOST_MISSING_S = 60.0
"""Rows without any scan that one call gives at most, seconds of them: bounds its memory."""
_SLOPE_STEP_S = 0.5
"""Time between two points of a board's clock by which its rate is followed, seconds."""
_SLOPE_POINTS = 20
"""Of those points that are kept: the last ten seconds. Our choice."""


@dataclass(slots=True)
class _Board:
    columns: slice
    ledger: BoardLedger
    offset: int | None = None
    """Tick minus seq; None before the first scan of a boot."""
    boot: int = -1
    last_tick: int = -1
    last_arrival_s: float = -math.inf
    last_fitted_s: float = -math.inf
    gone_s: float | None = None
    """From when on its missing scans are those of a board that is away."""
    kept: list[tuple[NDArray[np.int64], Scans]] = field(default_factory=list)
    last: Scans | None = None
    """Its last scan alone."""


class BoardMerge:
    """Rows from boards, in the order in which their columns stand.

    Args:
        channels: Columns of each board.
        ledgers: One a board, to count what is late, repeated or skipped.
        rate_hz: Nominal scans a second of each board, hertz.
        wait_s: How long a row waits for scans that are late, seconds; by the number of boards
            unless given. A link that delivers in bursts needs more than the time between two.
    """

    def __init__(
        self,
        channels: Sequence[int],
        ledgers: Sequence[BoardLedger],
        rate_hz: float,
        wait_s: float | None = None,
    ) -> None:
        edges = np.concatenate(([0], np.cumsum(channels))).tolist()
        self._boards = [
            _Board(slice(start, end), ledger)
            for start, end, ledger in zip(edges, edges[1:], ledgers, strict=False)
        ]
        self._width = edges[-1]
        self._none = Samples.empty(self._width)
        self._period_s = self._nominal_s = 1.0 / rate_hz
        usual_s = WAIT_S if len(channels) > 1 else WAIT_ALONE_S
        self._wait_s = max(usual_s if wait_s is None else wait_s, 2.5 * self._period_s)
        self._anchor: tuple[int, float] | None = None
        self._slope: list[tuple[int, float]] = []
        self._next = self._first = 0
        self._last_fitted_s = self._last_arrival_s = -math.inf

    def gone(self, index: int) -> None:
        """Say that a board's port is gone: what it lacks from now on is RECONNECTING."""
        board = self._boards[index]
        board.gone_s = board.last_fitted_s if board.gone_s is None else board.gone_s

    def last_arrival_s(self, index: int) -> float:
        """Return when a board's last scan came, host monotonic, seconds; −inf before any."""
        return self._boards[index].last_arrival_s

    def put(self, index: int, scans: Scans) -> None:
        """Take in scans of one board; all boards' in about the order of arrival."""
        board = self._boards[index]
        if scans.boot != board.boot:
            board.boot, board.offset = scans.boot, None
        if self._anchor is None:
            if index:
                board.ledger.early += len(scans.seq)
                return  # the grid begins with the first board's first scan
            self._begin_at(int(scans.seq[0]), scans)
        for start in range(0, len(scans.seq), _PIECE):
            part = slice(start, start + _PIECE)
            self._place(board, _part(scans, part), lead=index == 0)

    def release(self, now_s: float, looked_s: float) -> Samples:
        """Return the rows that are complete, or that have waited long enough, oldest first.

        Args:
            now_s: The present, host monotonic, seconds.
            looked_s: Up to when all that came was put here, at most the present: a board
                is late where it sent nothing, not where this program had no turn to read it.
        """
        if self._anchor is None:
            return self._none
        ends = [
            board.last_tick + 1
            for board in self._boards
            if looked_s - board.last_arrival_s <= self._wait_s and board.ledger.state == "running"
        ]
        overdue = math.floor(self._position(looked_s - self._wait_s)) + 1
        known = max(board.last_tick for board in self._boards) + 1
        overdue = min(overdue, max(known, self._next) + round(_MOST_MISSING_S / self._period_s))
        end = max(overdue, min(ends)) if ends else overdue
        if end <= self._next:
            return self._none
        return self._rows(self._next, end, now_s)

    def _begin_at(self, tick: int, scans: Scans) -> None:
        """Begin the grid; the first row is two ticks on, so that all boards can be in it."""
        self._anchor = (tick, float(scans.fitted_s[0]))
        self._boards[0].offset = 0  # rows are numbered as the first board counts
        self._next = self._first = tick + (2 if len(self._boards) > 1 else 0)
        for board in self._boards:
            board.last_arrival_s = float(scans.arrival_s[-1])  # none is late yet

    def _position(self, host_s: float) -> float:
        """Return where a moment lies on the grid, ticks."""
        tick, at_s = self._anchor or (0, host_s)
        return tick + (host_s - at_s) / self._period_s

    def _place(self, board: _Board, scans: Scans, *, lead: bool) -> None:
        seq, first = scans.seq, board.offset is None
        if board.offset is None:
            at = round(self._position(float(scans.fitted_s[0])))
            board.offset = max(at, board.last_tick + 1) - int(seq[0])
        ticks = seq + board.offset
        apart = self._position(float(scans.fitted_s[-1])) - int(ticks[-1])
        away = board.gone_s is not None or first
        # A lead that counts lines, not ticks, has not counted those that it did not print.
        behind = lead and apart > _SLIP and int(ticks[0]) < self._next
        if abs(apart) > _SLIP and (away or behind or not lead):
            # A faster board's two scans of one tick: the second takes the first's place.
            earliest = board.last_tick + (1 if lead or away else 0)
            move = max(round(apart), earliest - int(ticks[0]))
            if not away:
                self._slipped(board, ticks, move)
            board.offset += move
            ticks = ticks + move
        if lead:
            self._follow(int(ticks[-1]), float(scans.fitted_s[-1]), fresh=away)
        board.last = _part(scans, slice(len(seq) - 1, None))
        board.last_tick = max(board.last_tick, int(ticks[-1]))
        board.last_arrival_s = float(scans.arrival_s[-1])
        board.last_fitted_s = float(scans.fitted_s[-1])
        late = int(np.searchsorted(ticks, self._next))
        early = int(np.searchsorted(ticks[:late], self._first))
        board.ledger.early += early
        board.ledger.late += late - early
        if late < len(ticks):
            board.kept.append((ticks[late:], _part(scans, slice(late, None))))

    def _slipped(self, board: _Board, ticks: NDArray[np.int64], move: int) -> None:
        """Fill the hole that a slower board leaves; count what a faster one has too much."""
        if move < 0 and ticks[0] + move >= self._next:
            board.ledger.skipped -= move
        elif move == 1 and board.last is not None and board.last_tick + 1 == ticks[0] >= self._next:
            board.kept.append((ticks[:1].copy(), board.last))
            board.ledger.repeated += 1

    def _follow(self, tick: int, fitted_s: float, *, fresh: bool) -> None:
        """Keep the grid on the first board's clock."""
        self._anchor = (tick, fitted_s)
        slope = self._slope
        if fresh:
            slope.clear()
        if not slope or fitted_s - slope[-1][1] >= _SLOPE_STEP_S:
            slope.append((tick, fitted_s))
            if len(slope) > _SLOPE_POINTS:
                slope.pop(0)
        first_tick, first_s = slope[0]
        if fitted_s - first_s >= 2 * _SLOPE_STEP_S and tick > first_tick:
            measured_s = (fitted_s - first_s) / (tick - first_tick)
            if abs(measured_s / self._nominal_s - 1.0) < _MOST_OFF:
                self._period_s = measured_s

    def _rows(self, start: int, end: int, now_s: float) -> Samples:
        n = end - start
        values = np.zeros((n, self._width), np.float32)
        flags = np.full((n, self._width), Validity.MISSING, np.uint8)
        device_s = np.full(n, np.nan)
        arrival_s = np.full(n, -np.inf)
        tick, at_s = self._anchor or (start, now_s)
        fitted_s = np.float64(at_s) + (np.arange(start, end) - tick) * np.float64(self._period_s)
        for index, board in enumerate(self._boards):
            here = self._fill(board, start, end, values, flags, arrival_s)
            if index == 0:
                for ticks, scans in here:
                    fitted_s[ticks] = scans.fitted_s
                    device_s[ticks] = scans.device_s
        arrival_s[arrival_s == -np.inf] = now_s
        arrival_s = np.maximum.accumulate(np.maximum(arrival_s, self._last_arrival_s))
        fitted_s = np.maximum.accumulate(np.maximum(fitted_s, self._last_fitted_s))
        for board in self._boards:
            if board.gone_s is not None:
                self._flag_away(board, fitted_s > board.gone_s, flags)
        self._next = end
        self._last_arrival_s, self._last_fitted_s = float(arrival_s[-1]), float(fitted_s[-1])
        return Samples(
            values=values,
            counter=np.arange(start, end, dtype=np.int64),
            device_s=device_s,
            arrival_s=arrival_s,
            fitted_s=fitted_s,
            validity=flags,
        )

    @staticmethod
    def _fill(
        board: _Board,
        start: int,
        end: int,
        values: NDArray[np.float32],
        flags: NDArray[np.uint8],
        arrival_s: NDArray[np.float64],
    ) -> list[tuple[NDArray[np.int64], Scans]]:
        """Write a board's scans into their rows; return them with their row numbers."""
        here: list[tuple[NDArray[np.int64], Scans]] = []
        kept: list[tuple[NDArray[np.int64], Scans]] = []
        for ticks, scans in board.kept:
            count = int(np.searchsorted(ticks, end))
            if count < len(ticks):
                kept.append((ticks[count:], _part(scans, slice(count, None))))
            if count:
                rows, given = ticks[:count] - start, _part(scans, slice(0, count))
                values[rows, board.columns] = given.values
                flags[rows, board.columns] = given.flags
                arrival_s[rows] = np.maximum(arrival_s[rows], given.arrival_s)
                here.append((rows, given))
        board.kept = kept
        return here

    @staticmethod
    def _flag_away(board: _Board, since: NDArray[np.bool_], flags: NDArray[np.uint8]) -> None:
        """Flag as RECONNECTING what is missing since the port went; over once scans are back."""
        mine = flags[:, board.columns]
        missing = (mine & np.uint8(Validity.MISSING)) != 0
        missing &= since[:, None]
        mine[missing] |= np.uint8(Validity.RECONNECTING)
        if not missing[-1].any() and board.ledger.state == "running":
            board.gone_s = None


def _part(scans: Scans, part: slice) -> Scans:
    if part.start in (0, None) and (part.stop is None or part.stop >= len(scans.seq)):
        return scans
    return Scans(
        seq=scans.seq[part],
        device_s=scans.device_s[part],
        arrival_s=scans.arrival_s[part],
        fitted_s=scans.fitted_s[part],
        values=scans.values[part],
        flags=scans.flags[part],
        boot=scans.boot,
    )
