"""Figures of touch and of results, as PNG bytes.

Colours can be distinguished by colour-blind readers and in grey print. Knows nothing
about pages, files or how results were made.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from taxel.plain_text import short_names, without_controls
from taxel.plotting import drawn_name, finished, plt

_MAP = "viridis"
_MAPS_ACROSS = 5
_NAME = 30
"""Most characters of a class's name beside a matrix."""


def traces(
    time_s: NDArray[np.float64],
    values: NDArray[np.float32],
    channels: Sequence[str],
    unit: str,
    title: str,
    gate: float | None = None,
) -> bytes:
    """Return one line a channel over time.

    Args:
        time_s: Shape (n,), seconds.
        values: Shape (n, channels).
        channels: Names, one a column.
        unit: The values' unit.
        title: What is shown.
        gate: The contact threshold, drawn as a dashed line.
    """
    figure, axes = plt.subplots(figsize=(9, 2.7), layout="constrained")
    colours = plt.colormaps["turbo"](np.linspace(0.05, 0.95, len(channels)))
    for column, name in enumerate(channels):
        axes.plot(time_s, values[:, column], color=colours[column], lw=0.9, label=drawn_name(name))
    if gate is not None:
        axes.axhline(
            gate, color="black", ls="--", lw=0.8, label=f"gate {gate:g} {drawn_name(unit)}"
        )
    axes.set(xlabel="time (s)", ylabel=drawn_name(unit), title=drawn_name(title))
    axes.spines[["top", "right"]].set_visible(False)
    axes.legend(loc="center left", bbox_to_anchor=(1.0, 0.5), fontsize=7, frameon=False)
    return finished(figure)


def intensity_maps(images: dict[str, NDArray[np.float32]], unit: str) -> bytes:
    """Return images side by side on one scale: rows time (oldest on top), columns sensors.

    Args:
        images: Title → shape (steps, channels).
        unit: The values' unit.
    """
    across = min(len(images), _MAPS_ACROSS)
    down = -(-len(images) // across)
    figure, grid = plt.subplots(
        down, across, figsize=(2.1 * across + 0.6, 2.5 * down), layout="constrained", squeeze=False
    )
    low = min(float(image.min()) for image in images.values())
    high = max(float(image.max()) for image in images.values())
    for axes in grid.ravel()[len(images) :]:
        axes.set_visible(False)
    for axes, (title, image) in zip(grid.ravel(), images.items(), strict=False):
        shown = axes.imshow(image, cmap=_MAP, vmin=low, vmax=high, aspect="auto")
        axes.set_title(without_controls(title), fontsize=9)
        axes.set_xlabel("sensor", fontsize=8)
        axes.xaxis.get_major_locator().set_params(integer=True)
        axes.tick_params(labelsize=7)
    for row in grid:
        row[0].set_ylabel("row (oldest on top)", fontsize=8)
    figure.colorbar(shown, ax=grid.ravel().tolist(), label=drawn_name(unit), shrink=0.9)
    return finished(figure)


def confusion(classes: Sequence[str], counts: list[list[int]], title: str) -> bytes:
    """Return a confusion matrix: rows true, columns predicted, shares of the true class."""
    matrix = np.array(counts, float)
    shares = matrix / np.maximum(matrix.sum(axis=1, keepdims=True), 1)
    size = 1.4 + 0.55 * len(classes)
    figure, axes = plt.subplots(figsize=(size + 0.8, size), layout="constrained")
    axes.imshow(shares, cmap="Blues", vmin=0, vmax=1)
    for row in range(len(classes)):
        for column in range(len(classes)):
            axes.text(
                column,
                row,
                f"{shares[row, column]:.2f}\n{counts[row][column]}",
                ha="center",
                va="center",
                fontsize=7,
                color="white" if shares[row, column] > 0.55 else "black",
            )
    ticks = range(len(classes))
    names = short_names(classes, _NAME)
    axes.set_xticks(ticks, names, rotation=40, ha="right", fontsize=8)
    axes.set_yticks(ticks, names, fontsize=8)
    axes.set_xlabel("predicted", fontsize=8)
    axes.set_ylabel("true", fontsize=8)
    axes.set_title(drawn_name(title), fontsize=9)
    return finished(figure)


def accuracies(
    names: Sequence[str],
    values: Sequence[float],
    intervals: Sequence[tuple[float, float]],
    title: str,
) -> bytes:
    """Return accuracies as dots with their intervals; NaN intervals are not drawn."""
    figure, axes = plt.subplots(figsize=(7.5, 0.6 + 0.27 * len(names)), layout="constrained")
    for place, (value, (low, high)) in enumerate(zip(values, intervals, strict=True)):
        if np.isfinite(low):
            axes.plot([low, high], [place, place], color="#4477aa", lw=2, alpha=0.6)
        axes.plot(value, place, "o", color="#4477aa" if np.isfinite(low) else "#999999", ms=5)
        axes.text(1.02, place, f"{value:.3f}", va="center", fontsize=8)
    axes.set_yticks(range(len(names)), list(map(drawn_name, names)), fontsize=8)
    axes.invert_yaxis()
    axes.set_xlim(0, 1)
    axes.set_title(title, fontsize=9, loc="left")
    axes.grid(axis="x", alpha=0.3)
    axes.spines[["top", "right"]].set_visible(False)
    return finished(figure)
