"""What a recording holds, in figures, read in constant memory and with every check sum.

Knows nothing about how the figures are printed.
"""

from __future__ import annotations

from collections import Counter, defaultdict
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np

from taxel.recordings.manifest import Manifest
from taxel.recordings.reader import iterate_blocks, read_manifest
from taxel.recordings.tally import FrameTally, Tally
from taxel.signals import Samples, Validity


def summarise(path: Path) -> dict[str, Any]:
    """Return what a recording is and holds, as plain values.

    Returns:
        path, bytes, sensor, labels, groups, software, created; the ledger of
        `Tally` (scans, duration_s, rate_hz measured, counter_gaps, lost_scans …);
        channels (a list of name, unit, min, mean, max over usable values, and
        the shares 0 to 1 of saturated and unusable ones); marks_by_label
        ({label name: {label: count}}) and marks_by_group, of the groups that marks
        give, alike; cameras (a list of name, width, height and the ledger of
        `FrameTally`); check_sums, always "hold".

    Raises:
        BadRecording: It is missing, no recording of taxel's, cut short, or damaged.
    """
    manifest = read_manifest(path)
    tally = Tally()
    cameras = [FrameTally() for _ in manifest.cameras]
    spans = _Spans(len(manifest.sensor.channels))
    marks: dict[str, Counter[str]] = defaultdict(Counter)
    groups: dict[str, Counter[str]] = defaultdict(Counter)
    for block in iterate_blocks(path):
        tally.add(block.samples)
        tally.marks += len(block.marks)
        spans.add(block.samples)
        for frame in block.frames:
            cameras[frame.camera].add(frame)
        for mark in block.marks:
            for name, label in mark.labels.items():
                marks[name][label] += 1
            for name, value in mark.groups.items():
                groups[name][value] += 1
    return {
        "path": str(path),
        "bytes": path.stat().st_size,
        "check_sums": "hold",
        **_described(manifest),
        **tally.as_dict(),
        "marks_by_label": {name: dict(sorted(count.items())) for name, count in marks.items()},
        "marks_by_group": {name: dict(sorted(count.items())) for name, count in groups.items()},
        "channels": spans.rows(manifest),
        "cameras": [
            {"name": c.name, "width": c.width, "height": c.height, **ledger.as_dict()}
            for c, ledger in zip(manifest.cameras, cameras, strict=True)
        ],
    }


def recorded_s(summary: dict[str, Any]) -> float:
    """Return how long the array or the longest camera was recorded, seconds.

    Args:
        summary: As `summarise` gives it.
    """
    return max(float(entry["duration_s"]) for entry in (summary, *summary["cameras"]))


def _described(manifest: Manifest) -> dict[str, Any]:
    sensor = asdict(manifest.sensor)
    del sensor["channels"], sensor["units"]
    return {
        "sensor": sensor,
        "labels": dict(manifest.labels),
        "groups": dict(manifest.groups),
        "software": manifest.software,
        "created": manifest.created,
    }


class _Spans:
    """Smallest, mean and largest usable value of each channel."""

    def __init__(self, channels: int) -> None:
        self._low = np.full(channels, np.inf)
        self._high = np.full(channels, -np.inf)
        self._sum = np.zeros(channels)
        self._usable = np.zeros(channels, np.int64)
        self._saturated = np.zeros(channels, np.int64)
        self._scans = 0

    def add(self, samples: Samples) -> None:
        """Take in scans."""
        if len(samples) == 0:
            return
        usable = samples.usable & np.isfinite(samples.values)
        values = samples.values.astype(np.float64)
        self._low = np.minimum(self._low, np.where(usable, values, np.inf).min(axis=0))
        self._high = np.maximum(self._high, np.where(usable, values, -np.inf).max(axis=0))
        self._sum += np.where(usable, values, 0.0).sum(axis=0)
        self._usable += usable.sum(axis=0)
        self._saturated += (samples.validity & np.uint8(Validity.SATURATED) != 0).sum(axis=0)
        self._scans += len(samples)

    def rows(self, manifest: Manifest) -> list[dict[str, Any]]:
        """Return one row a channel; the figures are None where no value is usable."""
        sensor = manifest.sensor
        return [
            {
                "name": name,
                "unit": unit,
                "min": float(self._low[i]) if self._usable[i] else None,
                "mean": float(self._sum[i] / self._usable[i]) if self._usable[i] else None,
                "max": float(self._high[i]) if self._usable[i] else None,
                "saturated_share": float(self._saturated[i] / max(1, self._scans)),
                "unusable_share": 1.0 - float(self._usable[i] / max(1, self._scans)),
            }
            for i, (name, unit) in enumerate(zip(sensor.channels, sensor.units, strict=True))
        ]
