"""How the slip that a monitor measured is laid out in a recording, as FORMAT.md says.

Knows nothing about files, monitors or how slip is measured.
"""

from __future__ import annotations

import math

from taxel.recordings.cdr import CdrReader, CdrWriter
from taxel.recordings.frame_layout import FRAME_CHANNEL
from taxel.recordings.messages import message_record, wall_ns_of
from taxel.signals import SlipNote

SLIP_TOPIC = "/slip"
SLIP_SCHEMA_NAME = "taxel_msgs/msg/Slip"
_NUMBERS = ("slip_mm", "slip_sd_mm", "slip_rate_mm_s", "slip_rate_sd_mm_s", "slip_compliance",
            "slip_compliance_sd")  # fmt: skip
SLIP_SCHEMA = "".join(
    [
        "# The slip that a monitor measured live. Written by taxel; no label.\n",
        "float64 time_s  # the newest frame behind it, on the frames' fitted clock, seconds\n",
        *(f"float64 {name}  # NaN where unknown\n" for name in _NUMBERS),
        "bool slip_seen\n",
        "string who  # which monitor\n",
    ]
).encode()


def slip_channel(cameras: int) -> int:
    """Return the channel's number in a recording of so many cameras: it follows theirs."""
    return FRAME_CHANNEL + 2 * cameras


def encode_slip(
    note: SlipNote, sequence: int, cameras: int, wall_anchor_ns: int
) -> tuple[int, bytes]:
    """Return a note's log time (ns) and its MCAP message record."""
    body = CdrWriter()
    body.float64(note.time_s)
    for name in _NUMBERS:
        value = note.values.get(name)
        body.float64(math.nan if value is None else float(value))
    body.flag(bool(note.values.get("slip_seen")))
    body.text(note.who)
    log_ns = wall_ns_of(note.time_s, wall_anchor_ns)
    record = message_record(slip_channel(cameras), sequence, log_ns, log_ns, body.content)
    return log_ns, record


def decode_slip(content: bytes) -> SlipNote:
    """Return what `encode_slip` wrote; a number that is not finite is None.

    Raises:
        ValueError: It is not laid out as FORMAT.md says.
    """
    body = CdrReader(content)
    time_s = body.float64()
    numbers = {name: body.float64() for name in _NUMBERS}
    values: dict[str, float | bool | None] = {
        name: value if math.isfinite(value) else None for name, value in numbers.items()
    }
    values["slip_seen"] = body.flag()
    return SlipNote(time_s=time_s, who=body.text(), values=values)
