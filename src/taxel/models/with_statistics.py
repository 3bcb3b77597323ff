"""A network's learned features beside each channel's plain statistics, and one last layer.

Features that a network learned for its own classes carry little information on a class that it
never saw; each channel's mean, spread and share of the whole describe any touch. One
linear layer over both is all that adapting fits (docs/decisions/0028). Knows nothing
about training or files.
"""

from __future__ import annotations

import torch
from torch import Tensor, nn

STATISTICS = 3
"""Statistics of each channel. Source: our choice, docs/decisions/0028."""
_LEAST = 1e-6


class WithStatistics(nn.Module):
    """A body without its last layer, statistics beside it, and a last layer of its own.

    Args:
        network: A network whose attribute `last` is its last linear layer, which is taken off.
        channels: Channels of a window.
        classes: How many classes to tell apart.

    Raises:
        ValueError: The network has no such layer.
    """

    def __init__(self, network: nn.Module, channels: int, classes: int) -> None:
        super().__init__()
        last = getattr(network, "last", None)
        if not isinstance(last, nn.Linear):
            raise ValueError("needed a network that ends in a linear layer `last`; got another")
        network.last = nn.Identity()
        self.body = network
        self.last = nn.Linear(last.in_features + STATISTICS * channels, classes)

    def features(self, values: Tensor, mask: Tensor) -> Tensor:
        """Return what the last layer sees, shape (n, features); arguments as for `forward`."""
        return torch.cat([self.body(values, mask), statistics(values, mask)], dim=1)

    def forward(self, values: Tensor, mask: Tensor) -> Tensor:
        """Return logits, shape (n, classes).

        Args:
            values: Shape (n, steps, channels), scaled; 0 where padded.
            mask: Shape (n, steps), False where a row is padding.
        """
        logits: Tensor = self.last(self.features(values, mask))
        return logits


def statistics(values: Tensor, mask: Tensor) -> Tensor:
    """Return each channel's mean, deviation and share of its row, shape (n, 3 × channels).

    The share is the channel's value over the root of its row's summed squares, mean over the
    rows: what a touch's strength leaves unchanged.

    Args:
        values: Shape (n, steps, channels); 0 where padded.
        mask: Shape (n, steps).
    """
    measured = mask.unsqueeze(2).to(values.dtype)
    rows = measured.sum(dim=1).clamp(min=1.0)
    mean = (values * measured).sum(dim=1) / rows
    spread = (((values - mean.unsqueeze(1)) * measured) ** 2).sum(dim=1) / rows
    whole = (values**2).sum(dim=2, keepdim=True).clamp(min=_LEAST).sqrt()
    share = (values / whole * measured).sum(dim=1) / rows
    return torch.cat([mean, spread.clamp(min=0.0).sqrt(), share], dim=1)
