"""What is computed of a window before a linear model or trees see it, as one exportable module.

The features are blocks of plain statistics, each channel by itself unless it says otherwise.
They are computed in double precision, so that PyTorch offline and ONNX Runtime live give trees
the same numbers. Rows that are padding do not count, and how many rows there are is no
feature: the length of a trial must not predict its class. Knows nothing about models or files.

Source: our choice of usual statistics, docs/decisions/0039.
"""

from __future__ import annotations

import re
from collections.abc import Callable

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor, nn

from taxel.models.touch_window import FAR, MOST_ROWS, TINY, Touch, coarse, rounded

SEGMENTS, PARTS = 8, 16
"""Equal parts of a window whose means are taken, less the window's mean and as they are. Source:
our choice, 0039."""
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
FEWEST_IN_PAD = 4
"""Channels that make a pad whose rows can be standardised. Source: our choice, 0039."""
MOST_VALUES = 40_000
"""Values of a window up to which every row is seen; where many channels make it larger, evenly
spaced rows: a mat's 2,048 taxels left time for their means alone. Source: our choice, 0039."""
_BATCH_VALUES = 1_000_000


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


BLOCKS: dict[str, tuple[Callable[[Touch], Tensor], int]] = {
    "rows": (_rows, 1),
    "centred": (_centred, 2),
    "mean": (_mean, 2),
    "statistics": (_statistics, 2),
    "level": (_level, 2),
    "tared": (_tared, 2),
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
"""Blocks that see every row of a long window: what changes from row to row."""
UNIT = "unit/"
"""Before a block's name: the block of rows that are standardised across the channels of a pad."""


class TouchFeatures(nn.Module):
    """Some blocks of features, side by side.

    Args:
        blocks: Names in `BLOCKS`, some behind `UNIT`.
        pads: Each channel's pad, as numbers from 0; see `pads_of`.
    """

    def __init__(self, blocks: tuple[str, ...], pads: tuple[int, ...]) -> None:
        super().__init__()
        self.blocks = blocks
        _, pad = np.unique(np.array(pads, np.int64), return_inverse=True)
        self._pad = torch.from_numpy(pad)
        self._mean = torch.from_numpy(averaging(pad))

    def forward(self, values: Tensor, mask: Tensor | None) -> Tensor:
        """Return features, shape (n, features) float64.

        Args:
            values: Shape (n, steps, channels), unscaled.
            mask: Shape (n, steps); None where no row is padding.
        """
        steps, channels = (int(size) for size in values.shape[1:])  # no graph of sizes
        every = row_stride(steps, channels)
        if every > 1:
            values, mask = values[:, ::every], None if mask is None else mask[:, ::every]
        present = None if mask is None else mask.unsqueeze(2).double()
        fine = Touch(values.double() if present is None else values.double() * present, present)
        plain = coarse(fine)
        unit = None
        found = []
        for name in self.blocks:
            if name.startswith(UNIT) and unit is None:
                standardised = plain.kept(self._standardised(plain.values), plain.present)
                unit = Touch(standardised, None if plain.whole else plain.present)
            touch = unit if name.startswith(UNIT) and unit is not None else plain
            touch = fine if name in FINE_BLOCKS else touch
            found.append(BLOCKS[name.removeprefix(UNIT)][0](touch))
        return torch.cat(found, dim=1)

    def _standardised(self, values: Tensor) -> Tensor:
        """Return each row less its pad's mean, over its pad's deviation."""
        apart = values - rounded(torch.matmul(values, self._mean)).index_select(2, self._pad)
        power = torch.matmul(apart.square(), self._mean)
        return apart / (power.sqrt() + TINY).index_select(2, self._pad)


def pads_of(channels: tuple[str, ...]) -> tuple[int, ...]:
    """Return each channel's pad: channels whose names differ in their last number only.

    An array in which no pad has `FEWEST_IN_PAD` channels is one pad as a whole.
    """
    stems = [re.sub(r"\d+$", "", name) for name in channels]
    large = {stem for stem in stems if stems.count(stem) >= FEWEST_IN_PAD}
    if not large:
        return (0,) * len(channels)
    order = {stem: number for number, stem in enumerate(dict.fromkeys(stems))}
    return tuple(order[stem] for stem in stems)


def averaging(pad: NDArray[np.int64]) -> NDArray[np.float64]:
    """Return what takes each pad's mean, shape (channels, pads)."""
    own = (pad[:, None] == np.arange(pad.max(initial=0) + 1)).astype(np.float64)
    return np.asarray(own / own.sum(axis=0))


def row_stride(steps: int, channels: int) -> int:
    """Return of how many rows of a window one is seen: of each, but in large windows of many
    channels. Long windows of few channels are averaged (`coarse`).
    """
    if channels * MOST_ROWS <= MOST_VALUES:
        return 1
    return max(1, -(-steps * channels // MOST_VALUES))


def fitting_blocks(blocks: tuple[str, ...], steps: int, channels: int) -> tuple[str, ...]:
    """Return those blocks that windows of so many rows and channels have."""
    steps = -(-steps // row_stride(steps, channels))
    few = channels <= MOST_CORRELATED
    return tuple(
        name for name in blocks
        if steps >= BLOCKS[name.removeprefix(UNIT)][1]
        and (name != "correlation" or (channels > 1 and few))
        and (channels >= FEWEST_IN_PAD or not name.startswith(UNIT))
    )  # fmt: skip


def compute_features(
    blocks: tuple[str, ...],
    pads: tuple[int, ...],
    values: NDArray[np.float32],
    mask: NDArray[np.bool_],
) -> NDArray[np.float32]:
    """Return features of many windows, shape (n, features) float32.

    Args:
        blocks: Names in `BLOCKS`, some behind `UNIT`.
        pads: Each channel's pad.
        values: Shape (n, steps, channels), unscaled.
        mask: Shape (n, steps).
    """
    module = TouchFeatures(blocks, pads)
    batch = max(1, _BATCH_VALUES // (values.shape[1] * values.shape[2]))
    parts = []
    padded = not mask.all()
    with torch.inference_mode():
        for start in range(0, len(values), batch):
            part = slice(start, start + batch)
            measured = torch.from_numpy(mask[part]) if padded else None
            found = module(torch.from_numpy(values[part]), measured)
            parts.append(found.float().numpy())
    return np.concatenate(parts)


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
