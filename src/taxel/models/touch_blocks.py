"""Blocks of plain statistics of a window, each channel by itself unless it says otherwise.

In double precision; rows that are padding do not count, and how many rows there are is no feature.
Knows nothing about which are computed together.

Source: our choice of usual statistics, docs/decisions/0039.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from taxel.models.grid_features import IMAGE_BLOCKS
from taxel.models.touch_window import FAR, TINY, Touch, rounded

SEGMENTS, PARTS = 8, 16
"""Equal parts of a window whose means are taken, less the window's mean and as they are. Source:
our choice, 0039."""
START_ROWS = (1, 2, 4, 8)
"""First rows of a window whose means are the block `start`. Source: our choice, 0039."""
QUANTILES = (0.1, 0.25, 0.5, 0.75, 0.9)
FINE_QUANTILES = (0.02, 0.05, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 0.95, 0.98)
"""Of values, in the block `distribution`. Source: our choice, 0039."""
CHANGE_ROWS = (4, 16, 64)
"""Rows over which changes are taken there, in windows of four times as many. Source: as above."""
CHANGE_QUANTILES = (0.02, 0.1, 0.25, 0.5, 0.75, 0.9, 0.98)
"""Of those changes. Source: as above."""
MOST_CHANGES = 100
"""Changes of which they are taken. Source: our choice, 0039: of all changes in 400 rows of five
channels they took 0.6 ms live."""
MOST_SORTED = 200
"""Rows of which quantiles are taken; of up to twice as many, all. Source: our choice, 0039."""
SPECTRUM_ROWS = (8, 64)
"""Least and most rows of a stretch whose spectrum is taken; stretches overlap by half and their
powers are averaged (Welch). Source: our choice, 0039."""
MOST_CORRELATED = 24
"""Channels up to which all pairs are correlated. Source: our choice, 0039."""


def _log(positive: Tensor) -> Tensor:
    return (positive + TINY).log()


def _rows(touch: Touch) -> Tensor:
    return touch.kept(touch.values, touch.present).flatten(1)


def _centred(touch: Touch) -> Tensor:
    return touch.centred.flatten(1)


def _mean(touch: Touch) -> Tensor:
    return touch.mean


def _statistics(touch: Touch) -> Tensor:
    parts = [touch.mean, touch.deviation, touch.least, touch.most, touch.last, touch.activity]
    return torch.cat(parts, dim=1)


def _level(touch: Touch) -> Tensor:
    return torch.cat([touch.mean, touch.least, touch.most, touch.first, touch.last], dim=1)


def _start(touch: Touch) -> Tensor:
    """Means of the first rows: where channels drift, what they show before they do.

    Args:
        touch: The first rows of each window, as they are.
    """
    parts = []
    for rows in START_ROWS:
        measured = touch.present[:, :rows]
        total = touch.kept(touch.values[:, :rows], measured).sum(dim=1)
        parts.append(rounded(total / measured.sum(dim=1).clamp(min=1.0)))
    return torch.cat(parts, dim=1)


def _tared(touch: Touch) -> Tensor:
    parts = [touch.mean, touch.least, touch.most, touch.last]
    return torch.cat([part - touch.first for part in parts], dim=1)


def _shape(touch: Touch) -> Tensor:
    inside = [touch.least, touch.most, touch.first, touch.last]
    sizes = [touch.deviation, touch.most - touch.least, touch.activity]
    parts = [part - touch.mean for part in inside] + [
        (part + touch.rounding).log() for part in sizes
    ]
    return torch.cat([*parts, touch.deviation, touch.activity, touch.slope], dim=1)


def _course(touch: Touch) -> Tensor:
    return touch.parts(touch.centred, SEGMENTS).flatten(1)


def _parts(touch: Touch) -> Tensor:
    return rounded(touch.parts(touch.values, PARTS)).flatten(1)


def _quantiles(touch: Touch) -> Tensor:
    """Quantiles less the mean, and how often the course crosses its mean.

    Of long windows those of evenly spaced rows: sorting would take most of a recogniser's time.
    """
    every = max(1, int(touch.values.shape[1]) // MOST_SORTED)
    taken = _at_quantiles(touch, touch.values[:, ::every], touch.present[:, ::every], QUANTILES)
    side = (touch.centred > touch.rounding.unsqueeze(1)).double()
    both = touch.present[:, 1:] * touch.present[:, :-1]
    crossed = touch.kept((side[:, 1:] - side[:, :-1]).abs(), both).sum(dim=1)
    rate = crossed / (touch.count - 1.0).clamp(min=1.0)
    return torch.cat([(taken - touch.mean.unsqueeze(1)).flatten(1), rate], dim=1)


def _distribution(touch: Touch) -> Tensor:
    """Finer quantiles less the mean, and quantiles of changes over few and many rows.

    Of long windows those of evenly spaced rows: sorting would take most of a recogniser's time.
    """
    steps = int(touch.values.shape[1])
    every = max(1, steps // MOST_SORTED)
    values, present = touch.values[:, ::every], touch.present[:, ::every]
    levels = _at_quantiles(touch, values, present, FINE_QUANTILES)
    found = [levels - touch.mean.unsqueeze(1)]
    for rows in CHANGE_ROWS:
        if steps >= 4 * rows:
            every = -(-(steps - rows) // MOST_CHANGES)
            change = touch.values[:, rows::every] - touch.values[:, :-rows:every]
            both = touch.present[:, rows::every] * touch.present[:, :-rows:every]
            found.append(_at_quantiles(touch, touch.kept(change, both), both, CHANGE_QUANTILES))
    return torch.cat([part.flatten(1) for part in found], dim=1)


def _at_quantiles(
    touch: Touch, values: Tensor, present: Tensor, levels: tuple[float, ...]
) -> Tensor:
    """Return each channel's quantiles, the nearest row's value, shape (n, levels, channels).

    Where no row is present they are 0.

    Args:
        touch: Whose these are.
        values: Shape (n, rows, channels).
        present: Shape (n, rows, 1).
        levels: Shares of the rows, 0…1.
    """
    count = present.sum(dim=1)
    shares = torch.tensor(levels, dtype=torch.float64)
    index = (shares * (count.clamp(min=1.0) - 1.0) + 0.5).floor().long().unsqueeze(2)
    if touch.whole:
        return values.sort(dim=1)[0][:, index[0, :, 0]]
    ordered, _ = (values * present + FAR * (1.0 - present)).sort(dim=1)
    taken = torch.gather(ordered, 1, index.expand(-1, -1, ordered.shape[2]))
    return taken * (count > 0.0).double().unsqueeze(2)


def _octaves(touch: Touch) -> Tensor:
    """Logarithm of the mean square of each octave's Haar wavelets."""
    now, here, parts = touch.values, touch.present, []
    while now.shape[1] >= 2:
        if now.shape[1] % 2:
            now, here = now[:, :-1], here[:, :-1]
        even, odd = now[:, 0::2], now[:, 1::2]
        both = here[:, 0::2] * here[:, 1::2]
        power = touch.kept((even - odd).square(), both).sum(dim=1) / both.sum(dim=1).clamp(min=1.0)
        parts.append(_log(power))
        now, here = touch.kept(even + odd, both) / 2.0, both
    return torch.cat(parts, dim=1)


def _spectrum(touch: Touch) -> Tensor:
    """Logarithm of each frequency's power, averaged over stretches (Welch)."""
    length = spectrum_rows(touch.values.shape[1])
    half = length // 2
    whole = touch.centred.shape[1] // half
    channels = touch.values.shape[2]
    halves = touch.centred[:, : whole * half].reshape(-1, whole, half, channels)
    there = touch.present[:, : whole * half].reshape(-1, whole, half)[:, :, -1]
    stretches = torch.cat([halves[:, :-1], halves[:, 1:]], dim=2)
    measured = there[:, 1:].unsqueeze(2).unsqueeze(3)
    level = stretches.mean(dim=2, keepdim=True)
    cosine, sine = (torch.from_numpy(part) for part in waves(length))
    turned = (stretches - level).transpose(2, 3)
    power = (turned @ cosine).square() + (turned @ sine).square()
    mean = touch.kept(power, measured).sum(dim=1) / measured.sum(dim=1).clamp(min=1.0)
    return _log(mean).flatten(1)


def _pattern(touch: Touch) -> Tensor:
    """Each channel's share of the whole, of level, change and spread: no gain in common."""
    found = []
    for part in (touch.mean, touch.last - touch.first, touch.deviation):
        size = part.square().sum(dim=1, keepdim=True).sqrt()
        found.append(part / (size + TINY))
    return torch.cat(found, dim=1)


def _correlation(touch: Touch) -> Tensor:
    spread = (touch.deviation + touch.rounding) * touch.count.sqrt()
    unit = touch.centred / spread.unsqueeze(1)
    pairs = torch.matmul(unit.transpose(1, 2), unit)
    row, column = (torch.from_numpy(part) for part in np.triu_indices(pairs.shape[1], 1))
    return pairs[:, row, column]


START = "start"
"""The block that sees a window's first rows alone, neither averaged nor spaced."""
BLOCKS: dict[str, tuple[Callable[[Touch], Tensor], int]] = {
    "rows": (_rows, 1),
    "centred": (_centred, 2),
    "mean": (_mean, 2),
    "statistics": (_statistics, 2),
    "level": (_level, 2),
    "tared": (_tared, 2),
    START: (_start, 2 * START_ROWS[-1]),
    "shape": (_shape, 3),
    "course": (_course, SEGMENTS),
    "parts": (_parts, 2),
    "quantiles": (_quantiles, 10),
    "distribution": (_distribution, 4 * CHANGE_ROWS[0]),
    "octaves": (_octaves, 4),
    "spectrum": (_spectrum, SPECTRUM_ROWS[0]),
    "pattern": (_pattern, 2),
    "correlation": (_correlation, 4),
}
"""Block → how it is computed, and how many rows a window must have for it."""


FINE_BLOCKS = ("octaves",)
"""Blocks that see a long window's rows as they are, not averaged: what changes from row to row."""
UNIT = "unit/"
"""Before a block's name: the block of rows that are standardised across the channels of a pad."""
GRID = "grid/"
"""Before a block's name: the block of what each row's imprints on grids are like."""


def prefix_of(name: str) -> str:
    """Return what stands before a block's name, `UNIT`, `GRID` or nothing."""
    return next((before for before in (UNIT, GRID) if name.startswith(before)), "")


def is_of_grids(name: str) -> bool:
    """Return whether a block needs channels that lie in grids."""
    return name in IMAGE_BLOCKS or name.startswith(GRID)


def is_block(name: str) -> bool:
    """Return whether there is such a block."""
    return name in IMAGE_BLOCKS or name.removeprefix(prefix_of(name)) in BLOCKS


def rows_for(name: str) -> int:
    """Return how many rows a window must have for a block."""
    return 1 if name in IMAGE_BLOCKS else BLOCKS[name.removeprefix(prefix_of(name))][1]


def spectrum_rows(steps: int) -> int:
    """Return how many rows a stretch of the spectrum has: a power of 2 that fits twice."""
    least, most = SPECTRUM_ROWS
    length = most
    while length > least and length > steps // 2:
        length //= 2
    return length


def waves(length: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return a Hann window times cosine and sine, shapes (length, length // 2), from 1 up."""
    row = np.arange(length)[:, None]
    angle = 2.0 * np.pi * row * np.arange(1, length // 2 + 1) / length
    hann = 0.5 - 0.5 * np.cos(2.0 * np.pi * (row + 0.5) / length)
    return hann * np.cos(angle), hann * np.sin(angle)
