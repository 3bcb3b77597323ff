"""A recurrent network for comparison: one LSTM over the rows of a window.

The TENG thesis names LSTMs as the next step past a 2D CNN (section 2.5.3) and
gives no sizes; ours are of the order of its own networks
(docs/decisions/0024). Knows nothing about training or files.
"""

from __future__ import annotations

from torch import Tensor, nn

UNITS = 64
"""Numbers that the LSTM remembers. Source: our choice, docs/decisions/0024."""
HIDDEN = 32
"""Units of the dense layer, as in `cnn2d`. Source: our choice, docs/decisions/0007."""


class Lstm(nn.Module):
    """One LSTM layer, its state after the last measured row, one hidden dense layer.

    Args:
        steps: Rows in a window; not used, windows of any length fit.
        channels: Channels of the array: the LSTM's input at each row.
        classes: How many classes to tell apart.
    """

    def __init__(self, steps: int, channels: int, classes: int) -> None:
        super().__init__()
        self.memory = nn.LSTM(channels, UNITS, batch_first=True)
        self.hidden = nn.Sequential(nn.Linear(UNITS, HIDDEN), nn.ReLU())
        self.last = nn.Linear(HIDDEN, classes)

    def forward(self, values: Tensor, mask: Tensor) -> Tensor:
        """Return logits, shape (n, classes).

        Args:
            values: Shape (n, steps, channels), scaled; 0 where padded.
            mask: Shape (n, steps), False where a row is padding.
        """
        states, _ = self.memory(values)
        present = mask.to(states.dtype)
        # 1 at the last measured row alone: padding stands behind it.
        at_end = present - nn.functional.pad(present[:, 1:], (0, 1))
        state = (states * at_end.unsqueeze(2)).sum(dim=1)
        logits: Tensor = self.last(self.hidden(state))
        return logits
