"""What may follow serial://: paths and options, read and checked.

Knows nothing about ports.

Background of our choices: docs/decisions/0014.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from taxel.errors import BadSource

BAUD = 500_000
"""Bits a second of boards that speak the wire format: 16 MHz divides it without rest, and 1000
scans of 12 channels a second need 390,000. Source: docs/decisions/0014."""
CSV_BAUD = 115_200
"""The same for sketches that print numbers: what most of them set. Our choice."""
HELLO_S = 5.0
"""How long opening waits for each board, seconds: an Arduino that restarts as its port is opened
spends two in its bootloader. Source: docs/decisions/0014."""

BUNDLE_S = 0.005
"""How long rows are gathered, seconds: a call costs the same for one row as for ten, 40 % of a core
for three boards at 1 ms and 7 % at 5 ms. Source: measured, docs/decisions/0014."""


@dataclass(frozen=True, slots=True, kw_only=True)
class SerialOptions:
    """An address, read."""

    paths: tuple[str, ...]
    """One a board, in the order of the columns."""
    format: str
    """wire or csv."""
    baud: int
    rate_hz: float | None
    """Scans a second: set on boards that speak the wire format; believed of those that print."""
    channels: tuple[str, ...]
    """Names of all columns; empty: the boards' own."""
    time: str
    """csv: unit of the first column, ms or us; none where it is no time."""
    unit: str
    """csv: unit of the values."""
    full_scale: float | None
    """csv: from where a value counts as saturated."""
    zero_is_end: bool
    """wire: whether 0 counts is an end of the converter."""
    name: str
    """The array's name, used as the topic in recordings."""
    wait_s: float
    """How long opening waits, seconds."""
    bundle_s: float
    """Rows are given together at most this often, seconds."""
    late_s: float | None
    """How long a row waits for late scans, seconds; None: as usual, see `BoardMerge`."""


_OF_CSV = ("time", "unit", "full_scale")
_OF_WIRE = ("zero",)


def read_options(name: str, options: dict[str, str]) -> SerialOptions:
    """Read what follows serial://.

    Raises:
        BadSource: A path is named twice or left out; an option is unknown or of the wrong kind.
    """
    unread = dict(options)
    paths = tuple(part.strip() for part in name.split(","))
    if not all(paths) or len(set(paths)) < len(paths):
        raise BadSource(
            "paths of ports joined by commas, each once", repr(name), "list them: taxel find"
        )
    csv = _one_of(unread, "format", ("wire", "csv")) == "csv"
    unknown = [key for key in (_OF_WIRE if csv else _OF_CSV) if key in unread]
    names = unread.pop("channels", "")
    bundle_ms = _number(unread, "bundle_ms", 0.0, 1000.0)
    late_ms = _number(unread, "late_ms", 1.0, 10_000.0)
    read = SerialOptions(
        paths=paths,
        format="csv" if csv else "wire",
        baud=int(_number(unread, "baud", 300, 12_000_000) or (CSV_BAUD if csv else BAUD)),
        rate_hz=_number(unread, "rate_hz", 0.1 if csv else 1, 65_535),
        channels=tuple(part.strip() for part in names.split(",")) if names else (),
        time=_one_of(unread, "time", ("none", "ms", "us")),
        unit=unread.pop("unit", "count"),
        full_scale=_number(unread, "full_scale", -math.inf, math.inf),
        zero_is_end=_one_of(unread, "zero", ("good", "saturated")) == "saturated",
        name=unread.pop("name", "boards"),
        wait_s=_number(unread, "wait_s", 0.1, 600.0) or HELLO_S,
        bundle_s=BUNDLE_S if bundle_ms is None else bundle_ms / 1000.0,
        late_s=None if late_ms is None else late_ms / 1000.0,
    )
    if unread or unknown:
        raise BadSource(
            f"options of serial:// with format={read.format}",
            ", ".join(sorted([*unread, *unknown])),
            "mend the address; docs/how-to/serial-boards.md lists them",
        )
    if not all(read.channels) or len(set(read.channels)) < len(read.channels):
        raise BadSource("a name for each channel, each once", repr(names), "mend channels=")
    return read


def _one_of(options: dict[str, str], key: str, choices: tuple[str, ...]) -> str:
    value = options.pop(key, choices[0])
    if value not in choices:
        raise BadSource(f"{key} as one of {', '.join(choices)}", repr(value), "mend the address")
    return value


def _number(options: dict[str, str], key: str, low: float, high: float) -> float | None:
    text = options.pop(key, None)
    if text is None:
        return None
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not low <= value <= high:
        raise BadSource(
            f"{key} as a number from {low:g} to {high:g}", repr(text), "mend the address"
        )
    return value
