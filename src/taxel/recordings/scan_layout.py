"""How scans and marks lie in a recording: fixed-size messages, so that a chunk is one array.

A scan is a ROS 2 message in CDR (little endian), whose size depends only on
the number of channels. The MCAP message record around it has a fixed head,
so that a run of scans is a numpy array as it stands: no loop over messages,
neither on writing nor on reading. FORMAT.md has the byte table. Knows
nothing about files, chunks or threads.
"""

from __future__ import annotations

import json
import struct
from typing import Any

import numpy as np
from numpy.typing import NDArray

from taxel.recordings.mcap_file import RECORD_HEAD
from taxel.signals import Mark, Samples

SCAN_SCHEMA_NAME = "taxel_msgs/msg/Scan"
SCAN_SCHEMA = b"""\
# One scan of a touch array: one reading of all channels. Written by taxel.
float64 fitted_s     # best estimate of when it was taken, host monotonic, seconds
float64 device_s     # the device's clock, seconds since its boot; NaN where it has none
float64 arrival_s    # when it arrived, host monotonic, seconds
int64 counter        # the device's scan counter; -1 where it has none
float32[] values     # one a channel, in the unit that the manifest gives
uint8[] validity     # one a channel; 0 good, 1 missing, 2 stale, 4 saturated, 8 reconnecting, \
16 not finite
"""

MARK_TOPIC = "/marks"
MARK_SCHEMA_NAME = "taxel.Mark"
MARK_SCHEMA = json.dumps(
    {
        "title": "taxel.Mark",
        "description": "A labelled stretch of time, on the fitted clock of the scans.",
        "type": "object",
        "properties": {
            "start_s": {"type": "number"},
            "end_s": {"type": "number"},
            "labels": {"type": "object", "additionalProperties": {"type": "string"}},
            "groups": {"type": "object", "additionalProperties": {"type": "string"}},
        },
        "required": ["start_s", "end_s", "labels", "groups"],
    }
).encode()

SCAN_CHANNEL, MARK_CHANNEL = 1, 2
"""MCAP channel numbers, the same in every recording, so that a chunk can be read alone."""

MESSAGE_OPCODE = 0x05
MESSAGE_HEAD = struct.Struct("<HIQQ")
"""Channel, sequence, log time and publish time (ns), before every message's own bytes."""
CDR_LITTLE_ENDIAN = 0x0100
"""The CDR head 00 01 00 00, read as one little-endian u32."""


def scan_topic(sensor_name: str) -> str:
    """Return the topic on which a sensor's scans are recorded."""
    return f"/touch/{sensor_name}"


def record_dtype(channels: int) -> np.dtype[Any]:
    """Return the layout of one scan with its MCAP record head, packed.

    The CDR alignment holds by itself: the four 8-byte fields come first, and
    4-byte fields follow them.
    """
    return np.dtype(
        [
            ("opcode", "u1"),
            ("length", "<u8"),
            ("channel", "<u2"),
            ("sequence", "<u4"),
            ("log_ns", "<u8"),
            ("publish_ns", "<u8"),
            ("cdr", "<u4"),
            ("fitted_s", "<f8"),
            ("device_s", "<f8"),
            ("arrival_s", "<f8"),
            ("counter", "<i8"),
            ("n_values", "<u4"),
            ("values", "<f4", (channels,)),
            ("n_validity", "<u4"),
            ("validity", "u1", (channels,)),
        ]
    )


def encode_scans(samples: Samples, first_sequence: int, wall_anchor_ns: int) -> NDArray[np.void]:
    """Return scans as MCAP message records, shape (n,), ready to be written.

    Args:
        samples: The scans; fitted time must be finite.
        first_sequence: Number of the first scan in its recording, from 0.
        wall_anchor_ns: Wall time at monotonic zero, nanoseconds.
    """
    n, channels = samples.values.shape
    records = np.zeros(n, record_dtype(channels))
    records["opcode"] = MESSAGE_OPCODE
    records["length"] = records.dtype.itemsize - RECORD_HEAD.size
    records["channel"] = SCAN_CHANNEL
    records["sequence"] = np.arange(first_sequence, first_sequence + n) & 0xFFFFFFFF
    records["log_ns"] = _wall_ns(samples.fitted_s, wall_anchor_ns)
    arrival = np.where(np.isfinite(samples.arrival_s), samples.arrival_s, samples.fitted_s)
    records["publish_ns"] = _wall_ns(arrival, wall_anchor_ns)
    records["cdr"] = CDR_LITTLE_ENDIAN
    records["fitted_s"] = samples.fitted_s
    records["device_s"] = samples.device_s
    records["arrival_s"] = samples.arrival_s
    records["counter"] = samples.counter
    records["n_values"] = records["n_validity"] = channels
    records["values"] = samples.values
    records["validity"] = samples.validity
    return records


def decode_scans(records: NDArray[np.void]) -> Samples:
    """Return the scans of message records, as arrays of their own."""
    return Samples(
        values=np.ascontiguousarray(records["values"], np.float32),
        counter=np.ascontiguousarray(records["counter"], np.int64),
        device_s=np.ascontiguousarray(records["device_s"], np.float64),
        arrival_s=np.ascontiguousarray(records["arrival_s"], np.float64),
        fitted_s=np.ascontiguousarray(records["fitted_s"], np.float64),
        validity=np.ascontiguousarray(records["validity"], np.uint8),
    )


def encode_mark(mark: Mark, sequence: int, wall_anchor_ns: int) -> tuple[int, bytes]:
    """Return a mark's log time (of its start, ns) and its MCAP message record."""
    text = json.dumps(
        {
            "start_s": mark.start_s,
            "end_s": mark.end_s,
            "labels": dict(mark.labels),
            "groups": dict(mark.groups),
        },
        ensure_ascii=False,
    ).encode()
    log_ns = int(_wall_ns(np.array([mark.start_s]), wall_anchor_ns)[0])
    head = RECORD_HEAD.pack(MESSAGE_OPCODE, MESSAGE_HEAD.size + len(text))
    return log_ns, head + MESSAGE_HEAD.pack(MARK_CHANNEL, sequence, log_ns, log_ns) + text


def run_of_scans(content: bytes, at: int, dtype: np.dtype[Any]) -> NDArray[np.void]:
    """Return all scans that follow one another from `at`, without copying.

    Raises:
        ValueError: The first is not laid out as FORMAT.md says.
    """
    channels = dtype["values"].shape[0]
    count = (len(content) - at) // dtype.itemsize
    records = np.frombuffer(content, dtype, count, at)
    fits = (
        (records["opcode"] == MESSAGE_OPCODE)
        & (records["length"] == dtype.itemsize - RECORD_HEAD.size)
        & (records["channel"] == SCAN_CHANNEL)
        & (records["cdr"] == CDR_LITTLE_ENDIAN)
        & (records["n_values"] == channels)
        & (records["n_validity"] == channels)
    )
    run = count if fits.all() else int(np.argmin(fits))
    if run == 0:
        raise ValueError(f"a scan is not laid out for {channels} channels")
    return records[:run]


def decode_mark(text: bytes) -> Mark:
    """Return the mark that a message holds."""
    fields = json.loads(text)
    return Mark(
        start_s=float(fields["start_s"]),
        end_s=float(fields["end_s"]),
        labels=fields["labels"],
        groups=fields["groups"],
    )


def _wall_ns(time_s: NDArray[np.float64], wall_anchor_ns: int) -> NDArray[np.int64]:
    """Return wall nanoseconds; MCAP knows no time before 1970, so earlier becomes 0."""
    return np.maximum(np.rint(time_s * 1e9).astype(np.int64) + wall_anchor_ns, 0)
