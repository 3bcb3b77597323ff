"""The thesis's signal network: a 1D CNN over one flat sequence of all values.

A 12×12 window is read as 144 values in a row (TENG thesis, section 3.5.1), scan
by scan: the thesis leaves that order open (docs/decisions/0042); layer sizes
are ours (docs/decisions/0007). Knows nothing about
training or files.
"""

from __future__ import annotations

from torch import Tensor, nn

FILTERS = (8, 16)
"""Filters of the two convolutions. Source: our choice, docs/decisions/0007."""
KERNEL = 5
"""Values under one filter. Source: our choice, docs/decisions/0007."""
HIDDEN = 32
"""Units of the dense layer. Source: our choice, docs/decisions/0007."""


class Cnn1d(nn.Module):
    """Two 1D convolutions with pooling, one hidden dense layer.

    Args:
        steps: Scans in a window.
        channels: Values in a scan.
        classes: How many classes to tell apart.
    """

    def __init__(self, steps: int, channels: int, classes: int) -> None:
        super().__init__()
        first, second = FILTERS
        self.features = nn.Sequential(
            nn.Conv1d(1, first, KERNEL, padding=KERNEL // 2),
            nn.ReLU(),
            nn.MaxPool1d(2, ceil_mode=True),
            nn.Conv1d(first, second, KERNEL, padding=KERNEL // 2),
            nn.ReLU(),
            nn.MaxPool1d(2, ceil_mode=True),
            nn.Flatten(),
        )
        halved = -(-steps * channels // 2)
        self.hidden = nn.Sequential(nn.Linear(second * -(-halved // 2), HIDDEN), nn.ReLU())
        self.last = nn.Linear(HIDDEN, classes)

    def forward(self, values: Tensor, mask: Tensor) -> Tensor:
        """Return logits, shape (n, classes).

        Args:
            values: Shape (n, steps, channels), scaled; 0 where padded.
            mask: Shape (n, steps); not used, since padding is 0 in the sequence.
        """
        sequence = values.flatten(1).unsqueeze(1)
        logits: Tensor = self.last(self.hidden(self.features(sequence)))
        return logits
