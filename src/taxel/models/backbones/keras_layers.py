"""The pieces that Keras' image networks are made of, said in PyTorch.

A module's dotted path with its dots as underscores is the Keras layer's name
("conv2.block1.1_conv" is "conv2_block1_1_conv"), so that Keras' weights fit by
name. Knows nothing about whole networks, weights or files.

Source: keras.applications 3.15.1 (densenet.py, resnet.py, efficientnet.py),
read for their numbers; the code is ours.
"""

from __future__ import annotations

from typing import Literal

import torch
from torch import Tensor, nn

Top = Literal["logits", "softmax", "places"]
"""What the 1000-way top gives: its weighted sums; Keras' default, probabilities; or the sums of
each place of the last maps, whose mean over all places is the first."""

IMAGENET_MEAN = (0.485, 0.456, 0.406)
"""Mean of ImageNet's pixels, R G B, of 1. Source: keras.applications.imagenet_utils."""
IMAGENET_SPREAD = (0.229, 0.224, 0.225)
"""Standard deviation of ImageNet's pixels, R G B, of 1. Source: as above."""
_MOMENTUM = 0.01
"""Share of a new batch in the moving statistics. Source: Keras' momentum of 0.99."""


class PixelScale(nn.Module):
    """Pixels of 0 to 255 to what a network was trained on: (pixels − mean) ÷ spread.

    Args:
        mean: R G B, of 255.
        spread: R G B, of 255.
        bgr: Hand on blue first, as ResNet's published weights expect.
    """

    mean: Tensor
    factor: Tensor

    def __init__(
        self, mean: tuple[float, ...], spread: tuple[float, ...], *, bgr: bool = False
    ) -> None:
        super().__init__()
        # Not persistent: Keras keeps these outside its model, so they count nowhere.
        shape = (1, 3, 1, 1)
        self.register_buffer("mean", torch.tensor(mean).reshape(shape), persistent=False)
        self.register_buffer("factor", 1 / torch.tensor(spread).reshape(shape), persistent=False)
        self.bgr = bgr

    def forward(self, images: Tensor) -> Tensor:
        """Return scaled images, floating, of images (n, 3, h, w), R G B, 0 to 255."""
        scaled = (images.to(self.mean.dtype) - self.mean) * self.factor
        return scaled.flip(1) if self.bgr else scaled


class Normalization(nn.Module):
    """Keras' layer of this name: seven numbers that travel with the weights.

    Starts with ImageNet's statistics, as the published file holds them.
    """

    mean: Tensor
    variance: Tensor
    count: Tensor

    def __init__(self) -> None:
        super().__init__()
        self.register_buffer("mean", torch.tensor(IMAGENET_MEAN))
        self.register_buffer("variance", torch.tensor(IMAGENET_SPREAD).square())
        self.register_buffer("count", torch.zeros((), dtype=torch.int64))

    def forward(self, images: Tensor) -> Tensor:
        """Return normalised images, shape (n, 3, h, w), of images of 0 to 1."""
        spread = self.variance.sqrt().clamp_min(1e-7)
        return (images - self.mean[:, None, None]) / spread[:, None, None]


class KerasClassifier(nn.Linear):
    """Keras' layer "predictions": the 1000-way top over averaged maps, kept as features."""

    def __init__(self, inputs: int, outputs: int, top: Top) -> None:
        super().__init__(inputs, outputs)
        self.top = top

    def forward(self, maps: Tensor) -> Tensor:
        """Return features of maps (n, inputs, h, w).

        Returns:
            Shape (n, outputs); (n, h · w, outputs), row by row, where the top gives "places".
        """
        if self.top == "places":
            return super().forward(maps.flatten(2).transpose(1, 2))
        logits = super().forward(maps.mean(dim=(2, 3)))
        return logits.softmax(dim=1) if self.top == "softmax" else logits


def batch_norm(channels: int, eps: float) -> nn.BatchNorm2d:
    """Return a batch norm with Keras' momentum."""
    return nn.BatchNorm2d(channels, eps=eps, momentum=_MOMENTUM)


def same_pad(kernel: int, side_px: int = 224) -> nn.ZeroPad2d:
    """Return TensorFlow's padding "same" before a stride of 2.

    Over an even side it puts one zero less before the image than behind it, over
    an odd one as many.

    Args:
        kernel: Width of the convolution, odd, pixels.
        side_px: Height and width of what comes in, pixels.
    """
    behind = kernel // 2
    before = behind - (side_px % 2 == 0)
    return nn.ZeroPad2d((before, behind, before, behind))
