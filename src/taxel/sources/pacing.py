"""Release samples and frames when their time has come: shared by simulators and replays.

Knows nothing about where samples come from.

Background of our choices: docs/decisions/0006.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from heapq import heappop, heappush
from itertools import islice

import numpy as np
from numpy.typing import NDArray

from taxel.clock import Clock
from taxel.errors import BadSource
from taxel.signals import Frame, Mark, Samples

Stretch = tuple[Samples, list[Mark]]
"""The next part of a stream, on the stream's own clock; either half may be empty."""

_BUNDLE_S = 0.005
"""Scans that come within this time are given together, as USB does: 5 at 1 kHz. Our choice."""
_AHEAD = 6
"""Frames fetched before they fall due: three moments of two cameras. Our choice."""
_LATER = 4
"""Stretches fetched before they fall due: without scans two cameras use up two a moment. Ours."""
_SPARE_S = 0.006
"""Idle time that fetching ahead needs, seconds: a chunk takes 1 to 4 ms. Our choice."""
_ON_TIME_S = 0.005
"""After a frame that fell due so lately none is looked for that is not made yet, seconds. Ours."""
_BURST_SCANS = 4096
"""Scans given at once when the source runs as fast as possible. Our choice."""
_BURST_FRAMES = 64
"""Frames given at once then, of a source without scans. Our choice."""


def read_speed(options: dict[str, str]) -> float:
    """Take "speed" out of an address's options: a factor of real time, infinity for "max".

    Raises:
        BadSource: It is no number above 0.
    """
    text = options.pop("speed", "1")
    try:
        speed = float("inf") if text == "max" else float(text)
    except ValueError:
        speed = 0.0
    if not speed > 0:
        raise BadSource(
            "speed as a number above 0, or max", repr(text), "write for example speed=2"
        )
    return speed


@dataclass(frozen=True, slots=True)
class FrameStream:
    """An iterator of camera frames, and whether its next frame is ready."""

    frames: Iterator[Frame]
    """Oldest first."""
    together: int = 1
    """Frames that are made at once, such as one of each camera."""
    ready: Callable[[], bool] = lambda: True
    """Whether the next frame can be had without waiting for it; a source that prepares its next
    grasp says no until that is done."""


class Pacer:
    """Lets out a stream's samples and marks as they fall due.

    The stream's clock is moved so that its first scan or frame lies at the moment of
    opening, or of `begin`. At a speed other than 1 all stamps keep their spacing; only the
    release is hurried or slowed. A scan falls due at its arrival, so the
    stream's own jitter is kept. Stretches are fetched one at a time, when the
    one before is used up: memory is that of a stretch, or of what fell due
    while nobody read.

    Args:
        stretches: The stream, oldest first; it may be endless.
        channels: Number of channels.
        clock: The clock to wait on.
        speed: A factor of real time; infinity gives all that is there.
        frames: The cameras' frames on the same clock.
        ahead: Fetch the next frames and stretches while nothing is due, as a recording's can be
            and those of a simulator that is being acted on cannot.
        stretch_ready: Whether the next stretch can be had without waiting for it.
    """

    def __init__(
        self,
        stretches: Iterator[Stretch],
        channels: int,
        clock: Clock,
        speed: float,
        frames: FrameStream | None = None,
        *,
        ahead: bool = False,
        stretch_ready: Callable[[], bool] = lambda: True,
    ) -> None:
        frames = frames or FrameStream(iter(()))
        self._frame_ready, self._stretch_ready = frames.ready, stretch_ready
        self._stretches = stretches
        self._later: deque[Stretch] = deque()
        self._may_fetch_ahead = ahead
        self._together = frames.together
        self._owed = 1
        """Fetches of stretches that are left for when nothing is due."""
        self._clock = clock
        self._speed = speed
        self._opened_s = clock.now_s()
        self._shift_s: float | None = None
        self._none = Samples.empty(channels)
        self._head = self._none
        self._due_s: NDArray[np.float64] = np.zeros(0)
        self._marks: list[tuple[float, int, Mark]] = []  # a heap: end, number, mark
        self._marks_came = 0
        self._scans_given_s = self._frames_given_s = -np.inf
        self._over = False
        self._frames = frames.frames
        self._ahead: deque[Frame] = deque()
        self._given_frames: list[Frame] = []
        self.frames_given = 0
        """Frames that `frames` has returned."""
        first = self._next_frame
        self._first_frame_s = first.fitted_s if first else np.inf
        self._fetch_owed()

    @property
    def ended(self) -> bool:
        """True when no scan and no frame is left."""
        self._fetch_owed()
        return self._over and not len(self._head) and self._next_frame is None

    def begin(self) -> None:
        """Let the stream begin now instead of at opening; nothing may have been read yet."""
        late_s = self._clock.now_s() - self._opened_s
        self._opened_s += late_s
        if self._shift_s is not None:
            self._shift_s += late_s
        self._head = replace(
            self._head,
            fitted_s=self._head.fitted_s + late_s,
            arrival_s=self._head.arrival_s + late_s,
        )
        self._due_s = self._due_s + late_s
        self._marks = [
            (end_s + late_s, number, _moved(mark, late_s)) for end_s, number, mark in self._marks
        ]

    def read(self, timeout_s: float) -> Samples:
        """Return what is due, waiting at most `timeout_s` seconds for the first scan.

        At the end of the stream it returns at once. What comes next is made by the next call, or
        by `marks` or `ended`: a simulator takes milliseconds, for which nothing due may wait.
        """
        if self.ended:
            return self._none
        if self._speed == np.inf:
            return self._take_burst()
        if self._may_fetch_ahead:
            self._fetch_ahead()
        scan_s, frame_s = self._scan_due_s(), self._frame_due_s()
        now_s = self._clock.now_s()
        if min(scan_s, frame_s) > now_s:
            # Scans are given some at a time; no frame waits for that.
            longest_s = timeout_s if self._frame_ready() else min(timeout_s, _BUNDLE_S)
            self._clock.sleep(min(min(scan_s + _BUNDLE_S, frame_s) - now_s, longest_s))
        now_s = self._clock.now_s()
        due_s = -np.inf
        until_s = self._until_s(now_s)
        while (self._ahead or due_s < now_s - _ON_TIME_S) and self._frame_due_s() <= now_s:
            frame = self._next_frame
            if frame is not None and frame.fitted_s + (self._shift_s or 0.0) > until_s:
                break
            due_s = self._frame_due_s()
            self._take_frame()
        return self._take_due(now_s)

    def frames(self) -> list[Frame]:
        """Return the frames that fell due in `read` since the last call, oldest first."""
        given, self._given_frames = self._given_frames, []
        self.frames_given += len(given)
        return given

    def marks(self) -> list[Mark]:
        """Return, once each, the marks whose scans and frames were given; at the end, the rest.

        A frame that is still to come belongs to a mark until the mark's very end: of two cameras'
        last frames, taken at once, the second must not be taken for the next trial's first.
        """
        self._fetch_owed()
        until_s = np.inf
        if len(self._head) or self._owed:
            until_s = self._scans_given_s
        frame = self._next_frame
        if frame is not None:
            before_s = math.nextafter(frame.fitted_s + (self._shift_s or 0.0), -math.inf)
            until_s = min(until_s, before_s, max(self._frames_given_s, self._stream_s()))
        elif not self._frame_ready():
            until_s = min(until_s, self._frames_given_s)
        done: list[tuple[float, int, Mark]] = []
        while self._marks and self._marks[0][0] <= until_s:
            done.append(heappop(self._marks))
        return [mark for _, _, mark in sorted(done, key=lambda waited: waited[1])]

    def _until_s(self, now_s: float) -> float:
        """Return up to when frames are given: where all scans at hand are due, to the last of them.

        Who reads late gets one stretch of scans a read; frames that ran ahead of them would come
        before marks that lie between.
        """
        if len(self._head) and self._due_s[-1] <= now_s:
            return float(self._head.fitted_s[-1])
        return math.inf

    def _stream_s(self) -> float:
        """Return how far the stream has come by the clock, seconds on its moved stamps."""
        if self._speed == np.inf:
            return math.inf
        return self._opened_s + (self._clock.now_s() - self._opened_s) * self._speed

    def close(self) -> None:
        """Give nothing more, and let go of the stream."""
        self._over = True
        self._frames, self._given_frames = iter(()), []
        self._ahead.clear()
        self._head, self._marks = self._none, []
        self._stretches = iter(())
        self._later.clear()

    def _fetch_ahead(self) -> None:
        """Fetch while there is time: reading from the disk then delays nothing that is due."""
        while min(self._scan_due_s(), self._frame_due_s()) > self._clock.now_s() + _SPARE_S:
            frames, stretches = len(self._ahead), len(self._later)
            if frames < _AHEAD:
                self._ahead.extend(islice(self._frames, 1))
            if len(self._ahead) == frames and stretches < _LATER:
                self._later.extend(islice(self._stretches, 1))
            if (frames, stretches) == (len(self._ahead), len(self._later)):
                break

    @property
    def _next_frame(self) -> Frame | None:
        """The next frame to give, fetched now where none was; None where it is not ready yet."""
        if not self._ahead and self._frame_ready():
            self._ahead.extend(islice(self._frames, self._together))
        return self._ahead[0] if self._ahead else None

    def _scan_due_s(self) -> float:
        return float(self._due_s[0]) if len(self._head) else np.inf

    def _frame_due_s(self) -> float:
        frame = self._next_frame
        if frame is None:
            return np.inf
        came_s = max(frame.arrival_s, frame.fitted_s) + (self._shift_s or 0.0)
        return self._opened_s + (came_s - self._opened_s) / self._speed

    def _take_frame(self) -> None:
        frame, shift_s = self._next_frame, self._shift_s or 0.0
        if frame is not None:
            moved = replace(
                frame, arrival_s=frame.arrival_s + shift_s, fitted_s=frame.fitted_s + shift_s
            )
            self._given_frames.append(moved)
            self._frames_given_s = moved.fitted_s
            self._ahead.popleft()
            self._owed += 1

    def _take_burst(self) -> Samples:
        """Give what comes next, frames and scans in step with each other."""
        if not len(self._head):
            for _ in range(_BURST_FRAMES):
                self._take_frame()
            return self._none
        count = len(self._head)
        if self._next_frame is not None:
            until_s = self._next_frame.fitted_s + (self._shift_s or 0.0)
            count = int(np.searchsorted(self._head.fitted_s, until_s, side="right"))
            if not count:
                self._take_frame()
                return self._none
        return self._take(min(count, _BURST_SCANS))

    def _take_due(self, now_s: float) -> Samples:
        count = int(np.searchsorted(self._due_s, now_s, side="right"))
        return self._take(count) if count else self._none

    def _take(self, count: int) -> Samples:
        given = self._head[:count]
        self._head, self._due_s = self._head[count:], self._due_s[count:]
        self._scans_given_s = float(given.fitted_s[-1])
        self._owed += 1
        return given

    def _fetch_owed(self) -> None:
        while self._owed and self._stretch_ready():
            self._owed -= 1
            self._fetch()

    def _fetch(self) -> None:
        """Make the head hold a scan, unless the stream is over.

        Where there is no array a stretch holds marks only: one a frame keeps ahead of
        the frames, and nothing makes opening wait until all have been read.
        """
        waiting: list[Mark] = []
        while not len(self._head) and not self._over:
            stretch = self._later.popleft() if self._later else next(self._stretches, None)
            if stretch is None:
                self._over = True
                break
            samples, marks = stretch
            waiting += marks
            if len(samples):
                self._put(samples)
            elif not self._none.values.shape[1] and self._next_frame is not None:
                break
        if self._shift_s is None and np.isfinite(self._first_frame_s):
            self._shift_s = self._opened_s - self._first_frame_s
        if self._shift_s is not None:
            for mark in waiting:
                moved = _moved(mark, self._shift_s)
                self._marks_came += 1
                if not math.isnan(moved.end_s):  # else it never falls due, and keeps no order
                    heappush(self._marks, (moved.end_s, self._marks_came, moved))

    def _put(self, samples: Samples) -> None:
        if self._shift_s is None:
            first_s = min(float(samples.fitted_s[0]), self._first_frame_s)
            self._shift_s = self._opened_s - first_s
        fitted_s = samples.fitted_s + self._shift_s
        arrival_s = samples.arrival_s + self._shift_s
        self._head = replace(samples, fitted_s=fitted_s, arrival_s=arrival_s)
        came_s = np.maximum.accumulate(np.where(np.isfinite(arrival_s), arrival_s, fitted_s))
        self._due_s = self._opened_s + (came_s - self._opened_s) / self._speed


def _moved(mark: Mark, by_s: float) -> Mark:
    return replace(mark, start_s=mark.start_s + by_s, end_s=mark.end_s + by_s)
