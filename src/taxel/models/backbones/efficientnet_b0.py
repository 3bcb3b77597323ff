"""EfficientNetB0 as Keras builds it, with its 1000-way top: 5,330,571 numbers.

Of these, seven are the normalisation layer's. Keras' dropout and stochastic
depth, which act in training only, are left out. Knows nothing about weights,
files or training loops.

Source: Tan and Le, ICML 2019; keras.applications.efficientnet.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import NamedTuple

import torch
from torch import Tensor, nn

from taxel.models.backbones.keras_layers import (
    IMAGENET_SPREAD,
    KerasClassifier,
    Normalization,
    Top,
    batch_norm,
    same_pad,
)

EPS = 1e-3
"""Added to a variance. Source: Keras' batch normalisation, default."""
SQUEEZE = 0.25
"""Channels between squeeze and excitation, of those that come in. Source: the paper."""
STEM = 32
HEAD = 1280
CLASSES = 1000
SIDE_PX = 224
"""Height and width of an image, pixels. Source: the paper, Table 1."""
REPEATS = "abcdefgh"
"""Letters of a stage's blocks in Keras' names of layers."""


class Stage(NamedTuple):
    """Blocks of one width."""

    kernel: int
    repeats: int
    outputs: int
    expand: int
    stride: int


STAGES = (
    Stage(3, 1, 16, 1, 1),
    Stage(3, 2, 24, 6, 2),
    Stage(5, 2, 40, 6, 2),
    Stage(3, 3, 80, 6, 2),
    Stage(5, 3, 112, 6, 1),
    Stage(5, 4, 192, 6, 2),
    Stage(3, 1, 320, 6, 1),
)
"""Kernel, repeats, outputs, expansion and stride. Source: the paper, Table 1."""


class SqueezeExcite(nn.Module):
    """Weigh each channel by what the whole image says of it."""

    def __init__(self, channels: int, inner: int) -> None:
        super().__init__()
        self.reduce = nn.Conv2d(channels, inner, 1)
        self.expand = nn.Conv2d(inner, channels, 1)

    def forward(self, maps: Tensor) -> Tensor:
        """Return weighed maps of the same shape (n, channels, h, w)."""
        squeezed = nn.functional.silu(self.reduce(maps.mean(dim=(2, 3), keepdim=True)))
        weighed: Tensor = maps * self.expand(squeezed).sigmoid()
        return weighed


class InvertedBlock(nn.Module):
    """Widen, convolve each channel by itself, narrow, and add what came in where it fits.

    Args:
        inputs: Channels that come in.
        stage: Kernel, outputs and expansion.
        stride: Of the channel-wise convolution.
        side_px: Height and width of the maps that come in, pixels.
        activation: Between the layers.
        squeeze: Whether channels are weighed, as in B0 but not in Lite0.
    """

    def __init__(
        self,
        inputs: int,
        stage: Stage,
        stride: int,
        side_px: int,
        activation: Callable[[], nn.Module],
        squeeze: bool,
    ) -> None:
        super().__init__()
        wide = inputs * stage.expand
        self.adds = stride == 1 and inputs == stage.outputs
        self.widens = stage.expand != 1
        if self.widens:
            self.expand_conv = nn.Conv2d(inputs, wide, 1, bias=False)
            self.expand_bn = batch_norm(wide, EPS)
        self.pad = same_pad(stage.kernel, side_px) if stride == 2 else nn.Identity()
        self.dwconv = nn.Conv2d(
            wide,
            wide,
            stage.kernel,
            stride=stride,
            padding=0 if stride == 2 else stage.kernel // 2,
            groups=wide,
            bias=False,
        )
        self.bn = batch_norm(wide, EPS)
        self.activation = activation()
        self.se = SqueezeExcite(wide, max(1, int(inputs * SQUEEZE))) if squeeze else nn.Identity()
        self.project_conv = nn.Conv2d(wide, stage.outputs, 1, bias=False)
        self.project_bn = batch_norm(stage.outputs, EPS)

    def forward(self, maps: Tensor) -> Tensor:
        """Return maps (n, outputs, h / stride, w / stride) of maps (n, inputs, h, w)."""
        inner = maps
        if self.widens:
            inner = self.activation(self.expand_bn(self.expand_conv(inner)))
        inner = self.se(self.activation(self.bn(_by_channel(self.dwconv, self.pad(inner)))))
        outcome: Tensor = self.project_bn(self.project_conv(inner))
        return outcome + maps if self.adds else outcome


def _by_channel(conv: nn.Conv2d, maps: Tensor) -> Tensor:
    """Convolve channel by channel, on a processor in 32 bits under autocast too.

    PyTorch's backward pass of it in bfloat16 takes eight times as long (docs/decisions/0057).
    """
    if maps.device.type == "cpu" and torch.is_autocast_enabled("cpu"):
        with torch.autocast("cpu", enabled=False):
            return torch.as_tensor(conv(maps.float()))
    return torch.as_tensor(conv(maps))


class ConvNorm(nn.Module):
    """A convolution, its batch norm and an activation."""

    def __init__(self, conv: nn.Conv2d, activation: Callable[[], nn.Module]) -> None:
        super().__init__()
        self.conv = conv
        self.bn = batch_norm(conv.out_channels, EPS)
        self.activation = activation()

    def forward(self, maps: Tensor) -> Tensor:
        """Return maps (n, outputs, h', w')."""
        outcome: Tensor = self.activation(self.bn(self.conv(maps)))
        return outcome


class InvertedNetwork(nn.Module):
    """Stem, seven stages of inverted blocks, head and top, over scaled images.

    Args:
        activation: Between the layers.
        squeeze: Whether channels are weighed.
        top: What the 1000-way top gives.
        stages: The blocks.
        side_px: Height and width of an image, pixels.
    """

    def __init__(
        self,
        activation: Callable[[], nn.Module],
        squeeze: bool,
        top: Top,
        stages: Sequence[Stage] = STAGES,
        side_px: int = SIDE_PX,
    ) -> None:
        super().__init__()
        self.stem_pad = same_pad(3, side_px)
        self.stem = ConvNorm(nn.Conv2d(3, STEM, 3, stride=2, bias=False), activation)
        inputs, side_px = STEM, _halved(side_px, 2)
        self.blocks: list[str] = []
        for number, stage in enumerate(stages, start=1):
            for repeat in range(stage.repeats):
                name = f"block{number}{REPEATS[repeat]}"
                stride = stage.stride if repeat == 0 else 1
                block = InvertedBlock(inputs, stage, stride, side_px, activation, squeeze)
                self.add_module(name, block)
                self.blocks.append(name)
                inputs, side_px = stage.outputs, _halved(side_px, stride)
        self.top = ConvNorm(nn.Conv2d(inputs, HEAD, 1, bias=False), activation)
        self.predictions = KerasClassifier(HEAD, CLASSES, top)

    def forward(self, scaled: Tensor) -> Tensor:
        """Return features, shape (n, 1000), of scaled images (n, 3, side, side)."""
        maps: Tensor = self.stem(self.stem_pad(scaled))
        for name in self.blocks:
            maps = self.get_submodule(name)(maps)
        features: Tensor = self.predictions(self.top(maps))
        return features


class EfficientNetB0(InvertedNetwork):
    """Images (n, 3, 224, 224), R G B, 0 to 255 → features (n, 1000).

    Args:
        top: What the 1000-way top gives.
        published: Divide once more by the root of ImageNet's spread, as Keras does
            with its published weights only, since these were trained so.
    """

    rescale: Tensor

    def __init__(self, top: Top = "logits", *, published: bool = True) -> None:
        super().__init__(nn.SiLU, squeeze=True, top=top)
        self.normalization = Normalization()
        factor = [1 / math.sqrt(s) if published else 1.0 for s in IMAGENET_SPREAD]
        self.register_buffer("rescale", torch.tensor(factor).reshape(1, 3, 1, 1), persistent=False)

    def forward(self, images: Tensor) -> Tensor:
        """Return features, shape (n, 1000), of images (n, 3, 224, 224), 0 to 255."""
        scaled = self.normalization(images.to(self.rescale.dtype) / 255) * self.rescale
        return super().forward(scaled)


def _halved(side_px: int, stride: int) -> int:
    """Return the side of the maps behind a stride, pixels."""
    return -(-side_px // stride)
