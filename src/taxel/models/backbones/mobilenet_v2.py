"""MobileNetV2 with its 1000-way top, as torchvision builds it: 3,538,984 numbers.

Unlike Keras': zeros stand on all sides alike, and a variance gets 1e-5. Knows
nothing about weights, files or training.

Source: Sandler et al., CVPR 2018; torchvision.models.mobilenetv2, whose published
weights fit by name.
"""

from __future__ import annotations

from typing import NamedTuple

from torch import Tensor, nn

from taxel.models.backbones.keras_layers import (
    IMAGENET_MEAN,
    IMAGENET_SPREAD,
    KerasClassifier,
    PixelScale,
    Top,
    batch_norm,
)

EPS = 1e-5
"""Added to a variance. Source: PyTorch's batch norm, default."""
STEM, HEAD, CLASSES = 32, 1280, 1000


class Stage(NamedTuple):
    """Blocks of one width."""

    expand: int
    outputs: int
    repeats: int
    stride: int


STAGES = (
    Stage(1, 16, 1, 1),
    Stage(6, 24, 2, 2),
    Stage(6, 32, 3, 2),
    Stage(6, 64, 4, 2),
    Stage(6, 96, 3, 1),
    Stage(6, 160, 3, 2),
    Stage(6, 320, 1, 1),
)
"""Expansion, outputs, repeats and stride. Source: the paper, Table 2."""


class Block(nn.Module):
    """Widen, convolve each channel by itself, narrow, and add what came in where it fits.

    Args:
        inputs: Channels that come in.
        stage: Expansion and outputs.
        stride: Of the channel-wise convolution.
    """

    def __init__(self, inputs: int, stage: Stage, stride: int) -> None:
        super().__init__()
        wide = inputs * stage.expand
        self.adds = stride == 1 and inputs == stage.outputs
        layers: list[nn.Module] = []
        if stage.expand != 1:
            layers.append(_conv(inputs, wide, 1))
        layers.append(_conv(wide, wide, 3, stride=stride, groups=wide))
        layers += [nn.Conv2d(wide, stage.outputs, 1, bias=False), batch_norm(stage.outputs, EPS)]
        self.conv = nn.Sequential(*layers)

    def forward(self, maps: Tensor) -> Tensor:
        """Return maps (n, outputs, h / stride, w / stride) of maps (n, inputs, h, w)."""
        outcome: Tensor = self.conv(maps)
        return outcome + maps if self.adds else outcome


class MobileNetV2(nn.Module):
    """Images (n, 3, 224, 224), R G B, 0 to 255 → features (n, 1000).

    Args:
        top: What the 1000-way top gives.
    """

    def __init__(self, top: Top = "logits") -> None:
        super().__init__()
        mean, spread = (
            tuple(255 * each for each in part) for part in (IMAGENET_MEAN, IMAGENET_SPREAD)
        )
        self.scale = PixelScale(mean, spread)
        layers: list[nn.Module] = [_conv(3, STEM, 3, stride=2)]
        inputs = STEM
        for stage in STAGES:
            for repeat in range(stage.repeats):
                layers.append(Block(inputs, stage, stage.stride if repeat == 0 else 1))
                inputs = stage.outputs
        self.features = nn.Sequential(*layers, _conv(inputs, HEAD, 1))
        self.predictions = KerasClassifier(HEAD, CLASSES, top)

    def forward(self, images: Tensor) -> Tensor:
        """Return features, shape (n, 1000), of images (n, 3, 224, 224), 0 to 255."""
        features: Tensor = self.predictions(self.features(self.scale(images)))
        return features


def rename_published(key: str) -> str:
    """Return our name of a tensor of torchvision's file."""
    return key.replace("classifier.1.", "predictions.")


def _conv(
    inputs: int, outputs: int, kernel: int, *, stride: int = 1, groups: int = 1
) -> nn.Sequential:
    """Return a convolution with zeros on all sides, its batch norm and ReLU6."""
    return nn.Sequential(
        nn.Conv2d(inputs, outputs, kernel, stride, padding=kernel // 2, groups=groups, bias=False),
        batch_norm(outputs, EPS),
        nn.ReLU6(),
    )
