"""Figures of a calibration file, as PNG bytes.

They read the file's own content, so that a page can be made of any calibration. Colours can
be distinguished by colour-blind readers and in grey print. Knows nothing about pages or recordings.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.lines import Line2D
from matplotlib.patches import Rectangle
from numpy.typing import NDArray

from taxel.calibration.curves import Curve, Form
from taxel.calibration.stored import shown_units
from taxel.plotting import drawn_name, finished, plt

_ACROSS = 4
"""Small pictures in a row of a figure."""
_UP, _DOWN, _GREY, _RED = "#4477aa", "#ee8844", "#9aa3ad", "#bb3344"

Document = Mapping[str, Any]


def curves(document: Document) -> bytes:
    """Return values over force, one small picture a sensor: presses, curve, band, usable range."""
    channels = document["channels"]
    down = -(-len(channels) // _ACROSS)
    figure, grid = plt.subplots(
        down, _ACROSS, figsize=(11, 2.25 * down), layout="constrained", squeeze=False
    )
    for axes in grid.ravel()[len(channels) :]:
        axes.set_visible(False)
    for axes, channel in zip(grid.ravel(), channels, strict=False):
        _curve(axes, channel, document["form"])
    for axes in grid[:, 0]:
        axes.set_ylabel(_units(document)[0], fontsize=8)
    for axes in grid[-1]:
        axes.set_xlabel("N", fontsize=8)
    handles = [
        Line2D([], [], marker="^", ls="", color=_UP, ms=4, label="rising forces"),
        Line2D([], [], marker="v", ls="", color=_DOWN, ms=4, label="falling forces"),
        Line2D([], [], color="black", lw=1.2, label="curve, 95 % band"),
        Rectangle((0, 0), 1, 1, color="#e3ecd9", label="forces in its range"),
    ]
    figure.legend(handles=handles, loc="outside upper center", ncols=4, fontsize=8, frameon=False)
    return finished(figure)


def _curve(axes: Axes, entry: Mapping[str, Any], form: Form) -> None:
    force, volts = _numbers(entry["force_n"]), _numbers(entry["volts"])
    rising = np.array(entry["rising"], bool)
    axes.set_title(drawn_name(entry["channel"]), fontsize=8)
    axes.tick_params(labelsize=7)
    axes.spines[["top", "right"]].set_visible(False)
    if len(force) == 0:
        axes.text(0.5, 0.5, entry["why_none"], ha="center", va="center", fontsize=8,
                  transform=axes.transAxes)  # fmt: skip
        return
    if entry["largest_n"] is not None:
        low = max(entry["smallest_n"], float(force.min()))  # below, it is the curve's word alone
        axes.axvspan(low, max(entry["largest_n"], low), color="#e3ecd9", lw=0)
    if entry["curve"] is None:
        why = "no curve:\n" + entry["why_none"].replace(", ", ",\n")
        axes.text(0.5, 0.05, why, ha="center", va="bottom", fontsize=6.5, transform=axes.transAxes)
    else:
        at = np.linspace(0.0, float(force.max()), 200)
        curve = Curve.of(form, entry["curve"])
        grid = _numbers(entry["grid_n"])
        low_v, high_v = (_numbers(part) for part in entry["band_v"])
        axes.fill_between(grid, low_v, high_v, color="black", alpha=0.18, lw=0)
        axes.plot(at, curve.volts(at), color="black", lw=1.0)
    axes.plot(force[rising], volts[rising], "^", color=_UP, ms=2.8, alpha=0.8, mew=0)
    axes.plot(force[~rising], volts[~rising], "v", color=_DOWN, ms=2.8, alpha=0.8, mew=0)
    largest = 1.1 * float(np.nanmax(volts))
    axes.set_ylim(0, largest if largest > 0 else 0.01)
    axes.set_xlim(0, 1.04 * float(force.max()))


def errors_by_force(document: Document) -> bytes:
    """Return the error of held-out presses over force, the curve's beside a straight line's."""
    rows = document["error_by_force"]
    force = _numbers([row["force_n"] for row in rows])
    figure, axes = plt.subplots(figsize=(5.6, 3.1), layout="constrained")
    axes.plot(force, force, color=_GREY, lw=0.8, ls=":", label="as large as the force")
    axes.plot(force, _numbers([row["line_n"] for row in rows]), "s--", color=_GREY, ms=4, lw=1,
              label="straight line")  # fmt: skip
    axes.plot(force, _numbers([row["curve_n"] for row in rows]), "o-", color=_UP, ms=5, lw=1.4,
              label=f"curve ({document['form']})")  # fmt: skip
    axes.set(xscale="log", yscale="log", xlabel="force (N)", ylabel="mean error (N)")
    ticks = [float(f"{newtons:.2g}") for newtons in force]
    axes.set_xticks(ticks, [f"{tick:g}" for tick in ticks], fontsize=8)
    axes.minorticks_off()
    axes.yaxis.set_major_formatter(lambda value, _: f"{value:g}")
    axes.spines[["top", "right"]].set_visible(False)
    axes.grid(alpha=0.25)
    axes.legend(fontsize=8, frameon=False)
    axes.set_title("presses held out, all sensors", fontsize=9, loc="left")
    return finished(figure)


def uniformity(document: Document) -> bytes:
    """Return each sensor's value at one force, and what pins read of known voltages."""
    results = [document["at_one_force"], *document["references"]]
    names = [drawn_name(channel["channel"]) for channel in document["channels"]]
    figure, grid = plt.subplots(
        1, len(results), figsize=(3.2 + 2.6 * len(results), 0.9 + 0.24 * len(names)),
        layout="constrained", squeeze=False, sharey=True,
    )  # fmt: skip
    place = np.arange(len(names))
    for axes, result in zip(grid[0], results, strict=True):
        volts = _numbers(result["volts"])
        far = np.array([name in result["outliers"] for name in names])
        end = np.array(result["at_least"], bool)
        like = np.isfinite(volts) & ~end & ~far
        if like.any():
            axes.axvline(float(np.median(volts[like])), color=_GREY, lw=0.9, ls="--")
        axes.plot(volts[like], place[like], "o", color=_UP, ms=5)
        axes.plot(volts[far], place[far], "D", color=_RED, ms=5)
        axes.plot(volts[end], place[end], ">", color=_GREY, ms=5)
        axes.set_title(_about(result), fontsize=8.5, loc="left")
        axes.set_xlabel(_units(document)[0], fontsize=8)
        axes.tick_params(labelsize=7.5)
        axes.grid(axis="x", alpha=0.25)
        axes.spines[["top", "right"]].set_visible(False)
        axes.margins(x=0.15)
        axes.ticklabel_format(useOffset=False, axis="x")
        axes.locator_params(axis="x", nbins=4)
    grid[0][0].set_yticks(place, names, fontsize=8)
    grid[0][0].invert_yaxis()
    return finished(figure)


def _about(result: Mapping[str, Any]) -> str:
    spread = result["spread_pct"]
    text = "at the converter's end" if spread is None else f"spread {spread:.2g} %"
    return f"at {result['at']}: {text}"


def ghosts(document: Document) -> bytes:
    """Return the cross-talk matrix, % of the pressed sensor; its diagonal is left out."""
    names = [drawn_name(channel["channel"]) for channel in document["channels"]]
    share = 100.0 * np.array([_numbers(row) for row in document["ghosts"]["share"]])
    np.fill_diagonal(share, np.nan)
    known = share[np.isfinite(share)]
    largest = max(float(np.percentile(np.abs(known), 99)) if len(known) else 0.0, 0.5)
    size = 2.2 + 0.36 * len(names)
    figure, axes = plt.subplots(figsize=(size + 1.0, size), layout="constrained")
    axes.set_facecolor("#e8eaed")  # where nothing is known, and on the diagonal
    shown = axes.imshow(share, cmap="RdBu_r", vmin=-largest, vmax=largest)
    for row, column in np.argwhere(np.isfinite(share)):
        value = share[row, column]
        if abs(value) < 0.05:
            continue
        axes.text(column, row, f"{value:.1f}", ha="center", va="center", fontsize=6,
                  color="white" if abs(value) > 0.7 * largest else "black")  # fmt: skip
    ticks = range(len(names))
    axes.set_xticks(ticks, names, rotation=45, ha="right", fontsize=7.5)
    axes.set_yticks(ticks, names, fontsize=7.5)
    axes.set_xlabel("shows it", fontsize=8)
    axes.set_ylabel("pressed", fontsize=8)
    figure.colorbar(shown, ax=axes, label="% of the pressed sensor", shrink=0.8)
    return finished(figure)


def rest(document: Document) -> bytes:
    """Return noise, hum and drift of each sensor at rest."""
    channels = document["channels"]
    _, small, factor = _units(document)
    names = [drawn_name(channel["channel"]) for channel in channels]
    place = np.arange(len(names))
    figure, (left, right) = plt.subplots(
        1, 2, figsize=(8.6, 0.9 + 0.24 * len(names)), layout="constrained", sharey=True
    )
    for key, mark, colour, label in (
        ("rms_v", "o", _UP, "noise, rms"),
        ("told_rms_v", "o", _GREY, "after 20 ms mean"),
        ("hum_50_v", "s", _DOWN, "50 Hz"),
        ("hum_60_v", "^", "#228855", "60 Hz"),
    ):
        values = factor * _numbers([channel["noise"][key] for channel in channels])
        left.plot(values, place, mark, color=colour, ms=5, label=label)
    left.set_xlabel(small, fontsize=8)
    left.set_xlim(left=0)
    left.legend(fontsize=7.5, frameon=False, loc="lower left", bbox_to_anchor=(-0.02, 1.0),
                ncols=4, columnspacing=0.8, handletextpad=0.1)  # fmt: skip
    for at, channel in enumerate(channels):
        line = channel["rest"]
        if line is None:
            continue
        low, high = _numbers(line["per_hour_95"]) * factor
        if math.isfinite(low):
            right.plot([low, high], [at, at], color=_UP, lw=3, alpha=0.4)
        right.plot(factor * line["per_hour"], at, "o", color=_UP, ms=5)
    right.axvline(0.0, color=_GREY, lw=0.8)
    right.set_xlabel(f"drift of the baseline, {small} an hour", fontsize=8)
    left.set_yticks(place, names, fontsize=8)
    left.invert_yaxis()
    for axes in (left, right):
        axes.tick_params(labelsize=7.5)
        axes.grid(axis="x", alpha=0.25)
        axes.spines[["top", "right"]].set_visible(False)
    return finished(figure)


def _units(document: Document) -> tuple[str, str, float]:
    unit, small, factor = shown_units(document["sensor"]["units"])
    return drawn_name(unit), drawn_name(small), factor


def _numbers(values: Sequence[float | None]) -> NDArray[np.float64]:
    return np.array([math.nan if value is None else float(value) for value in values])
