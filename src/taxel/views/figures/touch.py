"""A figure of raw touch: a lane a channel over time, the map and the image at the strongest touch.

Knows nothing about sources, files or models.
"""

from __future__ import annotations

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from numpy.typing import NDArray

from taxel.plain_text import number_of, short_names
from taxel.plotting import drawn_name, finished, plt
from taxel.signals import Samples, Validity
from taxel.views.terminal import array_grid, hand_fingers, share_of, short_number
from taxel.views.trace_buffer import TraceBuffer, measured_rate_hz, usable_values

_MAP = "viridis"
_IMAGE_ROWS = 12
_ROW_HZ = 100.0
"""The image is a window as in docs/decisions/0003."""
_NAME = 24
"""Most characters of a channel's name beside its lane."""
_LANE = 0.86
"""Share of a lane's height that a full scale fills."""
_MOST_POINTS = 4000
"""Points a trace that still show at this size."""
_MOST_NUMBERED = 16
_SIDE_INCHES, _TALLEST_INCHES = 4.6, 11.0
"""Height of map and image together, and of the tallest figure."""


def touch_figure(buffer: TraceBuffer, title: str) -> bytes:
    """Return a PNG of what a buffer keeps.

    Args:
        buffer: At least one scan; its scale is the colours'.
        title: What is shown.
    """
    samples = buffer.kept
    shares = share_of(usable_values(samples), *buffer.scale())
    channels = len(buffer.info.channels)
    tall = min(max(_SIDE_INCHES, 1.4 + 0.3 * channels), _TALLEST_INCHES)
    figure = plt.figure(figsize=(11, tall), layout="constrained")
    heights = [1.0, 1.0]
    if tall > 1.3 * _SIDE_INCHES:
        heights.append(2 * (tall / _SIDE_INCHES - 1))
    grid = figure.add_gridspec(len(heights), 2, width_ratios=(2.6, 1), height_ratios=heights)
    strongest = _strongest(shares)
    time_s = samples.fitted_s - samples.fitted_s[0]
    lanes = figure.add_subplot(grid[:, 0])
    _draw_lanes(lanes, time_s, shares, samples, buffer)
    lanes.axvline(float(time_s[strongest]), color="0.4", lw=0.8, ls=":")
    now = usable_values(samples)[strongest]
    _draw_map(figure.add_subplot(grid[0, 1]), now, shares[strongest], buffer)
    axes = figure.add_subplot(grid[1, 1])
    picture = _draw_image(axes, shares, strongest, buffer.info.rate_hz)
    bar = figure.colorbar(picture, ax=axes, shrink=0.9)
    _label_bar(bar, buffer)
    figure.suptitle(
        f"{drawn_name(title)}\n{_facts(samples, buffer)}", fontsize=10, x=0.01, ha="left"
    )
    return finished(figure)


def _draw_lanes(
    axes: Axes,
    time_s: NDArray[np.float64],
    shares: NDArray[np.float32],
    kept: Samples,
    buffer: TraceBuffer,
) -> None:
    """Draw each channel in a lane of its own, first on top; saturated values in red."""
    count = shares.shape[1]
    step = max(1, len(time_s) // _MOST_POINTS)
    saturated = (kept.validity & np.uint8(Validity.SATURATED)) != 0
    for column in range(count):
        floor = count - 1 - column
        line = floor + _LANE * shares[:, column]
        axes.axhline(floor, color="0.88", lw=0.6, zorder=0)
        axes.plot(time_s[::step], line[::step], color="#2a6f97", lw=0.9)
        high = np.where(saturated[:, column], line, np.nan)
        axes.plot(time_s[::step], high[::step], color="#c1121f", lw=1.6)
    axes.set_yticks(
        [count - 1 - column + 0.3 for column in range(count)],
        short_names(buffer.info.channels, _NAME),
        fontsize=8 if count <= 24 else 6,
    )
    axes.tick_params(axis="y", length=0)
    axes.set(xlabel="time (s)", ylim=(-0.15, count), xlim=(0, max(float(time_s[-1]), 1e-3)))
    axes.set_title(_lane_note(buffer, bool(saturated.any())), fontsize=9, loc="left")
    axes.spines[["top", "right", "left"]].set_visible(False)


def _draw_map(
    axes: Axes, values: NDArray[np.float32], shares: NDArray[np.float32], buffer: TraceBuffer
) -> None:
    numbers, cells = array_grid(values), array_grid(shares)
    axes.imshow(cells, cmap=_grey_where_bad(), vmin=0, vmax=1, aspect="auto")
    if len(values) <= _MOST_NUMBERED:
        for (row, column), value in np.ndenumerate(numbers):
            ink = "black" if cells[row, column] > 0.6 else "white"
            text = short_number(float(value))
            axes.text(column, row, text, ha="center", va="center", color=ink, fontsize=8)
    fingers = hand_fingers(buffer.info.channels)
    if fingers:
        axes.set_xticks(range(4), short_names(fingers, _NAME), fontsize=8)
        axes.set_yticks(range(3), ["distal", "middle", "proximal"], fontsize=8)
    else:
        axes.set_xticks([])
        axes.set_yticks([])
    axes.tick_params(length=0)
    axes.set_title("the array at the dotted line", fontsize=9, loc="left")


def _draw_image(
    axes: Axes, shares: NDArray[np.float32], strongest: int, rate_hz: float
) -> matplotlib.image.AxesImage:
    every = max(1, round(rate_hz / _ROW_HZ))
    first = max(0, strongest - every * (_IMAGE_ROWS // 2))
    image = shares[first::every][:_IMAGE_ROWS]
    picture = axes.imshow(image, cmap=_grey_where_bad(), vmin=0, vmax=1, aspect="auto")
    span = f" ({len(image) * every / rate_hz:.2g} s)" if rate_hz > 0 else ""
    axes.set_title(
        f"{number_of(len(image), 'row')}{span} around it, oldest on top", fontsize=9, loc="left"
    )
    axes.set_xlabel("sensor", fontsize=8)
    axes.set_ylabel("row", fontsize=8)
    axes.set_yticks(range(0, len(image), 3))
    axes.tick_params(labelsize=7)
    return picture


def _strongest(shares: NDArray[np.float32]) -> int:
    """Return the row with the largest sum."""
    return int(np.argmax(np.nan_to_num(shares).sum(axis=1)))


def _facts(kept: Samples, buffer: TraceBuffer) -> str:
    rate_hz = measured_rate_hz(kept)
    flags = ", ".join(
        f"{name} in {number_of(count, 'scan', ',')}" for name, count in buffer.flags.items()
    )
    return (
        f"{number_of(len(kept), 'scan', ',')}, {rate_hz:.1f} scans/s measured "
        f"({buffer.info.rate_hz:g} nominal), {buffer.lost:,} lost, {flags or 'all values good'}"
    )


def _lane_note(buffer: TraceBuffer, saturated: bool) -> str:
    red = "; red: saturated" if saturated else ""
    if buffer.info.full_scale is not None:
        return (
            f"each lane 0 to {buffer.info.full_scale:.3g} {drawn_name(buffer.info.units[0])}{red}"
        )
    return f"each lane from its least value, one span a unit{red}"


def _label_bar(bar: matplotlib.colorbar.Colorbar, buffer: TraceBuffer) -> None:
    full = buffer.info.full_scale
    if full is None:
        bar.set_label("share of the span", fontsize=8)
        bar.ax.tick_params(labelsize=7)
        return
    places = np.linspace(0, 1, 4)
    bar.set_ticks(list(places), labels=[f"{place * full:.1f}" for place in places], fontsize=7)
    bar.set_label(drawn_name(buffer.info.units[0]), fontsize=8)


def _grey_where_bad() -> matplotlib.colors.Colormap:
    return plt.colormaps[_MAP].with_extremes(bad="0.7")
