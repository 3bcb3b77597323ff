"""What the stages of an image network see: each channel's means by place, and its deviation.

The last layers of a network that knows pictures say what object is in one; those in the middle say
what textures and edges there are, which is what differs between touches. Knows nothing about
weights, files or training.

Background of our choices: docs/decisions/0041.
"""

from __future__ import annotations

from typing import Final

import numpy as np
import torch
from torch import Tensor, nn

from taxel.models.backbones.efficientnet_lite import EfficientNetLite
from taxel.models.export_onnx import export_backbone
from taxel.models.weights import Weights
from taxel.windows.trial_network import SIDE_PX

NETWORK: Final = "efficientnet-lite0"
"""A name in `BACKBONES`; its weights lie in a package that comes with taxel[train]."""
STAGES: Final = ("block5c", "block6d", "block7a")
"""Ends of the network's last three stages; what is behind them is left out. Source: our choice,
docs/decisions/0041."""
_LEAST_VARIANCE = 1e-12


class StageLooks(nn.Module):
    """Images (n, 3, 224, 224), R G B, 0 to 255 → features (n, 3120).

    Args:
        network: Whose stages are looked at.
    """

    def __init__(self, network: EfficientNetLite) -> None:
        super().__init__()
        self.network = network

    def forward(self, images: Tensor) -> Tensor:
        """Return the channels' means in the image's quarters and their deviations, by stage.

        Where a stage has an odd number of rows, both halves hold the one in the middle.
        """
        maps = self.network.stem(self.network.stem_pad(self.network.scale(images)))
        found: list[Tensor] = []
        for name in self.network.blocks:
            maps = self.network.get_submodule(name)(maps)
            if name in STAGES:
                found += [*_quarters(maps), _deviation(maps)]
        return torch.cat(found, dim=1)


def _quarters(maps: Tensor) -> list[Tensor]:
    """Return the means of four quarters, shape (n, channels) each, row by row."""
    height, width = int(maps.shape[2]), int(maps.shape[3])
    rows, columns = (
        (slice(0, (side + 1) // 2), slice(side // 2, side)) for side in (height, width)
    )
    return [maps[:, :, row, column].mean(dim=(2, 3)) for row in rows for column in columns]


def _deviation(maps: Tensor) -> Tensor:
    """Return the deviation over the image, shape (n, channels)."""
    variance = (maps - maps.mean(dim=(2, 3), keepdim=True)).square().mean(dim=(2, 3))
    return variance.clamp(min=_LEAST_VARIANCE).sqrt()


def export_stage_looks(weights: Weights) -> bytes:
    """Return an ONNX model: frames, uint8 (n, 224, 224, 3), R G B → features (n, 3120).

    Its numbers are those that 16 bits can hold, so that a bundle with it packs to half the size.

    Args:
        weights: Of `NETWORK`.

    Raises:
        BadInput: The file is damaged or another network's.
        BadBundle: ONNX Runtime gives other features than PyTorch.
    """
    network = EfficientNetLite()
    weights.load_into(network)
    return _in_few_bits(export_backbone(StageLooks(network), NETWORK, SIDE_PX, SIDE_PX))


def _in_few_bits(model: bytes) -> bytes:
    """Return a model whose weights are numbers of 16 bits, kept in 32: the lower half is zeros."""
    import onnx
    from onnx import numpy_helper

    read = onnx.load_from_string(model)
    for tensor in read.graph.initializer:
        values = numpy_helper.to_array(tensor)
        if values.dtype == np.float32:
            with np.errstate(over="ignore"):
                rounded = values.astype(np.float16).astype(np.float32)
            if np.isfinite(rounded).all():
                tensor.CopyFrom(numpy_helper.from_array(rounded, tensor.name))
    return bytes(read.SerializeToString())
