"""What travels through the rings: scans, frames, marks and notes, as bytes.

One byte says the kind, fixed fields follow; nothing is pickled. Knows nothing about rings.
"""

from __future__ import annotations

import json
import struct
from collections.abc import Iterable
from dataclasses import asdict
from typing import Any, TypeGuard

import numpy as np
from numpy.typing import NDArray

from taxel.live import frame_loop
from taxel.plain_text import number_of
from taxel.signals import Frame, Mark, Samples

_SCANS = struct.Struct("<BxxxII")
_FRAME = struct.Struct("<BxHxxxxqddd")
_KIND_SCANS, _KIND_FRAME, _KIND_MARK, _KIND_NOTE = b"SFMN"

Packet = Samples | Frame | Mark | dict[str, Any]
"""A dict is a note: what a process sends another, as JSON."""


def pack(value: Packet) -> bytes:
    """Return a value as the bytes of one message."""
    if isinstance(value, Frame):
        head = _FRAME.pack(
            _KIND_FRAME,
            value.camera,
            value.counter,
            value.device_s,
            value.arrival_s,
            value.fitted_s,
        )
        return head + value.jpeg
    if isinstance(value, Samples):
        n, channels = value.values.shape
        parts = (value.counter, value.device_s, value.arrival_s, value.fitted_s, value.values,
                 value.validity)  # fmt: skip
        head = _SCANS.pack(_KIND_SCANS, n, channels)
        return b"".join([head, *(np.ascontiguousarray(part).tobytes() for part in parts)])
    if isinstance(value, Mark):
        return bytes([_KIND_MARK]) + json.dumps(asdict(value)).encode()
    return bytes([_KIND_NOTE]) + json.dumps(value).encode()


def unpack(content: bytes) -> Packet:
    """Return the value of one message.

    Raises:
        ValueError: The bytes are none.
    """
    try:
        return _unpack(content)
    except (
        struct.error, IndexError, TypeError, KeyError, OverflowError, RecursionError
    ) as error:  # fmt: skip
        raise ValueError(
            f"needed a packet; got {number_of(len(content), 'byte')} without one"
        ) from error


def notes_of(contents: Iterable[bytes]) -> list[dict[str, Any]]:
    """Return the notes among several messages.

    Raises:
        ValueError: The bytes of one are no packet.
    """
    return [note for note in map(unpack, contents) if isinstance(note, dict)]


def ends_grasp(packet: Packet) -> TypeGuard[Mark]:
    """True for a mark that holds a grasp's outcome; a hand's marks in the same file do not."""
    return isinstance(packet, Mark) and frame_loop.ends_grasp(packet)


def asks(packet: Packet, what: str) -> TypeGuard[dict[str, Any]]:
    """True for a note that orders this to be done."""
    return isinstance(packet, dict) and packet.get("do") == what


def _unpack(content: bytes) -> Packet:
    kind = content[0]
    if kind == _KIND_FRAME:
        _, camera, counter, device_s, arrival_s, fitted_s = _FRAME.unpack_from(content)
        return Frame(
            camera=camera, jpeg=content[_FRAME.size :], counter=counter, device_s=device_s,
            arrival_s=arrival_s, fitted_s=fitted_s,
        )  # fmt: skip
    if kind == _KIND_SCANS:
        return _scans(content)
    if kind == _KIND_MARK:
        return Mark(**json.loads(content[1:]))
    found: dict[str, Any] = json.loads(content[1:])
    return found


def _scans(content: bytes) -> Samples:
    _, n, channels = _SCANS.unpack_from(content)
    at = _SCANS.size

    def column(dtype: type, width: int = 0) -> Any:
        nonlocal at
        count = n * (width or 1)
        part: NDArray[Any] = np.frombuffer(content, dtype, count, at)
        at += part.nbytes
        return part.reshape(n, width) if width else part

    counter = column(np.int64)
    device_s, arrival_s, fitted_s = column(np.float64), column(np.float64), column(np.float64)
    return Samples(
        counter=counter, device_s=device_s, arrival_s=arrival_s, fitted_s=fitted_s,
        values=column(np.float32, channels), validity=column(np.uint8, channels),
    )  # fmt: skip
