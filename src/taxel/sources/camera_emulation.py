"""An emulated capture device: JPEG images on its own clock, with the faults of real ones.

Fulfils `Capture` and behaves like a USB camera under its driver: it runs free from the moment it
is powered, has a jittering and drifting clock, eight buffers, loses what comes while all are full,
and counts those frames, too. Given to `Cameras` as its factory; no address leads here. Knows
nothing about processes or what the images show.

Background of our choices: docs/decisions/0015.
"""

from __future__ import annotations

import random
import time
from collections import deque
from dataclasses import dataclass
from typing import Literal

from taxel.errors import BadSource
from taxel.sources.cameras.capture import Buffer, CameraGiven, CameraGone, CameraRequest

FaultKind = Literal["frozen", "stall", "gone", "empty", "damaged", "cut", "late", "hang", "killed"]
_DELAY_S = 0.004
"""From the middle of the exposure to the host, where nothing is late. Our choice."""


@dataclass(frozen=True, slots=True, kw_only=True)
class CameraFault:
    """Something that goes wrong for a while; frames are counted from when power came."""

    kind: FaultKind
    """frozen: the same image again and again. stall: no buffers, and the count goes on. gone:
    unplugged. empty, damaged, cut: zero length, error flag, no end mark. late: delivered
    `late_s` later. hang: the driver does not return. killed: the process dies."""
    first: int
    """First frame that is hit."""
    frames: int = 1
    """How many are hit."""
    late_s: float = 0.0
    """Extra delay of "late", seconds."""

    def hits(self, number: int) -> bool:
        """Whether a frame is hit."""
        return self.first <= number < self.first + self.frames


@dataclass(frozen=True, slots=True, kw_only=True)
class EmulatedCamera:
    """One camera's body; calling it gives its device, so that it is a `CaptureFactory`."""

    images: tuple[bytes, ...]
    """Different JPEG images, shown one after another and again."""
    rate_hz: float = 25.0
    """Frames a second."""
    repeats: int = 1
    """Frames that each image is shown for."""
    jitter_s: float = 0.0005
    """Standard deviation of a frame's moment, seconds."""
    drift_ppm: float = 40.0
    """How much its clock is fast, parts in a million."""
    foreign_clock_s: float | None = None
    """Where stamps are not of the host's clock: what its own showed at power-on, seconds."""
    padding: int = 0
    """Zero bytes behind each image, as drivers leave them."""
    buffers: int = 8
    """Frames that its driver holds, as many as `v4l2.py` asks for."""
    serial: str | None = None
    """Serial number; None is the path of its device."""
    refuses: tuple[str, str, str] | None = None
    """Where opening fails: needed, got, mend."""
    faults: tuple[CameraFault, ...] = ()

    def __call__(self, request: CameraRequest) -> EmulatedCapture:
        return EmulatedCapture(self, request)


@dataclass(frozen=True)
class EmulatedPair:
    """Several cameras by their device path: a `CaptureFactory` for all of them."""

    bodies: dict[str, EmulatedCamera]
    """Path → camera."""

    def __call__(self, request: CameraRequest) -> EmulatedCapture:
        return EmulatedCapture(self.bodies[request.path], request)


class EmulatedCapture:
    """The device of one emulated camera."""

    def __init__(self, body: EmulatedCamera, request: CameraRequest) -> None:
        self._body, self._request = body, request
        self._born_s: float | None = None
        self._number = 0
        """The next frame that the camera takes, since power came."""
        self._opened_at = 0
        self._filled: deque[Buffer] = deque()
        self._open = False

    def open(self) -> CameraGiven:
        """Power it at the first call; as `Capture.open`.

        Raises:
            BadSource: It refuses, or is unplugged.
        """
        body, request = self._body, self._request
        if body.refuses is not None:
            raise BadSource(*body.refuses)
        now_s = time.monotonic()
        if self._born_s is None:
            self._born_s = now_s
        self._number = self._newest(now_s) + 1
        self._check_plugged(now_s)
        self._opened_at, self._open = self._number, True
        self._filled.clear()
        return CameraGiven(
            width=request.width, height=request.height, pixel_format="MJPG",
            rate_hz=body.rate_hz, card="emulated camera", bus="none",
            serial=request.path if body.serial is None else body.serial, node=request.path,
        )  # fmt: skip

    def next(self, timeout_s: float) -> Buffer | None:
        """Return the oldest filled buffer; as `Capture.next`."""
        until_s = time.monotonic() + timeout_s
        while True:
            now_s = time.monotonic()
            self._check_plugged(now_s)
            self._fill(now_s)
            if self._filled:
                return self._filled.popleft()
            if now_s >= until_s:
                return None
            ready_s = self._ready_s(self._number)
            time.sleep(max(0.0, min(ready_s, until_s) - now_s))

    def close(self) -> None:
        """Stop streaming; the camera keeps its power."""
        self._open = False

    def _fill(self, now_s: float) -> None:
        """Let the driver take in all frames that are ready; those without a buffer are lost."""
        while self._ready_s(self._number) <= now_s:
            number = self._number
            self._number += 1
            kinds = [fault.kind for fault in self._body.faults if fault.hits(number)]
            if "killed" in kinds:
                raise SystemExit(1)
            if "hang" in kinds:
                end_s = self._ready_s(self._last_of("hang", number))
                time.sleep(max(0.0, end_s - time.monotonic()))
            if {"stall", "hang"} & set(kinds) or len(self._filled) >= self._body.buffers:
                continue
            self._filled.append(self._buffer(number, kinds))

    def _buffer(self, number: int, kinds: list[FaultKind]) -> Buffer:
        body = self._body
        data = self._image(number) + bytes(body.padding)
        if "empty" in kinds:
            data = b""
        if "cut" in kinds:
            data = data[: len(data) // 2].replace(b"\xff\xd9", b"")
        device_s = self._taken_s(number)
        if body.foreign_clock_s is not None:
            assert self._born_s is not None
            device_s += body.foreign_clock_s - self._born_s
        return Buffer(
            data=data,
            sequence=number - self._opened_at,
            device_s=device_s,
            monotonic=body.foreign_clock_s is None,
            damaged="damaged" in kinds,
        )

    def _image(self, number: int) -> bytes:
        for fault in self._body.faults:
            if fault.kind == "frozen" and fault.hits(number):
                number = max(0, fault.first - 1)
        return self._body.images[number // self._body.repeats % len(self._body.images)]

    def _taken_s(self, number: int) -> float:
        """Return when a frame is taken, host clock; jittered, the same at each asking."""
        assert self._born_s is not None
        jitter = random.Random(f"{self._request.path} {number}").gauss(0.0, self._body.jitter_s)
        return self._born_s + (number + 1) * self._period_s + jitter

    def _ready_s(self, number: int) -> float:
        late_s = sum(
            fault.late_s
            for fault in self._body.faults
            if fault.kind == "late" and fault.hits(number)
        )
        return self._taken_s(number) + _DELAY_S + late_s

    def _newest(self, now_s: float) -> int:
        """Return the newest frame that was taken by now, -1 before the first."""
        assert self._born_s is not None
        return int((now_s - self._born_s) / self._period_s) - 1

    def _check_plugged(self, now_s: float) -> None:
        number = self._newest(now_s) + 1
        if any(fault.kind == "gone" and fault.hits(number) for fault in self._body.faults):
            self._open = False
            raise CameraGone("no such device (ENODEV)")

    def _last_of(self, kind: FaultKind, number: int) -> int:
        return max(
            fault.first + fault.frames
            for fault in self._body.faults
            if fault.kind == kind and fault.hits(number)
        )

    @property
    def _period_s(self) -> float:
        return (1.0 - self._body.drift_ppm * 1e-6) / self._body.rate_hz


def gel_images(count: int, camera: int = 0, seed: int = 0) -> tuple[bytes, ...]:
    """Return different images of a simulated GelSight that holds a cup while it is filled.

    Args:
        count: How many, at most 600.
        camera: 0 for the left, 1 for the right finger.
        seed: Of the cup.

    Raises:
        MissingExtra: The simulator is not installed.
    """
    from taxel.clock import ManualClock
    from taxel.sources.opening import open_source

    images: list[bytes] = []
    url = f"sim://cup-pour?speed=max&runs=1&seed={seed}&duration_s={count / 20 + 1:g}"
    with open_source(url, ManualClock()) as source:
        while len(images) < count and not source.ended:
            source.read()
            for frame in source.frames():
                if frame.camera == camera and frame.jpeg not in images[-1:]:
                    images.append(frame.jpeg)
    return tuple(images[:count])
