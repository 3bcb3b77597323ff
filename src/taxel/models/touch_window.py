"""One batch of windows, with what several blocks of features need of it, each computed once.

In double precision; rows that are padding do not count. Knows nothing about features or models.
"""

from __future__ import annotations

from functools import cached_property

import torch
from torch import Tensor
from torch.nn import functional

MOST_ROWS = 500
"""Rows of a window up to which every block sees each of them; in longer windows so many rows are
averaged that there are as many. Source: our choice, 0039: of 2,117 rows of 18 channels a
recogniser took 4 ms."""
FAR = 1e30
"""What padding is taken for where the least or the most is sought."""
TINY = 1e-9
"""Added where a quotient or a logarithm would be without bounds."""
_ROUNDING = 1e-9
"""Share of a level below which a difference is rounding, in double precision."""


class Touch:
    """One batch of windows, with what several blocks need of it.

    Args:
        values: Shape (n, steps, channels) float64, unscaled; 0 where padded.
        present: Shape (n, steps, 1) float64: 1 where a row was measured, 0 where it is padding;
            None where no row is, for then an exported model computes less.
    """

    def __init__(self, values: Tensor, present: Tensor | None) -> None:
        self.values = values
        self.whole = present is None
        """Whether no row is padding."""
        rows = int(values.shape[1])  # no graph of sizes
        self.present = torch.ones(1, rows, 1).double() if present is None else present
        """Shape (n, steps, 1); (1, steps, 1) where no row is padding."""
        self.count = self.present.sum(dim=1).clamp(min=1.0)

    def kept(self, values: Tensor, present: Tensor) -> Tensor:
        """Return values where rows are measured, else 0.

        Args:
            values: Shape (n, rows, …).
            present: Shape (n, rows, 1): `self.present`, or what was made of it.
        """
        return values if self.whole else values * present

    @cached_property
    def mean(self) -> Tensor:
        """Shape (n, channels)."""
        return rounded(self.kept(self.values, self.present).sum(dim=1) / self.count)

    @cached_property
    def centred(self) -> Tensor:
        """Values less their mean, 0 where padded, shape (n, steps, channels)."""
        return self.kept(self.values - self.mean.unsqueeze(1), self.present)

    @cached_property
    def deviation(self) -> Tensor:
        """Shape (n, channels)."""
        return (self.centred.square().sum(dim=1) / self.count).sqrt()

    @cached_property
    def rounding(self) -> Tensor:
        """What is smaller stands for nothing, shape (n, channels).

        Without it a still channel's deviation is its mean's last binary digit, which PyTorch and
        ONNX Runtime round differently, and trees would learn from it.
        """
        return _ROUNDING * self.mean.abs() + TINY

    def beyond(self, far: float) -> Tensor:
        """Return values, and something far away where rows are padding, shape as values'."""
        if self.whole:
            return self.values
        return self.values * self.present + far * (1.0 - self.present)

    @cached_property
    def least(self) -> Tensor:
        """Shape (n, channels)."""
        return self.beyond(FAR).amin(dim=1)

    @cached_property
    def most(self) -> Tensor:
        """Shape (n, channels)."""
        return self.beyond(-FAR).amax(dim=1)

    @cached_property
    def first(self) -> Tensor:
        """Shape (n, channels)."""
        return self.values[:, 0]

    @cached_property
    def last(self) -> Tensor:
        """Shape (n, channels)."""
        if self.whole:
            return self.values[:, -1]
        after = torch.cat([self.present[:, 1:], torch.zeros_like(self.present[:, :1])], dim=1)
        return (self.values * (self.present - after)).sum(dim=1)

    @cached_property
    def steps(self) -> Tensor:
        """Each row less the one before, 0 where padded, shape (n, steps − 1, channels)."""
        return self.kept(self.values[:, 1:] - self.values[:, :-1], self.present[:, 1:])

    @cached_property
    def place(self) -> Tensor:
        """Each row's place in its window, 0 … 1 − 1/rows, shape (n, steps, 1)."""
        return (self.present.cumsum(dim=1) - 1.0) / self.count.unsqueeze(1)

    def parts(self, values: Tensor, count: int) -> Tensor:
        """Return means over equal parts of a window's time, shape (n, count, channels).

        A row counts in each part by the share of its time that lies there, so that a trial of
        fewer rows than parts has no empty ones, from which its length could be read.

        Args:
            values: Shape (n, steps, channels), such as `centred`.
            count: Of parts.
        """
        edges = torch.arange(count, dtype=torch.float64) / count
        end = self.place + 1.0 / self.count.unsqueeze(1)
        inside = torch.minimum(end, edges + 1.0 / count) - torch.maximum(self.place, edges)
        share = inside.clamp(min=0.0) * count * self.present
        return torch.matmul(share.transpose(1, 2), values)

    @cached_property
    def slope(self) -> Tensor:
        """Change over the window along the fitted line, shape (n, channels)."""
        middle = (self.place * self.present).sum(dim=1, keepdim=True) / self.count.unsqueeze(1)
        place = (self.place - middle) * self.present
        return (place * self.centred).sum(dim=1) / place.square().sum(dim=1).clamp(min=TINY)

    @cached_property
    def activity(self) -> Tensor:
        """Mean size of a step, shape (n, channels)."""
        return self.steps.abs().sum(dim=1) / (self.count - 1.0).clamp(min=1.0)


def rounded(values: Tensor) -> Tensor:
    """Return averages to single precision, as scans are measured.

    The last digits of a sum depend on its order, which PyTorch and ONNX Runtime choose each for
    itself; so a channel that stands still is exactly its mean in both.
    """
    return values.float().double()


def coarse(touch: Touch) -> Touch:
    """Return long windows with every few rows averaged, others as they are."""
    steps, channels = (int(size) for size in touch.values.shape[1:])  # no graph of sizes
    every = -(-steps // MOST_ROWS)
    if every == 1:
        return touch
    rows = -(-steps // every)
    more = (0, 0, 0, rows * every - steps)
    values = functional.pad(touch.values, more).reshape(-1, rows, every, channels)
    present = functional.pad(touch.present, more).reshape(-1, rows, every, 1)
    count = present.sum(dim=2)
    mean = rounded(values.sum(dim=2) / count.clamp(min=1.0))
    return Touch(mean, None if touch.whole else (count > 0).double())
