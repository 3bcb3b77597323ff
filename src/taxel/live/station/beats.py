"""Signs of life in shared memory: each process its own row, read by the supervisor.

A row is written by one process and read by others, eight bytes at a time, without a lock.
Knows nothing about what the processes do.

Background of our choices: docs/decisions/0030.
"""

from __future__ import annotations

import time
from dataclasses import dataclass
from enum import IntEnum
from multiprocessing import shared_memory
from typing import Self

from taxel.live.station.ring import bytes_of
from taxel.live.station.shared import create_shared

ROWS = 32
"""Processes that one board of beats has room for. Source: our choice."""
_FIELDS = 8
_STOP_AT = ROWS * _FIELDS
_GO_AT = _STOP_AT + 1
_TICK_AT = _STOP_AT + 2
_CELLS = _STOP_AT + 8
"""Cells of eight bytes, with room."""
_PATIENCE_BITS = 16
"""A sign of life is one cell, so that nobody reads half of it: microseconds on the host's clock
above, milliseconds of patience in these bits. With the patience of one step and the time of
another a monitor would seem silent that has just ended a long step."""
_LONGEST_PATIENCE_MS = (1 << _PATIENCE_BITS) - 1


class Work(IntEnum):
    """The state that a process reports of itself."""

    STARTING = 0
    RUNNING = 1
    FAILED = 2
    ENDED = 3


@dataclass(frozen=True, slots=True)
class Beat:
    """One process's row."""

    beat_s: float
    """When it last gave a sign, host monotonic, seconds; 0 where it never did."""
    work: Work
    produced: int
    """Scans, frames or decisions that it made."""
    consumed: int
    """Messages that it took in."""
    dropped: int
    """Messages that were gone before it came to them."""
    patience_s: float
    """How long it asks to be left alone in a step that is known to be long, seconds; 0 usually."""


class Beats:
    """The board of beats and the word to stop, for as long as its maker lives."""

    def __init__(self) -> None:
        size = _CELLS * 8
        self._memory = create_shared(size)
        bytes_of(self._memory)[:size] = bytes(size)
        self._view = BeatsView(self._memory.name)
        self.name = self._memory.name

    def read(self, row: int) -> Beat:
        """Return a process's row."""
        return self._view.read(row)

    def clear(self, row: int) -> None:
        """Forget a process that will be followed by another."""
        self._view.clear(row)

    def fail(self, row: int) -> None:
        """Write on a process's behalf that it will make nothing more; its counts stay."""
        self._view.set_work(row, Work.FAILED)

    def tick(self, now_s: float) -> None:
        """Write that the supervisor lives; from now on its ticks are due."""
        self._view.tick(now_s)

    def rest(self) -> None:
        """Write that no ticks are due until the next one."""
        self._view.tick(0.0)

    def go(self) -> None:
        """Let the sources begin: everybody who follows them is there."""
        self._view.go()

    def stop(self) -> None:
        """Ask every process to end."""
        self._view.stop()

    def close(self) -> None:
        """Give the memory back."""
        self._view.close()
        self._memory.close()
        self._memory.unlink()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()


class BeatsView:
    """One process's view of the board.

    Args:
        name: The board's.
    """

    def __init__(self, name: str) -> None:
        self._memory = shared_memory.SharedMemory(name)
        self._cells = bytes_of(self._memory)[: _CELLS * 8].cast("Q")

    @property
    def stopping(self) -> bool:
        """True once every process was asked to end."""
        return bool(self._cells[_STOP_AT])

    @property
    def gone(self) -> bool:
        """True once the sources may begin."""
        return bool(self._cells[_GO_AT])

    def tick(self, now_s: float) -> None:
        """Write the moment of the supervisor's tick, monotonic seconds; 0: none is due."""
        self._cells[_TICK_AT] = round(now_s * 1e9)

    def still_s(self, now_s: float) -> float:
        """Return how long ago the supervisor's last tick was, seconds; 0 where none is due."""
        tick_ns = self._cells[_TICK_AT]
        return max(0.0, now_s - tick_ns / 1e9) if tick_ns else 0.0

    def go(self) -> None:
        """Let the sources begin."""
        self._cells[_GO_AT] = 1

    def stop(self) -> None:
        """Ask every process to end."""
        self._cells[_STOP_AT] = 1

    def read(self, row: int) -> Beat:
        """Return a process's row."""
        at = row * _FIELDS
        cells = self._cells
        sign = cells[at]
        return Beat(
            (sign >> _PATIENCE_BITS) / 1e6, Work(cells[at + 1]), cells[at + 2], cells[at + 3],
            cells[at + 4], (sign & _LONGEST_PATIENCE_MS) / 1e3,
        )  # fmt: skip

    def write(
        self,
        row: int,
        work: Work = Work.RUNNING,
        *,
        produced: int = 0,
        consumed: int = 0,
        dropped: int = 0,
        patience_s: float = 0.0,
    ) -> None:
        """Give a sign of life, with what was counted so far."""
        at = row * _FIELDS
        cells = self._cells
        cells[at + 2], cells[at + 3], cells[at + 4] = produced, consumed, dropped
        patience_ms = min(round(patience_s * 1e3), _LONGEST_PATIENCE_MS)
        cells[at] = time.monotonic_ns() // 1000 << _PATIENCE_BITS | patience_ms
        # Last: what has just begun to run must not be read with a sign from before.
        cells[at + 1] = work

    def set_work(self, row: int, work: Work) -> None:
        """Write what a process is said to do, without a sign of life."""
        self._cells[row * _FIELDS + 1] = work

    def clear(self, row: int) -> None:
        """Forget a row."""
        for field in range(_FIELDS):
            self._cells[row * _FIELDS + field] = 0

    def close(self) -> None:
        """Let go of the memory."""
        self._cells.release()
        self._memory.close()
