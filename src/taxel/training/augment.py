"""Random changes to training windows that stand for what a session changes.

Knows nothing about files, models or the loop.
"""

from __future__ import annotations

from dataclasses import dataclass

import torch
from torch import Tensor


@dataclass(frozen=True, slots=True, kw_only=True)
class Augment:
    """How much each window is changed; all zero changes nothing.

    Applied to scaled values, anew in every epoch.
    """

    noise: float = 0.0
    """Deviation of noise added to each value, in scaled units."""
    gain: float = 0.0
    """Deviation of the logarithm of a factor for the whole window."""
    channel_gain: float = 0.0
    """Deviation of the logarithm of a factor for each channel of a window."""
    offset: float = 0.0
    """Deviation of a constant added to each channel of a window, in scaled units."""

    def apply(self, values: Tensor, mask: Tensor, generator: torch.Generator) -> Tensor:
        """Return changed windows, shape (n, steps, channels); padding stays 0.

        Args:
            values: Shape (n, steps, channels), scaled.
            mask: Shape (n, steps).
            generator: The source of randomness.
        """
        n, _, channels = values.shape
        changed = values
        if self.gain:
            changed = changed * torch.exp(self.gain * torch.randn(n, 1, 1, generator=generator))
        if self.channel_gain:
            factor = torch.randn(n, 1, channels, generator=generator)
            changed = changed * torch.exp(self.channel_gain * factor)
        if self.offset:
            changed = changed + self.offset * torch.randn(n, 1, channels, generator=generator)
        if self.noise:
            changed = changed + self.noise * torch.randn(values.shape, generator=generator)
        if changed is not values and not bool(mask.all()):
            changed = changed * mask.unsqueeze(2)
        return changed
