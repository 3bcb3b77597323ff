"""The MCAP message record around each message, the same for all kinds.

Knows nothing about what messages hold.
"""

from __future__ import annotations

import struct

import numpy as np
from numpy.typing import NDArray

from taxel.recordings.mcap_file import RECORD_HEAD

MESSAGE_OPCODE = 0x05
MESSAGE_HEAD = struct.Struct("<HIQQ")
"""Channel, sequence, log time and publish time (ns), before every message's own bytes."""
SEPARATOR = "=" * 80
"""Between the definitions of a `ros2msg` schema. Source: MCAP's registry, ROS 2."""


def message_record(
    channel: int, sequence: int, log_ns: int, publish_ns: int, *body: bytes
) -> bytes:
    """Return a message as MCAP's record.

    Args:
        channel: Its number.
        sequence: Number of the message within its channel, from 0; kept modulo 2³².
        log_ns: When it was taken, wall nanoseconds.
        publish_ns: When it arrived, wall nanoseconds.
        body: The message's own bytes, in pieces.
    """
    size = MESSAGE_HEAD.size + sum(map(len, body))
    stamps = MESSAGE_HEAD.pack(channel, sequence & 0xFFFFFFFF, log_ns, publish_ns)
    return b"".join((RECORD_HEAD.pack(MESSAGE_OPCODE, size), stamps, *body))


def wall_ns(time_s: NDArray[np.float64], wall_anchor_ns: int) -> NDArray[np.int64]:
    """Return wall nanoseconds, shape (n,); MCAP knows no time before 1970, so earlier becomes 0.

    Args:
        time_s: Shape (n,), on the recording's fitted clock, seconds.
        wall_anchor_ns: Wall time of that clock's zero, nanoseconds since 1970.
    """
    return np.maximum(np.rint(time_s * 1e9).astype(np.int64) + wall_anchor_ns, 0)


def wall_ns_of(time_s: float, wall_anchor_ns: int) -> int:
    """Return wall nanoseconds of a single moment."""
    return max(round(time_s * 1e9) + wall_anchor_ns, 0)


def definition(own: str, *parts: tuple[str, str]) -> bytes:
    """Return a `ros2msg` schema.

    Args:
        own: The message's own lines.
        parts: Name (package/Type) and lines of each type that it uses.
    """
    text = own
    for name, lines in parts:
        text += f"{SEPARATOR}\nMSG: {name}\n{lines}"
    return text.encode()
