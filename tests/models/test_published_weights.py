"""Published weights, converted: the answers of their graph, and what files say of themselves."""

from __future__ import annotations

import io
import json
import tarfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch
from safetensors.torch import save_file
from tfjs_graph import IMAGENET_BGR, read_archive, run_graph, sample_image, scaled

from taxel.errors import BadFile
from taxel.models.backbones.catalogue import BACKBONES
from taxel.models.backbones.resnet import ResNet
from taxel.models.backbones.weight_files import (
    assign_tensors,
    load_backbone_weights,
    save_backbone_weights,
)
from taxel.models.published.about import About, parse_about
from taxel.models.published.origins import ORIGINS, Origin
from taxel.models.published.resnet_names import resnet_tensors
from taxel.models.published.tfjs import read_layers_model
from taxel.models.weights import RANDOM, find_weights

TOP_5 = [506, 646, 418, 761, 487]
"""Of `sample_image`, by the package's own graph: python tests/models/tfjs_graph.py ARCHIVE."""
FIRST_LOGITS = (-3.0983, 2.1624, -5.2041, -4.6333, -0.7243, 2.0098, -2.9072, -3.2488)
"""As above."""
PALACE, UNIFORM = 698, 652
"""Classes of ImageNet."""


def _fetched(backbone: str) -> torch.nn.Module:
    weights = find_weights(backbone, environment={})
    if weights.path is None:
        pytest.skip(f"no weights here: taxel weights fetch {backbone}")
    module = BACKBONES[backbone].build("logits").eval()
    weights.load_into(module)
    return module


def _by_publisher() -> Origin:
    return next(origin for origin in ORIGINS["resnet50"] if origin.place == "publisher")


def test_resnet50_gives_the_answers_of_the_package_it_came_from() -> None:
    """Top five and logits of a drawn image, as the package's graph gives them by its own JSON."""
    if find_weights("resnet50", environment={}).origin == _by_publisher().words:
        pytest.skip("these weights are the publisher's newer file, not the package's")
    module = _fetched("resnet50")
    image = torch.from_numpy(sample_image()).permute(2, 0, 1)[None]

    with torch.no_grad():
        logits = module(image)[0]

    assert logits.topk(5).indices.tolist() == TOP_5
    assert logits[:8].tolist() == pytest.approx(FIRST_LOGITS, abs=1e-3)


def _palace() -> np.ndarray[Any, Any]:
    from sklearn.datasets import load_sample_images

    found: np.ndarray[Any, Any] = load_sample_images().images[0]
    return found


def _officer() -> np.ndarray[Any, Any]:
    """Return matplotlib's photograph of Grace Hopper in uniform, without what lies below."""
    import cv2
    from matplotlib.cbook import get_sample_data

    image = cv2.imread(str(get_sample_data("grace_hopper.jpg", asfileobj=False)))
    assert image is not None
    return np.asarray(image[: image.shape[1], :, ::-1])


@pytest.mark.parametrize(("photograph", "wanted"), [(_palace, PALACE), (_officer, UNIFORM)])
@pytest.mark.parametrize(
    "backbone", ["resnet50", "efficientnet-lite1", "efficientnet-lite2", "mobilenet-v2"]
)
def test_fetched_weights_name_what_a_photograph_shows(
    backbone: str, photograph: Callable[[], np.ndarray[Any, Any]], wanted: int
) -> None:
    """Two photographs, cut square, get their right one of 1000 classes."""
    from taxel.models.frame_network import FrameNetwork

    module = _fetched(backbone)
    image = photograph()
    side = min(image.shape[:2])
    top, left = (image.shape[0] - side) // 2, (image.shape[1] - side) // 2
    square = np.ascontiguousarray(image[top : top + side, left : left + side])

    with torch.no_grad():
        logits = FrameNetwork(module, backbone).eval()(torch.from_numpy(square[None]))

    assert logits.argmax().item() == wanted


# A small ResNet of one block a stage, stored as Keras and TensorFlow.js store the real one.


def _small_layers() -> list[dict[str, Any]]:
    """Return the layers of a ResNet with one block a stage, named as in the real package."""
    layers: list[dict[str, Any]] = []

    def add(name: str, kind: str, *inputs: str, **config: Any) -> str:
        nodes = [[[each, 0, 0, {}] for each in inputs]] if inputs else []
        layers.append({"name": name, "class_name": kind, "config": {"name": name, **config},
                       "inbound_nodes": nodes})  # fmt: skip
        return name

    def conv(name: str, bn: str, given: str, side: int, stride: int, outputs: int) -> str:
        made = add(name, "Conv2D", given, kernel_size=[side, side], strides=[stride, stride],
                   padding="same" if side == 3 else "valid", filters=outputs)  # fmt: skip
        return add(bn, "BatchNormalization", made, epsilon=0.001)

    def relu(given: str) -> str:
        return add(f"activation_{len(layers)}", "Activation", given, activation="relu")

    last = add("conv1_pad", "ZeroPadding2D", add("input_1", "InputLayer"),
               padding=[[3, 3], [3, 3]])  # fmt: skip
    last = relu(conv("conv1", "bn_conv1", last, 7, 2, 64))
    last = add("pool1_pad", "ZeroPadding2D", last, padding=[[1, 1], [1, 1]])
    last = add("max_pooling2d", "MaxPooling2D", last, pool_size=[3, 3], strides=[2, 2],
               padding="valid")  # fmt: skip
    for stage, width in zip(range(2, 6), (64, 128, 256, 512), strict=True):
        at, stride = f"{stage}a_branch", 1 if stage == 2 else 2
        inner = relu(conv(f"res{at}2a", f"bn{at}2a", last, 1, stride, width))
        inner = relu(conv(f"res{at}2b", f"bn{at}2b", inner, 3, 1, width))
        inner = conv(f"res{at}2c", f"bn{at}2c", inner, 1, 1, 4 * width)
        short = conv(f"res{at}1", f"bn{at}1", last, 1, stride, 4 * width)
        last = relu(add(f"add_{stage}", "Add", inner, short))
    add("fc1000", "Dense", add("avg_pool", "GlobalAveragePooling2D", last), units=1000)
    return layers


def _small_arrays(layers: list[dict[str, Any]]) -> dict[str, np.ndarray[Any, Any]]:
    draw = np.random.default_rng(5)
    found: dict[str, np.ndarray[Any, Any]] = {}
    channels = {"input_1": 3}
    for layer in layers:
        name, config = layer["name"], layer["config"]
        inputs = layer["inbound_nodes"][0][0][0] if layer["inbound_nodes"] else ""
        width = channels.get(inputs, 3)
        if layer["class_name"] == "Conv2D":
            side, outputs = config["kernel_size"][0], config["filters"]
            scale = (2 / (side * side * width)) ** 0.5
            found[f"{name}/kernel"] = draw.normal(0, scale, (side, side, width, outputs))
            found[f"{name}/bias"] = draw.normal(0, 0.1, outputs)
            width = outputs
        elif layer["class_name"] == "BatchNormalization":
            found[f"{name}/gamma"] = draw.uniform(0.6, 1.0, width)
            found[f"{name}/beta"] = draw.normal(0, 0.1, width)
            found[f"{name}/moving_mean"] = draw.normal(0, 0.1, width)
            # Down to nothing, where the epsilons of 1e-3 and 1e-5 differ most.
            found[f"{name}/moving_variance"] = draw.uniform(0.0, 2.0, width) ** 4
        elif layer["class_name"] == "Dense":
            found[f"{name}/kernel"] = draw.normal(0, 0.02, (width, 1000))
            found[f"{name}/bias"] = draw.normal(0, 0.1, 1000)
        channels[name] = width
    return {name: values.astype("<f4") for name, values in found.items()}


def _tar_of(path: Path, files: dict[str, bytes], mode: Any = "w:") -> Path:
    with tarfile.open(path, mode) as archive:
        for name, content in files.items():
            member = tarfile.TarInfo(name)
            member.size = len(content)
            archive.addfile(member, io.BytesIO(content))
    return path


def _files_of(
    layers: list[dict[str, Any]], arrays: dict[str, np.ndarray[Any, Any]], shards: int = 3
) -> dict[str, bytes]:
    content = b"".join(values.tobytes() for values in arrays.values())
    cut = [len(content) * part // shards for part in range(shards + 1)]
    names = [f"group1-shard{part + 1}of{shards}.bin" for part in range(shards)]
    files = {f"package/ResNet50/{name}": content[low:high]
             for name, low, high in zip(names, cut[:-1], cut[1:], strict=True)}  # fmt: skip
    entries = [{"name": name, "shape": list(values.shape), "dtype": "float32"}
            for name, values in arrays.items()]  # fmt: skip
    model = {
        "modelTopology": {"model_config": {"config": {"layers": layers}}},
        "weightsManifest": [{"paths": names, "weights": entries}],
    }
    files["package/ResNet50/model.json"] = json.dumps(model).encode()
    files["package/lib/index.js"] = b"throw new Error('never run')"
    return files


@pytest.fixture(scope="module")
def small(tmp_path_factory: pytest.TempPathFactory) -> Path:
    layers = _small_layers()
    folder = tmp_path_factory.mktemp("tfjs")
    return _tar_of(folder / "small.tgz", _files_of(layers, _small_arrays(layers)))


def test_the_conversion_gives_what_the_graph_gives_layer_by_layer(small: Path) -> None:
    """A ResNet of one block a stage, its variances down to 0: within 1e-4 of the largest logit."""
    topology, weights = read_archive(small, "package/ResNet50")
    image = sample_image()
    wanted = run_graph(topology, weights, scaled(image))
    module = ResNet((1, 1, 1, 1)).eval()
    tensors = resnet_tensors(read_layers_model(small, "package/ResNet50"))
    assign_tensors(module, "resnet50", tensors, small)

    with torch.no_grad():
        found = module(torch.from_numpy(image).permute(2, 0, 1)[None])

    assert wanted.std() > 0.1
    assert (found - wanted).abs().max() <= 1e-4 * wanted.abs().max()


def test_a_tar_with_damage_is_refused(small: Path, tmp_path: Path) -> None:
    layers = [{"name": "conv1", "config": {}}]
    arrays = {"conv1/kernel": np.zeros((1, 1, 2, 3), "<f4")}
    good = _files_of(layers, arrays)
    model = json.loads(good["package/ResNet50/model.json"])

    def refused(files: dict[str, bytes]) -> str:
        path = _tar_of(tmp_path / "bad.tgz", files)
        with pytest.raises(BadFile) as caught:
            read_layers_model(path, "package/ResNet50")
        return str(caught.value)

    assert "KeyError" in refused({})
    assert "KeyError" in refused({k: v for k, v in good.items() if "shard2" not in k})
    short = dict(good)
    short["package/ResNet50/group1-shard1of3.bin"] = b""
    assert "buffer" in refused(short)
    more = dict(good)
    more["package/ResNet50/group1-shard3of3.bin"] += b"\0"
    assert "25 bytes for 24" in refused(more)
    model["weightsManifest"][0]["weights"][0]["dtype"] = "uint8"
    assert "of the kind uint8" in refused(
        good | {"package/ResNet50/model.json": json.dumps(model).encode()}
    )
    (tmp_path / "none.tgz").write_bytes(small.read_bytes()[:700])
    with pytest.raises(BadFile):
        read_layers_model(tmp_path / "none.tgz", "package/ResNet50")


def test_only_plain_files_of_the_folder_are_read_and_none_is_unpacked(tmp_path: Path) -> None:
    """A link, a path that leads outside and a file of another folder are passed over."""
    path = tmp_path / "bad.tgz"
    with tarfile.open(path, "w:gz") as archive:
        link = tarfile.TarInfo("package/ResNet50/model.json")
        link.type, link.linkname = tarfile.SYMTYPE, "/etc/passwd"
        archive.addfile(link)
        outside = tarfile.TarInfo("package/ResNet50/../../../outside")
        outside.size = 1
        archive.addfile(outside, io.BytesIO(b"x"))

    with pytest.raises(BadFile, match="KeyError"):
        read_layers_model(path, "package/ResNet50")
    assert [each.name for each in tmp_path.iterdir()] == ["bad.tgz"]


# What files say of themselves.


def test_a_file_of_our_own_training_says_how_it_was_trained(tmp_path: Path) -> None:
    path = tmp_path / "edge.safetensors"
    about = About(origin="taxel train-backbone", trained="end to end, 3 epochs")
    module = BACKBONES["edge"].build("logits")
    save_backbone_weights(module, path, about.head())
    load_backbone_weights(module, "edge", path)

    assert find_weights("edge", path).words == (
        "file:edge.safetensors (taxel train-backbone, end to end, 3 epochs)"
    )


@pytest.mark.parametrize("text", ["[", "[]", '{"origin": 3}', "null", '{"origin": {}}'])
def test_a_head_that_says_nothing_of_use_is_passed_over(text: str, tmp_path: Path) -> None:
    assert parse_about({"taxel": text}) is None
    assert parse_about({}) is None
    path = tmp_path / "edge.safetensors"
    save_file({"a": torch.zeros(1)}, path, metadata={"taxel": text})
    assert find_weights("edge", path).words == "file:edge.safetensors"


def test_an_empty_cache_leaves_random_weights(tmp_path: Path) -> None:
    assert find_weights("resnet50", environment={}, cache=tmp_path).label == RANDOM


def test_the_mean_pixel_is_the_one_the_package_was_trained_with() -> None:
    from taxel.models.backbones.resnet import MEAN

    assert MEAN[::-1] == IMAGENET_BGR
