"""The part of the kernel's V4L2 interface that capturing needs: structures and request numbers.

Layouts follow the kernel's public header linux/videodev2.h, whose BSD-3-Clause choice allows it;
tests compare sizes, offsets and numbers with a C compiler's (docs/decisions/0015). Knows nothing
about files or cameras.
"""

from __future__ import annotations

import ctypes
from ctypes import (
    Structure,
    Union,
    c_char,
    c_int32,
    c_long,
    c_uint8,
    c_uint32,
    c_ulong,
    c_void_p,
    sizeof,
)

VIDEO_CAPTURE = 1
"""Buffer type: images from a camera."""
MMAP = 1
"""Memory: the driver's buffers, mapped."""
FIELD_ANY = 0
DISCRETE = 1
"""Sizes and intervals that are listed one by one."""
CAN_CAPTURE, CAN_STREAM, HAS_DEVICE_CAPS = 0x1, 0x04000000, 0x80000000
"""Bits of `Capability.capabilities`."""
CAN_SET_RATE = 0x1000
"""Bit of `CaptureParm.capability`."""
BUFFER_ERROR = 0x40
"""The driver says that the data may be damaged."""
STAMP_MASK, STAMP_MONOTONIC = 0xE000, 0x2000


def four_cc(code: str) -> int:
    """Return a pixel format's number, as of "MJPG"."""
    return int.from_bytes(code.encode("ascii"), "little")


def four_letters(number: int) -> str:
    """Return a pixel format's four letters."""
    return number.to_bytes(4, "little").decode("ascii", "replace").strip("\0")


MJPG, JPEG = four_cc("MJPG"), four_cc("JPEG")


class Capability(Structure):
    """struct v4l2_capability: who the device is and what it can do."""

    _fields_ = [
        ("driver", c_char * 16),
        ("card", c_char * 32),
        ("bus_info", c_char * 32),
        ("version", c_uint32),
        ("capabilities", c_uint32),
        ("device_caps", c_uint32),
        ("reserved", c_uint32 * 3),
    ]


class FormatDescription(Structure):
    """struct v4l2_fmtdesc: one pixel format that the device offers."""

    _fields_ = [
        ("index", c_uint32),
        ("type", c_uint32),
        ("flags", c_uint32),
        ("description", c_char * 32),
        ("pixelformat", c_uint32),
        ("mbus_code", c_uint32),
        ("reserved", c_uint32 * 3),
    ]


class PixFormat(Structure):
    """struct v4l2_pix_format: size and coding of an image."""

    _fields_ = [
        ("width", c_uint32),
        ("height", c_uint32),
        ("pixelformat", c_uint32),
        ("field", c_uint32),
        ("bytesperline", c_uint32),
        ("sizeimage", c_uint32),
        ("colorspace", c_uint32),
        ("priv", c_uint32),
        ("flags", c_uint32),
        ("ycbcr_enc", c_uint32),
        ("quantization", c_uint32),
        ("xfer_func", c_uint32),
    ]


class _FormatUnion(Union):
    _fields_ = [("pix", PixFormat), ("pointer", c_void_p), ("raw", c_uint8 * 200)]


class Format(Structure):
    """struct v4l2_format."""

    _fields_ = [("type", c_uint32), ("fmt", _FormatUnion)]


class Fraction(Structure):
    """struct v4l2_fract: seconds a frame, as a fraction."""

    _fields_ = [("numerator", c_uint32), ("denominator", c_uint32)]


class CaptureParm(Structure):
    """struct v4l2_captureparm."""

    _fields_ = [
        ("capability", c_uint32),
        ("capturemode", c_uint32),
        ("timeperframe", Fraction),
        ("extendedmode", c_uint32),
        ("readbuffers", c_uint32),
        ("reserved", c_uint32 * 4),
    ]


class _ParmUnion(Union):
    _fields_ = [("capture", CaptureParm), ("raw", c_uint8 * 200)]


class StreamParm(Structure):
    """struct v4l2_streamparm: the frame rate."""

    _fields_ = [("type", c_uint32), ("parm", _ParmUnion)]


class RequestBuffers(Structure):
    """struct v4l2_requestbuffers."""

    _fields_ = [
        ("count", c_uint32),
        ("type", c_uint32),
        ("memory", c_uint32),
        ("capabilities", c_uint32),
        ("flags", c_uint8),
        ("reserved", c_uint8 * 3),
    ]


class TimeValue(Structure):
    """struct timeval."""

    _fields_ = [("seconds", c_long), ("microseconds", c_long)]


class TimeCode(Structure):
    """struct v4l2_timecode; not used, but it takes its place."""

    _fields_ = [("type", c_uint32), ("flags", c_uint32), ("rest", c_uint8 * 8)]


class _Place(Union):
    _fields_ = [
        ("offset", c_uint32),
        ("userptr", c_ulong),
        ("planes", c_void_p),
        ("fd", c_int32),
    ]


class Buffer(Structure):
    """struct v4l2_buffer: one image's place, stamp and number."""

    _fields_ = [
        ("index", c_uint32),
        ("type", c_uint32),
        ("bytesused", c_uint32),
        ("flags", c_uint32),
        ("field", c_uint32),
        ("timestamp", TimeValue),
        ("timecode", TimeCode),
        ("sequence", c_uint32),
        ("memory", c_uint32),
        ("m", _Place),
        ("length", c_uint32),
        ("reserved2", c_uint32),
        ("request_fd", c_int32),
    ]


class _Steps(Structure):
    _fields_ = [
        ("min_width", c_uint32),
        ("max_width", c_uint32),
        ("step_width", c_uint32),
        ("min_height", c_uint32),
        ("max_height", c_uint32),
        ("step_height", c_uint32),
    ]


class FrameSize(Structure):
    """struct v4l2_frmsizeenum: a size that is offered; `steps` begins with width and height."""

    _fields_ = [
        ("index", c_uint32),
        ("pixel_format", c_uint32),
        ("type", c_uint32),
        ("steps", _Steps),
        ("reserved", c_uint32 * 2),
    ]


class FrameInterval(Structure):
    """struct v4l2_frmivalenum: a time a frame that is offered; `steps[0]` is the shortest."""

    _fields_ = [
        ("index", c_uint32),
        ("pixel_format", c_uint32),
        ("width", c_uint32),
        ("height", c_uint32),
        ("type", c_uint32),
        ("steps", Fraction * 3),
        ("reserved", c_uint32 * 2),
    ]


_WRITE, _READ = 1, 2


def _request(direction: int, number: int, what: type[ctypes._CData]) -> int:
    """Return an ioctl's number: direction, size, 'V' and the call's own number."""
    return direction << 30 | sizeof(what) << 16 | ord("V") << 8 | number


QUERYCAP = _request(_READ, 0, Capability)
ENUM_FMT = _request(_READ | _WRITE, 2, FormatDescription)
G_FMT = _request(_READ | _WRITE, 4, Format)
S_FMT = _request(_READ | _WRITE, 5, Format)
REQBUFS = _request(_READ | _WRITE, 8, RequestBuffers)
QUERYBUF = _request(_READ | _WRITE, 9, Buffer)
QBUF = _request(_READ | _WRITE, 15, Buffer)
DQBUF = _request(_READ | _WRITE, 17, Buffer)
STREAMON = _request(_WRITE, 18, c_int32)
STREAMOFF = _request(_WRITE, 19, c_int32)
G_PARM = _request(_READ | _WRITE, 21, StreamParm)
S_PARM = _request(_READ | _WRITE, 22, StreamParm)
ENUM_FRAMESIZES = _request(_READ | _WRITE, 74, FrameSize)
ENUM_FRAMEINTERVALS = _request(_READ | _WRITE, 75, FrameInterval)
