"""Random changes to training windows that stand for what a session changes.

Knows nothing about files, models or the loop.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import torch
from torch import Tensor
from torch.nn import functional

from taxel.errors import BadInput


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
    shift_rows: int = 0
    """Largest shift in time, rows either way; what comes in repeats the edge row."""
    rotate_deg: float = 0.0
    """Largest turn of the window as an image of rows × channels, degrees either way, as
    the TENG thesis names it (section 2.5.2); it mixes time with place."""
    shift_fingers: int = 0
    """Largest shift across the hand, fingers either way, as if the object lay further to
    one side; what comes in repeats the edge finger."""
    phalanges: int = 3
    """Channels of one finger, for `shift_fingers`; they stand finger by finger."""

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

        Raises:
            BadInput: `shift_fingers` for channels that are not whole fingers.
        """
        n, rows, channels = values.shape
        changed = values
        if rows > steps:
            changed = self._stretch(changed, steps, generator)
        if self.shift_rows:
            changed = self._shift_rows(changed, mask[:, :steps], generator)
        if self.shift_fingers:
            changed = self._shift_fingers(changed, generator)
        if self.rotate_deg:
            changed = self._rotate(changed, generator)

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

    def _shift_rows(self, values: Tensor, mask: Tensor, generator: torch.Generator) -> Tensor:
        """Move each window in time, within its measured rows."""
        n, steps, channels = values.shape
        shift = _whole_numbers(self.shift_rows, n, generator)
        last = mask.sum(dim=1, keepdim=True).clamp(min=1) - 1
        row = torch.minimum((torch.arange(steps) - shift[:, None]).clamp(min=0), last)
        return values.gather(1, row.unsqueeze(2).expand(n, steps, channels))

    def _shift_fingers(self, values: Tensor, generator: torch.Generator) -> Tensor:
        """Move each window across the hand by whole fingers."""
        n, steps, channels = values.shape
        if channels % self.phalanges:
            raise BadInput(
                f"channels in fingers of {self.phalanges} for a shift across fingers",
                f"{channels}",
                "say how many channels a finger has, or do not shift across fingers",
            )
        fingers = values.reshape(n, steps, -1, self.phalanges)
        count = fingers.shape[2]
        shift = _whole_numbers(self.shift_fingers, n, generator)
        finger = (torch.arange(count) - shift[:, None]).clamp(0, count - 1)
        index = finger[:, None, :, None].expand(n, steps, count, self.phalanges)
        return fingers.gather(2, index).flatten(2)

    def _rotate(self, values: Tensor, generator: torch.Generator) -> Tensor:
        """Turn each window about its middle, by linear interpolation; edges repeat outwards."""
        n, steps, channels = values.shape
        turn = 2.0 * torch.rand(n, generator=generator) - 1.0
        angle = math.radians(self.rotate_deg) * turn
        cos, sin = torch.cos(angle), torch.sin(angle)
        # grid_sample counts from −1 to 1 along both sides: a turn in pixels needs their ratio.
        ratio = (steps - 1) / max(1, channels - 1)
        zero = torch.zeros(n)
        across = torch.stack([cos, -sin * ratio, zero], dim=1)
        down = torch.stack([sin / max(ratio, 1e-9), cos, zero], dim=1)
        place = functional.affine_grid(
            torch.stack([across, down], dim=1), [n, 1, steps, channels], align_corners=True
        )
        image = functional.grid_sample(
            values.unsqueeze(1), place, padding_mode="border", align_corners=True
        )
        return image[:, 0]


def _whole_numbers(largest: int, n: int, generator: torch.Generator) -> Tensor:
    """Return n whole numbers from −largest to largest, each as likely."""
    return torch.randint(-largest, largest + 1, (n,), generator=generator)
