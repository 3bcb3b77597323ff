"""What a bundle says about itself, and the file's layout.

A bundle is one file: a first line `TAXEL BUNDLE 1 <sha256 of the rest>`, then a
zip of `bundle.json` (this contract), `model.onnx` and three `check_*.npy` arrays
with a few windows and the probabilities that they must give. Nothing in it is
unpickled. Knows nothing about training frameworks.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import MISSING, asdict, dataclass, fields, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from taxel.decisions.unknown import Unknown, unknown_from_json, unknown_to_json
from taxel.errors import BadBundle
from taxel.signals import SensorInfo
from taxel.windows.config import MOST_RATE_CHANGE, WindowConfig
from taxel.windows.reference import Reference
from taxel.windows.scaling import Scaling

FORMAT = 1
"""Version of the layout above."""
LARGEST_DIFFERENCE = 1e-4
"""A probability may differ by this much between training framework, export and load.
Source: our choice, docs/decisions/0009."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Contract:
    """What a bundle needs and gives."""

    target: str
    """What it tells, such as "shape"."""
    classes: tuple[str, ...]
    """Its answers, in the order of its probabilities."""
    window: WindowConfig
    scaling: Scaling
    channels: tuple[str, ...]
    """Names of the channels that it was trained on, in order."""
    units: tuple[str, ...]
    """Their units, which a source must share."""
    rate_hz: float
    """Nominal rate of the recordings that it was trained on, hertz."""
    model: str
    parameters: int
    data_digest: str
    """SHA-256 over the training recordings, hexadecimal."""
    accuracy: Mapping[str, float]
    """Split → accuracy 0…1, as measured when it was trained; may be empty."""
    software: str
    """Version of taxel that wrote it."""
    parity: float | None
    """Largest difference of a probability between the training framework and ONNX Runtime;
    None for a run that was not exported yet."""
    reference: Reference | None = None
    """The level of the reference touches that the scaling holds for; None where it was
    trained on values as measured."""
    unknown: Unknown | None = None
    """How to tell touch that is unlike all that was learned; None where it was not learned."""

    def check_sensor(self, sensor: SensorInfo) -> None:
        """Refuse a sensor that this bundle was not made for.

        Raises:
            BadBundle: The channels are others in number, unit, name or order, or windows of
                the sensor's own scans would last another time.
        """
        named = self.window.channels
        if named is not None and set(named) <= set(sensor.channels):
            sensor = sensor.only(named)
        if len(sensor.channels) != len(self.channels) or sensor.units != self.units:
            raise BadBundle(
                f"{len(self.channels)} channels in {', '.join(sorted(set(self.units)))}",
                f"{len(sensor.channels)} in {', '.join(sorted(set(sensor.units)))} "
                f"from {sensor.name!r}",
                "train a bundle on recordings of this sensor",
            )
        if sensor.channels != self.channels:
            raise BadBundle(
                f"the channels {', '.join(self.channels)}, in this order",
                f"{', '.join(sensor.channels)} from {sensor.name!r}",
                "name or order them so in the import table or with channels= in serial://, if you "
                "are sure which is which; or train with --channels, which takes them by name",
            )
        low_hz, high_hz = self.rate_hz / MOST_RATE_CHANGE, self.rate_hz * MOST_RATE_CHANGE
        if self.window.grid_hz is None and not low_hz <= sensor.rate_hz <= high_hz:
            raise BadBundle(
                f"about {self.rate_hz:g} scans/s, whose rows this bundle takes as they come",
                f"{sensor.rate_hz:g} from {sensor.name!r}",
                "train a bundle on recordings of this rate, or on a common --grid",
            )


def at_level(contract: Contract, level: NDArray[np.float32]) -> Contract:
    """Return the contract for a session, pad or gel whose reference touches have another level.

    Args:
        contract: One that was trained with reference touches.
        level: That level, shape (channels,), as `taxel.windows.reference.touch_level` gives it;
            a channel that gives nothing keeps the level that it has.

    Raises:
        BadBundle: The bundle was trained without reference touches.
    """
    if contract.reference is None:
        raise BadBundle(
            "a bundle trained with reference touches", "one without",
            "train it with --recipe teng-referenced, or with --reference",
        )  # fmt: skip
    level = np.where(level > 0, level, contract.reference.level).astype(np.float32)
    return replace(
        contract,
        scaling=contract.scaling.at_level(contract.reference.level, level),
        reference=replace(contract.reference, level=level),
    )


def contract_to_json(contract: Contract) -> str:
    """Return the contract as JSON text."""
    data = asdict(replace(contract, unknown=None))
    data["format"] = FORMAT
    data["scaling"] = {
        "kind": contract.scaling.kind,
        "offset": [float(value) for value in contract.scaling.offset],
        "factor": [float(value) for value in contract.scaling.factor],
    }
    if contract.reference is not None:
        data["reference"]["level"] = [float(value) for value in contract.reference.level]
    if contract.unknown is not None:
        data["unknown"] = unknown_to_json(contract.unknown)
    return json.dumps(data, indent=1, sort_keys=True)


def contract_from_json(text: str) -> Contract:
    """Return the contract that a JSON text holds.

    Raises:
        BadBundle: A field is missing, unknown or of the wrong kind.
    """
    try:
        data: dict[str, Any] = json.loads(text)
        if data.pop("format") != FORMAT:
            raise ValueError("another format")
        known = {field.name for field in fields(Contract)}
        data = {field.name: field.default for field in fields(Contract)
                if field.default is not MISSING} | data  # fmt: skip
        if set(data) != known:
            raise ValueError(f"the fields {sorted(set(data) ^ known)} differ")
        scaling = data["scaling"]
        data["scaling"] = Scaling(
            kind=scaling["kind"],
            offset=np.array(scaling["offset"], np.float32),
            factor=np.array(scaling["factor"], np.float32),
        )
        window = data["window"]
        if window["channels"] is not None:
            window["channels"] = tuple(window["channels"])
        data["window"] = WindowConfig(**window)
        if data["reference"] is not None:
            level = np.array(data["reference"]["level"], np.float32)
            data["reference"] = Reference(touches=data["reference"]["touches"], level=level)
        if data["unknown"] is not None:
            data["unknown"] = unknown_from_json(data["unknown"])
        for key in ("classes", "channels", "units"):
            data[key] = tuple(data[key])
        return Contract(**data)
    except (ValueError, KeyError, TypeError, AttributeError) as error:
        raise BadBundle(
            f"a bundle of format {FORMAT}", f"another ({error})", "write it again with taxel bundle"
        ) from error
