"""Read the messages of recording format 1, which taxel wrote before; nothing writes it any more.

Scans had the lengths of their two lists before them; marks and slip were JSON; a frame's exact
times were 64 hexadecimal digits in its frame_id. Knows nothing about files or check sums.

Background: docs/decisions/0051.
"""

from __future__ import annotations

import json
import struct

from taxel.foreign.json_text import Fields, parse_json
from taxel.recordings.cdr import CDR_HEAD
from taxel.recordings.frame_layout import FRAME_CHANNEL
from taxel.recordings.scan_layout import FURTHEST_S
from taxel.signals import Frame, Mark, SlipNote

_STAMP = struct.Struct("<iII")
"""Seconds, nanoseconds, and the length of frame_id."""
_TIMES = struct.Struct(">qddd")
"""Counter, device, arrival and fitted time."""


def slip_channel(cameras: int) -> int:
    """Return the channel of slip in a recording of so many cameras."""
    return FRAME_CHANNEL + cameras


def decode_mark(text: bytes) -> Mark:
    """Return the mark that a message holds.

    Raises:
        ValueError: It is not laid out as format 1 says.
    """
    fields = Fields(parse_json(text), "a mark")
    return Mark(
        start_s=fields.number("start_s", -FURTHEST_S, FURTHEST_S),
        end_s=fields.number("end_s", -FURTHEST_S, FURTHEST_S),
        labels=fields.pairs("labels"),
        groups=fields.pairs("groups"),
    )


def decode_frame(channel: int, body: bytes) -> Frame:
    """Return the frame that a message of a camera's channel holds.

    Args:
        channel: The message's channel, `FRAME_CHANNEL` or above.
        body: The message's own bytes, without MCAP's head.

    Raises:
        ValueError: It is not laid out as format 1 says.
    """
    try:
        _, _, length = _STAMP.unpack_from(body, len(CDR_HEAD))
        start = len(CDR_HEAD) + _STAMP.size
        identity = body[start : start + length - 1]
        counter, device_s, arrival_s, fitted_s = _TIMES.unpack(bytes.fromhex(identity.decode()))
        at = -(-(start + length) // 4) * 4
        (size,) = struct.unpack_from("<I", body, at)
    except (struct.error, UnicodeDecodeError) as error:
        raise ValueError(f"a frame is not laid out as taxel's: {error}") from error
    jpeg = bytes(body[at + 4 : at + 4 + size])
    if body[:4] != CDR_HEAD or len(jpeg) != size:
        raise ValueError("a frame is not laid out as taxel's")
    return Frame(
        camera=channel - FRAME_CHANNEL,
        jpeg=jpeg,
        counter=counter,
        device_s=device_s,
        arrival_s=arrival_s,
        fitted_s=fitted_s,
    )


def decode_slip(body: bytes) -> SlipNote:
    """Return the slip that a message holds.

    Raises:
        ValueError: It is no JSON, or lacks a field.
    """
    values = json.loads(body)
    try:
        return SlipNote(time_s=float(values.pop("time_s")), who=str(values.pop("who")),
                        values=values)  # fmt: skip
    except (KeyError, TypeError, AttributeError) as error:
        raise ValueError(f"a slip message without {error}") from error
