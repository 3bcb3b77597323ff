"""Frames on the wire: COBS, a check over what is sent, a zero byte as the end.

    frame = COBS(payload) ‖ check (3 bytes, none of them zero) ‖ 0x00

The check is CRC-16 of the *encoded* bytes, so that damage to one of COBS's own
length bytes, which moves zeros about in the payload, is damage like any other: every burst
of up to 16 bits is found, most significant bit first. Its 16 bits travel as 7 + 7 + 2 bits under
a leading one, so that none of its bytes is zero. Knows nothing about messages or ports.

Source: protocol/SPEC.md, docs/decisions/0014.
"""

from __future__ import annotations

from binascii import crc_hqx
from dataclasses import dataclass, fields

from cobs import cobs

from taxel.errors import BadInput

DELIMITER = b"\x00"
"""Ends each frame, and stands nowhere else."""
LONGEST_PAYLOAD = 240
"""Bytes of a payload: with its frame it fits a buffer of 256 bytes on a microcontroller.
Source: our choice, docs/decisions/0014."""
_CHECK = 3
LONGEST_FRAME = LONGEST_PAYLOAD + 1 + _CHECK
"""Bytes of a frame without its delimiter."""
_SHORTEST_FRAME = 2 + _CHECK
"""One byte of payload, its COBS length byte and the check."""


def check_of(encoded: bytes) -> bytes:
    """Return the three check bytes that follow these encoded bytes."""
    crc = crc_hqx(encoded, 0xFFFF)
    return bytes((0x80 | crc >> 9, 0x80 | (crc >> 2) & 0x7F, 0x80 | (crc & 3) << 5))


def frame_of(payload: bytes) -> bytes:
    """Return a payload as a frame, its delimiter included.

    Raises:
        BadInput: The payload is empty or longer than `LONGEST_PAYLOAD` bytes.
    """
    if not 0 < len(payload) <= LONGEST_PAYLOAD:
        raise BadInput(
            f"a payload of 1 to {LONGEST_PAYLOAD} bytes", f"{len(payload)} bytes", "send less"
        )
    encoded: bytes = cobs.encode(payload)
    return encoded + check_of(encoded) + DELIMITER


@dataclass(slots=True, kw_only=True)
class BadFrames:
    """How many frames were thrown away, by reason. Two delimiters in a row are no frame."""

    short: int = 0
    """Fewer bytes than the smallest frame."""
    long: int = 0
    """More bytes than the largest frame before a delimiter came."""
    check: int = 0
    """The check does not fit the bytes."""
    cobs: int = 0
    """The check fits and the bytes are no COBS: a faulty sender."""
    message: int = 0
    """A sound frame that is no message of this protocol; counted by whoever unpacks it."""

    @property
    def total(self) -> int:
        """All of them."""
        return sum(self.by_reason().values())

    def by_reason(self) -> dict[str, int]:
        """Return reason → count."""
        return {field.name: int(getattr(self, field.name)) for field in fields(self)}


class FrameDecoder:
    """Cut a stream of bytes into payloads, whatever the bytes and however they come in pieces.

    Never raises, keeps at most `LONGEST_FRAME` bytes, and gives nothing whose check fails.
    After damage it is in step again at the next delimiter. What comes before the first
    delimiter may be the end of a frame: it is judged, and counted as bad where it fails.
    """

    def __init__(self) -> None:
        self.bad = BadFrames()
        self._kept = b""
        self._skipping = False

    def feed(self, data: bytes) -> list[bytes]:
        """Take in bytes as they came; return the payloads that they complete, oldest first."""
        *ended, rest = (self._kept + data).split(DELIMITER)
        if self._skipping and ended:
            self._skipping = False  # counted when it grew too long
            ended = ended[1:]
        payloads = []
        for frame in ended:
            payload = self._payload(frame) if frame else None
            if payload is not None:
                payloads.append(payload)
        if self._skipping:
            rest = b""
        elif len(rest) > LONGEST_FRAME:
            self.bad.long += 1
            self._skipping, rest = True, b""
        self._kept = rest
        return payloads

    def _payload(self, frame: bytes) -> bytes | None:
        if len(frame) < _SHORTEST_FRAME:
            self.bad.short += 1
            return None
        if len(frame) > LONGEST_FRAME:
            self.bad.long += 1
            return None
        encoded = frame[:-_CHECK]
        crc = crc_hqx(encoded, 0xFFFF)
        if (  # check_of, written out: this is the hot path
            frame[-3] != 0x80 | crc >> 9
            or frame[-2] != 0x80 | (crc >> 2) & 0x7F
            or frame[-1] != 0x80 | (crc & 3) << 5
        ):
            self.bad.check += 1
            return None
        try:
            payload: bytes = cobs.decode(encoded)
        except cobs.DecodeError:
            self.bad.cobs += 1
            return None
        return payload
