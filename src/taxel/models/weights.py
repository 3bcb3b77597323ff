"""Find the weights that a backbone starts from, and say honestly what they are.

Order: an explicit path, the environment variable TAXEL_WEIGHTS (a file, or a
folder of files named after backbones), an installed package that carries them,
what comes with taxel, what `taxel weights fetch` brought, and at last random
numbers, labelled RANDOM.
Nothing is downloaded here. Knows nothing about training or features.
"""

from __future__ import annotations

import hashlib
import os
from collections.abc import Mapping
from dataclasses import dataclass, replace
from importlib.util import find_spec
from pathlib import Path

from torch import nn

from taxel.errors import BadFile, BadInput
from taxel.foreign.files import open_file
from taxel.models.backbones.catalogue import find_backbone
from taxel.models.backbones.random_start import fill_randomly
from taxel.models.backbones.weight_files import load_backbone_weights, read_tensors, tensor_digest
from taxel.models.published.about import About, parse_about
from taxel.models.published.origins import Origin, origins_of

VARIABLE = "TAXEL_WEIGHTS"
"""Environment variable with a file or folder of weights."""
RANDOM = "RANDOM"
"""Label of weights that were trained on nothing."""
IMAGENET = "ImageNet"
"""Label of weights that are known, by a pinned sum, to be ImageNet's."""
LEAST_SIDE_PX, MOST_SIDE_PX = 32, 512
"""Height and width of images that a network may be trained on, pixels: below, a backbone that
halves five times has no map left. Source: our choice, docs/decisions/0057."""
SHIPPED = "taxel"
"""Label of weights that come with taxel."""
_READY = Path(__file__).with_name("backbones") / "ready"


@dataclass(frozen=True, slots=True, kw_only=True)
class Weights:
    """Which weights a backbone has."""

    backbone: str
    label: str
    """"ImageNet", "taxel", "file:NAME", or "RANDOM", which every table must show."""
    digest: str
    """SHA-256 of the file; of backbone and seed where the weights are random."""
    path: Path | None
    """The file; None where the weights are random."""
    origin: str = ""
    """Where they come from; what the file itself says unless its sum is pinned."""
    seed: int = 0
    """Of random weights."""
    side_px: int | None = None
    """Height and width of the images that they were trained on, pixels; the backbone's own unless
    the file says another."""

    @property
    def words(self) -> str:
        """Label and origin, for rows and bundles."""
        return f"{self.label} ({self.origin})" if self.origin else self.label

    def load_into(self, module: nn.Module) -> None:
        """Fill a module that `BACKBONES[self.backbone].build` made.

        Raises:
            BadInput: The file is damaged or another network's.
        """
        if self.path is None:
            fill_randomly(module, self.backbone, self.seed)
        else:
            load_backbone_weights(module, self.backbone, self.path)


def find_weights(
    backbone: str,
    path: Path | None = None,
    *,
    seed: int = 0,
    environment: Mapping[str, str] = os.environ,
    cache: Path | None = None,
) -> Weights:
    """Return the weights that a backbone starts from.

    Args:
        backbone: A name in `BACKBONES`.
        path: A file, or a folder of files named after backbones; goes before all else.
        seed: Of random weights.
        environment: Where TAXEL_WEIGHTS is looked up.
        cache: Folder of fetched weights; the user's cache unless given.

    Raises:
        BadInput: There is no such backbone or path.
    """
    find_backbone(backbone)
    if path is not None:
        weights_path = _find_at(backbone, path, "check the path")
        if weights_path is None:
            names = ", ".join(_names_of(backbone))
            raise BadInput(f"one of the files {names}", f"none of them in {path}", "add it there")
        return _describe(backbone, weights_path)
    if environment.get(VARIABLE):
        place = Path(environment[VARIABLE])
        if weights_path := _find_at(backbone, place, f"check the variable {VARIABLE}"):
            return _describe(backbone, weights_path)
    if packaged := _packaged(backbone):
        return _describe(backbone, packaged)
    default = shipped_weights(backbone) or fetched_weights(backbone, cache)
    return default or _random(backbone, seed)


def model_weights(
    model: str, place: Path | None = None, *, environment: Mapping[str, str] = os.environ
) -> Path | None:
    """Return the file of backbone weights that only one model uses: trained end to end with it.

    A folder of weights may hold one a model, such as resnet50+transformer.safetensors.

    Args:
        model: backbone+head.
        place: A folder; that of the variable TAXEL_WEIGHTS unless given.
        environment: Where TAXEL_WEIGHTS is looked up.
    """
    folder = place or environment.get(VARIABLE)
    path = Path(folder) / f"{model}.safetensors" if folder else None
    return path if path and path.is_file() else None


def shipped_weights(backbone: str) -> Weights | None:
    """Return the weights that come with taxel; None where none do."""
    path = _READY / f"{backbone}.safetensors"
    return replace(_describe(backbone, path), label=SHIPPED) if path.is_file() else None


def fetched_path(backbone: str, cache: Path | None = None) -> Path:
    """Return where a backbone's fetched weights lie, or would lie.

    Args:
        backbone: Its name.
        cache: Folder of fetched weights; the user's cache unless given.
    """
    return (cache or weight_cache()) / f"{backbone}.safetensors"


def fetched_weights(backbone: str, cache: Path | None = None) -> Weights | None:
    """Return what was fetched for a backbone; None where nothing was.

    Args:
        backbone: Its name.
        cache: Folder of fetched weights; the user's cache unless given.
    """
    path = fetched_path(backbone, cache)
    return _describe(backbone, path, own=True) if path.is_file() else None


def weight_cache() -> Path:
    """Return the user's folder of fetched weights."""
    base = os.environ.get("XDG_CACHE_HOME")
    return (Path(base) if base else Path.home() / ".cache") / "taxel" / "weights"


def _find_at(backbone: str, place: Path, mend: str) -> Path | None:
    """Return the file that a place is or holds; None where a folder holds none."""
    if place.is_file():
        return place
    if not place.is_dir():
        raise BadInput(f"a file or folder of weights for {backbone}", f"no {place}", mend)
    return next((place / n for n in _names_of(backbone) if (place / n).is_file()), None)


def _names_of(backbone: str) -> list[str]:
    """Return what a backbone's file in a folder may be called, best first."""
    names = [backbone + suffix for suffix in (".safetensors", ".weights.h5", ".h5", ".pth")]
    return names + [o.file_name for o in origins_of(backbone) if o.place != "npm"]


def _describe(backbone: str, path: Path, *, own: bool = False) -> Weights:
    """Return what a file is.

    Args:
        backbone: Whose weights it should hold.
        path: The file.
        own: taxel itself fetched it: what it says of its origin is believed.
    """
    sha256, md5 = _hash_file(path)
    about, digest = _look_into(path)
    for origin in origins_of(backbone):
        pinned = sha256 == origin.member_sha256 or (origin.md5 and md5 == origin.md5)
        if pinned or (digest and _is_converted(origin, digest, about if own else None)):
            label = IMAGENET if origin.imagenet else f"file:{path.name}"
            return Weights(
                backbone=backbone, label=label, digest=sha256, path=path, origin=origin.words
            )
    stated = ", ".join(part for part in (about.origin, about.trained) if part) if about else ""
    return Weights(
        backbone=backbone, label=f"file:{path.name}", digest=sha256, path=path, origin=stated,
        side_px=_side_px(about),
    )  # fmt: skip


def _side_px(about: About | None) -> int | None:
    """Return the side of the images that a file says it was trained on, pixels."""
    side_text = about.side_px if about else ""
    if not side_text.isdecimal() or not LEAST_SIDE_PX <= int(side_text) <= MOST_SIDE_PX:
        return None
    return int(side_text)


def _look_into(path: Path) -> tuple[About | None, str]:
    """Return a .safetensors file's description and its tensors' sum; nothing of others."""
    if path.suffix != ".safetensors":
        return None, ""
    try:
        tensors, head = read_tensors(path)
    except (BadFile, OSError):
        return None, ""  # refused in full where it is loaded
    return parse_about(head), tensor_digest(tensors)


def _is_converted(origin: Origin, digest: str, about: About | None) -> bool:
    """Return whether tensors are those that a place handed out."""
    if origin.tensors:
        return digest == origin.tensors
    return about is not None and (about.origin, about.tensors) == (origin.words, digest)


def _hash_file(path: Path) -> tuple[str, str]:
    sha256, md5 = hashlib.sha256(), hashlib.md5(usedforsecurity=False)
    try:
        with open_file(path) as file:
            while block := file.read(1 << 20):
                sha256.update(block)
                md5.update(block)
    except (OSError, BadFile) as error:
        got = getattr(error, "got", None) or getattr(error, "strerror", None) or error
        raise BadInput(
            f"to read the weights {path}", f"{got}", "check the file's rights"
        ) from error
    return sha256.hexdigest(), md5.hexdigest()


def _random(backbone: str, seed: int) -> Weights:
    digest = hashlib.sha256(f"{RANDOM} {backbone} {seed}".encode()).hexdigest()
    return Weights(backbone=backbone, label=RANDOM, digest=digest, path=None, seed=seed)


def _packaged(backbone: str) -> Path | None:
    """Return the file of an installed package, found without running the package."""
    for origin in origins_of(backbone):
        module, _, rest = origin.member.partition("/")
        spec = find_spec(module) if origin.place == "pypi" else None
        for folder in (spec.submodule_search_locations or []) if spec else []:
            path = Path(folder) / rest
            if path.is_file():
                return path
    return None
