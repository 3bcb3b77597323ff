"""Touch in the terminal: sparklines, heat maps, the map of a hand.

Knows nothing about sources, models or files.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from rich.style import Style
from rich.text import Text

_BARS = " ▁▂▃▄▅▆▇█"
_STOPS = np.array(
    [(20, 24, 60), (59, 82, 139), (33, 145, 140), (94, 201, 98), (253, 231, 37)], float
)
"""Dark blue to yellow, told apart by colour-blind readers; our own five stops."""


def sparkline(values: NDArray[np.float32], width: int, low: float, high: float) -> str:
    """Return the newest values as one line of bars; the largest of each cell is shown.

    Args:
        values: Shape (n,), oldest first.
        width: Characters.
        low: Value of an empty bar.
        high: Value of a full bar.
    """
    if not len(values):
        return " " * width
    cells = np.array_split(values, min(width, len(values)))
    tops = np.array([np.nanmax(cell) if np.isfinite(cell).any() else low for cell in cells])
    share = np.clip((tops - low) / max(high - low, 1e-9), 0.0, 1.0)
    line = "".join(_BARS[round(float(s) * (len(_BARS) - 1))] for s in share)
    return line.rjust(width)


def heat_map(values: NDArray[np.float32], low: float, high: float) -> Text:
    """Return an image in coloured half blocks, two rows of the image a line.

    Args:
        values: Shape (rows, columns); values that are not finite are grey.
        low: Value of the darkest colour.
        high: Value of the brightest.
    """
    rows, columns = values.shape
    text = Text()
    for top in range(0, rows, 2):
        for column in range(columns):
            upper = _colour(float(values[top, column]), low, high)
            lower = _colour(float(values[top + 1, column]), low, high) if top + 1 < rows else None
            text.append("▀▀", Style(color=upper, bgcolor=lower))
        text.append("\n")
    text.rstrip()
    return text


def array_map(values: NDArray[np.float32], low: float, high: float) -> Text:
    """Return one reading of an array as labelled cells.

    Twelve values are four fingers × three phalanges (distal on top); any other
    number becomes a near-square grid.

    Args:
        values: Shape (channels,).
        low: Value of the darkest colour.
        high: Value of the brightest.
    """
    if len(values) == 12:
        grid = values.reshape(4, 3).T[::-1]
    else:
        columns = int(np.ceil(np.sqrt(len(values))))
        padded = np.full(columns * -(-len(values) // columns), np.nan, np.float32)
        padded[: len(values)] = values
        grid = padded.reshape(-1, columns)
    text = Text()
    for row in grid:
        for value in row:
            colour = _colour(float(value), low, high)
            bright = np.isfinite(value) and (value - low) / max(high - low, 1e-9) > 0.55
            label = f"{value:5.2f} " if np.isfinite(value) else "  –   "
            text.append(label, Style(color="black" if bright else "white", bgcolor=colour))
            text.append(" ")
        text.append("\n")
    text.rstrip()
    return text


def _colour(value: float, low: float, high: float) -> str:
    if not np.isfinite(value):
        return "#555555"
    place = float(np.clip((value - low) / max(high - low, 1e-9), 0.0, 1.0)) * (len(_STOPS) - 1)
    first = min(int(place), len(_STOPS) - 2)
    red, green, blue = _STOPS[first] + (place - first) * (_STOPS[first + 1] - _STOPS[first])
    return f"#{round(red):02x}{round(green):02x}{round(blue):02x}"
