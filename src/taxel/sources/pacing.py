"""Release samples when their time has come: shared by simulators and replays.

Knows nothing about where samples come from.
"""

from __future__ import annotations

from collections import deque
from dataclasses import replace

import numpy as np

from taxel.clock import Clock
from taxel.signals import Mark, Samples

_BLOCK_S = 0.005
"""Shortest wait for the next scans, seconds: 5 scans at 1 kHz come together, as over USB."""
_BURST = 4096
"""Scans given at once when the source runs as fast as possible."""


class Pacer:
    """A queue of samples and marks that lets out what is due.

    Times of the stream are moved so that its first scan falls on the moment of
    opening; at a speed other than 1 they keep their spacing, and only their
    release is hurried or slowed.

    Args:
        clock: The clock to wait on.
        speed: A factor of real time; infinity gives all at once.
        channels: Number of channels.
    """

    def __init__(self, clock: Clock, speed: float, channels: int) -> None:
        self._clock = clock
        self._speed = speed
        self._opened_s = clock.now_s()
        self._first_s: float | None = None
        self._queue: deque[Samples] = deque()
        self._marks: deque[Mark] = deque()
        self._given_s = -np.inf
        self._channels = channels

    @property
    def empty(self) -> bool:
        """True when no samples wait."""
        return not self._queue

    def put(self, samples: Samples, marks: list[Mark]) -> None:
        """Take in the next stretch of the stream, on the stream's own clock."""
        if self._first_s is None:
            if not len(samples):
                return
            self._first_s = float(samples.fitted_s[0])
        shift = self._opened_s - self._first_s
        if len(samples):
            self._queue.append(
                replace(
                    samples,
                    fitted_s=samples.fitted_s + shift,
                    arrival_s=samples.arrival_s + shift,
                )
            )
        self._marks += [
            replace(mark, start_s=mark.start_s + shift, end_s=mark.end_s + shift) for mark in marks
        ]

    def take(self, timeout_s: float) -> Samples:
        """Return what is due, waiting at most `timeout_s` for the first scan."""
        if not self._queue:
            return Samples.empty(self._channels)
        if self._speed == np.inf:
            return self._pop(np.inf)
        due_s = self._release_s(float(self._queue[0].arrival_s[0]))
        end_s = self._clock.now_s() + timeout_s
        self._clock.sleep(min(max(due_s - self._clock.now_s(), _BLOCK_S), timeout_s))
        now_s = min(self._clock.now_s(), max(end_s, due_s))
        return self._pop(self._opened_s + (now_s - self._opened_s) * self._speed)

    def marks(self) -> list[Mark]:
        """Return the marks whose last scan was given."""
        done = []
        while self._marks and self._marks[0].end_s <= self._given_s:
            done.append(self._marks.popleft())
        return done

    def _release_s(self, stream_s: float) -> float:
        return self._opened_s + (stream_s - self._opened_s) / self._speed

    def _pop(self, until_s: float) -> Samples:
        head = self._queue[0]
        count = int(np.searchsorted(head.arrival_s, until_s, side="right"))
        count = min(count, _BURST) if until_s == np.inf else count
        given, rest = head[:count], head[count:]
        if len(rest):
            self._queue[0] = rest
        else:
            self._queue.popleft()
        if len(given):
            self._given_s = float(given.fitted_s[-1])
        return given
