"""Weights of a backbone from a file and to one, checked name by name.

Reads .safetensors (ours), Keras' .h5 and .weights.h5, and the .pth files that
were published of some. Knows nothing about where files lie or which to take.
"""

from __future__ import annotations

import hashlib
import importlib
import pickle
import re
from collections.abc import Callable, Mapping
from functools import partial
from itertools import count, takewhile
from pathlib import Path
from typing import Any

import torch
from safetensors import SafetensorError, safe_open
from safetensors.torch import save_file
from torch import Tensor, nn

from taxel.errors import BadFile, BadInput, MissingExtra
from taxel.foreign.files import check_tensors
from taxel.models.backbones import efficientnet_lite, mobilenet_v2
from taxel.models.backbones.keras_layers import Normalization
from taxel.plain_text import number_of
from taxel.recordings.whole import whole_file

SUFFIXES = (".safetensors", ".h5", ".pth")
"""Kinds of file that can be read; Keras' ".weights.h5" ends in ".h5" too."""
_PTH_NAMES: dict[str, Callable[[str], str]] = {
    f"efficientnet-lite{number}": partial(efficientnet_lite.rename_published, number=number)
    for number in range(len(efficientnet_lite.LITES))
} | {"mobilenet-v2": mobilenet_v2.rename_published}
"""Backbones whose weights were published as .pth → our name of a tensor there."""
_TOP_NAMES = ("fc1000", "probs")
"""Older names of Keras' layer "predictions" in its published files."""
_MEND = "give this backbone's own file, with its 1000-way top"


def load_backbone_weights(module: nn.Module, name: str, path: Path) -> None:
    """Fill a backbone with the weights of a file, all of them or none.

    Args:
        module: What `BACKBONES[name].build` made.
        name: Its name there.
        path: The file.

    Raises:
        BadInput: The file is missing, damaged, of another kind or another network's.
    """
    if not path.is_file():
        raise BadInput(f"a file of weights for {name}", f"no file {path}", "check the path")
    reader = _READERS.get(path.suffix.lower())
    if reader is None:
        raise BadInput(
            f"weights in a file that ends in {', '.join(SUFFIXES)}", f"{path.name}", "convert it"
        )
    assign_tensors(module, name, reader(module, name, path), path)


def save_backbone_weights(
    module: nn.Module, path: Path, about: dict[str, str] | None = None
) -> None:
    """Write a backbone's weights as .safetensors, whole or not at all.

    Args:
        module: The backbone.
        path: The file.
        about: Words about it, kept in the file's head.

    Raises:
        RecordingFailed: The disk refused.
    """
    tensors = {key: value.contiguous() for key, value in backbone_tensors(module).items()}
    save_tensors(path, tensors, about)


def backbone_tensors(module: nn.Module) -> dict[str, Tensor]:
    """Return a module's tensors without PyTorch's own counters of batches."""
    state: dict[str, Tensor] = module.state_dict()
    return {key: value for key, value in state.items() if not key.endswith("num_batches_tracked")}


def tensor_digest(tensors: Mapping[str, Tensor]) -> str:
    """Return the SHA-256 over tensors: names, kinds, shapes and values, hexadecimal.

    Unlike a file's sum, it stays the same however the tensors are stored.
    """
    whole = hashlib.sha256()
    for name, tensor in sorted(tensors.items()):
        whole.update(f"{name} {tensor.dtype} {tuple(tensor.shape)}\n".encode())
        whole.update(tensor.detach().contiguous().cpu().numpy().tobytes())
    return whole.hexdigest()


def read_tensors(path: Path) -> tuple[dict[str, Tensor], dict[str, str]]:
    """Return the tensors of a .safetensors file, and the words about them in its head.

    Raises:
        BadFile: It is no such file, or too large.
        OSError: It is not there, or may not be read.
    """
    check_tensors(path)
    try:
        with safe_open(path, framework="pt") as file:
            return {key: file.get_tensor(key) for key in file.keys()}, file.metadata() or {}  # noqa: SIM118
    except SafetensorError as error:
        raise BadFile("a whole .safetensors file", f"{error}", _MEND) from error


def save_tensors(
    path: Path, tensors: dict[str, Tensor], about: dict[str, str] | None = None
) -> None:
    """Write tensors and words about them as .safetensors, whole or not at all.

    Raises:
        RecordingFailed: The disk refused; `whole_file` makes it of any OSError.
    """
    with whole_file(path) as temporary:
        try:
            temporary.touch()
            mode = temporary.stat().st_mode
            save_file(tensors, temporary, metadata=about)
            temporary.chmod(mode)  # safetensors lets its owner alone read it
        except SafetensorError as error:  # a full disk, among others
            raise OSError(str(error)) from error


def assign_tensors(module: nn.Module, name: str, tensors: Mapping[str, Tensor], path: Path) -> None:
    """Fill a backbone with tensors by name, all of them or none.

    Args:
        module: What `BACKBONES[name].build` made.
        name: Its name there.
        tensors: Our name → tensor.
        path: Where they come from, for messages.

    Raises:
        BadInput: One is missing, unknown, of another shape, or not finite.
    """
    own_tensors = backbone_tensors(module)
    tensors = {k: v for k, v in tensors.items() if not k.endswith("num_batches_tracked")}
    missing = [key for key in own_tensors if key not in tensors]
    unknown = [key for key in tensors if key not in own_tensors]
    if missing or unknown:
        lacks = f"{len(missing)} missing (first {missing[0]})" if missing else ""
        extra = f"{len(unknown)} unknown (first {unknown[0]})" if unknown else ""
        got = ", ".join(part for part in (lacks, extra) if part)
        raise BadInput(f"the weights of {name}", f"{path.name} with {got}", _MEND)
    for key, tensor in own_tensors.items():
        if tensor.shape != tensors[key].shape:
            raise BadInput(
                f"{key} of shape {tuple(tensor.shape)} for {name}",
                f"{tuple(tensors[key].shape)} in {path.name}",
                _MEND,
            )
        if not torch.isfinite(tensors[key]).all():
            raise BadInput(
                f"finite weights for {name}", f"NaN or infinity in {key} of {path.name}", _MEND
            )
    module.load_state_dict(dict(tensors), strict=False)


def _read_safetensors(_module: nn.Module, name: str, path: Path) -> Mapping[str, Tensor]:
    try:
        return read_tensors(path)[0]
    except (OSError, BadFile) as error:
        got = getattr(error, "got", error)
        raise BadInput(f"the weights of {name}", f"{path.name}: {got}", _MEND) from error


def _read_pth(_module: nn.Module, name: str, path: Path) -> Mapping[str, Tensor]:
    rename = _PTH_NAMES.get(name)
    if rename is None:
        raise BadInput(
            f"a .h5 or .safetensors file for {name}",
            f"{path.name}",
            f"only {', '.join(_PTH_NAMES)} were published as .pth",
        )
    try:
        loaded = torch.load(path, map_location="cpu", weights_only=True)
    except (pickle.UnpicklingError, RuntimeError, EOFError, ValueError, OSError) as error:
        first = str(error).splitlines()[0] if str(error) else type(error).__name__
        raise BadInput(f"the weights of {name}", f"{path.name}: {first}", _MEND) from error
    if not isinstance(loaded, dict) or not all(isinstance(v, Tensor) for v in loaded.values()):
        raise BadInput(f"the weights of {name}", f"{path.name} without them", _MEND)
    return {rename(str(key)): value for key, value in loaded.items()}


def _read_keras(module: nn.Module, name: str, path: Path) -> Mapping[str, Tensor]:
    layers = _read_h5(name, path)
    tensors: dict[str, Tensor] = {}
    used: set[str] = set()
    for at, layer in module.named_modules():
        parts = _parts_of(layer)
        if not parts:
            continue
        keras_name = at.replace(".", "_")
        if keras_name not in layers:
            continue
        used.add(keras_name)
        if len(parts) != len(layers[keras_name]):
            raise BadInput(
                f"{number_of(len(parts), 'array')} in the layer {keras_name} of {name}",
                f"{len(layers[keras_name])} in {path.name}",
                _MEND,
            )
        for (key, turn), array in zip(parts, layers[keras_name], strict=True):
            if turn and array.dim() != len(turn):
                raise BadInput(
                    f"an array of {number_of(len(turn), 'axis')} in the layer {keras_name} of "
                    f"{name}",
                    f"{array.dim()} in {path.name}",
                    _MEND,
                )
            tensors[f"{at}.{key}"] = array.permute(turn) if turn else array
    # A layer that we do not have is reported under its own name.
    tensors.update({layer: each[0] for layer, each in layers.items() if layer not in used})
    return tensors


_READERS: dict[str, Callable[[nn.Module, str, Path], Mapping[str, Tensor]]] = {
    ".safetensors": _read_safetensors,
    ".pth": _read_pth,
    ".h5": _read_keras,
}


def _parts_of(layer: nn.Module) -> list[tuple[str, tuple[int, ...]]]:
    """Return our names of a Keras layer's arrays, in its order, and how to turn their axes."""
    if isinstance(layer, nn.Conv2d):
        # Keras: height, width, in, out; a channel-wise one: height, width, channels, 1.
        turn = (2, 3, 0, 1) if layer.groups > 1 else (3, 2, 0, 1)
        return [("weight", turn)] + ([("bias", ())] if layer.bias is not None else [])
    if isinstance(layer, nn.Linear):
        return [("weight", (1, 0)), ("bias", ())]
    if isinstance(layer, nn.BatchNorm2d):
        return [(key, ()) for key in ("weight", "bias", "running_mean", "running_var")]
    if isinstance(layer, Normalization):
        return [(key, ()) for key in ("mean", "variance", "count")]
    return []


def _read_h5(name: str, path: Path) -> dict[str, list[Tensor]]:
    """Return each layer's arrays in Keras' order, by the layer's name with "_" for "/"."""
    try:
        h5py: Any = importlib.import_module("h5py")
    except ImportError as error:
        raise MissingExtra("h5py", "hdf5", f"Keras' file {path.name}") from error
    try:
        with h5py.File(path, "r") as file:
            root = file.get("model_weights", file)
            layers = _legacy_layers(root) if "layer_names" in _names_in(root) else _layers(root)
    except (OSError, KeyError, ValueError, RuntimeError, TypeError) as error:
        raise BadInput(
            f"the weights of {name} in a Keras file", f"{path.name}: {error}", _MEND
        ) from error
    return {_our_name(layer): arrays for layer, arrays in layers.items() if arrays}


def _our_name(layer: str) -> str:
    # "normalization_3" is the name of the layer in the fourth network of a session.
    layer = re.sub(r"^(normalization)_\d+$", r"\1", layer.replace("/", "_"))
    return "predictions" if layer in _TOP_NAMES else layer


def _names_in(root: Any) -> set[str]:
    return {re.sub(r"\d+$", "", str(key)) for key in root.attrs}


def _legacy_layers(root: Any) -> dict[str, list[Tensor]]:
    """Read the format of Keras 2: names of layers and of their arrays stand in attributes."""
    return {
        layer: [
            torch.from_numpy(root[layer][array][()].copy())
            if root[layer][array].shape
            else torch.tensor(root[layer][array][()])
            for array in _attribute(root[layer], "weight_names")
        ]
        for layer in _attribute(root, "layer_names")
    }


def _attribute(group: Any, name: str) -> list[str]:
    """Return a list of names; HDF5 stores a long one in numbered parts."""
    numbered = takewhile(lambda part: part in group.attrs, (f"{name}{i}" for i in count()))
    parts = [name] if name in group.attrs else list(numbered)
    words = [word for part in parts for word in group.attrs[part]]
    return [word.decode() if isinstance(word, bytes) else str(word) for word in words]


def _layers(root: Any) -> dict[str, list[Tensor]]:
    """Read the format of Keras 3: a group "vars" a layer, with the layer's name on it."""
    found: dict[str, list[Tensor]] = {}

    def visit(path: str, item: Any) -> None:
        if path.endswith("/vars") and len(item):
            layer = str(item.attrs.get("name", path))
            found[layer] = [torch.as_tensor(item[key][()]) for key in sorted(item, key=int)]

    root.visititems(visit)
    return found
