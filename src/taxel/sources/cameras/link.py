"""The parent's side of one capture process: start it, hear it, take its frames, start it again.

Knows nothing about other cameras, addresses or what frames show.

Background of our choices: docs/decisions/0015.
"""

from __future__ import annotations

import contextlib
import json
import os
import pickle
import select
import subprocess
import sys
import time
from dataclasses import dataclass
from typing import Any

import numpy as np

from taxel.errors import BadSource
from taxel.signals import Frame
from taxel.sources.cameras.capture import CameraGiven, CameraRequest, CaptureFactory
from taxel.sources.cameras.process import FIRST_FRAME_S, OPEN, RUN, RUN_BY_SOCKET, CaptureJob
from taxel.sources.cameras.ring import (
    BAD,
    FRAMES,
    LOST,
    RATE_MHZ,
    REOPENED,
    REPEATED,
    FrameRing,
    RingFrame,
    make_ring,
)
from taxel.sources.fitted_time import FittedTime

_START_S = 20.0
"""A capture process that says nothing for so long failed to start, on the busiest machine."""
_END_S = 1.0
"""A capture process that has not ended so long after it was asked to is killed."""
_RESTART_S = 0.5
"""Between two starts of a capture process that died. Our choice."""
_LARGEST_DELAY_S = 10.0
"""A "monotonic" stamp further from the host's clock is of another clock. Our choice."""


@dataclass(frozen=True, slots=True, kw_only=True)
class CameraLedger:
    """Counts of one camera's frames since it was opened."""

    name: str
    frames: int
    """Whole frames that came to the host."""
    lost: int
    """Frames that the device counted and that never came, by sequence number."""
    repeated: int
    """Frames whose bytes are those of the one before."""
    bad: int
    """Buffers without a whole JPEG, flagged as damaged, or too large."""
    dropped: int
    """Frames that nobody took before newer ones needed the place."""
    reopened: int
    """How often the device was closed and opened again."""
    restarted: int
    """How often the capture process itself died and was started again."""
    rate_hz: float | None
    """Frames a second over the last 30; None before there are any."""
    state: str
    """"running", "gone" or "no process"."""
    why: str
    """What happened, where the state is not running."""


class CameraLink:
    """One camera with its process; call `open`, then `run`, then `frames` again and again.

    Args:
        number: Stamped on the frames.
        name: For the ledger.
        request: What to ask the device for.
        factory: Makes the device inside the process.
    """

    def __init__(
        self, number: int, name: str, request: CameraRequest, factory: CaptureFactory
    ) -> None:
        self._number, self._name = number, name
        self._request, self._factory = request, factory
        # As much as the raw image: what UVC drivers reserve for the largest JPEG, too.
        self._slot_bytes = max(1 << 16, 2 * request.width * request.height)
        self._ring_fd = make_ring(self._slot_bytes)
        self._ring = FrameRing(os.dup(self._ring_fd), self._slot_bytes)
        self._fitted: FittedTime | None = None
        self._last_device_s = -np.inf
        self._state, self._why = "starting", ""
        self._restarted = 0
        self._started_s = 0.0
        self._unread = b""
        self._bell = -1
        self._given: CameraGiven | None = None
        self._serial_shared = False
        self._start()

    @property
    def bell(self) -> int:
        """File descriptor that can be read when a frame came; -1 while there is no process."""
        return self._bell

    def open(self) -> CameraGiven:
        """Open the device; return what it gives.

        Raises:
            BadSource: It cannot be used, or is not there.
        """
        self._command(OPEN)
        self._given = CameraGiven(**self._hear("given", _START_S))
        return self._given

    def begin(self, serial_shared: bool = False) -> None:
        """Let the process measure the rate and run.

        Args:
            serial_shared: Another camera has the same serial number.
        """
        self._serial_shared = serial_shared
        self._command(RUN_BY_SOCKET if serial_shared else RUN)

    def measured(self) -> tuple[float, float]:
        """Return frames and different images a second, once measured.

        Raises:
            BadSource: Too few frames came.
        """
        rate_hz, images_hz = self._hear("rate_hz", _START_S + FIRST_FRAME_S)
        os.set_blocking(self._stdout, False)
        return rate_hz, images_hz

    def fresh(self) -> None:
        """Let go of the frames that came while other cameras were being opened."""
        self._ring.skip()

    def silence(self) -> None:
        """Take the rings of the bell that came so far; start the process again if it died."""
        if self._bell < 0:
            self._restart()
            return
        self._listen()  # so that what it says never fills the pipe
        with contextlib.suppress(BlockingIOError):
            while rung := os.read(self._bell, 4096):
                if len(rung) < 4096:
                    return
            self._listen()
            self._state, self._why = "no process", "the capture process ended"
            os.close(self._bell)
            self._bell = -1

    def frames(self) -> list[Frame]:
        """Return the frames since the last call, oldest first; never waits."""
        return [self._stamped(ring_frame) for ring_frame in self._ring.take()]

    def ledger(self) -> CameraLedger:
        """Return the counts so far."""
        self._listen()
        words = self._ring.words
        return CameraLedger(
            name=self._name,
            frames=words[FRAMES],
            lost=words[LOST],
            repeated=words[REPEATED],
            bad=words[BAD],
            dropped=self._ring.dropped,
            reopened=words[REOPENED],
            restarted=self._restarted,
            rate_hz=words[RATE_MHZ] / 1e3 or None,
            state=self._state,
            why=self._why,
        )

    def close(self) -> None:
        """End the process and let go of the memory."""
        self._end()
        self._ring.close()
        os.close(self._ring_fd)

    def _start(self) -> None:
        """Start the process; where the camera was open before, to get that camera back."""
        self._bell, bell_in = os.pipe()
        os.set_blocking(self._bell, False)
        job = CaptureJob(
            self._request, self._factory, self._ring_fd, self._slot_bytes, bell_in,
            os.getpid(), self._given, self._serial_shared,
        )  # fmt: skip
        self._process = subprocess.Popen(
            # -P: a folder called taxel where the user stands is not the package.
            [sys.executable, "-P", "-m", "taxel.sources.cameras.process"],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            pass_fds=(self._ring_fd, bell_in),
        )
        os.close(bell_in)
        assert self._process.stdout is not None
        self._stdout = self._process.stdout.fileno()
        self._unread = b""
        self._started_s = time.monotonic()
        self._command(pickle.dumps(job))
        if self._given is not None:
            os.set_blocking(self._stdout, False)

    def _restart(self) -> None:
        """Start the process again, at most twice a second; its memory goes on."""
        if time.monotonic() - self._started_s > _RESTART_S:
            self._end()
            self._restarted += 1
            self._fitted, self._last_device_s = None, -np.inf
            self._start()

    def _end(self) -> None:
        """Close the process's input, which ends it."""
        process = self._process
        assert process.stdin is not None
        assert process.stdout is not None
        with contextlib.suppress(BrokenPipeError):
            process.stdin.close()
        try:
            process.wait(_END_S)
        except subprocess.TimeoutExpired:
            process.kill()
            process.wait()
        process.stdout.close()
        if self._bell >= 0:
            os.close(self._bell)

    def _command(self, word: bytes) -> None:
        assert self._process.stdin is not None
        with contextlib.suppress(BrokenPipeError):  # it died: its silence says it
            self._process.stdin.write(word)
            self._process.stdin.flush()

    def _hear(self, key: str, within_s: float) -> Any:
        """Wait for an answer.

        Raises:
            BadSource: The process says that it failed, or died.
        """
        until_s = time.monotonic() + within_s
        while True:
            line, found, rest = self._unread.partition(b"\n")
            if found:
                self._unread = rest
                message = json.loads(line)
                if "failed" in message:
                    raise BadSource(*message["failed"])
                if key in message:
                    return (
                        (message[key], message["images_hz"]) if key == "rate_hz" else message[key]
                    )
                self._note(message)
                continue
            left_s = until_s - time.monotonic()
            ready, _, _ = select.select([self._stdout], [], [], max(0.0, left_s))
            more = os.read(self._stdout, 1 << 16) if ready else b""
            if not more:
                raise BadSource(
                    f"an answer from the capture process of {self._request.path}",
                    "its end" if ready else f"none within {within_s:g} s",
                    "see what it wrote above",
                )
            self._unread += more

    def _listen(self) -> None:
        """Take in what the process said about its state; never waits."""
        with contextlib.suppress(BlockingIOError):
            while more := os.read(self._stdout, 1 << 16):
                self._unread += more
        *lines, self._unread = self._unread.split(b"\n")
        for line in lines:
            self._note(json.loads(line))

    def _note(self, message: dict[str, Any]) -> None:
        if "state" in message:
            self._state, self._why = message["state"], message["why"]

    def _stamped(self, ring_frame: RingFrame) -> Frame:
        return Frame(
            camera=self._number,
            jpeg=ring_frame.jpeg,
            counter=ring_frame.sequence,
            device_s=ring_frame.device_s,
            arrival_s=ring_frame.arrival_s,
            fitted_s=self._fit(ring_frame),
        )

    def _fit(self, ring_frame: RingFrame) -> float:
        """Return when a frame was taken: the driver's stamp, or a fit of another clock's."""
        delay_s = ring_frame.arrival_s - ring_frame.device_s
        if ring_frame.monotonic and abs(delay_s) < _LARGEST_DELAY_S:
            return min(ring_frame.device_s, ring_frame.arrival_s)
        if (
            self._fitted is None or ring_frame.device_s < self._last_device_s
        ):  # its clock began anew
            self._fitted = FittedTime()
        self._last_device_s = ring_frame.device_s
        fitted = self._fitted.of(np.array([ring_frame.device_s]), np.array([ring_frame.arrival_s]))
        return float(min(fitted[0], ring_frame.arrival_s))
