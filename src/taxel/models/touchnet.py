"""A small residual 1D CNN for any array: four views of each channel, then convolutions in time.

What a session changes (level, gain, drift) differs from channel to channel, so
the network sees each channel four times: on its own scale, relative to the
whole window, relative to itself, and as change. All of it happens inside the
network on values as measured, so that a bundle's input stays raw. Knows
nothing about training or files (docs/decisions/0011).
"""

from __future__ import annotations

import torch
from torch import Tensor, nn
from torch.nn import functional

WIDTHS = (32, 48, 64)
"""Filters of the stem and the two blocks. Source: docs/decisions/0011."""
LAG = 4
"""Rows between the two ends of a change. Source: our choice, 0011."""
VIEWS = 4
"""Of each channel: on its own scale, beside the window, beside itself, and as change."""


class TouchNet(nn.Module):
    """Views, a strided stem, two residual blocks, mean and maximum over time.

    Call `prepare` with the training windows before training: it measures each
    channel's level and scale.

    Args:
        steps: Rows in a window; windows of any length can be given later.
        channels: Channels of the array.
        classes: How many classes to tell apart.
    """

    level: Tensor
    scale: Tensor
    change: Tensor
    wander: Tensor

    def __init__(self, steps: int, channels: int, classes: int) -> None:
        super().__init__()
        self._lag = max(1, min(LAG, steps - 1))  # of a single row there is no change: zeros
        for name in ("level", "scale", "change", "wander"):
            self.register_buffer(name, torch.ones(channels))
        stem, *later = WIDTHS
        stride = 4 if steps >= 64 else 1
        self.stem = nn.Sequential(
            nn.Conv1d(VIEWS * channels, stem, 9, stride, padding=4, bias=False),
            nn.BatchNorm1d(stem),
            nn.ReLU(),
        )
        strides = (2, 1) if steps >= 64 else (1, 1)
        self.blocks = nn.Sequential(
            *(_Block(a, b, s) for a, b, s in zip(WIDTHS[:-1], later, strides, strict=True))
        )
        self.still = nn.BatchNorm1d(2 * channels)
        self.drop = nn.Dropout(0.3)
        self.last = nn.Linear(2 * WIDTHS[-1] + 2 * channels, classes)

    def prepare(self, values: Tensor, mask: Tensor) -> None:
        """Measure each channel's level, scale, change and wander on training windows.

        Args:
            values: Shape (n, steps, channels), as measured.
            mask: Shape (n, steps), False where a row is padding.
        """
        present = mask.unsqueeze(2)
        mean = _mean(values, present)
        apart = (values - mean) * present
        deviation = _mean(apart.square(), present).sqrt()[:, 0]
        overall = (apart.square().sum((0, 1)) / present.sum((0, 1))).sqrt()
        both = present[:, self._lag :] & present[:, : -self._lag]
        step = (values[:, self._lag :] - values[:, : -self._lag]).abs() * both
        least = (1e-3 * overall).clamp(max=1e-6)  # of a channel: signals may be as small
        least = torch.where(least > 0, least, torch.full_like(least, 1e-6))
        self.level = mean[:, 0].median(0).values
        self.wander = (mean[:, 0] - self.level).abs().mean(0) + least
        self.scale = deviation.median(0).values + 0.05 * overall + least
        self.change = step.sum((0, 1)) / both.sum().clamp(min=1) + least

    def forward(self, values: Tensor, mask: Tensor) -> Tensor:
        """Return logits, shape (n, classes).

        Args:
            values: Shape (n, steps, channels), as measured; 0 where padded.
            mask: Shape (n, steps), False where a row is padding.
        """
        present = mask.unsqueeze(2).to(values.dtype)
        mean = _mean(values, present)
        apart = (values - mean) * present / self.scale
        own = (_mean(apart.square(), present) + 1e-4).sqrt()
        window = (_mean(apart.square(), present).mean(2, keepdim=True) + 1e-4).sqrt()
        step = (values[:, self._lag :] - values[:, : -self._lag]) / self.change
        step = _squash(step) * present[:, self._lag :]
        step = functional.pad(step, (0, 0, self._lag, 0))
        views = torch.cat([_squash(apart), apart / window, apart / (own + 0.1), step], dim=2)
        found = self.blocks(self.stem(views.transpose(1, 2)))
        level = _squash((mean[:, 0] - self.level) / self.wander)
        still = self.still(torch.cat([torch.log(own[:, 0]), level], dim=1))
        features = torch.cat([found.mean(2), found.amax(2), still], dim=1)
        logits: Tensor = self.last(self.drop(features))
        return logits


class _Block(nn.Module):
    """Two convolutions beside a shortcut."""

    def __init__(self, before: int, after: int, stride: int) -> None:
        super().__init__()
        self.main = nn.Sequential(
            nn.Conv1d(before, after, 5, stride, padding=2, bias=False),
            nn.BatchNorm1d(after),
            nn.ReLU(),
            nn.Conv1d(after, after, 5, padding=2, bias=False),
            nn.BatchNorm1d(after),
        )
        pool = nn.AvgPool1d(stride, ceil_mode=True) if stride > 1 else nn.Identity()
        self.short = nn.Sequential(pool, nn.Conv1d(before, after, 1))

    def forward(self, x: Tensor) -> Tensor:
        """Return (n, after, length / stride) of (n, before, length)."""
        found: Tensor = functional.relu(self.main(x) + self.short(x))
        return found


def _mean(values: Tensor, present: Tensor) -> Tensor:
    """Return the mean over measured rows, shape (n, 1, channels)."""
    total = (values * present).sum(dim=1, keepdim=True)
    return total / present.sum(dim=1, keepdim=True).clamp(min=1)


def _squash(x: Tensor) -> Tensor:
    """Return asinh(x), written so that every ONNX engine has it."""
    return torch.sign(x) * torch.log(x.abs() + torch.sqrt(x * x + 1.0))
