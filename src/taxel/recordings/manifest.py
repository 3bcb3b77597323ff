"""The manifest: what a recording is, written at the head of the file before any scan.

It stands there twice (FORMAT.md says where), each copy with its own check
sum, so that a damaged byte never takes away what a recording means. Knows
nothing about files, scans or models.
"""

from __future__ import annotations

import json
import time
import zlib
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from datetime import UTC, datetime
from typing import Any

from taxel import __version__
from taxel.errors import BadRecording
from taxel.signals import CameraInfo, SensorInfo

NO_ARRAY = SensorInfo(name="none", channels=(), units=(), rate_hz=0.0)
"""The sensor of a recording that holds cameras only."""
FORMAT_VERSION = "1"
"""Raised when a reader of the old format would misread the new one."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Manifest:
    """What a recording is: its sensor, its labels, and what it belongs to."""

    sensor: SensorInfo
    """The array whose scans these are."""
    cameras: tuple[CameraInfo, ...] = ()
    """The tactile cameras whose frames these are, in the order of `Frame.camera`."""
    labels: Mapping[str, str] = field(default_factory=dict)
    """What may be learned, and holds for the whole recording: shape, material, sign …"""
    groups: Mapping[str, str] = field(default_factory=dict)
    """What must not be split: session, grasp, object, file …"""
    software: str = f"taxel {__version__}"
    """What wrote the recording."""
    created: str = ""
    """Wall time of the start, ISO 8601 with zone; empty where the source's own is unknown."""
    wall_anchor_ns: int = 0
    """Wall time at monotonic zero, nanoseconds since 1970; 0 where time starts at the data."""

    @staticmethod
    def started_now(
        sensor: SensorInfo,
        labels: Mapping[str, str] | None = None,
        groups: Mapping[str, str] | None = None,
        now_s: float | None = None,
        cameras: tuple[CameraInfo, ...] = (),
    ) -> Manifest:
        """Return a manifest whose wall clock is read once, now.

        All later stamps are this anchor plus monotonic time, so they never jump.

        Args:
            sensor: The array that is recorded.
            labels: What holds for the whole recording.
            groups: What the recording belongs to.
            now_s: This moment on the scans' own clock, seconds; the host's monotonic clock by
                default. Simulators have a clock of their own.
            cameras: The tactile cameras that are recorded.
        """
        now_ns = time.monotonic_ns() if now_s is None else round(now_s * 1e9)
        return Manifest(
            sensor=sensor,
            cameras=cameras,
            labels=dict(labels or {}),
            groups=dict(groups or {}),
            created=datetime.now(UTC).isoformat(timespec="milliseconds"),
            wall_anchor_ns=time.time_ns() - now_ns,
        )


def to_record(manifest: Manifest) -> dict[str, str]:
    """Return the manifest as the string pairs that an MCAP record holds."""
    sensor = manifest.sensor
    pairs = {
        "format": FORMAT_VERSION,
        "sensor": _json(
            {
                "name": sensor.name,
                "channels": list(sensor.channels),
                "units": list(sensor.units),
                "rate_hz": sensor.rate_hz,
                "full_scale": sensor.full_scale,
                "serial": sensor.serial,
                "details": dict(sensor.details),
            }
        ),
        "labels": _json(dict(manifest.labels)),
        "groups": _json(dict(manifest.groups)),
        "software": manifest.software,
        "created": manifest.created,
        "wall_anchor_ns": str(manifest.wall_anchor_ns),
    }
    if manifest.cameras:
        pairs["cameras"] = _json([asdict(camera) for camera in manifest.cameras])
    return pairs | {"crc32": _check_sum(pairs)}


def from_record(pairs: Mapping[str, str]) -> Manifest:
    """Return the manifest that `to_record` wrote.

    Raises:
        BadRecording: The check sum fails, the format is newer, or a field is missing.
    """
    body = {key: value for key, value in pairs.items() if key != "crc32"}
    if pairs.get("crc32") != _check_sum(body):
        raise BadRecording(
            "a manifest whose check sum holds", "a damaged manifest", "run: taxel recover"
        )
    if body.get("format") != FORMAT_VERSION:
        raise BadRecording(
            f"recording format {FORMAT_VERSION}",
            f"format {body.get('format')!r}",
            "update taxel to read it",
        )
    try:
        return _parse(body)
    except (KeyError, TypeError, ValueError) as error:
        raise BadRecording(
            "a complete manifest", f"{type(error).__name__}: {error}", "record it again"
        ) from error


def _parse(body: Mapping[str, str]) -> Manifest:
    sensor: dict[str, Any] = json.loads(body["sensor"])
    return Manifest(
        sensor=SensorInfo(
            name=sensor["name"],
            channels=tuple(sensor["channels"]),
            units=tuple(sensor["units"]),
            rate_hz=float(sensor["rate_hz"]),
            full_scale=sensor["full_scale"],
            serial=sensor["serial"],
            details=sensor["details"],
        ),
        cameras=tuple(CameraInfo(**camera) for camera in json.loads(body.get("cameras", "[]"))),
        labels=json.loads(body["labels"]),
        groups=json.loads(body["groups"]),
        software=body["software"],
        created=body["created"],
        wall_anchor_ns=int(body["wall_anchor_ns"]),
    )


def _json(value: object) -> str:
    return json.dumps(value, ensure_ascii=False, sort_keys=True)


def _check_sum(pairs: Mapping[str, str]) -> str:
    return f"{zlib.crc32(_json(dict(pairs)).encode()):08x}"
