"""Robustness curves as one figure: a panel a fault, accuracy with its interval, share answered.

Colours can be distinguished by colour-blind readers and in grey print. Knows nothing about how the
curves were measured.
"""

from __future__ import annotations

import textwrap
from collections.abc import Sequence
from itertools import groupby

import numpy as np
from matplotlib.axes import Axes
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from taxel.evaluation.robustness.curve import FALL, FaultPoint
from taxel.plotting import drawn_name, finished, plt

_ACROSS = 4
_DPI = 120
_TITLE_LETTERS = 42
"""Of a title, that a panel is wide."""
_LEGEND_ACROSS = {1: 1, 2: 2, 3: 3, 4: 5}
"""Columns of the legend by panels across, so that it fits."""
_ACCURACY, _GRASPS, _ANSWERED = "#1f4e8c", "#c1121f", "#b5b5b5"


def sweep_figure(
    points: Sequence[FaultPoint], title: str, *, chance: float = 0.0, cameras: bool = False
) -> bytes:
    """Return the curves as PNG.

    Args:
        points: The point without faults first.
        title: What was judged on what.
        chance: Accuracy of guessing, where the axis begins to mean something, 0…1.
        cameras: True for a grasp bundle.
    """
    base, *rest = points
    panels = [(fault, list(own)) for fault, own in groupby(rest, key=lambda point: point.fault)]
    across = min(_ACROSS, max(1, len(panels)))
    down = -(-len(panels) // across) or 1
    figure, grid = plt.subplots(
        down, across, figsize=(3.1 * across + 0.4, 2.35 * down + 1.0), layout="constrained",
        squeeze=False, sharey=True,
    )  # fmt: skip
    lowest = min([chance, *(point.grasps for point in points if np.isfinite(point.grasps)),
                  *(point.low for point in points if np.isfinite(point.low))])  # fmt: skip
    for axes in grid.ravel()[len(panels) :]:
        axes.set_visible(False)
    for axes, (fault, own) in zip(grid.ravel(), panels, strict=False):
        _panel(axes, base, own, fault)
        axes.set_ylim(max(0.0, lowest - 0.08), 1.02)
        if chance:
            axes.axhline(chance, color="0.5", lw=0.8, ls=":")
    for row in grid:
        row[0].set_ylabel("balanced accuracy" if cameras else "share right", fontsize=9)
    lines = textwrap.wrap(drawn_name(title), _TITLE_LETTERS * across)
    figure.suptitle("\n".join(lines), fontsize=11, x=0.01, ha="left")
    handles = _legend(chance, cameras)
    figure.legend(
        handles=handles, loc="outside lower left", ncols=min(len(handles), _LEGEND_ACROSS[across]),
        fontsize=8, frameon=False,
    )  # fmt: skip
    return finished(figure, dpi=_DPI)


def _panel(axes: Axes, base: FaultPoint, own: Sequence[FaultPoint], fault: str) -> None:
    """Draw one fault: levels evenly apart, the mildest on the left, without it further left."""
    each = [base, *own]
    place = np.arange(len(each), dtype=float)
    axes.bar(place, [point.answered for point in each], width=0.9, color=_ANSWERED, alpha=0.3, lw=0)
    low, high = (np.array([getattr(point, side) for point in each]) for side in ("low", "high"))
    axes.fill_between(place, low, high, color=_ACCURACY, alpha=0.18, lw=0)
    axes.plot(place, [point.grasps for point in each], "s--", color=_GRASPS, ms=3.5, lw=1.0)
    axes.plot(place, [point.accuracy for point in each], "o-", color=_ACCURACY, ms=4.5, lw=1.7)
    usual = np.array([base.accuracy if point.base is None else point.base for point in each])
    axes.plot(place, usual - FALL, color=_ACCURACY, lw=0.8, ls=(0, (4, 3)), alpha=0.6)
    axes.set_xticks(place, ["none", *(f"{point.level:g}" for point in own)], fontsize=8)
    axes.set_title(fault, fontsize=10, loc="left", weight="bold")
    draws = f", {own[0].draws} draws" if own[0].draws > 1 else ""
    axes.set_xlabel(own[0].unit + draws, fontsize=8)
    axes.tick_params(axis="y", labelsize=8)
    axes.grid(axis="y", alpha=0.25)
    axes.spines[["top", "right"]].set_visible(False)


def _legend(chance: float, cameras: bool) -> list[Line2D | Patch]:
    names = (
        ("moments, 95 % by cup", "slips warned of in time")
        if cameras
        else ("windows, 95 % by session", "whole grasps, unanswered ones not right")
    )
    found: list[Line2D | Patch] = [
        Line2D([], [], color=_ACCURACY, marker="o", ms=4.5, label=names[0]),
        Line2D([], [], color=_GRASPS, marker="s", ms=3.5, ls="--", lw=1, label=names[1]),
        Patch(color=_ANSWERED, alpha=0.4, label="share answered"),
        Line2D([], [], color=_ACCURACY, lw=0.8, ls="--", alpha=0.6,
               label=f"{100 * FALL:g} points lost"),
    ]  # fmt: skip
    if chance:
        found.append(Line2D([], [], color="0.5", lw=0.8, ls=":", label="guessing"))
    return found
