"""Crops as a mirrored camera would have shown them, from their numbers alone.

A gel has no side: a trial seen in a mirror, left for right or up for down, is a trial of the same
label. Each number of a mirrored crop is another number of the crop itself, or its negative, so
that no image is looked at again. Knows nothing about labels, models or files.

Source: docs/decisions/0041, "Mirror images".
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final, Literal

import numpy as np
from numpy.typing import NDArray

from taxel.windows.trial_crops import EDGES, GRID, PIXELS, STATISTICS, STILLS, THUMB

Side = Literal["left for right", "up for down"]
SIDES: Final[tuple[Side, ...]] = ("left for right", "up for down")
_MEAN, _LEAST, _MOST, _LAST, _P10, _P50, _P90 = 0, 2, 3, 4, 5, 6, 7
_SIGNED: Final = {
    _MEAN: _MEAN, _LEAST: _MOST, _MOST: _LEAST, _LAST: _LAST,
    _P10: _P90, _P50: _P50, _P90: _P10,
}  # fmt: skip
"""Statistic of a course → that of the course itself whose negative it is where the course has the
other sign; those that are not named stay as they are."""


@dataclass(frozen=True, slots=True)
class Mirror:
    """Which numbers of a crop make up its mirror image."""

    order: NDArray[np.intp]
    """Shape (columns,): where each number is taken from."""
    sign: NDArray[np.float32]
    """Shape (columns,): 1 or -1."""

    def apply(
        self, rows: NDArray[np.float32], columns: NDArray[np.intp] | slice = slice(None)
    ) -> NDArray[np.float32]:
        """Return some columns, all unless given, of the mirror images of crops (n, columns)."""
        return np.asarray(rows[:, self.order[columns]] * self.sign[columns], np.float32)

    def then(self, other: Mirror) -> Mirror:
        """Return this mirror seen in another."""
        return Mirror(self.order[other.order], self.sign[other.order] * other.sign)


def mirrors(widths: Mapping[str, int], cameras: int) -> tuple[Mirror, ...]:
    """Return the three mirrors of crops: left for right, up for down, and both.

    The slip signal is of distances and sizes of turns, which no mirror changes; features of
    the touch encoder, the plain picture and the image network, of which no model learns mirror
    images, are left as they are.

    Args:
        widths: View → numbers a crop, in the order in which they stand side by side.
        cameras: How many there are.
    """
    across, down = (_mirror(widths, cameras, side) for side in SIDES)
    return across, down, across.then(down)


def _mirror(widths: Mapping[str, int], cameras: int, side: Side) -> Mirror:
    parts, start = [], 0
    for view, width in widths.items():
        own = _of_view(view, width, cameras, side)
        parts.append(Mirror(own.order + start, own.sign))
        start += width
    return Mirror(
        np.concatenate([part.order for part in parts]),
        np.concatenate([part.sign for part in parts]),
    )


def _of_view(view: str, width: int, cameras: int, side: Side) -> Mirror:
    if view == "pixels":
        return _of_courses(*_pixel_columns(side), cameras)
    if view == "stills":
        blocks = np.arange(width // STILLS)[:, None] * STILLS
        return Mirror((blocks + _still_columns(side)).ravel(), np.ones(width, np.float32))
    return Mirror(np.arange(width), np.ones(width, np.float32))


def _of_courses(order: NDArray[np.intp], sign: NDArray[np.float32], cameras: int) -> Mirror:
    """Return the mirror of courses' statistics, from that of their columns.

    Of several cameras a crop holds the largest and the least number over them: where the sign is
    the other one, the largest is the negative of the least.
    """
    columns, extremes = len(order), min(cameras, 2)
    taken, signs = [], []
    for extreme in range(extremes):
        for statistic in range(STATISTICS):
            turned = (sign < 0) & (statistic in _SIGNED)
            block = np.where(
                turned,
                (extremes - 1 - extreme) * STATISTICS + _SIGNED.get(statistic, statistic),
                extreme * STATISTICS + statistic,
            )
            taken.append(block * columns + order)
            signs.append(np.where(turned, -1, 1))
    return Mirror(
        np.asarray(np.concatenate(taken), np.intp), np.concatenate(signs).astype(np.float32)
    )


def _pixel_columns(side: Side) -> tuple[NDArray[np.intp], NDArray[np.float32]]:
    """Return where a frame's numbers, as `PIXELS`, are taken from, and their signs."""
    order, sign = np.arange(len(PIXELS)), np.ones(len(PIXELS), np.float32)
    places = _places(GRID, side)
    for first in (PIXELS.index("step_0"), PIXELS.index("since_0")):
        order[first : first + len(places)] = first + places
    for name in ("flow_x" if side == "left for right" else "flow_y", "flow_turn"):
        sign[PIXELS.index(name)] = -1
    return order, sign


def _still_columns(side: Side) -> NDArray[np.intp]:
    """Return where a still's numbers are taken from: grey thumb, edges, colour by place."""
    places, thumb = _places(GRID, side), _places(THUMB, side)
    edges = places[:, None] * EDGES + np.arange(EDGES)[::-1]
    colours = places[:, None] * 3 + np.arange(3)
    first = len(thumb)
    return np.concatenate([thumb, first + edges.ravel(), first + edges.size + colours.ravel()])


def _places(grid: tuple[int, int], side: Side) -> NDArray[np.intp]:
    """Return where each place of a grid, row by row, comes from."""
    numbers = np.arange(grid[0] * grid[1]).reshape(grid)
    return (numbers[:, ::-1] if side == "left for right" else numbers[::-1]).ravel()
