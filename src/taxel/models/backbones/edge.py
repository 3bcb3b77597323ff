"""Ours for the edge: five small convolutions over a 160×120 frame, 64 features.

A frame costs 34 MFLOP, a hundredth of DenseNet121. The last maps are averaged
in four quarters, not over the whole gel, so that the features still know where
something moved. There are no published weights: it is trained with its head.
Knows nothing about weights, files or training.

Source: our choice of sizes; MEASURED there as the "own tiny CNN".

Background of our choices: docs/decisions/0013.
"""

from __future__ import annotations

from torch import Tensor, nn

from taxel.models.backbones.keras_layers import PixelScale, batch_norm

CHANNELS = (16, 32, 48, 64)
"""Channels after each halving of the image. Source: our choice, for about 35 MFLOP."""
FEATURES = 64
"""Features of a frame. Source: our choice."""
QUARTERS = 2
"""The last maps are averaged in 2 × 2 parts. Source: our choice."""
EPS = 1e-3


class EdgeCnn(nn.Module):
    """Images (n, 3, 120, 160), R G B, 0 to 255 → features (n, 64)."""

    def __init__(self) -> None:
        super().__init__()
        self.scale = PixelScale((127.5,) * 3, (63.75,) * 3)
        inputs = 3
        halving: list[nn.Module] = []
        for outputs in CHANNELS:
            halving += [
                nn.Conv2d(inputs, outputs, 3, stride=2, padding=1, bias=False),
                batch_norm(outputs, EPS),
                nn.ReLU(),
            ]
            inputs = outputs
        self.halving = nn.Sequential(*halving)
        self.refine = nn.Sequential(
            nn.Conv2d(inputs, inputs, 3, padding=1, bias=False), batch_norm(inputs, EPS), nn.ReLU()
        )
        # Over the 8 × 10 maps that a 120 × 160 image leaves.
        self.quarters = nn.AvgPool2d((8 // QUARTERS, 10 // QUARTERS))
        self.last = nn.Linear(inputs * QUARTERS**2, FEATURES)

    def forward(self, images: Tensor) -> Tensor:
        """Return features, shape (n, 64), of images (n, 3, 120, 160), 0 to 255."""
        maps = self.halving(self.scale(images))
        features: Tensor = self.last(self.quarters(maps + self.refine(maps)).flatten(1))
        return features
