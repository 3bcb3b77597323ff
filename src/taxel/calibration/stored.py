"""`calibration.json`: what is known of an array, checked when it is read.

Plain JSON with a version and a SHA-256 over all the rest; nothing in it is ever executed.
Knows nothing about recordings or how the figures were made.
"""

from __future__ import annotations

import hashlib
import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING, Any

from taxel import __version__
from taxel.calibration.curves import FORMS, Curve
from taxel.errors import BadFile, BadInput
from taxel.foreign.json_text import read_json
from taxel.recordings.whole import write_whole
from taxel.signals import SensorInfo

if TYPE_CHECKING:  # reading a calibration, as live does, needs no SciPy
    from taxel.calibration.results import Characterisation, SensorResult

FORMAT = "taxel-calibration"
VERSION = 1
"""Raised when a reader of the old version would misread the new one."""
_LARGEST_BYTES = 20_000_000
_IDENTITY = ("simulator", "seed", "wiring", "reference_v")
"""Details that tell an array apart from another of the same name: simulated ones have no serial
number of their own."""


def shown_units(units: Sequence[str]) -> tuple[str, str, float]:
    """Return the unit that channels' values are shown in, that of small ones, and its factor.

    Small values of channels in V are shown in mV, those of others in the channels' own unit.

    Args:
        units: Each channel's, as the array states them.
    """
    own = ", ".join(dict.fromkeys(units))
    return ("V", "mV", 1000.0) if own == "V" else (own, own, 1.0)


@dataclass(frozen=True, slots=True, kw_only=True)
class ChannelCalibration:
    """What is needed to correct one channel."""

    channel: str
    curve: Curve | None
    """Volts above the baseline at newtons; None where the channel has none."""
    largest_n: float
    """Forces above this are not resolved; NaN without a curve."""
    baseline: float
    """Where the channel rested, in its unit; NaN where it is not known."""
    noise: float
    """Standard deviation of the smoothed signal at rest; NaN where it is not known."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Calibration:
    """A calibration that was read, and its check held."""

    name: str
    """Of the array."""
    serial: str
    units: tuple[str, ...]
    identity: Mapping[str, str]
    """What else sets this array apart from others; empty for boards, which have serial numbers."""
    measure: str
    """How a press became one number: peak or plateau."""
    channels: tuple[ChannelCalibration, ...]
    digest: str
    """SHA-256 of all the rest, 64 hexadecimal digits."""
    document: Mapping[str, Any]
    """The whole file, with everything that was measured."""

    def check_fits(self, sensor: SensorInfo, where: str) -> None:
        """Refuse another array.

        Args:
            sensor: The array to be corrected.
            where: Its recording or source, for the message.

        Raises:
            BadInput: Its name, channels, units, serial number or identity differ.
        """
        if "calibration" in sensor.details:
            raise BadInput(
                "a raw recording",
                f"{where}, corrected already with calibration {sensor.details['calibration'][:12]}",
                "apply it to the raw one",
            )
        mine: dict[str, object] = {
            "name": self.name,
            "channels": tuple(channel.channel for channel in self.channels),
            "units": self.units,
            "serial number": self.serial,
        }
        theirs: dict[str, object] = {
            "name": sensor.name,
            "channels": sensor.channels,
            "units": sensor.units,
            "serial number": sensor.serial,
        }
        mine |= {key: self.identity.get(key, "") for key in _IDENTITY}
        theirs |= {key: sensor.details.get(key, "") for key in _IDENTITY}
        for key, value in mine.items():
            if value != theirs[key]:
                raise BadInput(
                    f"the sensors that were calibrated, {key} {_short(value)}",
                    f"{key} {_short(theirs[key])} in {where}",
                    "calibrate these sensors too",
                )


def document_of(
    results: Characterisation, made_from: list[dict[str, Any]], options: Mapping[str, Any]
) -> dict[str, Any]:
    """Return the content of a calibration file.

    Args:
        results: What was measured.
        made_from: One a recording: what it is, and its SHA-256 where it is a file.
        options: How it was asked for.
    """
    sensor = results.sensor
    body: dict[str, Any] = {
        "format": FORMAT,
        "version": VERSION,
        "software": f"taxel {__version__}",
        "created": datetime.now(UTC).isoformat(timespec="seconds"),
        "sensor": {
            "name": sensor.name,
            "serial": sensor.serial,
            "channels": list(sensor.channels),
            "units": list(sensor.units),
            "identity": {k: sensor.details[k] for k in _IDENTITY if k in sensor.details},
        },
        "conditions": {k: v for k, v in sensor.details.items() if k not in _IDENTITY},
        "made_from": made_from,
        "options": dict(options),
        "measure": results.measure,
        "form": results.form,
        "form_scores_aicc": results.form_scores,
        "forces_n": list(results.forces_n),
        "channels": [_channel(sensor) for sensor in results.sensors],
        "errors": [asdict(error) for error in results.errors],
        "error_by_force": [
            {"force_n": force, "curve_n": curve, "line_n": line}
            for force, curve, line in results.error_by_force
        ],
        "at_one_force": asdict(results.at_one_force),
        "references": [asdict(reference) for reference in results.references],
        "ghosts": asdict(results.ghosts),
    }
    body = json.loads(json.dumps(_plain(body)))
    return {**body, "sha256": _digest(body)}


def _channel(result: SensorResult) -> dict[str, Any]:
    fields = asdict(result)
    del fields["held_out"], fields["curve"]
    held = result.held_out[0][1].curve_n if result.held_out else [math.nan] * len(result.force_n)
    return {
        "channel": result.channel,
        "curve": None if result.curve is None else result.curve.named(),
        **fields,
        "told_n": list(held),
    }


def write_calibration(path: Path, document: Mapping[str, Any], overwrite: bool = False) -> None:
    """Write a calibration file, whole or not at all.

    Raises:
        BadInput: The file exists and may not be replaced, or does not end in .json.
        RecordingFailed: The disk refused.
    """
    check_output(path, overwrite)
    text = json.dumps(document, indent=1, ensure_ascii=False, allow_nan=False)
    write_whole(path, text + "\n")


def check_output(path: Path, overwrite: bool) -> None:
    """Refuse a name for a calibration file that cannot be used, before anything is measured.

    Raises:
        BadInput: The file exists and may not be replaced, or does not end in .json.
    """
    if path.suffix != ".json":
        raise BadInput("a calibration file that ends in .json", str(path), "rename it")
    if path.exists() and not overwrite:
        raise BadInput(
            "a calibration file that does not exist yet",
            str(path),
            "choose another, or --overwrite",
        )


def read_calibration(path: Path) -> Calibration:
    """Return a calibration whose check holds.

    Raises:
        BadInput: It is missing, no calibration, of another version, damaged or edited.
    """
    try:
        document = read_json(path, _LARGEST_BYTES, finite=True)
    except OSError as error:
        raise _bad(path, error.strerror or str(error)) from error
    except BadFile as error:
        raise _bad(path, f"no JSON, or a damaged one ({error.got})") from error
    if not isinstance(document, dict) or document.get("format") != FORMAT:
        raise _bad(path, "another kind of file")
    if document.get("version") != VERSION:
        raise BadInput(
            f"calibration version {VERSION}",
            f"version {document.get('version')!r} in {path}",
            "update taxel, or calibrate again",
        )
    body = {key: value for key, value in document.items() if key != "sha256"}
    digest = _digest(body)
    if document.get("sha256") != digest:
        raise _bad(path, "one that was damaged or edited: its check sum does not hold")
    try:
        return _parse(document, digest)
    except (KeyError, TypeError, ValueError, AttributeError, IndexError) as error:
        raise _bad(path, f"an incomplete one ({type(error).__name__}: {error})") from error


def _parse(document: dict[str, Any], digest: str) -> Calibration:
    sensor, form = document["sensor"], document["form"]
    if form not in FORMS:
        raise ValueError(f"no form {form!r}")
    channels = tuple(
        ChannelCalibration(
            channel=str(channel["channel"]),
            curve=None if channel["curve"] is None else Curve.of(form, channel["curve"]),
            largest_n=_number(channel["largest_n"]),
            baseline=math.nan if channel["rest"] is None else _number(channel["rest"]["level"]),
            noise=_number(channel["noise"]["told_rms_v"]),
        )
        for channel in document["channels"]
    )
    if [channel.channel for channel in channels] != list(sensor["channels"]):
        raise ValueError("channels that are not the sensor's")
    return Calibration(
        name=str(sensor["name"]),
        serial=str(sensor["serial"]),
        units=tuple(map(str, sensor["units"])),
        identity={str(k): str(v) for k, v in sensor["identity"].items()},
        measure=str(document["measure"]),
        channels=channels,
        digest=digest,
        document=document,
    )


def _number(value: float | None) -> float:
    return math.nan if value is None else float(value)


def _digest(body: Mapping[str, Any]) -> str:
    text = json.dumps(body, sort_keys=True, ensure_ascii=False, separators=(",", ":"))
    return hashlib.sha256(text.encode()).hexdigest()


def _plain(data: Any) -> Any:
    """Return what JSON can hold: numbers that are not finite become null, arrays lists."""
    if hasattr(data, "tolist"):
        data = data.tolist()
    if isinstance(data, float):
        return float(f"{data:.9g}") if math.isfinite(data) else None
    if isinstance(data, Mapping):
        return {str(key): _plain(value) for key, value in data.items()}
    if isinstance(data, list | tuple):
        return [_plain(value) for value in data]
    return data


def _bad(path: Path, got: str) -> BadInput:
    return BadInput("a calibration that taxel calibrate wrote", f"{path}: {got}", "calibrate again")


def _short(value: object) -> str:
    text = ", ".join(value) if isinstance(value, tuple) else str(value)
    return repr(text if len(text) <= 60 else text[:57] + "…")
