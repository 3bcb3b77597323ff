"""How scans lie in a recording: fixed-size messages, so that a chunk is one array.

A scan is a ROS 2 message in CDR (little endian), whose size depends only on
the number of channels, each of which is a field with its own name. The MCAP
message record around it has a fixed head, so that a run of scans is a numpy
array as it stands: no loop over messages, neither on writing nor on reading.
FORMAT.md has the byte table. Knows nothing about files, chunks or threads.

Background of our choices: docs/decisions/0004 and 0051.
"""

from __future__ import annotations

import struct
import zlib
from collections.abc import Mapping, Sequence
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from taxel.plain_text import number_of
from taxel.recordings.cdr import CDR_HEAD, CDR_LITTLE_ENDIAN
from taxel.recordings.field_names import field_names
from taxel.recordings.manifest import FORMAT_VERSION
from taxel.recordings.mcap_file import RECORD_HEAD
from taxel.recordings.messages import MESSAGE_OPCODE, definition, wall_ns
from taxel.signals import Samples

_SCAN_FIELDS = """\
# One scan of a touch array: one reading of all channels. Written by taxel.
float64 fitted_s   # best estimate of when it was taken, host monotonic, seconds
float64 device_s   # the device's clock, seconds since its boot; NaN where it has none
float64 arrival_s  # when it arrived, host monotonic, seconds
int64 counter      # the device's scan counter; -1 where it has none
"""
_VALIDITY = (
    "# one a channel; 0 good, 1 missing, 2 stale, 4 saturated, 8 reconnecting, 16 not finite"
)
MOST_NAMED = 1000
"""Channels that are fields with names of their own; a larger array is one field. Our choice."""

SCAN_CHANNEL = 1
"""MCAP channel of the scans, the same in every recording, so that a chunk can be read alone."""

FURTHEST_S = 4e9
"""No clock that counts from a boot or from 1970 lies further from zero, seconds: until 2096."""

_COUNTS = ("n_values", "n_validity")
"""Fields of format 1: the channels, counted twice."""
_ONE_BY_ONE = 8
"""Scans of a run that are looked at one by one before arrays are worth it. Our choice."""


def scan_topic(sensor_name: str) -> str:
    """Return the topic on which a sensor's scans are recorded."""
    return f"/touch/{sensor_name}"


def scan_schema(channels: Sequence[str], units: Sequence[str]) -> tuple[str, bytes]:
    """Return the name and the definition of a scan's message, a field a channel.

    The name ends in a digest of the fields, so that recordings of different arrays can be read
    beside each other: ROS knows one definition a name.
    """
    count = len(channels)
    if count > MOST_NAMED:
        fields = f"float32[{count}] channels\n"
    else:
        fields = "".join(f"float32 {name}\n" for name in field_names(channels, units))
    digest = f"{zlib.crc32(fields.encode()):08x}"
    own = _SCAN_FIELDS
    if not count:  # of cameras only: no scan is ever written
        return f"taxel_msgs/msg/Scan{digest}", own.encode()
    own += f"taxel_msgs/Values{digest} values  # in the unit that ends each name\n"
    own += f"uint8[{count}] validity  {_VALIDITY}\n"
    return f"taxel_msgs/msg/Scan{digest}", definition(own, (f"taxel_msgs/Values{digest}", fields))


def record_dtype(channels: int, version: str = FORMAT_VERSION) -> np.dtype[Any]:
    """Return the layout of one scan with its MCAP record head, packed.

    The CDR alignment holds by itself: the four 8-byte fields come first, and
    4-byte fields follow them. Format 1 had the lengths of both lists before them.
    """
    counted = version == "1"
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
            *([("n_values", "<u4")] if counted else []),
            ("values", "<f4", (channels,)),
            *([("n_validity", "<u4")] if counted else []),
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
    records["values"] = samples.values
    records["validity"] = samples.validity
    return records


def decode_scans(records: NDArray[np.void]) -> Samples:
    """Return the scans of message records, shape (n,), as arrays of their own."""
    return Samples(
        values=np.ascontiguousarray(records["values"], np.float32),
        counter=np.ascontiguousarray(records["counter"], np.int64),
        device_s=np.ascontiguousarray(records["device_s"], np.float64),
        arrival_s=np.ascontiguousarray(records["arrival_s"], np.float64),
        fitted_s=np.ascontiguousarray(records["fitted_s"], np.float64),
        validity=np.ascontiguousarray(records["validity"], np.uint8),
    )


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
        raise ValueError(
            f"a scan is not laid out for {number_of(dtype['values'].shape[0], 'channel')}"
        )
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
        (fields["cdr"][1], CDR_HEAD),
        *((fields[name][1], counted) for name in _COUNTS if name in fields),
    )


def _fitting(content: bytes, at: int, dtype: np.dtype[Any]) -> int:
    """Return how many scans follow one another from `at`; looks at twice as many each time."""
    channels = dtype["values"].shape[0]
    records = np.frombuffer(content, dtype, (len(content) - at) // dtype.itemsize, at)
    counts = [name for name in _COUNTS if name in (dtype.names or ())]
    run, step = 0, _ONE_BY_ONE
    while run < len(records):
        part = records[run : run + step]
        fits = (
            (part["opcode"] == MESSAGE_OPCODE)
            & (part["length"] == dtype.itemsize - RECORD_HEAD.size)
            & (part["channel"] == SCAN_CHANNEL)
            & (part["cdr"] == CDR_LITTLE_ENDIAN)
        )
        for name in counts:
            fits &= part[name] == channels
        if not fits.all():
            return run + int(np.argmin(fits))
        run, step = run + len(part), 2 * step
    return run
