"""Bundles that watch a grasp: features of frames, a head over the last k, and thresholds.

One file, as for arrays: a first line `TAXEL BUNDLE 1 <sha256 of the rest>`, then a zip of
`grasp.json` (the contract), `head.onnx`, for a backbone `backbone.onnx`, and `check_*.npy`
with features and the probabilities that they must give. Nothing in it is unpickled. Knows
nothing about training frameworks.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import asdict, dataclass, fields
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from taxel.bundles.contract import LARGEST_DIFFERENCE
from taxel.bundles.engine import Engine, EngineName, Precision, open_engine
from taxel.bundles.envelope import FIRST_WORDS, damaged, from_npy, pack, to_npy, unpack
from taxel.decisions.stability import StabilityConfig
from taxel.errors import BadBundle
from taxel.recordings.whole import write_whole
from taxel.signals import CameraInfo
from taxel.windows.rest import Tare

FORMAT = 1
GEL = "gel"
"""Features that markers and imprint give (`taxel.gel.slip_features`), without a backbone."""
_MEMBERS = ("grasp.json", "head.onnx", "check_features.npy", "check_probabilities.npy")


@dataclass(frozen=True, slots=True, kw_only=True)
class GraspContract:
    """What a grasp bundle needs and gives."""

    features: str
    """Name of the backbone, or "gel"."""
    weights: str
    """ImageNet, file:NAME or RANDOM; empty for "gel"."""
    head: str
    frames: int
    """k: frames in a window."""
    tare: Tare
    settle: tuple[int, int]
    """First and last-but-one frame of the settled grasp."""
    cameras: int
    width: int
    """Of the cameras' frames, pixels."""
    height: int
    rate_hz: float
    """Of the recordings that it was trained on, frames a second."""
    rule: str
    """What "unstable" means."""
    offset: tuple[tuple[float, ...], ...]
    """Shape (cameras, features), taken from what the head sees."""
    factor: tuple[tuple[float, ...], ...]
    """Shape (cameras, features), times which it sees them."""
    stability: StabilityConfig
    parameters: int
    data_digest: str
    measured: Mapping[str, float]
    """What was measured when it was trained, on cups held out; may be empty."""
    software: str

    def check_cameras(self, cameras: tuple[CameraInfo, ...]) -> None:
        """Refuse cameras that this bundle was not made for.

        Raises:
            BadBundle: Their number, size or rate differ.
        """
        if len(cameras) != self.cameras:
            raise BadBundle(
                f"a source with {self.cameras} tactile cameras", f"one with {len(cameras)}",
                "choose a source such as sim://cup-pour, or train on recordings of yours",
            )  # fmt: skip
        for camera in cameras:
            if (camera.width, camera.height) != (self.width, self.height):
                raise BadBundle(
                    f"frames of {self.width}×{self.height}", f"{camera.width}×{camera.height} from "
                    f"{camera.name!r}", "train a bundle on recordings of this camera",
                )  # fmt: skip
            if not 0.8 <= camera.rate_hz / self.rate_hz <= 1.25:
                raise BadBundle(
                    f"about {self.rate_hz:g} frames/s", f"{camera.rate_hz:g} from {camera.name!r}",
                    "train a bundle on recordings of this rate",
                )  # fmt: skip


@dataclass(frozen=True, slots=True)
class GraspBundle:
    """A grasp bundle that is ready to run."""

    contract: GraspContract
    head: Engine
    backbone: Engine | None
    """None where features come from the gel's markers and imprint."""
    offset: NDArray[np.float32]
    factor: NDArray[np.float32]

    def probability(self, window: NDArray[np.float32]) -> float:
        """Return the probability of "unstable" for scaled features (k, cameras, features)."""
        return float(self.head.run(features=window[None])[0])


def is_grasp_bundle(path: Path) -> bool:
    """Return whether a file is a grasp bundle, by its contents; False where it cannot be read."""
    try:
        with path.open("rb") as file:
            head = file.readline(200)
            return head.startswith(FIRST_WORDS) and b"grasp.json" in file.read(100)
    except OSError:
        return False


def write_grasp_bundle(
    path: Path,
    contract: GraspContract,
    head: bytes,
    backbone: bytes | None,
    check_features: NDArray[np.float32],
    check_probabilities: NDArray[np.float32],
) -> float:
    """Write a bundle, whole or not at all; return the largest difference that was found.

    Args:
        path: The file to write.
        contract: What the bundle says of itself.
        head: The head's ONNX.
        backbone: The backbone's ONNX; None for "gel".
        check_features: Scaled windows, shape (n, k, cameras, features).
        check_probabilities: What the trained head gives for them, shape (n,).

    Raises:
        BadBundle: The exported head gives other probabilities.
        RecordingFailed: The disk refused.
    """
    difference = _difference(open_engine(head), check_features, check_probabilities)
    if not difference <= LARGEST_DIFFERENCE:
        raise BadBundle(
            f"the exported head to equal the trained one within {LARGEST_DIFFERENCE:g}",
            f"a difference of {difference:.2g}", "report the versions of torch and onnxruntime",
        )  # fmt: skip
    members = {
        "grasp.json": contract_to_json(contract).encode(),
        "head.onnx": head,
        "check_features.npy": to_npy(check_features),
        "check_probabilities.npy": to_npy(check_probabilities),
    }
    if backbone is not None:
        members["backbone.onnx"] = backbone
    write_whole(path, pack(members))
    return difference


def read_grasp_bundle(
    path: Path,
    *,
    engine: EngineName = "onnxruntime",
    precision: Precision = "f32",
    threads: int = 1,
) -> GraspBundle:
    """Open a bundle, after checking that it is whole and gives what it gave when written.

    Raises:
        BadBundle: It is missing, damaged, of another kind or format, or gives other
            probabilities.
        MissingExtra: The engine is not installed.
    """
    members = unpack(path, _MEMBERS)
    contract = contract_from_json(members["grasp.json"].decode())
    head = open_engine(members["head.onnx"], threads=1)
    features, expected = (
        from_npy(members[f"check_{name}.npy"]) for name in ("features", "probabilities")
    )
    difference = _difference(head, features, expected)
    if not difference <= LARGEST_DIFFERENCE:
        raise BadBundle(
            f"its check windows to give the stored probabilities within {LARGEST_DIFFERENCE:g}",
            f"a difference of {difference:.2g} on this machine",
            "write the bundle again here, or report this machine's processor",
        )
    backbone = None
    if contract.features != GEL:
        if "backbone.onnx" not in members:
            raise damaged(path, f"no backbone for {contract.features}")
        backbone = open_engine(members["backbone.onnx"], engine, precision, threads)
    return GraspBundle(
        contract,
        head,
        backbone,
        np.array(contract.offset, np.float32),
        np.array(contract.factor, np.float32),
    )


def read_grasp_contract(path: Path) -> GraspContract:
    """Return what a grasp bundle needs and gives, without opening its models.

    Raises:
        BadBundle: It is missing, damaged or of another format.
    """
    return contract_from_json(unpack(path, _MEMBERS)["grasp.json"].decode())


def contract_to_json(contract: GraspContract) -> str:
    """Return the contract as JSON text; infinity is written as null."""
    data = asdict(contract) | {"format": FORMAT, "kind": "grasp"}
    if data["stability"]["frozen_s"] == float("inf"):
        data["stability"]["frozen_s"] = None
    return json.dumps(data, indent=1, sort_keys=True, allow_nan=False)


def contract_from_json(text: str) -> GraspContract:
    """Return the contract that a JSON text holds.

    Raises:
        BadBundle: A field is missing, unknown or of the wrong kind.
    """
    try:
        data: dict[str, Any] = json.loads(text)
        if data.pop("format") != FORMAT or data.pop("kind") != "grasp":
            raise ValueError("another format or kind")
        known = {field.name for field in fields(GraspContract)}
        if set(data) != known:
            raise ValueError(f"the fields {sorted(set(data) ^ known)} differ")
        stability = data["stability"]
        if stability["frozen_s"] is None:
            stability["frozen_s"] = float("inf")
        data["stability"] = StabilityConfig(**stability)
        data["settle"] = (int(data["settle"][0]), int(data["settle"][1]))
        for key in ("offset", "factor"):
            data[key] = tuple(tuple(map(float, row)) for row in data[key])
        return GraspContract(**data)
    except (ValueError, KeyError, TypeError, AttributeError, IndexError) as error:
        raise BadBundle(
            f"a grasp bundle of format {FORMAT}", f"another ({error})",
            "write it again with taxel bundle",
        ) from error  # fmt: skip


def _difference(
    head: Engine, features: NDArray[np.float32], expected: NDArray[np.float32]
) -> float:
    return float(np.abs(head.run(features=features) - expected).max())
