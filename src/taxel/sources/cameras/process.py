"""The capture process of one camera: from the device's buffers to shared memory, and nothing else.

Started as `python -m taxel.sources.cameras.process` with its job on standard input; small, since it
imports neither numpy nor images. It ends when its input ends, as it does when the parent dies. Says
what happened as one JSON object a line on standard output. Knows nothing about other cameras.

Background of our choices: docs/decisions/0015.
"""

from __future__ import annotations

import contextlib
import gc
import json
import os
import pickle
import select
import signal
import sys
import time
from collections import deque
from collections.abc import Callable
from dataclasses import asdict, dataclass
from typing import Any

from taxel.errors import BadSource
from taxel.processes import signal_at_parents_end
from taxel.sources.cameras.capture import (
    Buffer,
    CameraGiven,
    CameraGone,
    CameraRequest,
    Capture,
    CaptureFactory,
    another,
    whole_jpeg,
)
from taxel.sources.cameras.ring import (
    BAD,
    FRAMES,
    LOST,
    RATE_MHZ,
    REOPENED,
    REPEATED,
    FrameRing,
    RingFrame,
)

FIRST_FRAME_S = 5.0
"""A camera that sends nothing for so long after it was started is refused. Our choice."""
STALL_S = 2.0
"""A camera that is silent for so long while running is closed and opened again. Our choice."""
RETRY_S = 0.05
"""Between two tries to open a camera that is gone. Our choice."""
_LOOK_S = 0.05
"""Longest wait for a buffer before the parent is looked for."""
_SETTLE, _MEASURE, _MEASURE_S = 5, 25, 1.0
"""Frames let go, then frames and seconds (whichever is first) that the rate is measured over."""
_RECENT = 31
"""Frames that the running rate is measured over."""
OPEN, RUN, RUN_BY_SOCKET = b"o", b"r", b"s"
"""What the parent says on standard input after the job; the last where another camera has the same
serial number, so that the socket decides which it is."""


@dataclass(frozen=True)
class CaptureJob:
    """The job of a camera's capture process: its camera, ring and file descriptors."""

    request: CameraRequest
    factory: CaptureFactory
    ring_fd: int
    slot_bytes: int
    bell_fd: int
    """A byte is written here for each frame; never waited for."""
    parent: int
    """Process number of the parent."""
    first: CameraGiven | None = None
    """What the camera gave when it first ran, if it did: whatever fails now, go on trying."""
    serial_shared: bool = False
    """Another camera has the same serial number."""


class CaptureLoop:
    """Take buffers until the parent is gone; reopen the device whenever it comes back."""

    def __init__(self, job: CaptureJob) -> None:
        self._job = job
        self._capture: Capture = job.factory(job.request)
        self._ring = FrameRing(job.ring_fd, job.slot_bytes)
        self._input = select.poll()
        self._input.register(0, select.POLLIN | select.POLLHUP)
        self._first, self._serial_shared = job.first, job.serial_shared
        self._open = False
        self._reported = ("", "")
        self._sequence: int | None = None
        self._jpeg = b""
        self._stamps: deque[float] = deque(maxlen=_RECENT)
        self._heard_s = 0.0

    def run(self) -> None:
        """Do the job: open when asked to, measure, then capture to the end."""
        try:
            if self._first is None and not self._connect():
                return
            while not self._over(0.0):
                self._step()
        finally:
            self._capture.close()

    def _connect(self) -> bool:
        """Open and measure as the parent says; False where that failed or is not wanted."""
        path = self._job.request.path
        try:
            if sys.stdin.buffer.read(1) != OPEN:
                return False
            self._first = self._capture.open()
            _say(given=asdict(self._first))
            word = sys.stdin.buffer.read(1)
            if word not in (RUN, RUN_BY_SOCKET):
                return False
            self._serial_shared = word == RUN_BY_SOCKET
            rate_hz, images_hz = measure(self._capture, self._over, path)
        except BadSource as error:
            _say(failed=[error.needed, error.got, error.mend])
            return False
        except CameraGone as error:
            _say(failed=[f"a camera at {path}", str(error), "plug it in, or run: taxel find"])
            return False
        self._open, self._heard_s = True, time.monotonic()
        self._report("running", "")
        _say(rate_hz=rate_hz, images_hz=images_hz)
        return True

    def _step(self) -> None:
        """Take one buffer, or try to get the device back."""
        try:
            if not self._open:
                self._check_same(self._capture.open())
                self._open, self._sequence = True, None
                self._stamps.clear()
                self._heard_s = time.monotonic()
                self._ring.words[REOPENED] += 1
            found = self._capture.next(_LOOK_S)
            now_s = time.monotonic()
            if found is None:
                if now_s - self._heard_s > STALL_S:
                    raise CameraGone(f"no frame for {STALL_S:g} s")
                return
        except (BadSource, CameraGone) as error:
            self._report("gone", str(error))
            self._capture.close()
            self._open = False
            self._over(RETRY_S)
            return
        self._heard_s = now_s
        self._report("running", "")
        self._take(found, now_s)

    def _check_same(self, given: CameraGiven) -> None:
        """Refuse another camera than was first opened, such as two that came back swapped."""
        assert self._first is not None
        if what := another(self._first, given, self._serial_shared):
            raise CameraGone(f"another camera ({what}) is at this address")

    def _take(self, found: Buffer, now_s: float) -> None:
        """Count a buffer, and hand it on where it holds a whole image."""
        words = self._ring.words
        if self._sequence is not None:
            words[LOST] += max(0, found.sequence - self._sequence - 1)
        self._sequence = found.sequence
        jpeg = b"" if found.damaged else whole_jpeg(found.data)
        if not jpeg or not self._ring.put(
            RingFrame(jpeg, found.sequence, found.device_s, now_s, found.monotonic)
        ):
            words[BAD] += 1
            return
        words[FRAMES] += 1
        words[REPEATED] += jpeg == self._jpeg
        self._jpeg = jpeg
        self._stamps.append(found.device_s)
        span_s = self._stamps[-1] - self._stamps[0]
        words[RATE_MHZ] = round(1e3 * (len(self._stamps) - 1) / span_s) if span_s > 0 else 0
        with contextlib.suppress(BlockingIOError, BrokenPipeError):
            os.write(self._job.bell_fd, b".")

    def _over(self, wait_s: float) -> bool:
        """Return whether the parent is gone, or wants the end; wait for that so long."""
        return bool(self._input.poll(wait_s * 1e3)) or os.getppid() != self._job.parent

    def _report(self, state: str, why: str) -> None:
        if (state, why) != self._reported:
            self._reported = state, why
            _say(state=state, why=why)


def measure(
    capture: Capture, over: Callable[[float], bool], path: str, within_s: float = FIRST_FRAME_S
) -> tuple[float, float]:
    """Return frames and different images a second of a camera that has just been started.

    Args:
        capture: Open.
        over: Whether to stop.
        path: The camera's, for the error.
        within_s: Longest time that this may take, seconds.

    Raises:
        BadSource: Too few frames came.
        CameraGone: The device went away.
    """
    stamps: list[float] = []
    images, last, seen = 0, b"", 0
    until_s = time.monotonic() + within_s
    while len(stamps) < 2 or (len(stamps) < _MEASURE and stamps[-1] - stamps[0] < _MEASURE_S):
        if over(0.0) or time.monotonic() > until_s:
            raise BadSource(
                f"whole frames from {path}",
                f"{seen} within {within_s:g} s",
                "check its cable, or try a smaller size",
            )
        buffer = capture.next(_LOOK_S)
        if buffer is None or buffer.damaged or not whole_jpeg(buffer.data):
            continue
        seen += 1
        if seen <= _SETTLE:
            last = buffer.data
            continue
        images += bool(stamps) and buffer.data != last
        stamps.append(buffer.device_s)
        last = buffer.data
    span_s = stamps[-1] - stamps[0]
    if span_s <= 0:
        raise BadSource(f"stamps that rise from {path}", "equal ones", "report this driver")
    return (len(stamps) - 1) / span_s, images / span_s


def _say(**what: Any) -> None:
    sys.stdout.write(json.dumps(what) + "\n")
    sys.stdout.flush()


def main() -> None:
    """Run the job that stands on standard input."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C ends the parent, and thereby this
    # From our own parent by an unnamed pipe, as multiprocessing does it; never from a file.
    job: CaptureJob = pickle.load(sys.stdin.buffer)
    # A stopped one is woken by it, and ends; its parent's starting thread may end before.
    signal_at_parents_end(job.parent, signal.SIGCONT)
    os.set_blocking(job.bell_fd, False)
    loop = CaptureLoop(job)
    gc.freeze()
    with contextlib.suppress(BrokenPipeError):
        loop.run()


if __name__ == "__main__":
    # As a module of its own name, so that classes pickled by the parent are the same here.
    from taxel.sources.cameras.process import main as run_main

    run_main()
