"""What a camera's device must offer, and what is asked of it: the seam under `camera://`.

A real device (`v4l2.py`) and an emulated one (`camera_emulation.py`) stand behind the same three
calls, so that all above them is tested without a camera. Light on purpose: the capture process
imports it. Knows nothing about processes, files or pixels.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

from taxel.plain_text import visible


@dataclass(frozen=True, slots=True, kw_only=True)
class CameraRequest:
    """What an address asks of one camera."""

    path: str
    """Device node, such as /dev/v4l/by-id/….-video-index0."""
    width: int
    """Pixels a row."""
    height: int
    """Rows."""
    rate_hz: float | None = None
    """Frames a second; None takes what the camera does by itself."""


@dataclass(frozen=True, slots=True, kw_only=True)
class CameraGiven:
    """What the device said when it was asked, read back."""

    width: int
    height: int
    pixel_format: str
    """Four letters; always "MJPG" or "JPEG"."""
    rate_hz: float | None
    """Frames a second that the driver promises; None where it does not say."""
    card: str = ""
    """The device's name."""
    bus: str = ""
    """Where it is plugged in."""
    serial: str = ""
    """USB serial number; empty where it has none."""
    node: str = ""
    """The node that was opened, links followed."""


def another(first: CameraGiven, now: CameraGiven, serial_shared: bool) -> str:
    """Return what shows that a camera is another than at first; empty where nothing does.

    The same serial number is the same camera, in whatever socket; without one, or where several
    have it, the socket decides.

    Args:
        first: What it gave when it was first opened.
        now: What the camera gives that is at its address now.
        serial_shared: Whether another of the cameras has the same serial number.
    """
    if first.serial != now.serial:
        return f"serial {visible(now.serial)}" if now.serial else "without a serial number"
    if first.card != now.card:
        return f"its name is {visible(now.card)}"
    if (serial_shared or not first.serial) and first.bus and now.bus and first.bus != now.bus:
        return f"plugged in at {visible(now.bus)}, not {visible(first.bus)}"
    if (first.width, first.height) != (now.width, now.height):
        return f"{now.width}×{now.height}, not {first.width}×{first.height}"
    return ""


@dataclass(frozen=True, slots=True, kw_only=True)
class Buffer:
    """One buffer as the driver filled it."""

    data: bytes
    """JPEG, possibly padded; empty where the driver filled nothing."""
    sequence: int
    """Counts the frames that the device sent, lost ones included; starts anew when opened."""
    device_s: float
    """The driver's stamp, seconds."""
    monotonic: bool
    """Whether that stamp is of the host's monotonic clock."""
    damaged: bool
    """Whether the driver flagged the data as damaged."""


class CameraGone(Exception):
    """The device went away or failed; it may come back. The message says why."""


class Capture(Protocol):
    """A camera's device; may be opened again after `close`."""

    def open(self) -> CameraGiven:
        """Open and start streaming.

        Raises:
            BadSource: It cannot be used, or gives something other than what was asked.
            CameraGone: It is not there, or failed; it may come back.
        """
        ...

    def next(self, timeout_s: float) -> Buffer | None:
        """Return the next buffer, oldest first; None after `timeout_s` seconds of silence.

        Raises:
            CameraGone: The device went away or failed.
        """
        ...

    def close(self) -> None:
        """Stop streaming and let go of the device; harmless where it is gone or closed."""
        ...


CaptureFactory = Callable[[CameraRequest], Capture]
"""Makes the device of one camera inside its capture process; must survive pickling."""


def whole_jpeg(data: bytes) -> bytes:
    """Return a JPEG without the padding that drivers leave behind it; empty if it is not whole.

    Entropy-coded data never holds the end mark FF D9, so that the last one found is the image's.
    """
    if not data.startswith(b"\xff\xd8"):
        return b""
    end = data.rfind(b"\xff\xd9")
    return data[: end + 2] if end > 0 else b""
