"""One open RealSense camera: its two streams, whose frames wait here until they are taken.

The library calls back in a thread of its own; here frames are copied, stamped with their arrival
and kept, the oldest making room. Knows nothing about addresses or recordings.

Background of our choices: docs/decisions/0052.
"""

from __future__ import annotations

import math
import threading
import time
from collections import deque
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from types import ModuleType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from taxel.errors import BadSource, MissingExtra

KEPT = 32
"""Frames that wait, of both streams together: half a second, 50 MB. Source: our choice."""
COLOUR, DEPTH = 0, 1
"""Numbers of the streams, and of the cameras that they become."""
_MEND = "check its cable and port, and run realsense-viewer"


@dataclass(frozen=True, slots=True)
class RawFrame:
    """One frame as the library gives it, copied."""

    stream: int
    """`COLOUR` or `DEPTH`."""
    pixels: NDArray[Any]
    """Colour: shape (height, width, 3), uint8, red first. Depth: (height, width), uint16."""
    number: int
    """The device's own frame counter."""
    device_s: float
    """The device's clock, seconds; NaN where the library has only the host's."""
    arrival_s: float
    """Host monotonic, seconds."""


@dataclass(frozen=True, slots=True, kw_only=True)
class StreamChoice:
    """What is asked of both streams."""

    width: int
    height: int
    rate_hz: int


@dataclass(frozen=True, slots=True)
class FoundRealSense:
    """A camera that is plugged in."""

    name: str
    """The library's, such as "Intel RealSense D435I"."""
    serial: str
    usb: str
    """Version of the port that it is on, such as "3.2"; empty where the library does not know."""

    @property
    def address(self) -> str:
        """What opens it."""
        return f"realsense://{self.serial}"


Finder = Callable[[str], Any]
"""Gives the library's device of a serial number, or of any; None where there is none."""


def realsense_module() -> ModuleType:
    """Return the library.

    Raises:
        MissingExtra: It is not installed, or the system lacks what it needs.
    """
    try:
        import pyrealsense2
    except ImportError as error:
        package = "pyrealsense2" if error.name == "pyrealsense2" else f"pyrealsense2 ({error})"
        raise MissingExtra(package, "realsense", "RealSense cameras") from error
    found: ModuleType = pyrealsense2
    return found


def find_device(serial: str) -> Any:
    """Return a camera that is plugged in; None where there is none.

    Args:
        serial: Its number, or "any".
    """
    rs = realsense_module()
    for device in rs.context().query_devices():
        if serial in ("any", device.get_info(rs.camera_info.serial_number)):
            return device
    return None


def list_realsense(look: Callable[[], Iterable[Any]] | None = None) -> list[FoundRealSense]:
    """Return the cameras that are plugged in; none is started.

    Args:
        look: Gives the library's devices; those of this machine unless given.

    Raises:
        BadSource: The library cannot look.
        MissingExtra: pyrealsense2 is not installed.
    """
    rs = realsense_module()
    kinds = rs.camera_info
    try:
        return [
            FoundRealSense(*(info_of(device, kind) for kind in (
                kinds.name, kinds.serial_number, kinds.usb_type_descriptor)))
            for device in (look or rs.context().query_devices)()
        ]  # fmt: skip
    except RuntimeError as error:
        raise BadSource("a machine where RealSense cameras can be looked for", str(error),
                        "run: rs-enumerate-devices") from error  # fmt: skip


def info_of(device: Any, kind: Any) -> str:
    """Return one of a device's properties, such as its serial number; empty where it has none."""
    return str(device.get_info(kind)) if device.supports(kind) else ""


class OpenDevice:
    """A camera that streams, until `close`.

    Args:
        device: The library's.
        choice: What its streams shall be.

    Raises:
        BadSource: It has no such streams, or refuses to start.
    """

    def __init__(self, device: Any, choice: StreamChoice) -> None:
        rs = self._rs = realsense_module()
        self._device = device
        self._waiting: deque[RawFrame] = deque(maxlen=KEPT)
        self._came = threading.Condition()
        self._started: list[Any] = []
        self.dropped = 0
        """Frames that nobody took in time."""
        wanted = ((rs.stream.color, rs.format.rgb8), (rs.stream.depth, rs.format.z16))
        found = [self._find(kind, form, choice) for kind, form in wanted]
        self.profiles = [profile for _, profile in found]
        """The library's profiles of colour and depth."""
        self.depth_unit_m = float(found[DEPTH][0].get_option(rs.option.depth_units))
        """Metres of a step of depth."""
        try:
            for number, (sensor, profile) in enumerate(found):
                self._start(number, sensor, profile)
        except RuntimeError as error:
            self.close()
            raise BadSource("a RealSense camera that starts", str(error), _MEND) from error

    def _find(self, kind: Any, form: Any, choice: StreamChoice) -> tuple[Any, Any]:
        """Return the sensor and its profile of a stream."""
        offered = set()
        for sensor in self._device.query_sensors():
            for profile in sensor.get_stream_profiles():
                if profile.stream_type() != kind or profile.format() != form:
                    continue
                video = profile.as_video_stream_profile()
                given = StreamChoice(
                    width=video.width(), height=video.height(), rate_hz=profile.fps()
                )
                if given == choice:
                    return sensor, profile
                offered.add(f"{given.width}×{given.height} at {given.rate_hz}/s")
        raise BadSource(
            f"{kind.name} of {choice.width}×{choice.height} at {choice.rate_hz}/s",
            ", ".join(sorted(offered)) or "no such stream", "choose one that the camera has",
        )  # fmt: skip

    def _start(self, number: int, sensor: Any, profile: Any) -> None:
        option = self._rs.option.global_time_enabled
        if sensor.supports(option):
            sensor.set_option(option, 0)  # the device's own clock, not the library's fit of it
        sensor.open(profile)
        self._started.append(sensor)
        sensor.start(lambda frame: self._take_in(number, frame))

    def _take_in(self, stream: int, frame: Any) -> None:
        arrival_s = time.monotonic()
        own = frame.get_frame_timestamp_domain() == self._rs.timestamp_domain.hardware_clock
        raw = RawFrame(
            stream, np.array(frame.get_data()), frame.get_frame_number(),
            frame.get_timestamp() / 1000.0 if own else math.nan, arrival_s,
        )  # fmt: skip
        with self._came:
            self.dropped += len(self._waiting) == KEPT
            self._waiting.append(raw)
            self._came.notify()

    def wait(self, longest_s: float) -> bool:
        """Sleep until a frame waits, at most so long, seconds; return whether one does."""
        with self._came:
            return bool(self._waiting) or self._came.wait(longest_s)

    def take(self) -> list[RawFrame]:
        """Return the frames since the last call, in the order of their arrival; never waits."""
        with self._came:
            found = list(self._waiting)
            self._waiting.clear()
        return found

    def describe(self, stream: int) -> dict[str, str]:
        """Return what a stream is: its lens, and where depth lies beside colour."""
        seen = self.profiles[stream].as_video_stream_profile().get_intrinsics()
        found = {
            "fx_px": f"{seen.fx:.6g}", "fy_px": f"{seen.fy:.6g}", "ppx_px": f"{seen.ppx:.6g}",
            "ppy_px": f"{seen.ppy:.6g}", "distortion": seen.model.name,
            "distortion_coefficients": " ".join(f"{c:.6g}" for c in seen.coeffs),
            "card": self._info("name"), "firmware": self._info("firmware_version"),
            "usb": self._info("usb_type_descriptor"),
        }  # fmt: skip
        if stream == DEPTH:
            found["depth_unit_m"] = f"{self.depth_unit_m:.6g}"
            found |= self._beside()
        return {name: text for name, text in found.items() if text}

    def _beside(self) -> dict[str, str]:
        """Return how a point of depth is turned and moved into colour; nothing where unknown."""
        try:
            to = self.profiles[DEPTH].get_extrinsics_to(self.profiles[COLOUR])
        except RuntimeError:
            return {}
        return {
            "rotation_to_colour": " ".join(f"{value:.6g}" for value in to.rotation),
            "translation_to_colour_m": " ".join(f"{value:.6g}" for value in to.translation),
        }

    @property
    def serial(self) -> str:
        """The device's serial number."""
        return self._info("serial_number")

    def _info(self, name: str) -> str:
        return info_of(self._device, getattr(self._rs.camera_info, name))

    def close(self) -> None:
        """End both streams; of a camera that is gone nothing else can be expected."""
        for sensor in self._started:
            for end in (sensor.stop, sensor.close):
                try:
                    end()
                except RuntimeError:
                    continue
        self._started = []
