"""How camera frames lie in a recording: Foxglove's CompressedImage as ROS 2 CDR.

Foxglove, Lichtblick and Rerun show them without taxel. A frame comes back as it
was: its counter, its three times and its bytes. FORMAT.md has the byte table.
Knows nothing about files, chunks or threads.
"""

from __future__ import annotations

import math
import struct

from taxel.recordings.mcap_file import RECORD_HEAD
from taxel.recordings.scan_layout import CDR_LITTLE_ENDIAN, MESSAGE_HEAD, MESSAGE_OPCODE
from taxel.signals import Frame

FRAME_SCHEMA_NAME = "foxglove_msgs/msg/CompressedImage"
FRAME_SCHEMA = b"""\
builtin_interfaces/Time timestamp  # when it was taken
string frame_id                    # the other times: see taxel's FORMAT.md
uint8[] data                       # the image as its format says
string format                      # jpeg
================================================================================
MSG: builtin_interfaces/Time
int32 sec
uint32 nanosec
"""
FRAME_CHANNEL = 3
"""MCAP channel of the first camera; the next follow."""

_CDR = struct.pack("<I", CDR_LITTLE_ENDIAN)
_FORMAT = struct.pack("<I", 5) + b"jpeg\0"
_STAMP = struct.Struct("<iII")
"""Seconds, nanoseconds, and the length of frame_id."""
_TIMES = struct.Struct(">qddd")
"""Counter, device, arrival and fitted time, written in frame_id as 64 hexadecimal digits."""


def frame_topic(camera_name: str) -> str:
    """Return the topic on which a camera's frames are recorded."""
    return f"/camera/{camera_name}"


def encode_frame(frame: Frame, sequence: int, wall_anchor_ns: int) -> tuple[int, bytes]:
    """Return a frame's log time (ns) and its MCAP message record.

    Args:
        frame: Its fitted time must be finite.
        sequence: Number of this camera's frame in the recording, from 0.
        wall_anchor_ns: Wall time at monotonic zero, nanoseconds.
    """
    log_ns = _wall_ns(frame.fitted_s, wall_anchor_ns)
    arrival_s = frame.arrival_s if math.isfinite(frame.arrival_s) else frame.fitted_s
    times = _TIMES.pack(frame.counter, frame.device_s, frame.arrival_s, frame.fitted_s).hex()
    identity = times.encode() + b"\0"
    body = _CDR + _STAMP.pack(log_ns // 10**9, log_ns % 10**9, len(identity)) + identity
    body = _padded(body) + struct.pack("<I", len(frame.jpeg)) + frame.jpeg
    body = _padded(body) + _FORMAT
    head = RECORD_HEAD.pack(MESSAGE_OPCODE, MESSAGE_HEAD.size + len(body))
    stamps = MESSAGE_HEAD.pack(
        FRAME_CHANNEL + frame.camera,
        sequence & 0xFFFFFFFF,
        log_ns,
        _wall_ns(arrival_s, wall_anchor_ns),
    )
    return log_ns, head + stamps + body


def decode_frame(channel: int, body: bytes) -> Frame:
    """Return the frame that a message of a camera's channel holds.

    Args:
        channel: The message's channel, `FRAME_CHANNEL` or above.
        body: The message's own bytes, without MCAP's head.

    Raises:
        ValueError: It is not laid out as FORMAT.md says.
    """
    try:
        _, _, length = _STAMP.unpack_from(body, len(_CDR))
        start = len(_CDR) + _STAMP.size
        identity = body[start : start + length - 1]
        counter, device_s, arrival_s, fitted_s = _TIMES.unpack(bytes.fromhex(identity.decode()))
        at = _next_four(start + length)
        (size,) = struct.unpack_from("<I", body, at)
    except (struct.error, UnicodeDecodeError) as error:
        raise ValueError(f"a frame is not laid out as taxel's: {error}") from error
    jpeg = bytes(body[at + 4 : at + 4 + size])
    if body[:4] != _CDR or len(jpeg) != size:
        raise ValueError("a frame is not laid out as taxel's")
    return Frame(
        camera=channel - FRAME_CHANNEL,
        jpeg=jpeg,
        counter=counter,
        device_s=device_s,
        arrival_s=arrival_s,
        fitted_s=fitted_s,
    )


def _padded(body: bytes) -> bytes:
    return body + b"\0" * (_next_four(len(body)) - len(body))


def _next_four(at: int) -> int:
    """Return the next multiple of four: CDR aligns after its own head of four bytes."""
    return -(-at // 4) * 4


def _wall_ns(time_s: float, wall_anchor_ns: int) -> int:
    return max(round(time_s * 1e9) + wall_anchor_ns, 0)
