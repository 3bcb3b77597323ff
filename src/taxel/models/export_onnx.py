"""Backbones and heads as single-file ONNX, pixels' resize and scaling inside the graph.

Each export is run in ONNX Runtime against PyTorch before it is handed out.
Knows nothing about bundles, files or videos.

Background of our choices: docs/decisions/0009.
"""

from __future__ import annotations

import io
import warnings

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor, nn

from taxel.errors import BadBundle
from taxel.models.frame_network import FrameNetwork
from taxel.models.onnx_session import open_session
from taxel.models.sequence import SENSORS

FRAME_HEIGHT_PX = 240
"""Of a camera's frame. Source: the set of issue 3, 320×240."""
FRAME_WIDTH_PX = 320
"""As above."""
LARGEST_DIFFERENCE = 1e-4
"""Allowed between PyTorch and ONNX Runtime, of the largest output or 1. Source: our choice."""
_OPSET = 18


class HeadProbability(nn.Module):
    """A head over features that still stand apart by sensor, with its sigmoid."""

    def __init__(self, head: nn.Module) -> None:
        super().__init__()
        self.head = head

    def forward(self, features: Tensor) -> Tensor:
        """Return probabilities of "unstable", shape (n,), of features (n, k, 2, features)."""
        logits: Tensor = self.head(features.flatten(2))
        return logits.sigmoid()


def export_backbone(
    module: nn.Module,
    name: str,
    height_px: int = FRAME_HEIGHT_PX,
    width_px: int = FRAME_WIDTH_PX,
    *,
    side_px: int | None = None,
) -> bytes:
    """Return an ONNX model: frames, uint8 (n, h, w, 3), R G B → features (n, features).

    Args:
        module: What `BACKBONES[name].build` made, with its weights.
        name: Its name there.
        height_px: Of the camera's frame, pixels.
        width_px: As above.
        side_px: Height and width that the network takes, pixels; its own unless given.

    Raises:
        BadBundle: ONNX Runtime gives other features than PyTorch.
    """
    noise = np.random.default_rng(0).integers(0, 256, (2, height_px, width_px, 3), np.uint8)
    return _export(FrameNetwork(module, name, side_px), noise, "frames", "features")


def export_head(head: nn.Module, k: int, features: int) -> bytes:
    """Return an ONNX model: features (n, k, 2, features) → probability (n,) of "unstable".

    Args:
        head: What `HEADS[…].build` made, trained.
        k: Frames in a window.
        features: Of one sensor's frame.

    Raises:
        BadBundle: ONNX Runtime gives other probabilities than PyTorch.
    """
    noise = np.random.default_rng(0).normal(size=(2, k, SENSORS, features)).astype(np.float32)
    return _export(HeadProbability(head), noise, "features", "probability")


def _export(
    module: nn.Module, example: NDArray[np.generic], input_name: str, output_name: str
) -> bytes:
    training = module.training
    buffer = io.BytesIO()
    try:
        module.eval()
        with warnings.catch_warnings(), torch.no_grad():
            # torch announces its newer exporter at each call, and warns of LSTMs with
            # a free number of windows; both are checked below by running the model.
            warnings.simplefilter("ignore")
            torch.onnx.export(
                module,
                (torch.from_numpy(example),),
                buffer,  # type: ignore[arg-type]  # the older exporter writes to a buffer too
                input_names=[input_name],
                output_names=[output_name],
                dynamic_axes={input_name: {0: "n"}, output_name: {0: "n"}},
                opset_version=_OPSET,
                dynamo=False,
            )
        model = buffer.getvalue()
        _check(module, model, example, input_name)
    finally:
        module.train(training)
    return model


def _check(module: nn.Module, model: bytes, example: NDArray[np.generic], input_name: str) -> None:
    """Run another number of rows than the export saw, and compare."""
    session = open_session(model)
    for rows in (example[:1], np.concatenate([example, example[:1]])):
        found = session.run(None, {input_name: rows})[0]
        with torch.no_grad():
            wanted = module(torch.from_numpy(rows)).numpy()
        largest = float(np.abs(found - wanted).max() / max(1.0, np.abs(wanted).max()))
        if not largest <= LARGEST_DIFFERENCE:
            raise BadBundle(
                f"the exported model to equal PyTorch's within {LARGEST_DIFFERENCE:g}",
                f"a difference of {largest:.2g}",
                "report the model and the versions of torch and onnxruntime",
            )
