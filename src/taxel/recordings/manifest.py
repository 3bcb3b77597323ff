"""The manifest: what a recording is, written at the head of the file before any scan.

It stands there twice (FORMAT.md says where), each copy with its own check
sum, so that a damaged byte never takes away what a recording means. Knows
nothing about files, scans or models.

Background of our choices: docs/decisions/0004.
"""

from __future__ import annotations

import json
import re
import time
import zlib
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from datetime import UTC, datetime

import numpy as np

from taxel import __version__
from taxel.errors import BadFile, BadInput, BadRecording
from taxel.foreign.json_text import Fields, parse_json
from taxel.foreign.records import record_of
from taxel.signals import JPEG, CameraInfo, SensorInfo

NO_ARRAY = SensorInfo(name="none", channels=(), units=(), rate_hz=0.0)
"""The sensor of a recording that holds cameras only."""
FORMAT_VERSION = "2"
"""What is written; raised when a reader of the old format would misread the new one."""
READABLE = ("1", FORMAT_VERSION)
"""Versions that are read. Source: our choice, docs/decisions/0051."""
_MOST_CAMERAS, _LARGEST_SIDE, _LARGEST_RATE_HZ = 64, 65_535, 1e9
"""Bounds of what a manifest may say; no JPEG has a longer side. Source: our choice."""
_LARGEST_32 = 3.4e38
"""What 32 bits hold, about."""
_WHOLE = re.compile(r"-?[0-9]{1,19}")
_FURTHEST_NS = 4 * 10**18
"""Until the year 2096, nanoseconds: with the furthest time of a scan it still fits 64 bits."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Manifest:
    """What a recording is: its sensor, its labels, and what it belongs to."""

    sensor: SensorInfo
    """The array whose scans these are."""
    cameras: tuple[CameraInfo, ...] = ()
    """The cameras whose frames these are, in the order of `Frame.camera`."""
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
    version: str = field(default=FORMAT_VERSION, compare=False)
    """Format of the file that it was read from; what is written has `FORMAT_VERSION`."""

    @property
    def tactile(self) -> tuple[CameraInfo, ...]:
        """The tactile cameras, without those that watch the scene."""
        return tuple(camera for camera in self.cameras if not camera.scene)

    @property
    def of_jpeg(self) -> tuple[CameraInfo, ...]:
        """The cameras whose images are JPEG, tactile or not; depth is none of them."""
        return tuple(camera for camera in self.cameras if camera.coding == JPEG)

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


def check_manifest(manifest: Manifest) -> None:
    """Refuse a manifest that, once written, no reader would take.

    Raises:
        BadInput: A field is of another kind, or out of its range.
    """
    try:
        from_record(to_record(manifest))
    except (TypeError, ValueError) as error:
        got = error.got if isinstance(error, BadRecording) else str(error)
        raise BadInput(
            "a sensor or cameras that a recording can describe", got, "mend the source"
        ) from error


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
    if body.get("format") not in READABLE:
        raise BadRecording(
            f"recording format {' or '.join(READABLE)}",
            f"format {body.get('format')!r}",
            "update taxel to read it",
        )
    try:
        return _parse(body)
    except BadFile as error:
        raise BadRecording("a complete manifest", error.got, "record it again") from error
    except (KeyError, ValueError) as error:
        raise BadRecording(
            "a complete manifest", f"{type(error).__name__}: {error}", "record it again"
        ) from error


def _parse(body: Mapping[str, str]) -> Manifest:
    sensor = Fields(parse_json(body["sensor"]), "sensor")
    fields = Fields({name: parse_json(body[name]) for name in ("labels", "groups")}, "the manifest")
    cameras = parse_json(body.get("cameras", "[]"))
    if not isinstance(cameras, list) or len(cameras) > _MOST_CAMERAS:
        raise ValueError(f"cameras is no list of at most {_MOST_CAMERAS}")
    anchor = body["wall_anchor_ns"]
    if not _WHOLE.fullmatch(anchor) or abs(int(anchor)) > _FURTHEST_NS:
        raise ValueError("wall_anchor_ns is no whole number of nanoseconds")
    return Manifest(
        sensor=SensorInfo(
            name=sensor.text("name"),
            channels=sensor.texts("channels"),
            units=sensor.texts("units"),
            rate_hz=sensor.number("rate_hz", 0.0, _LARGEST_RATE_HZ),
            full_scale=sensor.number("full_scale", -_LARGEST_32, _LARGEST_32)
            if "full_scale" in sensor
            else None,
            serial=sensor.text("serial"),
            details=sensor.pairs("details"),
        ),
        cameras=tuple(map(_camera, cameras)),
        labels=fields.pairs("labels"),
        groups=fields.pairs("groups"),
        software=body["software"],
        created=body["created"],
        wall_anchor_ns=int(anchor),
        version=body["format"],
    )


def _camera(value: object) -> CameraInfo:
    camera = record_of(CameraInfo, value)
    sides = (camera.width, camera.height)
    if not 1 <= min(sides) <= max(sides) <= _LARGEST_SIDE:
        raise ValueError(f"a camera of {camera.width}×{camera.height} pixels")
    if not 0 <= camera.rate_hz <= _LARGEST_RATE_HZ:
        raise ValueError(f"a camera of {camera.rate_hz:g} frames a second")
    return camera


def _json(value: object) -> str:
    return json.dumps(value, ensure_ascii=False, sort_keys=True, default=_plain)


def _plain(value: object) -> object:
    """Return a number of NumPy's as Python's."""
    if isinstance(value, np.generic):
        return value.item()
    raise TypeError(f"{value!r} in place of a text or number")


def _check_sum(pairs: Mapping[str, str]) -> str:
    return f"{zlib.crc32(_json(dict(pairs)).encode()):08x}"
