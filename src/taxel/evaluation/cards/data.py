"""The data card: what the recordings behind a result are, read from them now.

Knows nothing about models or pages.
"""

from __future__ import annotations

import hashlib
from collections import Counter, defaultdict
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from taxel.evaluation.run_scores import is_number
from taxel.labels.class_order import in_order
from taxel.labels.trials import Trial
from taxel.plain_text import number_of
from taxel.recordings.reader import iterate_blocks, list_recordings
from taxel.recordings.summary import recorded_s, summarise
from taxel.windows.config import MOST_RATE_CHANGE

_UNITS = {
    *("c", "k", "pct", "ppm", "pf", "v", "mv", "a", "ma", "s", "ms", "hz", "n", "mm", "um", "g"),
    *("kg", "px", "deg", "pa", "kpa", "lux"),
}
"""A group whose name ends in one of these after an underscore is a measured figure."""
_MOST_VALUES = 40
"""A group with more values is said as a count only."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Nuisance:
    """Something measured that changes from recording to recording, such as a temperature."""

    name: str
    """As the manifest has it, with its unit, such as "temperature_c"."""
    values: tuple[float, ...]
    """One a recording, in their order."""


@dataclass(frozen=True, slots=True, kw_only=True)
class DataCard:
    """Facts about a set of recordings, printed beside a result."""

    recordings: int
    hours: float
    """Time recorded, hours; of the array, or of the longest camera."""
    megabytes: float
    sensors: dict[str, str]
    """Sensor or camera → what it is, in words."""
    details: dict[str, str]
    """What manifests say of the sensor, such as wiring; values that differ are joined."""
    classes: dict[str, dict[str, int]]
    """Label → {class: trials or recordings}."""
    groups: dict[str, int]
    """Group → how many values it has."""
    nuisances: tuple[Nuisance, ...]
    lost: str
    """What is missing or unusable, in words."""
    written: str
    """Software and dates."""
    digest: str
    """SHA-256 over the arrays' values, as a run has it; empty for cameras alone."""


def data_card(path: Path, on_file: Callable[[str], None] = lambda _: None) -> DataCard:
    """Return the data card of a folder: its sensors, hours, classes, groups, losses and digest.

    Args:
        path: A folder of recordings, or one.
        on_file: Called with a line before each file.

    Raises:
        BadRecording: There is none, or one is damaged.
    """
    rows, digest = [], hashlib.sha256()
    for file in list_recordings(path):
        on_file(f"data card · {file.name}")
        rows.append(summarise(file))
        for block in iterate_blocks(file):
            digest.update(block.samples.values.tobytes())
    arrays = any(row["channels"] for row in rows)
    return DataCard(
        recordings=len(rows),
        hours=sum(map(recorded_s, rows)) / 3600.0,
        megabytes=sum(row["bytes"] for row in rows) / 1e6,
        sensors=_sensors(rows),
        details=_details(rows),
        classes=_classes(rows),
        groups={
            name: len(set().union(*(_values(row, name) for row in rows)))
            for name in sorted(
                {name for row in rows for name in (*row["groups"], *row["marks_by_group"])}
            )
            if not _is_nuisance(name, rows)
        },
        nuisances=tuple(
            Nuisance(name=name, values=tuple(float(row["groups"][name]) for row in rows))
            for name in sorted({name for row in rows for name in row["groups"]})
            if _is_nuisance(name, rows)
        ),
        lost=_lost(rows),
        written=_written(rows),
        digest=digest.hexdigest() if arrays else "",
    )


def trial_counts(trials: Sequence[Trial], target: str) -> dict[str, int]:
    """Return class → trials of a label."""
    return dict(sorted(Counter(trial.labels[target] for trial in trials).items()))


def _is_nuisance(name: str, rows: list[dict[str, Any]]) -> bool:
    """Return whether a group is a measured figure of every recording, not a name for it."""
    values = [row["groups"].get(name, "") for row in rows]
    unit = name.rpartition("_")[2] in _UNITS
    return all(map(is_number, values)) and (unit or any("." in value for value in values))


def _sensors(rows: list[dict[str, Any]]) -> dict[str, str]:
    found: dict[str, str] = {}
    for row in rows:
        if row["channels"] and row["sensor"]["name"] not in found:
            units = ", ".join(sorted({channel["unit"] for channel in row["channels"]}))
            own = [
                r for r in rows if r["channels"] and r["sensor"]["name"] == row["sensor"]["name"]
            ]
            measured = [r["rate_hz"] for r in own if r["rate_hz"]]
            rate = f"{_rate(measured, 4)} scans/s measured" if measured else "rate unknown"
            found[row["sensor"]["name"]] = (
                f"{number_of(len(row['channels']), 'channel')} in {units}, {rate}, "
                f"{_rate([r['sensor']['rate_hz'] for r in own], 6)} nominal"
            )
        for camera in row["cameras"]:
            measured = [
                entry["rate_hz"] for r in rows for entry in r["cameras"]
                if entry["name"] == camera["name"] and entry["rate_hz"]
            ]  # fmt: skip
            rate = f"{np.median(measured):.4g} frames/s measured" if measured else "rate unknown"
            found.setdefault(
                f"camera {camera['name']}", f"{camera['width']}×{camera['height']} px, {rate}"
            )
    return found


def _rate(rates_hz: Sequence[float], digits: int) -> str:
    """Return the usual rate of recordings; the range of rates too unlike for one sensor's own."""
    low, high = min(rates_hz), max(rates_hz)
    shown = (low, high) if high > MOST_RATE_CHANGE * low else (np.median(rates_hz),)
    return " to ".join(
        np.format_float_positional(rate, digits, fractional=False, trim="-") for rate in shown
    )


def _details(rows: list[dict[str, Any]]) -> dict[str, str]:
    seen: dict[str, set[str]] = defaultdict(set)
    for row in rows:
        if row["channels"]:
            for name, value in row["sensor"]["details"].items():
                seen[name].add(str(value))
            if row["sensor"]["serial"]:
                seen["serial number"].add(row["sensor"]["serial"])
    return {
        name: ", ".join(sorted(values)) if len(values) <= 4 else f"{len(values)} different"
        for name, values in sorted(seen.items())
    }


def _classes(rows: list[dict[str, Any]]) -> dict[str, dict[str, int]]:
    """Return how many trials each label's classes have: marks, or recordings without any.

    A mark's own label wins; one that gives none has the recording's.
    """
    found: dict[str, Counter[str]] = defaultdict(Counter)
    for row in rows:
        for name, counts in row["marks_by_label"].items():
            found[name].update(counts)
        for name, value in row["labels"].items():
            if others := _unmarked(row, row["marks_by_label"].get(name, {})):
                found[name][value] += others
    return {
        name: {value: counts[value] for value in in_order(counts)}
        for name, counts in sorted(found.items())
        if len(counts) <= _MOST_VALUES
    }


def _values(row: dict[str, Any], group: str) -> set[str]:
    """Return a group's values of a recording's trials: those of marks, else the recording's."""
    own: dict[str, int] = row["marks_by_group"].get(group, {})
    whole = {row["groups"][group]} if group in row["groups"] and _unmarked(row, own) else set()
    return set(own) | whole


def _unmarked(row: dict[str, Any], counts: Mapping[str, int]) -> int:
    """Return how many of a recording's trials no mark gives a value of its own."""
    return int(max(1, row["marks"])) - sum(counts.values())


def _lost(rows: list[dict[str, Any]]) -> str:
    scans = sum(row["scans"] for row in rows)
    parts = []
    if scans:
        lost_scans = sum(row["lost_scans"] for row in rows)
        values = sum(row["scans"] * len(row["channels"]) for row in rows)
        unusable = sum(row["unusable_values"] for row in rows)
        saturated = sum(row["saturated_values"] for row in rows)
        parts.append(
            f"{lost_scans:,} of {scans + lost_scans:,} scans lost, "
            f"{unusable / values:.2%} of values unusable, {saturated / values:.2%} saturated"
        )
    frames = sum(camera["frames"] for row in rows for camera in row["cameras"])
    if frames:
        lost = sum(camera["lost_frames"] for row in rows for camera in row["cameras"])
        repeated = sum(camera["repeated"] for row in rows for camera in row["cameras"])
        parts.append(f"{lost:,} of {frames + lost:,} frames lost, {repeated:,} repeated")
    return "; ".join(parts) or "nothing recorded"


def _written(rows: list[dict[str, Any]]) -> str:
    software = ", ".join(sorted({row["software"] for row in rows if row["software"]}))
    days = sorted({row["created"][:10] for row in rows if row["created"]})
    when = days[0] if len(days) == 1 else f"{days[0]} to {days[-1]}" if days else "dates unknown"
    return f"{software or 'unknown software'}, {when}"
