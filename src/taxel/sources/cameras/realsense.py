"""`realsense://`: an RGB-D camera that looks on: colour as JPEG, depth as PNG of 16 bits.

    realsense://any?width=640&height=480&rate_hz=30        (the only one that is plugged in)
    realsense://123622270224                               (by its serial number)

Two cameras, `scene` and `scene-depth`, each with its lens in its details, the device's own
counter and clock, and the time fitted as of every other device. A camera that is unplugged is
silent until it is there again. Knows nothing about what frames show.

Background of our choices: docs/decisions/0052.
"""

from __future__ import annotations

import math
import time
from typing import Self

import numpy as np

from taxel.errors import BadSource
from taxel.frame_codec import encode_depth, encode_jpeg
from taxel.recordings.manifest import NO_ARRAY
from taxel.signals import (
    CODING,
    DEPTH_PNG,
    JPEG,
    ROLE,
    SCENE,
    CameraInfo,
    Frame,
    Mark,
    Samples,
    SensorInfo,
)
from taxel.sources.cameras.realsense_device import (
    COLOUR,
    DEPTH,
    Finder,
    OpenDevice,
    RawFrame,
    StreamChoice,
    find_device,
)
from taxel.sources.fitted_time import FittedTime

NAMES = ("scene", "scene-depth")
"""Of colour and depth."""
_DEFAULT = {"width": 640, "height": 480, "rate_hz": 30}
"""Source: a mode that a D435i has over USB 2, too (data sheet, table 4-2); our choice."""
_LIMITS = {"width": (16, 4096), "height": (16, 4096), "rate_hz": (1, 300)}
_MEASURED = 8
"""Frames of each stream by which the rate is measured. Source: our choice: a quarter second."""
_FIRST_S = 5.0
"""How long a camera may take to send them, seconds. Source: our choice."""
SILENT_S = 1.0
"""A camera that is silent for so long is looked for anew, seconds, and so often. Our choice."""


class RealSense:
    """One camera with two streams; a `Source` without an array.

    Args:
        name: Its serial number, or "any".
        options: As in the address: width, height (px), rate_hz, the same for both streams.
        find: Gives the library's device; what is plugged in unless given.

    Raises:
        BadSource: An option is wrong, or there is no such camera, or it sends nothing.
        MissingExtra: pyrealsense2 is not installed.
    """

    def __init__(self, name: str, options: dict[str, str], find: Finder = find_device) -> None:
        self._choice = parse_choice(options)
        self._name, self._find = name, find
        device = find(name)
        if device is None:
            raise BadSource("a RealSense camera that is plugged in", f"none as {name!r}",
                            "check its cable, or its serial number")  # fmt: skip
        self._device: OpenDevice | None = OpenDevice(device, self._choice)
        self._fits: list[FittedTime] = []
        self._last_s: list[float] = []
        self._begin_clocks()
        self._heard_s = time.monotonic()
        self._ended = False
        self.reopened = 0
        """How often the camera was found again."""
        try:
            rates_hz = self._measure(self._device)
            self._cameras = tuple(
                self._info(self._device, stream, rates_hz[stream]) for stream in (COLOUR, DEPTH)
            )
        except BaseException:
            self._device.close()
            raise

    @property
    def info(self) -> SensorInfo:
        return NO_ARRAY

    @property
    def cameras(self) -> tuple[CameraInfo, ...]:
        return self._cameras

    @property
    def ended(self) -> bool:
        """True once closed: a camera that is gone may come back."""
        return self._ended

    def read(self, timeout_s: float = 0.1) -> Samples:
        """Wait for a frame of either stream, at most `timeout_s` seconds; there are no scans."""
        if self._ended:
            return Samples.empty(0)
        if self._device is None or not self._device.wait(timeout_s):
            self._look_for_it(timeout_s)
        return Samples.empty(0)

    def frames(self) -> list[Frame]:
        """Return the frames since the last call, oldest first; never waits.

        Of a camera that nobody asks for long only the newest half second is kept; the device's
        counter shows what is missing.
        """
        raw = self._device.take() if self._device is not None else []
        if raw:
            self._heard_s = raw[-1].arrival_s
        return sorted(map(self._frame, raw), key=lambda frame: frame.fitted_s)

    def marks(self) -> list[Mark]:
        return []

    def _frame(self, raw: RawFrame) -> Frame:
        coded = encode_jpeg(raw.pixels) if raw.stream == COLOUR else encode_depth(raw.pixels)
        return Frame(
            camera=raw.stream, jpeg=coded, counter=raw.number, device_s=raw.device_s,
            arrival_s=raw.arrival_s, fitted_s=self._fitted(raw),
        )  # fmt: skip

    def _fitted(self, raw: RawFrame) -> float:
        """Return when a frame was taken: by the device's clock where the library gives it."""
        if math.isnan(raw.device_s):
            return raw.arrival_s
        if raw.device_s < self._last_s[raw.stream]:  # its clock began anew
            self._fits[raw.stream] = FittedTime()
        self._last_s[raw.stream] = raw.device_s
        fitted = self._fits[raw.stream].of(np.array([raw.device_s]), np.array([raw.arrival_s]))
        return float(min(fitted[0], raw.arrival_s))

    def _begin_clocks(self) -> None:
        self._fits = [FittedTime() for _ in NAMES]
        self._last_s = [-math.inf for _ in NAMES]

    def _look_for_it(self, timeout_s: float) -> None:
        """Open a camera again that has been silent, once it is there."""
        now_s = time.monotonic()
        if now_s - self._heard_s < SILENT_S:
            if self._device is None:
                time.sleep(min(timeout_s, SILENT_S - (now_s - self._heard_s)))
            return
        self._heard_s = now_s
        if self._device is not None:
            self._device.close()
            self._device = None
        try:
            found = self._find(self._name)
            if found is not None:
                self._device = OpenDevice(found, self._choice)
                self._begin_clocks()
                self.reopened += 1
        except (BadSource, RuntimeError):  # half plugged in: the next look finds it whole
            return

    def _measure(self, device: OpenDevice) -> list[float]:
        """Return the frames a second of both streams, hertz.

        Raises:
            BadSource: Too few came.
        """
        came: list[list[float]] = [[] for _ in NAMES]
        until_s = time.monotonic() + _FIRST_S
        while min(map(len, came)) < _MEASURED:
            if time.monotonic() > until_s:
                counts = " and ".join(f"{len(c)} of {n}" for c, n in zip(came, NAMES, strict=True))
                raise BadSource(
                    f"{_MEASURED} frames of each stream within {_FIRST_S:g} s", counts,
                    "check the cable: it needs USB 3 for large images",
                )  # fmt: skip
            device.wait(0.1)
            for raw in device.take():
                own = raw.arrival_s if math.isnan(raw.device_s) else raw.device_s
                came[raw.stream].append(own)
        self._heard_s = time.monotonic()
        return [(len(times) - 1) / max(times[-1] - times[0], 1e-3) for times in came]

    def _info(self, device: OpenDevice, stream: int, rate_hz: float) -> CameraInfo:
        choice = self._choice
        return CameraInfo(
            name=NAMES[stream], width=choice.width, height=choice.height,
            rate_hz=round(rate_hz, 3), serial=device.serial,
            details={
                ROLE: SCENE, CODING: DEPTH_PNG if stream == DEPTH else JPEG,
                "asked_hz": str(choice.rate_hz), "measured_hz": f"{rate_hz:.4g}",
                **device.describe(stream),
            },
        )  # fmt: skip

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self._ended = True
        if self._device is not None:
            self._device.close()
            self._device = None


def parse_choice(options: dict[str, str]) -> StreamChoice:
    """Return what an address asks for.

    Raises:
        BadSource: An option is unknown, or no whole number within its limits.
    """
    found = dict(_DEFAULT)
    for key, text in options.items():
        if key not in _LIMITS:
            raise BadSource(f"options of realsense:// among {', '.join(_LIMITS)}", repr(key),
                            "mend the address")  # fmt: skip
        low, high = _LIMITS[key]
        if not (text.isdecimal() and len(text) < 6 and low <= int(text) <= high):
            raise BadSource(f"{key} of realsense:// as a whole number within {low} and {high}",
                            repr(text), "mend the address")  # fmt: skip
        found[key] = int(text)
    return StreamChoice(**found)
