"""What is seen of taxels that lie in a grid: the imprint of a touch, wherever on the pad it lies.

A grid's values in one scan are an image. Its imprint is what rises above the image's mean: how
strong it is, where it lies, how wide, how turned and how even; numbers that follow a touch from
scan to scan. Of a window's mean image, and of the range of its values, more is taken that hardly
depends on where the touch lies: the spectrum's power, sorted values, and how often small patterns
(MiniRocket's kernels of nine taps, as squares) answer.

In double precision, and nothing is fitted. Knows nothing about models or files.

Source: our choice, docs/decisions/0060; Hu, "Visual pattern recognition by moment invariants", IRE
Trans. Inf. Theory 8(2), 1962; Dempster et al., "MiniRocket", KDD 2021.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable
from typing import NamedTuple

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from taxel.grid_names import grid_place
from taxel.models.kernel_features import kernels_of
from taxel.models.touch_window import TINY, Touch, rounded

SMALLEST = 3
"""Rows and columns of a grid, at least: as many as a pattern has. Source: our choice, 0060."""
FREQUENCIES = 6
"""Of the spectrum, in each direction. Source: as above."""
SORTED = 16
"""Of an image's sorted values, evenly spaced ones that are taken. Source: as above."""
POOLED = (1, 2, 4)
"""Taxels whose mean is one pixel, in each direction, where patterns are sought. Source: as
above."""
MOST_PIXELS = 1500
"""Of an image in which patterns are sought, and of which values are sorted: in larger ones only on
means over taxels, and only evenly spaced values. Source: as above: of 2,048 taxels patterns took
1.3 ms, and their finest showed nothing."""
THRESHOLDS = (0.5, 2.0)
"""Deviations of the image above which a pattern answers. Source: as above."""
_TAPS = 3
_FINEST = 2.0**24
"""Parts of the grid's longer side: what is finer in an imprint's shape is rounding."""


class Grid(NamedTuple):
    """Where channels lie in a grid: the channel at (row, column) has the number
    first + row · down + column · across.
    """

    rows: int
    columns: int
    first: int
    down: int
    across: int

    @property
    def channels(self) -> NDArray[np.int64]:
        """The channels' numbers row by row, shape (rows · columns,)."""
        row, column = np.indices((self.rows, self.columns)).reshape(2, -1)
        return np.asarray(self.first + row * self.down + column * self.across)


Grids = tuple[Grid, ...]


def grids_of(channels: tuple[str, ...]) -> Grids:
    """Return the grids in which channels lie by their names, such as r1c1, left_r1c1 or r1c1_x.

    A grid is complete, and its channels are in order, by rows or by columns.

    Args:
        channels: Names.
    """
    stems: dict[tuple[str, str], list[tuple[int, int, int]]] = defaultdict(list)
    for number, name in enumerate(channels):
        if place := grid_place(name):
            stems[place.grid].append((place.row, place.column, number))
    found = (_grid(places) for places in stems.values())
    return tuple(grid for grid in found if grid is not None)


def _grid(places: list[tuple[int, int, int]]) -> Grid | None:
    """Return where channels lie, by (row, column, channel), if they fill a grid in order."""
    sides = [sorted({place[axis] for place in places}) for axis in (0, 1)]
    rows, columns = map(len, sides)
    even = all(len(set(np.diff(side))) == 1 for side in sides)
    if not even or min(rows, columns) < SMALLEST or len(places) != rows * columns:
        return None
    ordered = np.array([number for _, _, number in sorted(places)])
    first, across, down = (int(ordered[at]) for at in (0, 1, columns))
    grid = Grid(rows, columns, first, down - first, across - first)
    twice = len({place[:2] for place in places}) < len(places)
    return None if twice or not np.array_equal(grid.channels, ordered) else grid


def imprints(values: Tensor, grids: Grids) -> Tensor:
    """Return what each scan's imprints are like, shape (n, steps, 18 a grid).

    Args:
        values: Shape (n, steps, channels) float64.
        grids: Where channels lie.
    """
    return torch.cat([_imprint(values.index_select(2, _own(grid)), grid) for grid in grids], dim=2)


def _own(grid: Grid) -> Tensor:
    return torch.from_numpy(grid.channels)


def _imprint(image: Tensor, grid: Grid) -> Tensor:
    """Return numbers of one grid's images, shape (n, steps, 18).

    Moments are of what rises above the image's mean, about its own centre; lengths are in halves of
    the grid's longer side.

    Args:
        image: Shape (n, steps, taxels) float64.
        grid: Where they lie.
    """
    count = float(grid.rows * grid.columns)
    mean = rounded(image.mean(dim=2, keepdim=True))
    above = (image - mean).clamp(min=0.0)
    most = above.amax(dim=2, keepdim=True)
    share = above / _or_one(most)
    total, *raw = torch.matmul(share, torch.from_numpy(_powers(grid))).unsqueeze(3).unbind(dim=2)
    y, x, yy, yx, xx, yyy, yyx, yxx, xxx, yyxx = (part / _or_one(total) for part in raw)
    tall, wide, both = yy - y * y, xx - x * x, yx - y * x
    middle, apart = (tall + wide) / 2.0, (tall - wide) / 2.0
    length = (apart.square() + both.square()).sqrt()
    square = share.square()
    second = square.sum(dim=2, keepdim=True)
    fourth = square.square().sum(dim=2, keepdim=True)
    shape = [
        y, x, tall, wide, both, middle + length, middle - length,
        yyy - 3.0 * y * yy + 2.0 * y**3,
        yyx - 2.0 * y * yx - x * yy + 2.0 * y * y * x,
        yxx - 2.0 * x * yx - y * xx + 2.0 * x * x * y,
        xxx - 3.0 * x * xx + 2.0 * x**3,
        yyxx - 2.0 * x * yyx - 2.0 * y * yxx + x * x * yy + y * y * xx + 4.0 * y * x * yx
        - 3.0 * y * y * x * x,
        total / count,
        total.square() / (count * _or_one(second)),
        second.square() / (count * _or_one(fourth)),
    ]  # fmt: skip
    level = torch.cat([mean, total * most / count, most], dim=2)
    # Rounded as scans are measured: else a touch that stands still would not be its own mean.
    even = torch.round(torch.cat(shape, dim=2) * _FINEST) / _FINEST
    return rounded(torch.cat([level, even], dim=2))


def _or_one(divisor: Tensor) -> Tensor:
    """Return what may be divided by: 1 where it is 0, for then what is divided is 0, too."""
    return torch.where(divisor > 0.0, divisor, torch.ones_like(divisor))


def _powers(grid: Grid) -> NDArray[np.float64]:
    """Return what takes an image's sum and raw moments, shape (taxels, 11)."""
    place = np.indices((grid.rows, grid.columns)).reshape(2, -1).astype(np.float64)
    half = max(grid.rows, grid.columns) / 2.0
    y, x = (place - place.mean(axis=1, keepdims=True)) / half
    orders = [(0, 0), (1, 0), (0, 1), (2, 0), (1, 1), (0, 2), (3, 0), (2, 1), (1, 2), (0, 3)]
    return np.stack([y**a * x**b for a, b in [*orders, (2, 2)]], axis=1)


def _of_images(measure: Callable[[Tensor, Grid], Tensor]) -> Callable[[Touch, Grids], Tensor]:
    """Return a block: what is measured of each grid's mean image and, of several rows, of the range
    of its values.
    """

    def block(touch: Touch, grids: Grids) -> Tensor:
        whole = [touch.mean]
        if int(touch.values.shape[1]) > 1:
            whole.append(touch.most - touch.least)
        parts = [measure(image.index_select(1, _own(grid)), grid)
                 for grid in grids for image in whole]  # fmt: skip
        return torch.cat(parts, dim=1)

    return block


def _imprint_of(image: Tensor, grid: Grid) -> Tensor:
    return _imprint(image.unsqueeze(1), grid).squeeze(1)


def _apart(image: Tensor) -> Tensor:
    """Return an image less its mean, shape (n, taxels)."""
    return image - rounded(image.mean(dim=1, keepdim=True))


def _spectrum(image: Tensor, grid: Grid) -> Tensor:
    """Return the logarithm of an image's power at low frequencies in both directions."""
    square = _apart(image).reshape(-1, grid.rows, grid.columns)
    high, wide = (min(FREQUENCIES, side // 2 + 1) for side in (grid.rows, grid.columns))
    left = _waves(grid.rows, np.arange(1 - high, high))
    right = [wave.T for wave in _waves(grid.columns, np.arange(wide))]
    real = left[0] @ square @ right[0] - left[1] @ square @ right[1]
    turned = left[0] @ square @ right[1] + left[1] @ square @ right[0]
    power = (real.square() + turned.square()) / (grid.rows * grid.columns)
    return (power + TINY).log().flatten(1)


def _waves(length: int, frequency: NDArray[np.int64]) -> tuple[Tensor, Tensor]:
    angle = 2.0 * np.pi * frequency[:, None] * np.arange(length) / length
    return torch.from_numpy(np.cos(angle)), torch.from_numpy(np.sin(angle))


def _sorted(image: Tensor, grid: Grid) -> Tensor:
    """Return evenly spaced ones of an image's sorted values less its mean."""
    spaced = _apart(image)[:, :: -(-grid.rows * grid.columns // MOST_PIXELS)]
    place = np.linspace(0, int(spaced.shape[1]) - 1, SORTED).astype(np.int64)
    return spaced.sort(dim=1)[0].index_select(1, torch.from_numpy(place))


def _patterns(image: Tensor, grid: Grid) -> Tensor:
    """Return how often small patterns answer: shares of an image's places above a threshold."""
    deviation = rounded(_apart(image).square().mean(dim=1, keepdim=True).sqrt()).unsqueeze(2)
    square = image.reshape(-1, grid.rows, grid.columns)
    found = []
    for pooled in _pooled(grid):
        rows, columns = grid.rows // pooled, grid.columns // pooled
        inside = square[:, : rows * pooled, : columns * pooled]
        blocks = inside.reshape(-1, rows, pooled, columns, pooled)
        seen = blocks.sum(dim=(2, 4)).flatten(1) / float(pooled**2)
        at = _neighbours(rows, columns)
        near = seen.index_select(1, torch.from_numpy(at.reshape(-1)))
        answers = torch.matmul(torch.from_numpy(kernels_of(1, 0)[0]), near.reshape(-1, *at.shape))
        for threshold in THRESHOLDS:
            above = answers > threshold * deviation
            # Counts are exact in single precision, which is twice as quick.
            found.append(above.float().sum(dim=2).double() / float(at.shape[1]))
    return torch.cat(found, dim=1)


def _pooled(grid: Grid) -> list[int]:
    """Return over how many taxels means are taken: a pattern fits, and the image is not too large;
    the most that fits where all are.
    """
    fitting = [own for own in POOLED if min(grid.rows, grid.columns) // own >= SMALLEST]
    small = [own for own in fitting
             if (grid.rows // own) * (grid.columns // own) <= MOST_PIXELS]  # fmt: skip
    return small or fitting[-1:]


def _neighbours(rows: int, columns: int) -> NDArray[np.int64]:
    """Return the pixels under each tap of a pattern at each place, shape (9, places)."""
    y, x = np.indices((rows - _TAPS + 1, columns - _TAPS + 1)).reshape(2, -1)
    down, across = np.indices((_TAPS, _TAPS)).reshape(2, -1, 1)
    return np.asarray((y + down) * columns + x + across)


IMAGE_BLOCKS: dict[str, Callable[[Touch, Grids], Tensor]] = {
    "imprint": _of_images(_imprint_of),
    "image spectrum": _of_images(_spectrum),
    "image values": _of_images(_sorted),
    "image patterns": _of_images(_patterns),
}
"""Block → how it is computed, of windows of any length."""
