"""Presses of known force and stretches of known voltage, from marks or from a table.

Knows nothing about volts measured, curves or files of recordings.

Background of our choices: docs/decisions/0022.
"""

from __future__ import annotations

import csv
import io
import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

from taxel.errors import BadDataset, BadFile, BadTable
from taxel.foreign.text_lines import lines_of
from taxel.signals import Mark, SensorInfo

LARGEST_FORCE_N = 1000.0
"""Above this a force is taken for a typing error, newtons. Our choice."""
_LARGEST_TABLE_BYTES = 10_000_000
"""Of a table of presses, some 200,000 of them. Source: our choice."""
_LARGEST_ROUND = 999_999_999
"""Above this the number of a round is taken for a typing error. Our choice."""
_COLUMNS = ("sensor", "force_n", "start_s", "end_s")
_MORE_COLUMNS = ("direction", "round", "reference_v")


@dataclass(frozen=True, slots=True, kw_only=True)
class Press:
    """One sensor pressed with one known force, from rest."""

    channel: int
    """Column of the array."""
    force_n: float
    """What the gauge showed, newtons."""
    start_s: float
    """Not after the first touch, on the scans' fitted clock, seconds."""
    end_s: float
    """When the sensor was let go of, same clock, seconds."""
    rising: bool = True
    """Part of a series of rising forces; False: of falling ones (hysteresis)."""
    round: int = 1
    """Which rising-and-falling series of its sensor, from 1."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Reference:
    """A known voltage on one pin, or on all."""

    channel: int | None
    """Column; None: all of them."""
    volts: float
    start_s: float
    end_s: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Script:
    """The presses and reference voltages that were applied to an array, oldest first."""

    presses: tuple[Press, ...]
    references: tuple[Reference, ...] = ()


def script_of_marks(marks: Sequence[Mark], sensor: SensorInfo) -> Script:
    """Return the presses in a recording's marks; other marks are passed over.

    A press has the labels sensor and force_n, and where known direction (up, down) and
    round; a known voltage has the label reference_v, and sensor where it is on one pin.

    Raises:
        BadDataset: A mark names no channel, or its numbers are none.
    """
    rows = []
    for mark in marks:
        if not {"force_n", "reference_v"} & set(mark.labels):
            continue
        where = f"the mark at {mark.start_s:.3f} s"
        rows.append((where, dict(mark.labels), mark.start_s, mark.end_s))
    try:
        return _script(rows, sensor)
    except BadTable as error:
        raise BadDataset(error.needed, error.got, "mend the marks, or give --presses") from error


def script_of_table(path: Path, sensor: SensorInfo, first_s: float) -> Script:
    """Return the presses that a CSV lists: sensor, force_n, start_s, end_s and, where known,
    direction, round and reference_v; times in seconds since the recording's first scan.

    Args:
        path: The table.
        sensor: The array; a sensor is named as its channel, or by number from 1.
        first_s: The first scan on the fitted clock, seconds.

    Raises:
        BadTable: It cannot be read; names the line.
    """
    rows = []
    try:
        text = "".join(lines_of(path, _LARGEST_TABLE_BYTES))
        reader = csv.DictReader(io.StringIO(text, newline=""), strict=True)
        _check_header(path, reader.fieldnames or ())
        for row in reader:
            where = f"{path}, line {reader.line_num}"
            if None in row or None in row.values():
                raise BadTable("as many cells as columns", f"others in {where}", "mend it")
            labels = {key: value.strip() for key, value in row.items() if value.strip()}
            start_s, end_s = (_time(labels.pop(k, ""), where) for k in ("start_s", "end_s"))
            rows.append((where, labels, first_s + start_s, first_s + end_s))
    except (OSError, BadFile, csv.Error) as error:
        reason = getattr(error, "strerror", None) or getattr(error, "got", error)
        raise BadTable("a table of presses (CSV)", f"{path}: {reason}", "check it") from error
    return _script(rows, sensor)


def _check_header(path: Path, names: Sequence[str]) -> None:
    missing = [name for name in _COLUMNS if name not in names]
    unknown = [name for name in names if name not in (*_COLUMNS, *_MORE_COLUMNS)]
    if missing or unknown or len(set(names)) < len(names):
        raise BadTable(
            f"the columns {', '.join(_COLUMNS)} and any of {', '.join(_MORE_COLUMNS)} in {path}",
            ", ".join(names) or "an empty file",
            "mend its first line",
        )


def _script(rows: list[tuple[str, dict[str, str], float, float]], sensor: SensorInfo) -> Script:
    presses: list[tuple[Press, bool, bool]] = []
    places: list[str] = []
    references: list[Reference] = []
    for where, labels, start_s, end_s in sorted(rows, key=lambda row: row[2]):
        if not (math.isfinite(start_s) and start_s < end_s):
            raise BadTable(
                "an end after the start", f"{start_s:g} to {end_s:g} s in {where}", "mend it"
            )
        if "reference_v" in labels:
            channel = _channel(labels["sensor"], sensor, where) if "sensor" in labels else None
            volts = _number(labels["reference_v"], "reference_v", where)
            references.append(Reference(channel=channel, volts=volts, start_s=start_s, end_s=end_s))
            continue
        force_n = _number(labels.get("force_n", ""), "force_n", where)
        if not 0 < force_n <= LARGEST_FORCE_N:
            raise BadTable(
                f"a force above 0 and up to {LARGEST_FORCE_N:g} N",
                f"{force_n:g} in {where}",
                "mend it",
            )
        way = labels.get("direction", "")
        if way not in ("", "up", "down"):
            raise BadTable("a direction of up or down", f"{way!r} in {where}", "mend it")
        number = _number(labels.get("round", "1"), "round", where)
        if not (0 <= number <= _LARGEST_ROUND and number.is_integer()):
            raise BadTable(
                f"a whole number from 0 to {_LARGEST_ROUND} as round",
                f"{labels['round']!r} in {where}",
                "mend it",
            )
        press = Press(
            channel=_channel(labels.get("sensor", ""), sensor, where),
            force_n=force_n,
            start_s=start_s,
            end_s=end_s,
            rising=way != "down",
            round=int(number),
        )
        presses.append((press, bool(way), "round" in labels))
        places.append(where)
    every = [press for press, _, _ in presses]
    _check_apart(every, places)
    all_presses: list[Press] = []
    for channel in sorted({press.channel for press in every}):
        all_presses += _in_series([press for press in presses if press[0].channel == channel])
    return Script(
        presses=tuple(sorted(all_presses, key=lambda press: press.start_s)),
        references=tuple(references),
    )


def _check_apart(presses: Sequence[Press], places: Sequence[str]) -> None:
    for (press, place), (later, place_later) in pairwise(zip(presses, places, strict=True)):
        if later.start_s < press.end_s:
            raise BadTable(
                "presses one after another, each from rest",
                f"one in {place_later} that begins before that in {place} has ended",
                "mend the times",
            )


def _in_series(presses: list[tuple[Press, bool, bool]]) -> list[Press]:
    """Fill in directions and rounds that were not said, from the order of the forces."""
    series: list[Press] = []
    rising, number, last_n = True, 1, 0.0
    for press, has_way, has_round in presses:
        before = rising
        if has_way:
            rising = press.rising
        elif last_n and press.force_n > last_n * 1.1:
            rising = True
        elif last_n and press.force_n < last_n / 1.1:
            rising = False
        if rising and not before:
            number += 1
        last_n = press.force_n
        series.append(
            Press(
                channel=press.channel,
                force_n=press.force_n,
                start_s=press.start_s,
                end_s=press.end_s,
                rising=rising,
                round=press.round if has_round else number,
            )
        )
    return series


def _channel(text: str, sensor: SensorInfo, where: str) -> int:
    if text in sensor.channels:
        return sensor.channels.index(text)
    if text.isascii() and text.isdecimal() and 1 <= int(text[:9]) <= len(sensor.channels):
        return int(text) - 1
    raise BadTable(
        f"a sensor among {', '.join(sensor.channels)}, or its number from 1",
        f"{text!r} in {where}",
        "mend it",
    )


def _time(text: str, where: str) -> float:
    seconds = _number(text, "time", where)
    if seconds < 0:
        raise BadTable("times since the first scan, from 0 s", f"{seconds:g} in {where}", "mend it")
    return seconds


def _number(text: str, what: str, where: str) -> float:
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise BadTable(f"a number as {what}", f"{text!r} in {where}", "mend it")
    return value
