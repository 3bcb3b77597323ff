"""How the slip that a monitor measured is laid out in a recording, as FORMAT.md says.

Knows nothing about files, monitors or how slip is measured.
"""

from __future__ import annotations

import json

import numpy as np

from taxel.recordings.frame_layout import FRAME_CHANNEL
from taxel.recordings.mcap_file import RECORD_HEAD
from taxel.recordings.scan_layout import MESSAGE_HEAD, MESSAGE_OPCODE, wall_ns
from taxel.signals import SlipNote

SLIP_TOPIC = "/slip"
SLIP_SCHEMA_NAME = "taxel.Slip"
_NUMBERS = ("slip_mm", "slip_sd_mm", "slip_rate_mm_s", "slip_rate_sd_mm_s", "slip_compliance",
            "slip_compliance_sd")  # fmt: skip
SLIP_SCHEMA = json.dumps(
    {
        "type": "object",
        "properties": {
            "time_s": {"type": "number"},
            "who": {"type": "string"},
            **{name: {"type": ["number", "null"]} for name in _NUMBERS},
            "slip_seen": {"type": "boolean"},
        },
    }
).encode()


def slip_channel(cameras: int) -> int:
    """Return the channel's number in a recording of so many cameras: it follows theirs."""
    return FRAME_CHANNEL + cameras


def encode_slip(
    note: SlipNote, sequence: int, cameras: int, wall_anchor_ns: int
) -> tuple[int, bytes]:
    """Return a note's log time (ns) and its MCAP message record."""
    text = json.dumps({"time_s": note.time_s, "who": note.who, **note.values}).encode()
    log_ns = int(wall_ns(np.array([note.time_s]), wall_anchor_ns)[0])
    head = RECORD_HEAD.pack(MESSAGE_OPCODE, MESSAGE_HEAD.size + len(text))
    message = MESSAGE_HEAD.pack(slip_channel(cameras), sequence % 2**32, log_ns, log_ns)
    return log_ns, head + message + text


def decode_slip(body: bytes) -> SlipNote:
    """Return what `encode_slip` wrote.

    Raises:
        ValueError: It is no JSON, or lacks a field.
    """
    values = json.loads(body)
    try:
        return SlipNote(time_s=float(values.pop("time_s")), who=str(values.pop("who")),
                        values=values)  # fmt: skip
    except (KeyError, TypeError, AttributeError) as error:
        raise ValueError(f"a slip message without {error}") from error
