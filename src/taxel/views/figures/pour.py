"""Probability over time with the states and the true events, as the paper's Figure 8.

Knows nothing about models.
"""

from __future__ import annotations

from pathlib import Path
from typing import Literal

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.lines import Line2D
from matplotlib.patches import Rectangle

from taxel.decisions.stability import Stability, states
from taxel.evaluation.early_warning.grasp_warnings import WarningResult
from taxel.evaluation.transitions.data import CameraSet, truth_moments
from taxel.plotting import drawn_name, plt
from taxel.recordings.whole import whole_file

_COLOURS = {
    Stability.STABLE: "#cfe8d5",
    Stability.WARNING: "#fbe3a4",
    Stability.UNSTABLE: "#f4b6ad",
    Stability.UNKNOWN: "#d9dce1",
}
_SHOWN_STATES = (Stability.STABLE, Stability.WARNING, Stability.UNSTABLE)
_LINES: dict[str, tuple[str, Literal["-", ":", "--"]]] = {
    "probability": ("#1f4e8c", "-"),
    "pour begins": ("#777777", ":"),
    "micro-slip (20 µm)": ("#d08700", "--"),
    "gross slip (300 µm)": ("#c0281c", "-"),
}
_SHOWN = 12
"""Pours in a figure."""


def write_pour_figure(path: Path, data: CameraSet, result: WarningResult, frames: int) -> None:
    """Write a PNG: a panel a pour, those that slip and those that hold in turn.

    Args:
        path: The file.
        data: The pours.
        result: What a monitor said of its test pours.
        frames: k, frames in a window.

    Raises:
        RecordingFailed: The disk refused.
    """
    chosen = _chosen(data, result)
    rows = -(-len(chosen) // 3)
    figure, axes = plt.subplots(
        rows, 3, figsize=(13, 2.1 * rows + 0.7), sharex=True, sharey=True, squeeze=False,
        layout="constrained",
    )  # fmt: skip
    for axis in axes.flat[len(chosen) :]:
        axis.set_visible(False)
    for axis, place in zip(axes.flat, chosen, strict=False):
        _panel(axis, data, result, place, frames)
    for axis in axes[-1]:
        axis.set_xlabel("time (s)")
    for axis in axes[:, 0]:
        axis.set_ylabel("P(unstable)")
    handles: list[Artist] = [Rectangle((0, 0), 1, 1, color=_COLOURS[s]) for s in _SHOWN_STATES]
    names = [state.name.lower() for state in _SHOWN_STATES]
    for name, (colour, style) in _LINES.items():
        handles.append(Line2D([], [], color=colour, linestyle=style))
        names.append(name)
    figure.legend(handles, names, loc="outside upper center", ncol=7, frameon=False)
    try:
        with whole_file(path) as temporary:
            figure.savefig(temporary, format="png", dpi=110)
    finally:
        plt.close(figure)


def _chosen(data: CameraSet, result: WarningResult) -> list[int]:
    """Return places among the test pours: as many that slip as that hold, spread evenly."""
    slips = [p for p, i in enumerate(result.tests) if truth_moments(data.pours[i])[1] is not None]
    holds = [p for p in range(len(result.tests)) if p not in slips]
    picked: list[int] = []
    for places in (slips, holds):
        count = min(_SHOWN // 2, len(places))
        picked += [places[i] for i in np.linspace(0, len(places) - 1, count).astype(int)]
    return picked


def _panel(axis: Axes, data: CameraSet, result: WarningResult, place: int, frames: int) -> None:
    index = result.tests[place]
    pour = data.pours[index]
    found = result.probabilities[place]
    time_s = pour.time_s[frames - 1 :] - pour.time_s[0]
    tuned = result.tuned[min(_fold_of(result, place), len(result.tuned) - 1)]
    shown = states(found, time_s, tuned.config)
    for state, colour in _COLOURS.items():
        axis.fill_between(time_s, 0, 1, where=(shown == state).tolist(), color=colour, step="post",
                          linewidth=0)  # fmt: skip
    axis.plot(time_s, found, color="#1f4e8c", linewidth=1.3)
    onset_s, event_s = truth_moments(pour)
    start = float(pour.groups.get("start_s", "nan"))
    marks = ((start, "#777777", ":"), (onset_s, "#d08700", "--"), (event_s, "#c0281c", "-"))
    for moment_s, colour, style in marks:
        if moment_s is not None and np.isfinite(moment_s):
            at_s = moment_s - (0.0 if moment_s == start else pour.time_s[0])
            axis.axvline(at_s, color=colour, linestyle=style, linewidth=1.4)
    axis.set_title(drawn_name(pour.name.replace("_", " ")), fontsize=9, loc="left")
    axis.set_ylim(0, 1)
    axis.spines[["top", "right"]].set_visible(False)


def _fold_of(result: WarningResult, place: int) -> int:
    """Return which tuning belongs to a test pour, where each fold has as many pours."""
    return place * len(result.tuned) // max(1, len(result.tests))
