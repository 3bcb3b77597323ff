"""A 3D CNN for comparison: time × fingers × phalanges.

The TENG thesis names 3D CNNs as the next step past a 2D CNN (section 2.5.3)
and gives no sizes; ours are those of `cnn2d` with one axis more
(docs/decisions/0024). Knows nothing about training or files.
"""

from __future__ import annotations

from torch import Tensor, nn

FILTERS = (8, 16)
"""3×3×3 filters of the two convolutions, as many as in `cnn2d`. Source: our choice, 0024."""
HIDDEN = 32
"""Units of the dense layer, as in `cnn2d`. Source: our choice, docs/decisions/0007."""
PLACES = {12: (4, 3)}
"""Channels → (fingers, phalanges), where channels run finger by finger. Other arrays are a
line of channels × 1. Source: TENG thesis, section 3.3; docs/decisions/0024."""


class Cnn3d(nn.Module):
    """Two 3D convolutions, pooled in time only, one hidden dense layer.

    Args:
        steps: Rows in a window (time, oldest first).
        channels: Channels of the array, finger by finger.
        classes: How many classes to tell apart.
    """

    def __init__(self, steps: int, channels: int, classes: int) -> None:
        super().__init__()
        first, second = FILTERS
        self._places = PLACES.get(channels, (channels, 1))
        # A hand of 4 × 3 places is too small to pool; time is not.
        self.features = nn.Sequential(
            nn.Conv3d(1, first, 3, padding=1),
            nn.ReLU(),
            nn.MaxPool3d((2, 1, 1), ceil_mode=True),
            nn.Conv3d(first, second, 3, padding=1),
            nn.ReLU(),
            nn.MaxPool3d((2, 1, 1), ceil_mode=True),
            nn.Flatten(),
        )
        halved = -(-steps // 2)
        size = second * -(-halved // 2) * channels
        self.hidden = nn.Sequential(nn.Linear(size, HIDDEN), nn.ReLU())
        self.last = nn.Linear(HIDDEN, classes)

    def forward(self, values: Tensor, mask: Tensor) -> Tensor:
        """Return logits, shape (n, classes).

        Args:
            values: Shape (n, steps, channels), scaled; 0 where padded.
            mask: Shape (n, steps); not used, since padding is 0 in the volume.
        """
        volume = values.reshape(-1, 1, values.shape[1], *self._places)
        logits: Tensor = self.last(self.hidden(self.features(volume)))
        return logits
