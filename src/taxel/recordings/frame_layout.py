"""How camera frames lie in a recording: ROS 2's CompressedImage, and their exact times beside it.

Any ROS 2 program shows the images; what only taxel needs is a message of its own on
/camera/NAME/times, with the same sequence number, so that a frame comes back bit by bit and every
image of a camera has the same frame_id. FORMAT.md has the byte table. Knows nothing about files,
chunks or threads.

Background of our choices: docs/decisions/0051.
"""

from __future__ import annotations

import math
import struct
from dataclasses import replace
from functools import cache

from taxel.recordings.cdr import CDR_HEAD
from taxel.recordings.messages import definition, message_record, wall_ns_of
from taxel.signals import Frame

FRAME_SCHEMA_NAME = "sensor_msgs/msg/CompressedImage"
FRAME_SCHEMA = definition(
    """\
std_msgs/Header header  # stamp: when it was taken; frame_id: the camera's name
string format           # jpeg or png
uint8[] data            # the image as it came, never coded again
""",
    ("std_msgs/Header", "builtin_interfaces/Time stamp\nstring frame_id\n"),
    ("builtin_interfaces/Time", "int32 sec\nuint32 nanosec\n"),
)
TIMES_SCHEMA_NAME = "taxel_msgs/msg/FrameTimes"
TIMES_SCHEMA = b"""\
# The exact times of the image with the same sequence number. Written by taxel.
float64 fitted_s   # best estimate of when it was taken, host monotonic, seconds
float64 device_s   # the device's clock, seconds since its boot; NaN where it has none
float64 arrival_s  # when it arrived, host monotonic, seconds
int64 counter      # the device's frame counter; -1 where it has none
"""
FRAME_CHANNEL = 3
"""MCAP channel of the first camera's images; the other cameras' follow, then all their times."""

_PNG = b"\x89PNG"
_STAMP = struct.Struct("<iI")
_LENGTH = struct.Struct("<I")
_TIMES = struct.Struct("<dddq")
"""Fitted, device and arrival time, seconds, and counter."""


def frame_topic(camera_name: str) -> str:
    """Return the topic on which a camera's frames are recorded."""
    return f"/camera/{camera_name}"


def times_topic(camera_name: str) -> str:
    """Return the topic on which the exact times of a camera's frames are recorded."""
    return f"{frame_topic(camera_name)}/times"


def check_times(frame: Frame, wall_anchor_ns: int) -> None:
    """Refuse a frame whose times and counter could not be written.

    Args:
        frame: Its fitted time must be finite.
        wall_anchor_ns: Wall time at monotonic zero, nanoseconds.

    Raises:
        struct.error: A time is no number, the counter no whole one of 64 bits, it was taken after
            2038, when ROS 2's seconds end, or arrived after 2554, when MCAP's nanoseconds end.
    """
    _pack_times(frame)
    encode_frame(replace(frame, jpeg=b""), "", 1, 0, wall_anchor_ns)


def _pack_times(frame: Frame) -> bytes:
    """Return a frame's exact times and its counter, as they are recorded."""
    return _TIMES.pack(frame.fitted_s, frame.device_s, frame.arrival_s, frame.counter)


def encode_frame(
    frame: Frame, name: str, cameras: int, sequence: int, wall_anchor_ns: int
) -> tuple[int, bytes, bytes]:
    """Return a frame's log time (ns), and the MCAP message records of its image and its times.

    Args:
        frame: Its fitted time must be finite.
        name: The camera's.
        cameras: How many the recording has.
        sequence: Number of this camera's frame in the recording, from 0.
        wall_anchor_ns: Wall time at monotonic zero, nanoseconds.
    """
    arrival_s = frame.arrival_s if math.isfinite(frame.arrival_s) else frame.fitted_s
    publish_ns = wall_ns_of(arrival_s, wall_anchor_ns)
    channel = FRAME_CHANNEL + frame.camera
    log_ns, body = image_message(frame, name, wall_anchor_ns)
    image = message_record(channel, sequence, log_ns, publish_ns, *body)
    exact = _pack_times(frame)
    times = message_record(channel + cameras, sequence, log_ns, publish_ns, CDR_HEAD, exact)
    return log_ns, image, times


def image_message(frame: Frame, name: str, wall_anchor_ns: int) -> tuple[int, tuple[bytes, ...]]:
    """Return a frame's log time (ns) and its CompressedImage in CDR, in pieces.

    Args:
        frame: Its fitted time must be finite.
        name: The camera's.
        wall_anchor_ns: Wall time at monotonic zero, nanoseconds.
    """
    log_ns = wall_ns_of(frame.fitted_s, wall_anchor_ns)
    stamp = _STAMP.pack(log_ns // 10**9, log_ns % 10**9)
    same = _identity(name, "png" if frame.jpeg.startswith(_PNG) else "jpeg")
    return log_ns, (CDR_HEAD, stamp, same, _LENGTH.pack(len(frame.jpeg)), frame.jpeg)


def decode_image(body: bytes) -> bytes:
    """Return the image that a message of a camera's channel holds.

    Args:
        body: The message's own bytes, without MCAP's head.

    Raises:
        ValueError: It is not laid out as FORMAT.md says.
    """
    at = len(CDR_HEAD) + _STAMP.size
    try:
        for _ in range(2):  # frame_id and format
            at = _next_four(at + _LENGTH.size + _LENGTH.unpack_from(body, at)[0])
        (size,) = _LENGTH.unpack_from(body, at)
    except struct.error as error:
        raise ValueError(f"a frame is not laid out as taxel's: {error}") from error
    image = bytes(body[at + _LENGTH.size : at + _LENGTH.size + size])
    if body[:4] != CDR_HEAD or len(image) != size:
        raise ValueError("a frame is not laid out as taxel's")
    return image


def decode_times(body: bytes) -> tuple[float, float, float, int]:
    """Return fitted, device and arrival time (seconds) and counter of a frame.

    Raises:
        ValueError: It is not laid out as FORMAT.md says.
    """
    if body[:4] != CDR_HEAD or len(body) != len(CDR_HEAD) + _TIMES.size:
        raise ValueError("the times of a frame are not laid out as taxel's")
    fitted_s, device_s, arrival_s, counter = _TIMES.unpack_from(body, len(CDR_HEAD))
    return fitted_s, device_s, arrival_s, counter


@cache
def _identity(name: str, form: str) -> bytes:
    """Return frame_id and format, the same for every image of a camera."""
    parts = b""
    for text in (name.encode() + b"\0", form.encode() + b"\0"):
        parts += _LENGTH.pack(len(text)) + text
        parts += b"\0" * (-len(parts) % 4)
    return parts


def _next_four(at: int) -> int:
    """Return the next multiple of four: CDR aligns after its own head of four bytes."""
    return -(-at // 4) * 4
