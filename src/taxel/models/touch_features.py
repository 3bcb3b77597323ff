"""What is computed of a window before a linear model or trees see it, as one exportable module.

The features are blocks, of plain statistics (`touch_blocks`) or of grids (`grid_features`).
They are computed in double precision, so that PyTorch offline and ONNX Runtime live give trees
the same numbers. Rows that are padding do not count, and how many rows there are is no
feature: the length of a trial must not predict its class. Knows nothing about models or files.

Source: our choice of usual statistics, docs/decisions/0039.
"""

from __future__ import annotations

import re

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor, nn

from taxel.models.grid_features import IMAGE_BLOCKS, Grids, grids_of, imprints
from taxel.models.touch_blocks import (
    BLOCKS,
    FINE_BLOCKS,
    MOST_CORRELATED,
    START,
    START_ROWS,
    UNIT,
    is_of_grids,
    prefix_of,
    rows_for,
)
from taxel.models.touch_window import MOST_ROWS, TINY, Touch, coarse, rounded

FEWEST_IN_PAD = 4
"""Channels that make a pad whose rows can be standardised. Source: our choice, 0039."""
MOST_VALUES = 40_000
"""Values of a window up to which every row is seen; where many channels make it larger, evenly
spaced rows: a mat's 2,048 taxels left time for their means alone. Source: our choice, 0039."""
FEWEST_SEEN = 8
"""Rows of a window that are seen however many channels it has. Source: as above."""
_BATCH_VALUES = 1_000_000
"""Values of windows that are looked at together: bounds memory."""


class TouchFeatures(nn.Module):
    """Some blocks of features, side by side.

    Args:
        blocks: Names in `BLOCKS`, some behind `UNIT` or `GRID`, or in `IMAGE_BLOCKS`.
        pads: Each channel's pad, as numbers from 0; see `pads_of`.
        grids: Where channels lie; needed by blocks that `is_of_grids`.
        every_row: Whether every row of a large window is seen; see `seen_rows`.
    """

    def __init__(
        self,
        blocks: tuple[str, ...],
        pads: tuple[int, ...],
        grids: Grids = (),
        *,
        every_row: bool = False,
    ) -> None:
        super().__init__()
        self.blocks = blocks
        self._grids = grids
        self._every_row = every_row
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
        head = None if mask is None else mask[:, : START_ROWS[-1]]
        first = _touch_of(values[:, : START_ROWS[-1]], head)
        seen = steps if self._every_row else seen_rows(steps, channels)
        if seen < steps:
            values, mask = _spaced(values, mask, seen), None
        fine = _touch_of(values, mask)
        plain = coarse(fine)
        seen_as: dict[str, Touch] = {}
        found = []
        for name in self.blocks:
            if name in IMAGE_BLOCKS:
                found.append(IMAGE_BLOCKS[name](plain, self._grids))
                continue
            before, own = prefix_of(name), fine if name in FINE_BLOCKS else plain
            own = first if name == START else own
            if before and before not in seen_as:
                made = (self._standardised(plain.values) if before == UNIT
                        else imprints(plain.values, self._grids))  # fmt: skip
                there = None if plain.whole else plain.present
                seen_as[before] = Touch(plain.kept(made, plain.present), there)
            found.append(BLOCKS[name.removeprefix(before)][0](seen_as.get(before, own)))
        return torch.cat(found, dim=1)

    def _standardised(self, values: Tensor) -> Tensor:
        """Return each row less its pad's mean, over its pad's deviation."""
        apart = values - rounded(torch.matmul(values, self._mean)).index_select(2, self._pad)
        power = torch.matmul(apart.square(), self._mean)
        return apart / (power.sqrt() + TINY).index_select(2, self._pad)


def _touch_of(values: Tensor, mask: Tensor | None) -> Touch:
    if mask is None:
        return Touch(values.double(), None)
    present = mask.unsqueeze(2).double()
    return Touch(values.double() * present, present)


def pads_of(channels: tuple[str, ...]) -> tuple[int, ...]:
    """Return each channel's pad: channels of a grid, or whose names differ in their last number
    only.

    An array in which no pad has `FEWEST_IN_PAD` channels is one pad as a whole.
    """
    stems = [re.sub(r"\d+$", "", name) for name in channels]
    for grid in grids_of(channels):
        for number in grid.channels:
            stems[number] = f"grid {grid.first}"
    large = {stem for stem in stems if stems.count(stem) >= FEWEST_IN_PAD}
    if not large:
        return (0,) * len(channels)
    order = {stem: number for number, stem in enumerate(dict.fromkeys(stems))}
    return tuple(order[stem] for stem in stems)


def averaging(pad: NDArray[np.int64]) -> NDArray[np.float64]:
    """Return what takes each pad's mean, shape (channels, pads)."""
    own = (pad[:, None] == np.arange(pad.max(initial=0) + 1)).astype(np.float64)
    return np.asarray(own / own.sum(axis=0))


def seen_rows(steps: int, channels: int) -> int:
    """Return how many rows of a window are seen: all, but in large windows of many channels, where
    it is as many as `MOST_VALUES` has room for, but `FEWEST_SEEN` at least. Long windows of few
    channels are averaged (`coarse`).
    """
    if channels * MOST_ROWS <= MOST_VALUES:
        return steps
    return min(steps, max(FEWEST_SEEN, MOST_VALUES // channels))


def _spaced(values: Tensor, mask: Tensor | None, count: int) -> Tensor:
    """Return as many evenly spaced rows of each window, none of which is padding: how long a trial
    is must not be seen.
    """
    place = (torch.arange(count, dtype=torch.float64) + 0.5) / count
    if mask is None:
        return values.index_select(1, (place * int(values.shape[1])).long())
    at = (place * mask.sum(dim=1, keepdim=True)).long()
    return values.gather(1, at.unsqueeze(2).expand(-1, -1, int(values.shape[2])))


def fitting_blocks(
    blocks: tuple[str, ...], steps: int, channels: int, *, grids: bool = False
) -> tuple[str, ...]:
    """Return those blocks that windows of so many rows and channels have.

    Args:
        blocks: Names.
        steps: Rows in a window.
        channels: Of the array.
        grids: Whether some lie in a grid.
    """
    steps = seen_rows(steps, channels)
    few = channels <= MOST_CORRELATED
    return tuple(
        name for name in blocks
        if steps >= rows_for(name)
        and (grids or not is_of_grids(name))
        and (name != "correlation" or (channels > 1 and few))
        and (channels >= FEWEST_IN_PAD or not name.startswith(UNIT))
    )  # fmt: skip


def compute_features(
    blocks: tuple[str, ...],
    pads: tuple[int, ...],
    values: NDArray[np.float32],
    mask: NDArray[np.bool_],
    grids: Grids = (),
) -> NDArray[np.float32]:
    """Return features of many windows, shape (n, features) float32.

    Args:
        blocks: Names, as of `TouchFeatures`.
        pads: Each channel's pad.
        values: Shape (n, steps, channels), unscaled.
        mask: Shape (n, steps).
        grids: Where channels lie.
    """
    module = TouchFeatures(blocks, pads, grids)
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
