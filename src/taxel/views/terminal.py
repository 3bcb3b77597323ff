"""Touch in the terminal: sparklines, heat maps, the map of a hand.

A scale's ends, `low` and `high`, are numbers or one number a channel. Knows
nothing about sources, models or files.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from rich.style import Style
from rich.text import Text

Scale = float | NDArray[np.float32]
"""One end of a scale, for all channels or for each; in the values' unit."""

_BARS = "▁▂▃▄▅▆▇"
"""Without the full block, so that traces on neighbouring lines never touch."""
_STOPS = np.array(
    [(20, 24, 60), (59, 82, 139), (33, 145, 140), (94, 201, 98), (253, 231, 37)], float
)
"""Dark blue to yellow, distinct to colour-blind readers; our own five stops."""
_UNKNOWN = "#555555"
_BRIGHT = 0.55
"""Above this share of the scale a cell is light and wants dark letters."""
HAND_CHANNELS = 12
"""Four fingers × three phalanges. Source: TENG thesis, section 3.3."""
_MOST_NUMBERED = 16
"""A map with more cells than this is drawn without numbers."""


def sparkline(values: NDArray[np.float32], width: int, low: float, high: float) -> str:
    """Return values as one line of bars, oldest first; the largest of each cell is shown.

    Args:
        values: Shape (n,); cells without a finite value stay blank.
        width: Characters; fewer values stand at the right.
        low: Value of the lowest bar.
        high: Value of a full bar.
    """
    if not len(values):
        return " " * width
    cells = np.array_split(values, min(width, len(values)))
    return "".join(_bar(cell, low, high) for cell in cells).rjust(width)


def heat_map(values: NDArray[np.float32], low: Scale, high: Scale, cell: int = 2) -> Text:
    """Return an image in coloured half blocks, two rows of the image a line.

    Args:
        values: Shape (rows, columns); values that are not finite are grey.
        low: Value of the darkest colour.
        high: Value of the brightest.
        cell: Characters a column; 2 makes square pixels.
    """
    shares = share_of(values, low, high)
    text = Text(no_wrap=True)
    for top in range(0, len(shares), 2):
        for column in range(shares.shape[1]):
            upper = _colour(float(shares[top, column]))
            below = _colour(float(shares[top + 1, column])) if top + 1 < len(shares) else None
            text.append("▀" * cell, Style(color=upper, bgcolor=below))
        text.append("\n")
    text.right_crop(1)
    return text


def array_map(values: NDArray[np.float32], low: Scale, high: Scale) -> Text:
    """Return one reading of an array as cells.

    Twelve values are four fingers × three phalanges (distal on top); any other
    number becomes a near-square grid, with numbers in it up to sixteen.

    Args:
        values: Shape (channels,); values that are not finite are grey.
        low: Value of the darkest colour.
        high: Value of the brightest.
    """
    grid, shares = array_grid(values), array_grid(share_of(values, low, high))
    if len(values) > _MOST_NUMBERED:
        return heat_map(shares, 0.0, 1.0, cell=3)
    text = Text(no_wrap=True)
    for row, row_shares in zip(grid, shares, strict=True):
        for value, share in zip(row, row_shares, strict=True):
            ink = "black" if share > _BRIGHT else "white"
            text.append(
                f"{short_number(float(value)):>5} ", Style(color=ink, bgcolor=_colour(share))
            )
            text.append(" ")
        text.append("\n")
    text.right_crop(1)
    return text


def array_grid(values: NDArray[np.float32]) -> NDArray[np.float32]:
    """Return one reading as a grid, shape (rows, columns); cells of no channel are NaN.

    Args:
        values: Shape (channels,).
    """
    if len(values) == HAND_CHANNELS:
        return values.reshape(4, 3).T[::-1]
    columns = max(1, int(np.ceil(np.sqrt(len(values)))))
    grid = np.full(columns * -(-len(values) // columns), np.nan, np.float32)
    grid[: len(values)] = values
    return grid.reshape(-1, columns)


def hand_fingers(channels: Sequence[str]) -> list[str] | None:
    """Return the fingers' names of a hand's map, left to right; None for another array.

    Args:
        channels: Names such as "index-distal", one a channel.
    """
    fingers = list(dict.fromkeys(name.partition("-")[0] for name in channels))
    return fingers if len(channels) == HAND_CHANNELS and len(fingers) == 4 else None


def share_of(values: NDArray[np.float32], low: Scale, high: Scale) -> NDArray[np.float32]:
    """Return where values lie between low (0) and high (1), clipped; same shape, NaN stays NaN."""
    span = np.maximum(np.asarray(high, np.float32) - low, np.float32(1e-9))
    shares: NDArray[np.float32] = np.clip((values - low) / span, 0.0, 1.0).astype(np.float32)
    return shares


def short_number(value: float) -> str:
    """Return a number in three figures, in six characters at most; a dash if not finite."""
    if not np.isfinite(value):
        return "–"
    for limit, divisor, letter in ((9999.5, 1.0, ""), (9.9995e5, 1e3, "k"), (9.9995e8, 1e6, "M")):
        if abs(value) < limit:
            return _three_figures(value / divisor) + letter
    return f"{value:.0e}".replace("e+0", "e").replace("e+", "e")


def _three_figures(value: float) -> str:
    size = abs(value)
    if size < 9.995:
        return f"{value if size >= 0.005 else 0.0:.2f}"
    return f"{value:.1f}" if size < 99.95 else f"{value:.0f}"


def _bar(cell: NDArray[np.float32], low: float, high: float) -> str:
    finite = cell[np.isfinite(cell)]
    if not len(finite):
        return " "
    share = float(np.clip((finite.max() - low) / max(high - low, 1e-9), 0.0, 1.0))
    return _BARS[round(share * (len(_BARS) - 1))]


def _colour(share: float) -> str:
    """Return the colour of a share, 0…1; grey for NaN."""
    if not np.isfinite(share):
        return _UNKNOWN
    place = float(share) * (len(_STOPS) - 1)
    first = min(int(place), len(_STOPS) - 2)
    red, green, blue = _STOPS[first] + (place - first) * (_STOPS[first + 1] - _STOPS[first])
    return f"#{round(red):02x}{round(green):02x}{round(blue):02x}"
