"""Ours for gel images: a small network pretrained on touch without labels, 192 features.

The last maps are not averaged over the gel but weighed place by place, so that the features say
where something is and their differences how it moved. Its weights come with taxel
(`ready/touch.safetensors`). Knows nothing about weights, files or training.

Background of our choices: docs/decisions/0058.
"""

from __future__ import annotations

from torch import Tensor, nn

from taxel.models.backbones.keras_layers import PixelScale, batch_norm

HEIGHT_PX, WIDTH_PX = 120, 160
"""Of the image that it takes, pixels: half a tactile camera's. Source: our choice."""
CHANNELS = (24, 40, 64, 96)
"""After each halving of the image. Source: our choice, for about 100 MFLOP."""
PLACES_PX = (8, 10)
"""Rows and columns of the last maps."""
NARROW = 32
"""Channels of the last maps. Source: our choice."""
FEATURES = 192
"""Features of a frame. Source: our choice."""
EPS = 1e-3


class Refine(nn.Module):
    """A convolution whose outcome is added to what came in."""

    def __init__(self, channels: int) -> None:
        super().__init__()
        self.layers = nn.Sequential(*_convolve(channels, channels, 3, 1))

    def forward(self, maps: Tensor) -> Tensor:
        """Return maps of the same shape, (n, channels, h, w)."""
        refined: Tensor = maps + self.layers(maps)
        return refined


class TouchEncoder(nn.Module):
    """Images (n, 3, 120, 160), R G B, 0 to 255 → features (n, 192)."""

    def __init__(self) -> None:
        super().__init__()
        self.scale = PixelScale((127.5,) * 3, (63.75,) * 3)
        first, second, third, fourth = CHANNELS
        self.maps = nn.Sequential(
            *_convolve(3, first, 5, 2),
            *_convolve(first, second, 3, 2),
            *_convolve(second, third, 3, 2),
            Refine(third),
            *_convolve(third, fourth, 3, 2),
            Refine(fourth),
            *_convolve(fourth, NARROW, 1, 1),
        )
        self.last = nn.Linear(NARROW * PLACES_PX[0] * PLACES_PX[1], FEATURES)

    def forward(self, images: Tensor) -> Tensor:
        """Return features, shape (n, 192), of images (n, 3, 120, 160), 0 to 255."""
        features: Tensor = self.last(self.maps(self.scale(images)).flatten(1))
        return features


def _convolve(inputs: int, outputs: int, kernel: int, stride: int) -> list[nn.Module]:
    return [
        nn.Conv2d(inputs, outputs, kernel, stride=stride, padding=kernel // 2, bias=False),
        batch_norm(outputs, EPS),
        nn.ReLU(),
    ]
