"""The thesis's image network: 3×3 filters, ReLU, pooling, flatten, dense.

The TENG thesis (section 3.6.2) names the layers and leaves their sizes open.
Ours are small enough for an 8-bit microcontroller with 8 KB of RAM and 256 KB
of flash (docs/decisions/0007). Knows nothing about training or files.
"""

from __future__ import annotations

from torch import Tensor, nn

FILTERS = (8, 16)
"""3×3 filters of the two convolutions. Source: our choice, docs/decisions/0007."""
HIDDEN = 32
"""Units of the dense layer. Source: our choice, docs/decisions/0007."""


class Cnn2d(nn.Module):
    """Two convolutions with pooling, one hidden dense layer.

    Args:
        steps: Rows of the image (time, oldest first).
        channels: Columns of the image (sensors).
        classes: How many classes to tell apart.
    """

    def __init__(self, steps: int, channels: int, classes: int) -> None:
        super().__init__()
        first, second = FILTERS
        self.features = nn.Sequential(
            nn.Conv2d(1, first, 3, padding=1),
            nn.ReLU(),
            nn.MaxPool2d(2, ceil_mode=True),
            nn.Conv2d(first, second, 3, padding=1),
            nn.ReLU(),
            nn.MaxPool2d(2, ceil_mode=True),
            nn.Flatten(),
        )
        rows, columns = (_halved_twice(size) for size in (steps, channels))
        self.hidden = nn.Sequential(nn.Linear(second * rows * columns, HIDDEN), nn.ReLU())
        self.last = nn.Linear(HIDDEN, classes)

    def forward(self, values: Tensor, mask: Tensor) -> Tensor:
        """Return logits, shape (n, classes).

        Args:
            values: Shape (n, steps, channels), scaled; 0 where padded.
            mask: Shape (n, steps); not used, since padding is 0 in the image.
        """
        logits: Tensor = self.last(self.hidden(self.features(values.unsqueeze(1))))
        return logits


def _halved_twice(size: int) -> int:
    """Return a side's length after two poolings by 2 that round up."""
    once = -(-size // 2)
    return -(-once // 2)
