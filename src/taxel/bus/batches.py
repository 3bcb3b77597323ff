"""What a message on the bus is: its key, its bytes, and the head that shows losses.

    key         taxel/STATION/touch/teng, …/camera/left, …/slip, …/state …
    attachment  number u64 · lost u64 · sent f64, little endian: how many messages went out under
                this key before, how many the publisher had to let go, host monotonic seconds
    payload     scans and frames as the tables below, everything else JSON

    scans   "S" u8 · 3 bytes · n u32 · channels u32 · counter i64[n] · device_s f64[n] ·
            arrival_s f64[n] · fitted_s f64[n] · values f32[n, channels] ·
            validity u8[n, channels]
    frame   "F" u8 · 1 byte · camera u16 · 4 bytes · counter i64 · device_s f64 · arrival_s f64 ·
            fitted_s f64 · the image

Little endian throughout; n are the scans of one batch, oldest first. These are the bytes of a
station's own rings (`taxel.live.station.packets`). Knows nothing about Zenoh.

Background of our choices: docs/decisions/0052.
"""

from __future__ import annotations

import json
import re
import struct
import zlib
from dataclasses import dataclass
from typing import Any

from taxel.live.station.packets import Packet, pack, unpack
from taxel.plain_text import finite
from taxel.signals import Frame, Samples

BATCH_S = 0.010
"""Time between two batches, seconds. Source: measured, docs/decisions/0052: a
third of the processor time of single scans, and 10 ms at most added."""
SCANS, FRAME, JSON = "taxel/scans", "taxel/frame", "application/json"
"""What a payload is, as Zenoh's encoding says it."""
_HEAD = struct.Struct("<QQd")
_PLAIN = re.compile(r"[^A-Za-z0-9_./-]")
LARGEST = 1 << 24
"""Bytes of the largest payload that is read: one image of `jpeg_head.LARGEST_PX`. Our choice."""


@dataclass(frozen=True, slots=True)
class Head:
    """What stands beside a payload."""

    number: int
    """Messages that went out under this key before."""
    lost: int
    """Ring messages that the publisher had to let go, since it began."""
    sent_s: float
    """When it was sent, the publisher's monotonic clock, seconds."""

    def pack(self) -> bytes:
        """Return the attachment's bytes."""
        return _HEAD.pack(self.number, self.lost, self.sent_s)

    @staticmethod
    def unpack(content: bytes) -> Head:
        """Return what an attachment says.

        Raises:
            ValueError: It is none.
        """
        try:
            return Head(*_HEAD.unpack(content))
        except struct.error as error:
            raise ValueError(f"needed {_HEAD.size} bytes of head; got {len(content)}") from error


def key_of(station: str, topic: str) -> str:
    """Return the key under which a topic is published.

    A name with characters that no key may hold has them replaced, and a check sum added, so that
    two names stay two.
    """
    plain = _PLAIN.sub("_", topic)
    if plain != topic:
        plain += f"-{zlib.crc32(topic.encode('utf-8', 'surrogatepass')):08x}"
    return f"taxel/{station}{plain}"


def encode(value: Samples | Frame | dict[str, Any]) -> tuple[str, bytes]:
    """Return what a payload is, and its bytes."""
    if isinstance(value, Samples):
        return SCANS, pack(value)
    if isinstance(value, Frame):
        return FRAME, pack(value)
    return JSON, json_bytes(value)


def decode(kind: str, payload: bytes) -> Packet:
    """Return the value of a payload.

    Raises:
        ValueError: The bytes are none.
    """
    if len(payload) > LARGEST:
        raise ValueError(f"needed at most {LARGEST} bytes; got {len(payload)}")
    if kind == JSON:
        value = json.loads(payload)
        if not isinstance(value, dict):
            raise ValueError("needed a JSON object")
        return value
    value = unpack(payload)
    if not isinstance(value, Samples if kind == SCANS else Frame):
        raise ValueError(f"needed {kind}; got another packet")
    return value


def json_bytes(value: dict[str, Any]) -> bytes:
    """Return a value as JSON; a number that is not finite becomes null."""
    try:
        return json.dumps(value, allow_nan=False, separators=(",", ":")).encode()
    except ValueError:
        return json.dumps(finite(value), allow_nan=False, separators=(",", ":")).encode()
