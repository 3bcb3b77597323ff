"""InceptionTime: convolutions of several lengths side by side, six modules deep.

Written from Ismail Fawaz et al., "InceptionTime: finding AlexNet for time
series classification", Data Mining and Knowledge Discovery 34, 2020, section 3.
One network is one member; the paper averages five, as `Job.members` does.
Where we depart from the paper: kernels no longer than the window, odd, and
padding that no layer sees (docs/decisions/0024). Knows nothing about training
or files.
"""

from __future__ import annotations

import torch
from torch import Tensor, nn
from torch.nn import functional

FILTERS = 32
"""Filters of each branch. Source: the paper, section 3.1."""
BOTTLENECK = 32
"""Channels behind a module's bottleneck. Source: the paper, section 3.1."""
KERNELS = (40, 20, 10)
"""Rows under the three branches' filters. Source: the paper, section 3.1."""
DEPTH = 6
"""Modules. Source: the paper, section 3.1."""
RESIDUAL_EVERY = 3
"""Modules that one shortcut spans. Source: the paper, section 3.1."""
WIDTH = 4 * FILTERS
"""Channels that a module gives: three convolutions and the pooled branch."""


class InceptionTime(nn.Module):
    """Six inception modules, a shortcut around every third, mean over time, one dense layer.

    Args:
        steps: Rows in a window; bounds the kernels, windows of any length can be given later.
        channels: Channels of the array.
        classes: How many classes to tell apart.
    """

    def __init__(self, steps: int, channels: int, classes: int) -> None:
        super().__init__()
        kernels = fitting_kernels(steps)
        before = [channels] + [WIDTH] * (DEPTH - 1)
        self.inceptions = nn.ModuleList(_Module(width, kernels) for width in before)
        self.shortcuts = nn.ModuleList(
            nn.Sequential(nn.Conv1d(width, WIDTH, 1, bias=False), nn.BatchNorm1d(WIDTH))
            for width in before[::RESIDUAL_EVERY]
        )
        self.last = nn.Linear(WIDTH, classes)

    def forward(self, values: Tensor, mask: Tensor) -> Tensor:
        """Return logits, shape (n, classes).

        Args:
            values: Shape (n, steps, channels), scaled; 0 where padded.
            mask: Shape (n, steps), False where a row is padding.
        """
        present = mask.unsqueeze(1).to(values.dtype)
        x = values.transpose(1, 2) * present
        around = x
        for number, module in enumerate(self.inceptions, 1):
            x = module(x) * present
            if number % RESIDUAL_EVERY == 0:
                shortcut = self.shortcuts[number // RESIDUAL_EVERY - 1]
                around = x = functional.relu(x + shortcut(around)) * present
        mean = x.sum(dim=2) / present.sum(dim=2).clamp(min=1)
        logits: Tensor = self.last(mean)
        return logits


class _Module(nn.Module):
    """A bottleneck, three convolutions behind it, and a pooled branch beside it."""

    def __init__(self, before: int, kernels: tuple[int, ...]) -> None:
        super().__init__()
        self.bottleneck = nn.Conv1d(before, BOTTLENECK, 1, bias=False)
        self.branches = nn.ModuleList(
            nn.Conv1d(BOTTLENECK, FILTERS, size, padding=size // 2, bias=False) for size in kernels
        )
        self.pooled = nn.Sequential(
            nn.MaxPool1d(3, stride=1, padding=1), nn.Conv1d(before, FILTERS, 1, bias=False)
        )
        self.norm = nn.BatchNorm1d(WIDTH)

    def forward(self, x: Tensor) -> Tensor:
        """Return (n, WIDTH, steps) of (n, before, steps)."""
        narrow = self.bottleneck(x)
        each = [branch(narrow) for branch in self.branches]
        found: Tensor = functional.relu(self.norm(torch.cat([*each, self.pooled(x)], dim=1)))
        return found


def fitting_kernels(steps: int) -> tuple[int, ...]:
    """Return the three kernels for windows of `steps` rows: the paper's proportions, odd.

    The longest is the paper's or the window's length, whichever is less: what reaches
    further sees padding only. 400 rows give 39, 19 and 9; 12 rows give 11, 5 and 3.
    """
    share = min(1.0, steps / KERNELS[0])
    return tuple(max(3, (int(size * share) - 1) | 1) for size in KERNELS)
