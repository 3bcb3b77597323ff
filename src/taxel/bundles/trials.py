"""Bundles that recognise camera trials: crops, what is seen in them, and a model.

One file, as for arrays: a first line `TAXEL BUNDLE 2 trials <sha256 of the rest>`, then a zip of
`trials.json` (the contract), `model.onnx`, `network.onnx` where crops are looked at through an
image network, and `check_*.npy` with crops as rows and what they must give, and what the network
must give for images that are drawn here. Nothing in it is unpickled. Knows nothing about training
frameworks.

Background of our choices: docs/decisions/0041.
"""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field, fields
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from taxel.bundles.contract import LARGEST_DIFFERENCE, RATE_RANGE
from taxel.bundles.engine import Engine, largest_difference, open_engine
from taxel.bundles.envelope import damaged, from_npy, pack, to_npy, unpack
from taxel.bundles.model_check import check_model
from taxel.bundles.model_trial import Trial, try_models
from taxel.bundles.signing import Trust
from taxel.errors import BadBundle
from taxel.foreign.json_text import Fields, parse_json
from taxel.models.devices import CPU
from taxel.plain_text import number_of, visible_names
from taxel.windows.trial_crops import FAMILIES, PLACES
from taxel.windows.trial_layout import Layout
from taxel.windows.trial_network import FEATURES, IMAGES, SIDE_PX, Network

FORMAT = 1
IN_RUN = "recogniser.taxel"
"""The bundle within the folder of a run of camera trials."""
_MOST_CAMERAS, _MOST_FRAMES, _LARGEST_SIDE, _MOST_CLASSES = 16, 10_000, 8192, 10_000
"""Bounds of what a contract may say. Source: our choice."""
_LONGEST_SPAN = 100_000
"""Frames of a crop, with those between its images. Source: our choice."""
_ROUNDED = 1e-6
"""How far weights may be from summing to 1: they are written as decimals."""
_MEMBERS = ("trials.json", "model.onnx", "check_rows.npy", "check_told.npy")
_NETWORK = ("network.onnx", "check_look.npy")
"""What a bundle holds whose crops are looked at through an image network."""
_CONTRACT = "trials.json"


@dataclass(frozen=True, slots=True, kw_only=True)
class TrialContract:
    """What a bundle of camera trials needs and gives."""

    target: str
    classes: tuple[str, ...]
    """Its answers, in the order of its probabilities."""
    crop: int
    """Images in a crop."""
    places: int
    """Crops of a whole trial, 1 or 3."""
    views: tuple[str, ...]
    """Names in `FAMILIES`, in the order of a row's numbers."""
    versions: tuple[str, ...]
    """Key of each when it was trained."""
    cameras: int
    width: int
    """Of the cameras' frames, pixels."""
    height: int
    rate_hz: float
    """Of the trials that it was trained on, frames a second."""
    mm_per_px: float
    """Millimetres that a pixel of a 320-pixel row covers."""
    sharpness: float
    """Power to which a trial's mean probabilities are raised."""
    threshold: float | None
    """A trial whose mean novelty is above it is UNKNOWN; None tests nothing."""
    data_digest: str
    measured: Mapping[str, float]
    """What was measured on trials held out; may be empty."""
    software: str
    learned: tuple[str, ...] = ()
    """Fingerprints of the training trials, as read and as imported, sorted; see
    `taxel.bundles.contract.fingerprint_of`. Empty where it is not known, as in older bundles.
    """
    moving: bool = False
    """Whether the crops of a whole trial are taken from its part in which something moves; from all
    of it in older bundles, and where there is one crop."""
    step: int = 1
    """Frames from a crop's image to its next."""
    weights: Mapping[str, float] = field(default_factory=dict)
    """Name in `PLACES` → what that crop of a whole trial counts in the mean, summing to 1; empty
    where there is one crop, and in older bundles, where all count alike."""
    network: str = ""
    """The image network that crops are looked at through, and where its weights come from; empty
    without one."""
    names: tuple[str, ...] = ()
    """Of the cameras, in the order in which the models take them; empty where it is not known."""

    @property
    def layout(self) -> Layout:
        """How a trial is cut."""
        return Layout(self.crop, self.places, self.moving, self.step)

    def check(
        self, names: Sequence[str], sizes: list[tuple[int, int]], rates_hz: list[float]
    ) -> None:
        """Refuse cameras that this bundle was not made for.

        Raises:
            BadBundle: Their number, order, size or rate differ.
        """
        if len(sizes) != self.cameras:
            raise BadBundle(
                f"trials of {number_of(self.cameras, 'camera')}", f"{len(sizes)}",
                "train a bundle on trials like these",
            )  # fmt: skip
        if tuple(names) != self.names and sorted(names) == sorted(self.names):
            raise BadBundle(
                f"the cameras in the order {visible_names(self.names)}", visible_names(names),
                "bring the table's columns, or the cameras of the source, into that order",
            )  # fmt: skip
        for width, height in sizes:
            if (width, height) != (self.width, self.height):
                raise BadBundle(
                    f"frames of {self.width}×{self.height}", f"{width}×{height}",
                    "train a bundle on trials of this camera",
                )  # fmt: skip
        for rate_hz in rates_hz if self.crop > 1 else ():  # an image alone has no rate
            if not RATE_RANGE[0] <= rate_hz / self.rate_hz <= RATE_RANGE[1]:
                raise BadBundle(
                    f"about {self.rate_hz:g} frames/s", f"{rate_hz:g}",
                    "train a bundle on trials of this rate",
                )  # fmt: skip


@dataclass(frozen=True, slots=True)
class TrialBundle:
    """A bundle that is ready to run."""

    contract: TrialContract
    model: Engine
    network: Network | None = None
    """What the view of that name looks through; None where the bundle has no such view."""

    def predict(self, rows: NDArray[np.float32]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return crops' probabilities, shape (n, classes), and novelty, shape (n,).

        Args:
            rows: Shape (n, numbers): the views side by side.
        """
        output = self.model.run(rows=rows).astype(np.float64)
        return output[:, :-1], output[:, -1]


def trial_bundle_bytes(
    contract: TrialContract,
    model: bytes,
    check_rows: NDArray[np.float32],
    check_expected: NDArray[np.float32],
    network: bytes | None = None,
) -> tuple[bytes, float]:
    """Return a bundle as it stands on disk, and the largest difference that was found.

    Args:
        contract: What the bundle says of itself.
        model: ONNX: rows → probabilities and novelty.
        check_rows: Crops, shape (n, numbers).
        check_expected: What the trained models give for them, shape (n, classes + 1).
        network: ONNX: images → features; None where no view looks through it.

    Raises:
        BadBundle: The exported model gives something else.
    """
    difference = largest_difference(open_engine(model).run(rows=check_rows), check_expected)
    _refuse_differing(difference)
    members = {
        _CONTRACT: contract_to_json(contract).encode(),
        "model.onnx": model,
        "check_rows.npy": to_npy(check_rows),
        "check_told.npy": to_npy(check_expected),
    }
    if network is not None:
        look = open_engine(network).run(frames=_check_images())
        members |= dict(zip(_NETWORK, (network, to_npy(look)), strict=True))
    return pack(members), difference


def read_trial_bundle(path: Path, trust: Trust | None = None, device: str = CPU) -> TrialBundle:
    """Open a bundle, after checking that it is whole and gives what it gave when written.

    Raises:
        BadBundle: It is missing, damaged, of another kind or format, gives something else, or
            none of the keys of `trust` signed it.
    """
    members = unpack(path, _MEMBERS, trust, _NETWORK)
    contract = contract_from_json(members[_CONTRACT])
    rows, expected = (from_npy(members[f"check_{name}.npy"]) for name in ("rows", "told"))
    _check_shapes(contract, rows, expected)
    tried = [Trial(members["model.onnx"], {"rows": some}) for some in (rows, rows[:1])]
    if "network" in contract.views:
        if lacking := [name for name in _NETWORK if name not in members]:
            raise damaged(path, f"no {' and no '.join(lacking)}")
        images = _check_images()
        tried += [Trial(members["network.onnx"], {"frames": some}) for some in (images, images[:1])]
    for trial in tried:
        check_model(trial.model)
    try_models(tried)
    model = open_engine(members["model.onnx"], threads=1, device=device)
    found = model.run(rows=rows)
    if found.shape != expected.shape:
        raise BadBundle(f"the answers to {number_of(len(rows), 'crop')}",
                        f"an array of shape {found.shape}",
                        "write the bundle again")  # fmt: skip
    _refuse_differing(largest_difference(found, expected))
    network = None
    if "network" in contract.views:
        looks = from_npy(members["check_look.npy"])
        network = _open_network(path, members["network.onnx"], looks, device)
    return TrialBundle(contract, model, network)


def _open_network(path: Path, model: bytes, expected: NDArray[Any], device: str) -> Network:
    """Return what crops are looked at through, after checking what it gives.

    Raises:
        BadBundle: It gives features of another shape, or others than when it was written.
    """
    engine = open_engine(model, threads=1, device=device)

    def look(images: NDArray[np.uint8]) -> NDArray[np.float32]:
        found = engine.run(frames=images)
        if found.shape != (len(images), FEATURES):
            raise damaged(path, f"an image network that gives features of shape {found.shape} for "
                          f"{number_of(len(images), 'image')}")  # fmt: skip
        return found

    images = _check_images()
    found = look(images)
    if expected.shape != found.shape:
        raise damaged(path, f"expected features of shape {expected.shape}")
    _refuse_differing(largest_difference(found, expected))
    look(images[:1])
    return look


def _check_images() -> NDArray[np.uint8]:
    """Return the images on which an image network is checked, as many as it is given at once."""
    down, across = np.meshgrid(np.arange(SIDE_PX), np.arange(SIDE_PX), indexing="ij")
    first = np.stack([down, across, down ^ across], axis=-1).astype(np.uint8)
    return np.stack([np.roll(first, 28 * turn, axis=1) for turn in range(IMAGES)])


def read_trial_contract(path: Path, trust: Trust | None = None) -> TrialContract:
    """Return what a bundle needs and gives, without opening its model.

    Raises:
        BadBundle: It is missing, damaged, of another format, or not signed by a key of `trust`.
    """
    return contract_from_json(unpack(path, (_CONTRACT,), trust)[_CONTRACT])


def contract_to_json(contract: TrialContract) -> str:
    """Return the contract as JSON text."""
    data = asdict(contract) | {"format": FORMAT, "kind": "trials"}
    if not contract.network:
        del data["network"]  # which older versions of taxel do not know
    if not contract.moving:
        del data["moving"]  # likewise
    if contract.step == 1:
        del data["step"]
    if not contract.weights:
        del data["weights"]
    if not contract.names:
        del data["names"]
    return json.dumps(data, indent=1, sort_keys=True, allow_nan=False)


def contract_from_json(text: str | bytes) -> TrialContract:
    """Return the contract that a JSON text holds.

    Raises:
        BadBundle: A field is missing, unknown, or of the wrong kind or range.
    """
    try:
        data = parse_json(text)
        if isinstance(data, dict):  # what older bundles lack
            data = {"learned": [], "network": "", "moving": False, "step": 1, "weights": {},
                    "names": []} | data  # fmt: skip
        return _contract(Fields(data, "the contract"))
    except ValueError as error:  # BadFile is a ValueError
        raise BadBundle(
            f"a bundle of camera trials of format {FORMAT}",
            f"another ({getattr(error, 'got', error)})",
            "train it again with taxel train, or update taxel if a newer version wrote it",
        ) from error


def _contract(entries: Fields) -> TrialContract:
    if entries.any("format") != FORMAT or entries.any("kind") != "trials":
        raise ValueError("another format or kind")
    entries.only({own.name for own in fields(TrialContract)} | {"format", "kind"})
    views, versions = entries.texts("views"), entries.texts("versions")
    network = entries.text("network")
    if not views or set(views) - set(FAMILIES):
        raise ValueError("views that this version of taxel does not know")
    if len(set(views)) < len(views):
        raise ValueError("a view twice")
    if bool(network) != ("network" in views):
        raise ValueError("an image network without its view, or a view without its network")
    if versions != tuple(FAMILIES[name].key for name in views):
        raise ValueError("views of another version of taxel")
    classes = entries.texts("classes")
    if not 2 <= len(set(classes)) == len(classes) <= _MOST_CLASSES:
        raise ValueError("classes that are not two or more different names")
    places = entries.count("places", 1, len(PLACES))
    if places not in (1, len(PLACES)):
        raise ValueError("places are neither 1 nor 3")
    layout = Layout(
        crop=entries.count("crop", 1, _MOST_FRAMES),
        places=places,
        moving=entries.flag("moving"),
        step=entries.count("step", 1, _MOST_FRAMES),
    )
    if layout.moving and places == 1:
        raise ValueError("a single crop, of a part of a trial")
    if layout.step > 1 and layout.crop == 1:
        raise ValueError("a step from a crop's only image to its next")
    if layout.span > _LONGEST_SPAN:  # live, that many frames are kept
        raise ValueError(f"crops of {layout.span} frames, more than {_LONGEST_SPAN}")
    weights = entries.numbers("weights")
    if weights and (
        places == 1 or set(weights) != set(PLACES) or min(weights.values()) < 0
        or not abs(sum(weights.values()) - 1) <= _ROUNDED  # nor NaN
    ):  # fmt: skip
        raise ValueError("weights of crops that are not one for each place, summing to 1")
    cameras, names = entries.count("cameras", 1, _MOST_CAMERAS), entries.texts("names")
    if names and len(names) != cameras:
        raise ValueError("another number of cameras than of their names")
    return TrialContract(
        target=entries.text("target"),
        classes=classes,
        crop=layout.crop,
        places=places,
        moving=layout.moving,
        step=layout.step,
        weights=weights,
        views=views,
        versions=versions,
        cameras=cameras,
        width=entries.count("width", 1, _LARGEST_SIDE),
        height=entries.count("height", 1, _LARGEST_SIDE),
        rate_hz=entries.number("rate_hz", 0.001, 1e6),
        mm_per_px=entries.number("mm_per_px", 1e-9, 1e3),
        sharpness=entries.number("sharpness", 1e-3, 1e3),
        threshold=None if entries.any("threshold") is None else entries.number("threshold", 0.0),
        data_digest=entries.text("data_digest"),
        measured=entries.numbers("measured"),
        software=entries.text("software"),
        learned=entries.texts("learned"),
        network=network,
        names=names,
    )


def _check_shapes(contract: TrialContract, rows: NDArray[Any], expected: NDArray[Any]) -> None:
    n = len(rows) if rows.ndim == 2 else 0
    shape = (n, len(contract.classes) + 1)
    if not n or rows.dtype != np.float32 or expected.shape != shape or expected.dtype != np.float32:
        raise BadBundle(f"check crops (n, numbers) and what they give, {shape}",
                        f"shapes {rows.shape} and {expected.shape}", "train it again")  # fmt: skip


def _refuse_differing(difference: float) -> None:
    if not difference <= LARGEST_DIFFERENCE:
        raise BadBundle(
            f"check crops to give what was trained within {LARGEST_DIFFERENCE:g}",
            f"a difference of {difference:.2g}",
            "train it again here, or report this machine's processor",
        )
