"""How marks lie in a recording: CDR, labels and groups as key and value. FORMAT.md has the fields.

Knows nothing about files, chunks or threads.
"""

from __future__ import annotations

from taxel.recordings.cdr import CdrReader, CdrWriter
from taxel.recordings.messages import definition, message_record, wall_ns_of
from taxel.recordings.scan_layout import FURTHEST_S
from taxel.signals import Mark

MARK_TOPIC = "/marks"
MARK_CHANNEL = 2
"""MCAP channel of the marks, the same in every recording."""
MARK_SCHEMA_NAME = "taxel_msgs/msg/Mark"
MARK_SCHEMA = definition(
    """\
# A labelled stretch of time. Written by taxel.
float64 start_s                      # first moment, on the scans' fitted clock, seconds
float64 end_s                        # last moment, same clock
diagnostic_msgs/KeyValue[] labels    # what may be learned
diagnostic_msgs/KeyValue[] groups    # what must not be split
""",
    ("diagnostic_msgs/KeyValue", "string key\nstring value\n"),
)


def encode_mark(mark: Mark, sequence: int, wall_anchor_ns: int) -> tuple[int, bytes]:
    """Return a mark's log time (of its start, ns) and its MCAP message record."""
    body = CdrWriter()
    body.float64(mark.start_s)
    body.float64(mark.end_s)
    body.pairs(mark.labels)
    body.pairs(mark.groups)
    log_ns = wall_ns_of(mark.start_s, wall_anchor_ns)
    return log_ns, message_record(MARK_CHANNEL, sequence, log_ns, log_ns, body.content)


def decode_mark(content: bytes) -> Mark:
    """Return the mark that a message holds.

    Raises:
        ValueError: It is not laid out as FORMAT.md says.
    """
    body = CdrReader(content)
    start_s, end_s = body.float64(), body.float64()
    if not max(abs(start_s), abs(end_s)) <= FURTHEST_S:
        raise ValueError("a mark has a time that no clock shows")
    return Mark(start_s=start_s, end_s=end_s, labels=body.pairs(), groups=body.pairs())
