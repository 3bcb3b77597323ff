"""A ConvLSTM for comparison: an LSTM whose gates are convolutions over fingers × phalanges.

The TENG thesis names "3D LSTM networks" (section 1) and gives no sizes; the cell is that of Shi et
al., NeurIPS 2015, without peepholes, its sizes of the order of the thesis's own networks
(docs/decisions/0047). Knows nothing about training or files.
"""

from __future__ import annotations

import torch
from torch import Tensor, nn

from taxel.models.cnn3d import PLACES

FILTERS = 16
"""Maps that the cell remembers, as many as the second convolution of `cnn3d`. Source: our choice,
docs/decisions/0047."""
HIDDEN = 32
"""Units of the dense layer, as in `cnn2d`. Source: our choice, docs/decisions/0007."""


class ConvLstm(nn.Module):
    """One ConvLSTM cell over the rows of a window, its state after the last measured row.

    Args:
        steps: Rows in a window; not used, windows of any length fit.
        channels: Channels of the array, finger by finger.
        classes: How many classes to tell apart.
    """

    def __init__(self, steps: int, channels: int, classes: int) -> None:
        super().__init__()
        self._places = PLACES.get(channels, (channels, 1))
        self.gates = nn.Conv2d(1 + FILTERS, 4 * FILTERS, 3, padding=1)
        self.hidden = nn.Sequential(nn.Linear(FILTERS * channels, HIDDEN), nn.ReLU())
        self.last = nn.Linear(HIDDEN, classes)

    def forward(self, values: Tensor, mask: Tensor) -> Tensor:
        """Return logits, shape (n, classes).

        Args:
            values: Shape (n, steps, channels), scaled; 0 where padded.
            mask: Shape (n, steps), False where a row is padding; the state is kept there.
        """
        rows = values.reshape(values.shape[0], values.shape[1], 1, *self._places)
        state = torch.zeros_like(rows[:, 0]).repeat(1, FILTERS, 1, 1)
        cell = state
        present = mask.to(values.dtype)[:, :, None, None, None]
        for step in range(values.shape[1]):
            gates = self.gates(torch.cat([rows[:, step], state], dim=1))
            enter, forget, leave, new = gates.chunk(4, dim=1)
            kept = torch.sigmoid(forget) * cell + torch.sigmoid(enter) * torch.tanh(new)
            shown = torch.sigmoid(leave) * torch.tanh(kept)
            here = present[:, step]
            cell = here * kept + (1.0 - here) * cell
            state = here * shown + (1.0 - here) * state
        logits: Tensor = self.last(self.hidden(state.flatten(1)))
        return logits
