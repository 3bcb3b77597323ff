"""The old ResNet of Keras (2.2 and before) in our names and with our epsilon.

Knows nothing about files.

Source: keras_applications 1.0.7, resnet50.py: names of layers, a batch norm's epsilon of 1e-3.
"""

from __future__ import annotations

import re

from torch import Tensor

from taxel.models.backbones.resnet import EPS
from taxel.models.published.tfjs import LayersModel

_BLOCK = re.compile(r"(res|bn)([2-5])([a-z])_branch(1|2[abc])")
_PLACES = {"1": "0", "2a": "1", "2b": "2", "2c": "3"}
"""Branch → our number in a block; branch 1 is the way that what came in takes."""
_OUTSIDE = {"conv1": "conv1.conv", "bn_conv1": "conv1.bn", "fc1000": "predictions"}
_ARRAYS = {
    "kernel": "weight",
    "bias": "bias",
    "gamma": "weight",
    "beta": "bias",
    "moving_mean": "running_mean",
    "moving_variance": "running_var",
}
_TURNS = {4: (3, 2, 0, 1), 2: (1, 0)}
"""Axes of a kernel in our order: Keras has height, width, in, out, and in, out."""


def resnet_tensors(model: LayersModel) -> dict[str, Tensor]:
    """Return a ResNet's tensors under our names; a name unknown to this comes back as is.

    Our batch norm adds another epsilon to the variance, so the difference goes into the
    variance itself: the sum, and with it every output, stays the same.
    """
    found: dict[str, Tensor] = {}
    for name, values in model.tensors.items():
        layer, _, array = name.rpartition("/")
        if array == "kernel":
            values = values.permute(_TURNS[values.dim()]) if values.dim() in _TURNS else values
        if array == "moving_variance":
            values = (values.double() + (float(model.configs[layer]["epsilon"]) - EPS)).float()
        place = _our_layer(layer)
        ours = f"{place}.{_ARRAYS[array]}" if place and array in _ARRAYS else name
        found[ours] = values.contiguous()
    return found


def _our_layer(layer: str) -> str:
    """Return our path of a layer; empty where it is none of a ResNet's."""
    match = _BLOCK.fullmatch(layer)
    if match is None:
        return _OUTSIDE.get(layer, "")
    kind = "conv" if match[1] == "res" else "bn"
    block = ord(match[3]) - ord("a") + 1
    return f"conv{match[2]}.block{block}.{_PLACES[match[4]]}_{kind}"
