"""Random changes to training windows that stand for what a session changes.

Knows nothing about files, models or the loop.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import torch
from torch import Tensor


@dataclass(frozen=True, slots=True, kw_only=True)
class Augment:
    """How much each window is changed; all zero changes nothing.

    Applied to scaled values, anew in every epoch.
    """

    noise: float = 0.0
    """Deviation of noise added to each value, in each channel's spread."""
    gain: float = 0.0
    """Deviation of the logarithm of a factor for the whole window."""
    channel_gain: float = 0.0
    """Deviation of the logarithm of a factor for each channel of a window."""
    offset: float = 0.0
    """Deviation of a constant added to each channel of a window, in its spread."""
    drift: float = 0.0
    """Deviation of a slope from −1 to 1 over the window, in each channel's spread."""
    warp: float = 0.0
    """Largest share by which time runs faster or slower; needs training windows that are
    longer than the network's by at least this share, from which a stretch is drawn."""

    def apply(
        self,
        values: Tensor,
        mask: Tensor,
        spread: Tensor,
        steps: int,
        generator: torch.Generator,
    ) -> Tensor:
        """Return changed windows, shape (n, steps, channels); padding stays 0.

        Args:
            values: Shape (n, rows, channels), scaled; rows ≥ steps.
            mask: Shape (n, rows); all True where rows > steps.
            spread: Each channel's usual deviation within a window, shape (channels,).
            steps: Rows that the network takes.
            generator: The source of randomness.
        """
        n, rows, channels = values.shape
        changed = values
        if rows > steps:
            changed = self._stretch(changed, steps, generator)

        def normal(*shape: int) -> Tensor:
            return torch.randn(*shape, generator=generator)

        if self.gain:
            changed = changed * torch.exp(self.gain * normal(n, 1, 1))
        if self.channel_gain:
            changed = changed * torch.exp(self.channel_gain * normal(n, 1, channels))
        if self.offset:
            changed = changed + self.offset * spread * normal(n, 1, channels)
        if self.drift:
            slope = torch.linspace(-1.0, 1.0, steps)[None, :, None]
            changed = changed + self.drift * spread * normal(n, 1, channels) * slope
        if self.noise:
            changed = changed + self.noise * spread * normal(n, steps, channels)
        if changed is not values and rows == steps and not bool(mask.all()):
            changed = changed * mask.unsqueeze(2)
        return changed

    def _stretch(self, values: Tensor, steps: int, generator: torch.Generator) -> Tensor:
        """Draw `steps` rows at a random place and speed, by linear interpolation."""
        n, rows, channels = values.shape
        turn = 2.0 * torch.rand(n, generator=generator) - 1.0
        speed = torch.exp(turn * math.log1p(self.warp))
        span = (speed * (steps - 1)).clamp(max=rows - 1.0)
        start = torch.rand(n, generator=generator) * (rows - 1.0 - span)
        place = start[:, None] + torch.linspace(0.0, 1.0, steps) * span[:, None]
        below = place.long().clamp(max=rows - 2)
        share = (place - below).unsqueeze(2)
        index = below.unsqueeze(2).expand(n, steps, channels)
        lower, upper = values.gather(1, index), values.gather(1, index + 1)
        return lower + share * (upper - lower)
