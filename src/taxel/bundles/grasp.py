"""Bundles that watch a grasp: features of frames, a head over the last k, and thresholds.

One file, as for arrays: a first line `TAXEL BUNDLE 2 grasp <sha256 of the rest>`, then a zip of
`grasp.json` (the contract), `head.onnx`, for a backbone `backbone.onnx`, and `check_*.npy`
with features and the probabilities that they must give. Nothing in it is unpickled. Knows
nothing about training frameworks.

Background of our choices: docs/decisions/0013.
"""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass, fields
from pathlib import Path
from typing import Any, get_args

import numpy as np
from numpy.typing import NDArray

from taxel.bundles.check_windows import other_windows, refuse_other_probabilities
from taxel.bundles.contract import LARGEST_DIFFERENCE, RATE_RANGE
from taxel.bundles.engine import (
    Engine,
    largest_difference,
    open_engine,
)
from taxel.bundles.envelope import (
    damaged,
    from_npy,
    pack,
    reading_contract,
    to_npy,
    unpack,
)
from taxel.bundles.model_check import check_model
from taxel.bundles.model_trial import Trial, try_models
from taxel.bundles.signing import Trust
from taxel.decisions.stability import StabilityConfig
from taxel.errors import BadBundle
from taxel.foreign.json_text import Fields, parse_json
from taxel.foreign.records import record_of
from taxel.gel.rim_slip import WITH_RIM
from taxel.gel.ring_slip import WITH_RINGS
from taxel.gel.slip_signal import PAIR_FEATURES
from taxel.models.devices import CPU
from taxel.plain_text import number_of
from taxel.recordings.whole import write_whole
from taxel.signals import CameraInfo
from taxel.windows.rest import Tare

FORMAT = 1
GEL = "gel"
"""Features that markers and imprint give (`taxel.gel.slip_features`), without a backbone."""
SLIP = "slip"
"""Features of slip over all gels (`taxel.gel.slip_signal`): offset and factor have one row."""
SLIP_RIM = "slip-rim"
"""The same, then those of the contacts' rims (`taxel.gel.rim_slip`); one row too."""
SLIP_RINGS = "slip-rings"
"""Those, then those of the gels' rings (`taxel.gel.ring_slip`)."""
SLIP_COLUMNS = {
    SLIP: len(PAIR_FEATURES), SLIP_RIM: len(WITH_RIM), SLIP_RINGS: len(WITH_RINGS),
}  # fmt: skip
"""What watches slip → how many columns its windows have."""
OWN_FEATURES = (GEL, *SLIP_COLUMNS)
"""What needs no backbone."""
SLIP_RATES_HZ = (18.0, 75.0)
"""Frames a second of cameras in which slip is watched. What is learned assumes 25 images a second;
at 25 sets a second warnings are level with those at 60, at 12.5 late. Source: training cups,
docs/decisions/0036."""
_ASPECT = 0.02
"""By how much the ratio of an image's sides may differ from the learned one's where it is scaled:
GelSight Minis give 3280×2464, too. Source: our choice, docs/decisions/0036."""
_MOST_CAMERAS, _MOST_FRAMES, _LARGEST_SIDE = 16, 10_000, 8192
"""Bounds of what a contract may say. Source: our choice."""
_MEMBERS = ("grasp.json", "head.onnx", "check_features.npy", "check_probabilities.npy")


@dataclass(frozen=True, slots=True, kw_only=True)
class GraspContract:
    """What a grasp bundle needs and gives."""

    features: str
    """Name of the backbone, "gel", "slip", "slip-rim" or "slip-rings"."""
    weights: str
    """ImageNet, file:NAME or RANDOM, and where they come from; empty for "gel"."""
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
    """Shape (cameras, features), one row for slip; taken from what the head sees."""
    factor: tuple[tuple[float, ...], ...]
    """Shape (cameras, features), times which it sees them."""
    stability: StabilityConfig
    parameters: int
    data_digest: str
    measured: Mapping[str, float]
    """What was measured when it was trained, on cups held out; may be empty."""
    software: str
    names: tuple[str, ...] = ()
    """Of the cameras, in the order in which the head takes them; empty where it is not known."""

    @property
    def gives_probability(self) -> bool:
        """False for a slip warning whose number of 0…1 is only a score: a forecast, the rule."""
        return self.features not in SLIP_COLUMNS or self.head not in ("forecast", "rule")

    def check_cameras(self, cameras: tuple[CameraInfo, ...]) -> None:
        """Refuse cameras that this bundle was not made for.

        Raises:
            BadBundle: Their number, size, rate or order differ.
        """
        feel = [camera for camera in cameras if not camera.scene]
        if len(cameras) != self.cameras or len(feel) < len(cameras):
            raise BadBundle(
                f"a source with {number_of(self.cameras, 'tactile camera')}",
                f"one with {len(feel)}",
                "choose a source such as sim://cup-pour, or train on recordings of yours",
            )  # fmt: skip
        camera_names = tuple(camera.name for camera in cameras)
        if camera_names != self.names and sorted(camera_names) == sorted(self.names):
            raise BadBundle(
                f"the cameras in the order {', '.join(self.names)}", ", ".join(camera_names),
                "name them to the source in that order",
            )  # fmt: skip
        for camera in cameras:
            self._check_size(camera)
            self._check_rate(camera)

    def settle_of(self, cameras: tuple[CameraInfo, ...]) -> slice:
        """Return which sets of frames are the settled grasp, for slip by the cameras' rate."""
        faster = self.rate_of(cameras) / self.rate_hz
        first = round(self.settle[0] * faster)
        return slice(first, max(round(self.settle[1] * faster), first + 1))

    def rate_of(self, cameras: tuple[CameraInfo, ...]) -> float:
        """Return the sets of frames a second: for slip the cameras' own, else `rate_hz`."""
        slip = self.features in SLIP_COLUMNS
        return min(camera.rate_hz for camera in cameras) if slip else self.rate_hz

    def _check_size(self, camera: CameraInfo) -> None:
        needed, fits = "", (camera.width, camera.height) == (self.width, self.height)
        if self.features in SLIP_COLUMNS:
            needed = ", or larger ones of that shape"
            shape = camera.width / camera.height / (self.width / self.height)
            fits = camera.width >= self.width and abs(shape - 1) <= _ASPECT
        if not fits:
            raise BadBundle(
                f"frames of {self.width}×{self.height}{needed}",
                f"{camera.width}×{camera.height} from {camera.name!r}",
                "let the camera send that size (width and height in its address), or train a "
                "monitor on recordings of it: taxel train-monitor",
            )  # fmt: skip

    def _check_rate(self, camera: CameraInfo) -> None:
        needed = f"about {self.rate_hz:g} frames/s"
        least, most = (share * self.rate_hz for share in RATE_RANGE)
        if self.features in SLIP_COLUMNS:
            least, most = SLIP_RATES_HZ
            needed = f"{least:g} to {most:g} frames/s"
        if not least <= camera.rate_hz <= most:
            raise BadBundle(
                needed, f"{camera.rate_hz:g} from {camera.name!r}",
                "let the camera send that many, or train a monitor on recordings of this rate: "
                "taxel train-monitor",
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
        """Return the probability of "unstable", or the score, of scaled features.

        Args:
            window: Shape (k, cameras, features).

        Returns:
            0…1; NaN where a feature is not finite: trees would give a number all the same.
        """
        if not np.isfinite(window).all():
            return math.nan
        return float(self.head.run(features=window[None])[0])


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
    path: Path | str,
    *,
    threads: int = 1,
    trust: Trust | None = None,
    device: str = CPU,
) -> GraspBundle:
    """Open a bundle, after checking that it is whole and gives what it gave when written.

    Args:
        path: The bundle.
        threads: Threads of the backbone; a head takes one.
        trust: Keys of which one must have signed it; any bundle unless given.
        device: Where ONNX Runtime runs it, a name in `PROVIDERS`.

    Raises:
        BadInput: The device is not there.
        BadBundle: It is missing, damaged, of another kind or format, gives other
            probabilities, or none of the keys of `trust` signed it.
    """
    path = Path(path)
    members = unpack(path, _MEMBERS, trust, ("backbone.onnx",))
    contract = contract_from_json(members["grasp.json"])
    features, expected = (
        from_npy(members[f"check_{name}.npy"]) for name in ("features", "probabilities")
    )
    _check_shapes(contract, features, expected)
    trials = [Trial(members["head.onnx"], {"features": features})]
    needs_backbone = contract.features not in OWN_FEATURES
    frame = np.zeros((1, contract.height, contract.width, 3), np.uint8)
    if needs_backbone:
        if "backbone.onnx" not in members:
            raise damaged(path, f"no backbone for {contract.features}")
        trials.append(Trial(members["backbone.onnx"], {"frames": frame}))
    for trial in trials:
        check_model(trial.model)
    try_models(trials)
    head = open_engine(members["head.onnx"], threads=1, device=device)
    refuse_other_probabilities(_difference(head, features, expected))
    backbone = None
    if needs_backbone:
        backbone = open_engine(members["backbone.onnx"], threads=threads, device=device)
        shape = backbone.run(frames=frame).shape
        sides = 3 if contract.tare == "local-size" else 2
        if len(shape) != sides or (shape[0], shape[-1]) != (1, len(contract.offset[0])):
            raise damaged(path, f"a backbone that gives features of shape {shape}")
    return GraspBundle(
        contract,
        head,
        backbone,
        np.array(contract.offset, np.float32),
        np.array(contract.factor, np.float32),
    )


def read_grasp_contract(path: Path | str, trust: Trust | None = None) -> GraspContract:
    """Return what a grasp bundle needs and gives, without opening its models.

    Raises:
        BadBundle: It is missing, damaged, of another format, or not signed by a key of `trust`.
    """
    return contract_from_json(unpack(Path(path), ("grasp.json",), trust)["grasp.json"])


def contract_to_json(contract: GraspContract) -> str:
    """Return the contract as JSON text; infinity is written as null."""
    data = asdict(contract) | {"format": FORMAT, "kind": "grasp"}
    if data["stability"]["frozen_s"] == float("inf"):
        data["stability"]["frozen_s"] = None
    if not contract.names:
        del data["names"]
    return json.dumps(data, indent=1, sort_keys=True, allow_nan=False)


def contract_from_json(text: str | bytes) -> GraspContract:
    """Return the contract that a JSON text holds.

    Raises:
        BadBundle: A field is missing, unknown, or of the wrong kind, length or range.
    """
    with reading_contract(f"a grasp bundle of format {FORMAT}"):
        return _contract(Fields(parse_json(text), "the contract"))


def _contract(entries: Fields) -> GraspContract:
    if entries.any("format") != FORMAT or entries.any("kind") != "grasp":
        raise ValueError("another format or kind")
    lacking = set() if "names" in entries else {"names"}  # bundles before them
    known = {field.name for field in fields(GraspContract)} - lacking
    entries.only(known | {"format", "kind"})
    stability = entries.any("stability")
    if isinstance(stability, dict) and stability.get("frozen_s", 0.0) is None:
        stability = stability | {"frozen_s": math.inf}
    first, last = entries.array("settle", (2,)).tolist()
    if not 0 <= first < last <= _MOST_FRAMES or first % 1 or last % 1:
        raise ValueError("settle is not the first and last of some frames")
    cameras = entries.count("cameras", 1, _MOST_CAMERAS)
    features = entries.text("features")
    rows, columns = (1, SLIP_COLUMNS[features]) if features in SLIP_COLUMNS else (cameras, None)
    offset, factor = (entries.array(name, (rows, columns)) for name in ("offset", "factor"))
    if offset.shape != factor.shape:
        raise ValueError("offset and factor differ in length")
    tare: Tare = entries.choice("tare", get_args(Tare))
    return GraspContract(
        features=features,
        weights=entries.text("weights"),
        head=entries.text("head"),
        frames=entries.count("frames", 1, _MOST_FRAMES),
        tare=tare,
        settle=(int(first), int(last)),
        cameras=cameras,
        width=entries.count("width", 1, _LARGEST_SIDE),
        height=entries.count("height", 1, _LARGEST_SIDE),
        rate_hz=entries.number("rate_hz", 0.001, 1e6),
        rule=entries.text("rule"),
        offset=tuple(map(tuple, offset.tolist())),
        factor=tuple(map(tuple, factor.tolist())),
        stability=record_of(StabilityConfig, stability, finite=False),
        parameters=entries.count("parameters", 0, 2**53),
        data_digest=entries.text("data_digest"),
        measured=entries.numbers("measured"),
        software=entries.text("software"),
        names=entries.texts("names") if "names" in entries else (),
    )


def _check_shapes(contract: GraspContract, features: NDArray[Any], expected: NDArray[Any]) -> None:
    """Refuse check windows that are not the contract's.

    Raises:
        BadBundle: A shape or kind of number is another.
    """
    n = len(features) if features.ndim else 0
    window = (n, contract.frames, len(contract.offset), len(contract.offset[0]))
    for name, array, shape in (("features", features, window), ("probabilities", expected, (n,))):
        if not n or array.shape != shape or array.dtype != np.float32:
            raise other_windows(name, shape, array)


def _difference(
    head: Engine, features: NDArray[np.float32], expected: NDArray[np.float32]
) -> float:
    found = head.run(features=features)
    alone = head.run(features=features[:1])  # as it will be asked live
    if found.shape != expected.shape or alone.shape != (1,):
        raise BadBundle(
            "a probability for each check window", f"an array of shape {found.shape}",
            "write the bundle again with taxel bundle",
        )  # fmt: skip
    return largest_difference(found, expected)
