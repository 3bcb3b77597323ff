"""What a board that classifies says: the wire's message of type 7, packed by `decision.c`.

Knows nothing about frames, ports or what the classes mean.
"""

from __future__ import annotations

import struct
from dataclasses import dataclass
from enum import IntEnum

KIND = 7
"""The first byte of its payload."""
NO_CLASS = 255
"""In the place of a class: the board decided nothing."""
_LAYOUT = struct.Struct("<BBIIBBBI")


class Doubt(IntEnum):
    """Why a board gives no class."""

    NONE = 0
    SATURATED = 1
    """A channel stood at the converter's end for the whole window."""
    NOT_SURE = 2
    """The likeliest class is not likely enough."""


@dataclass(frozen=True, slots=True)
class BoardDecision:
    """What a window was classified as."""

    board: int
    seq: int
    """The tick of the window's last row, u32."""
    t_us: int
    """When that row's scan was due, the board's clock, microseconds, u32."""
    best: int | None
    """The class's number, as the bundle orders them; None where none is given."""
    confidence: int
    """Probability of the likeliest class, 255 for 1."""
    reason: int
    """A `Doubt`."""
    took_us: int
    """How long the network took, with what interrupted it, microseconds."""


def unpack_decision(payload: bytes) -> BoardDecision | None:
    """Return the decision that a payload holds; None where it is another message."""
    if len(payload) != _LAYOUT.size or payload[0] != KIND:
        return None
    _, board, seq, t_us, best, confidence, reason, took_us = _LAYOUT.unpack(payload)
    return BoardDecision(
        board, seq, t_us, None if best == NO_CLASS else best, confidence, reason, took_us
    )
