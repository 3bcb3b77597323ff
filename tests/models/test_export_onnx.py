"""ONNX Runtime gives what PyTorch gives, from the camera's bytes on."""

from __future__ import annotations

import numpy as np
import onnx
import onnxruntime
import pytest
import torch

from taxel.errors import BadBundle
from taxel.models.backbones.catalogue import BACKBONES
from taxel.models.export_onnx import HeadProbability, _check, export_backbone, export_head
from taxel.models.frame_network import FrameNetwork
from taxel.models.sequence import HEADS
from taxel.models.weights import find_weights


def _run(model: bytes, rows: np.ndarray) -> np.ndarray:
    session = onnxruntime.InferenceSession(model, providers=["CPUExecutionProvider"])
    return np.asarray(session.run(None, {session.get_inputs()[0].name: rows})[0])


@pytest.mark.parametrize(
    "name",
    [
        "edge",
        "efficientnet-lite0",
        pytest.param("densenet121", marks=pytest.mark.slow),
        pytest.param("efficientnet-b0", marks=pytest.mark.slow),
        pytest.param("resnet50", marks=pytest.mark.slow),
    ],
)
def test_an_exported_backbone_equals_pytorchs_from_the_cameras_bytes_on(name: str) -> None:
    """Within 1e-4, for another number of frames than the export saw; one self-contained file."""
    row = BACKBONES[name]
    module = row.build("logits")
    find_weights(name, environment={}).load_into(module)
    model = export_backbone(module, name)
    frames = np.random.default_rng(1).integers(0, 256, (3, 240, 320, 3), np.uint8)

    with torch.no_grad():
        wanted = FrameNetwork(module, name).eval()(torch.from_numpy(frames)).numpy()
    found = _run(model, frames)

    assert found.shape == (3, row.features)
    assert np.abs(found - wanted).max() < 1e-4 * max(1.0, np.abs(wanted).max())
    tensors = onnx.load_from_string(model).graph.initializer
    assert all(t.data_location == onnx.TensorProto.DEFAULT for t in tensors)


@pytest.mark.parametrize("name", HEADS)
def test_an_exported_head_gives_pytorchs_probability(name: str) -> None:
    torch.manual_seed(0)
    head = HEADS[name].build(64, 8)
    model = export_head(head, 8, 64)
    features = np.random.default_rng(1).normal(size=(5, 8, 2, 64)).astype(np.float32)

    with torch.no_grad():
        wanted = head.eval()(torch.from_numpy(features).flatten(2)).sigmoid().numpy()
    found = _run(model, features)

    assert found.shape == (5,)
    assert np.abs(found - wanted).max() < 1e-5


def test_a_module_keeps_its_mode_through_an_export() -> None:
    head = HEADS["lstm"].build(4, 2).train()
    export_head(head, 2, 4)

    assert head.training


def test_a_model_that_differs_is_not_handed_out() -> None:
    torch.manual_seed(0)
    head = HEADS["lstm"].build(4, 2)
    model = export_head(head, 2, 4)
    torch.nn.init.constant_(head.last.bias, 3.0)
    features = np.zeros((2, 2, 2, 4), np.float32)

    with pytest.raises(BadBundle, match="equal PyTorch's within"):
        _check(HeadProbability(head).eval(), model, features, "features")
