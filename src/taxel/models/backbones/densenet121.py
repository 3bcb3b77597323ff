"""DenseNet121 as Keras builds it, with its 1000-way top: 8,062,504 numbers.

Every layer hands all it was given on to the next. Knows nothing about weights,
files or training.

Source: Huang et al., CVPR 2017; keras.applications.densenet.
"""

from __future__ import annotations

from collections import OrderedDict

import torch
from torch import Tensor, nn

from taxel.models.backbones.keras_layers import (
    IMAGENET_MEAN,
    IMAGENET_SPREAD,
    KerasClassifier,
    PixelScale,
    Top,
    batch_norm,
)

BLOCKS = (6, 12, 24, 16)
"""Layers in each dense block. Source: the paper, Table 1, DenseNet-121."""
GROWTH = 32
"""Channels that each layer adds. Source: the paper, Table 1."""
EPS = 1.001e-5
"""Added to a variance. Source: keras.applications.densenet."""
CLASSES = 1000


class DenseLayer(nn.Sequential):
    """Narrow, convolve, and append the result to what came in."""

    def __init__(self, channels: int) -> None:
        wide = 4 * GROWTH
        layers: dict[str, nn.Module] = {
            "0_bn": batch_norm(channels, EPS),
            "0_relu": nn.ReLU(),
            "1_conv": nn.Conv2d(channels, wide, 1, bias=False),
            "1_bn": batch_norm(wide, EPS),
            "1_relu": nn.ReLU(),
            "2_conv": nn.Conv2d(wide, GROWTH, 3, padding=1, bias=False),
        }
        super().__init__(OrderedDict(layers))

    def forward(self, maps: Tensor) -> Tensor:
        """Return maps (n, channels + GROWTH, h, w) of maps (n, channels, h, w)."""
        added = maps
        for layer in self:
            added = layer(added)
        return torch.cat([maps, added], dim=1)


class DenseNet121(nn.Module):
    """Images (n, 3, 224, 224), R G B, 0 to 255 → features (n, 1000).

    Args:
        top: What the 1000-way top gives.
    """

    def __init__(self, top: Top = "logits") -> None:
        super().__init__()
        self.scale = PixelScale(
            tuple(255 * m for m in IMAGENET_MEAN), tuple(255 * s for s in IMAGENET_SPREAD)
        )
        first: dict[str, nn.Module] = {
            "conv": nn.Conv2d(3, 64, 7, stride=2, padding=3, bias=False),
            "bn": batch_norm(64, EPS),
            "relu": nn.ReLU(),
            # Keras pads with zeros; after a ReLU that equals padding with nothing.
            "pool": nn.MaxPool2d(3, stride=2, padding=1),
        }
        self.conv1 = nn.Sequential(OrderedDict(first))
        channels = 64
        self.conv2, channels = _dense_block(BLOCKS[0], channels)
        self.pool2, channels = _transition(channels)
        self.conv3, channels = _dense_block(BLOCKS[1], channels)
        self.pool3, channels = _transition(channels)
        self.conv4, channels = _dense_block(BLOCKS[2], channels)
        self.pool4, channels = _transition(channels)
        self.conv5, channels = _dense_block(BLOCKS[3], channels)
        self.bn = batch_norm(channels, EPS)
        self.predictions = KerasClassifier(channels, CLASSES, top)

    def forward(self, images: Tensor) -> Tensor:
        """Return features, shape (n, 1000), of images (n, 3, 224, 224), 0 to 255."""
        maps = self.pool2(self.conv2(self.conv1(self.scale(images))))
        maps = self.pool4(self.conv4(self.pool3(self.conv3(maps))))
        features: Tensor = self.predictions(self.bn(self.conv5(maps)).relu())
        return features


def _dense_block(layers: int, channels: int) -> tuple[nn.Sequential, int]:
    each: OrderedDict[str, nn.Module] = OrderedDict(
        (f"block{i + 1}", DenseLayer(channels + i * GROWTH)) for i in range(layers)
    )
    return nn.Sequential(each), channels + layers * GROWTH


def _transition(channels: int) -> tuple[nn.Sequential, int]:
    layers: dict[str, nn.Module] = {
        "bn": batch_norm(channels, EPS),
        "relu": nn.ReLU(),
        "conv": nn.Conv2d(channels, channels // 2, 1, bias=False),
        "pool": nn.AvgPool2d(2),
    }
    return nn.Sequential(OrderedDict(layers)), channels // 2
