"""How scans and marks lie in a recording: fixed-size messages, so that a chunk is one array.

A scan is a ROS 2 message in CDR (little endian), whose size depends only on
the number of channels. The MCAP message record around it has a fixed head,
so that a run of scans is a numpy array as it stands: no loop over messages,
neither on writing nor on reading. FORMAT.md has the byte table. Knows
nothing about files, chunks or threads.

Background of our choices: docs/decisions/0004.
"""

from __future__ import annotations

import json
import struct
from collections.abc import Mapping
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from taxel.foreign.json_text import Fields, parse_json
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

FURTHEST_S = 4e9
"""No clock that counts from a boot or from 1970 lies further from zero, seconds: until 2096."""

MESSAGE_OPCODE = 0x05
MESSAGE_HEAD = struct.Struct("<HIQQ")
"""Channel, sequence, log time and publish time (ns), before every message's own bytes."""
_ONE_BY_ONE = 8
"""Scans of a run that are looked at one by one before arrays are worth it. Our choice."""
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
    records["log_ns"] = wall_ns(samples.fitted_s, wall_anchor_ns)
    arrival = np.where(np.isfinite(samples.arrival_s), samples.arrival_s, samples.fitted_s)
    records["publish_ns"] = wall_ns(arrival, wall_anchor_ns)
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
    log_ns = int(wall_ns(np.array([mark.start_s]), wall_anchor_ns)[0])
    head = RECORD_HEAD.pack(MESSAGE_OPCODE, MESSAGE_HEAD.size + len(text))
    return log_ns, head + MESSAGE_HEAD.pack(MARK_CHANNEL, sequence, log_ns, log_ns) + text


def end_of_scans(content: bytes, at: int, dtype: np.dtype[Any]) -> int:
    """Return where the run of scans that begins at `at` ends, bytes.

    What is looked at is bounded by the run's own length, so that a chunk of any mixture takes a
    time in proportion to its size.

    Raises:
        ValueError: The first is not laid out as FORMAT.md says.
    """
    begin, size = at, dtype.itemsize
    signs = _signs(dtype)
    for _ in range(_ONE_BY_ONE):
        if not _is_scan(content, at, size, signs):
            break
        at += size
    else:
        at += size * _fitting(content, at, dtype)
    if at == begin:
        raise ValueError(f"a scan is not laid out for {dtype['values'].shape[0]} channels")
    return at


def _is_scan(content: bytes, at: int, size: int, signs: tuple[tuple[int, bytes], ...]) -> bool:
    return at + size <= len(content) and all(
        content.startswith(sign, at + place) for place, sign in signs
    )


@cache
def _signs(dtype: np.dtype[Any]) -> tuple[tuple[int, bytes], ...]:
    """Return what stands at which byte of every scan."""
    fields: Mapping[str, Any] = dtype.fields or {}
    length = dtype.itemsize - RECORD_HEAD.size
    counted = struct.pack("<I", dtype["values"].shape[0])
    return (
        (0, RECORD_HEAD.pack(MESSAGE_OPCODE, length) + struct.pack("<H", SCAN_CHANNEL)),
        (fields["cdr"][1], struct.pack("<I", CDR_LITTLE_ENDIAN)),
        (fields["n_values"][1], counted),
        (fields["n_validity"][1], counted),
    )


def _fitting(content: bytes, at: int, dtype: np.dtype[Any]) -> int:
    """Return how many scans follow one another from `at`; looks at twice as many each time."""
    channels = dtype["values"].shape[0]
    records = np.frombuffer(content, dtype, (len(content) - at) // dtype.itemsize, at)
    run, step = 0, _ONE_BY_ONE
    while run < len(records):
        part = records[run : run + step]
        fits = (
            (part["opcode"] == MESSAGE_OPCODE)
            & (part["length"] == dtype.itemsize - RECORD_HEAD.size)
            & (part["channel"] == SCAN_CHANNEL)
            & (part["cdr"] == CDR_LITTLE_ENDIAN)
            & (part["n_values"] == channels)
            & (part["n_validity"] == channels)
        )
        if not fits.all():
            return run + int(np.argmin(fits))
        run, step = run + len(part), 2 * step
    return run


def decode_mark(text: bytes) -> Mark:
    """Return the mark that a message holds.

    Raises:
        ValueError: It is not laid out as FORMAT.md says.
    """
    fields = Fields(parse_json(text), "a mark")
    return Mark(
        start_s=fields.number("start_s", -FURTHEST_S, FURTHEST_S),
        end_s=fields.number("end_s", -FURTHEST_S, FURTHEST_S),
        labels=fields.pairs("labels"),
        groups=fields.pairs("groups"),
    )


def wall_ns(time_s: NDArray[np.float64], wall_anchor_ns: int) -> NDArray[np.int64]:
    """Return wall nanoseconds; MCAP knows no time before 1970, so earlier becomes 0."""
    return np.maximum(np.rint(time_s * 1e9).astype(np.int64) + wall_anchor_ns, 0)
