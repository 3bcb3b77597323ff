"""A figure of one pour's labels: the change signal, its threshold, and who says unstable when.

Knows nothing about how rules work, files or models.
"""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes

from taxel.labels.change import ChangeConfig, thresholds
from taxel.labels.rules import RULES
from taxel.plotting import drawn_name, finished, plt
from taxel.training.frames.label_sheet import PERSON, PourLabels
from taxel.training.frames.labels import rate_of

_CAMERAS = ("#1f4e8c", "#2a9d8f", "#7b4ea3", "#6c757d")
_RULES = {"change": "#1f4e8c", "micro-slip": "#d08700", "slip": "#d9622b", "gross-slip": "#c0281c",
          "drop": "#111111"}  # fmt: skip
_PERSON = "#7b2d8b"
_LANE = 0.32
"""Height of a rule's lane, inches."""


def label_figure(labels: PourLabels, rule: str) -> bytes:
    """Return a PNG: above the signal of each camera, below a lane for each rule and the person.

    Args:
        labels: What is said of the pour.
        rule: Whose correction is shown.
    """
    lanes = _lanes(labels, rule)
    figure, (above, below) = plt.subplots(
        2, 1, figsize=(9.6, 3.6 + _LANE * len(lanes)), sharex=True, layout="constrained",
        height_ratios=(3.0, 0.4 + _LANE * len(lanes)),
    )  # fmt: skip
    _draw_signal(above, labels)
    _draw_lanes(below, labels, lanes)
    correction = labels.corrections.get(rule)
    if correction is not None and correction.onset_s is not None:
        above.axvline(correction.onset_s, color=_PERSON, lw=1.4, ls="-.")
    onset = labels.onset(rule)
    if onset is not None:
        above.axvline(onset, color=_RULES.get(rule, "0.3"), lw=1.2, ls="--")
    figure.suptitle(f"{drawn_name(labels.pour.name)}: {rule}", fontsize=10, x=0.01, ha="left")
    return finished(figure)


def _draw_signal(axes: Axes, labels: PourLabels) -> None:
    rate_hz = rate_of(labels.pour)
    signal = labels.signal.astype(np.float64)
    limits = thresholds(signal, rate_hz)
    settled = ChangeConfig().settled(rate_hz)
    time_s = labels.time_s
    axes.axvspan(
        time_s[settled.start], time_s[settled.stop - 1], color="0.92", lw=0, label="settled frames"
    )
    for column, camera in enumerate(labels.pour.cameras):
        colour = _CAMERAS[column % len(_CAMERAS)]
        axes.plot(time_s, signal[:, column], color=colour, lw=1.2, label=drawn_name(camera.name))
        axes.axhline(limits[column], color=colour, lw=0.9, ls=":")
    axes.plot([], [], color="0.4", lw=0.9, ls=":", label="threshold")
    axes.set(ylabel="change (% of brightness)", xlim=(0, float(time_s[-1])), ylim=(0, None))
    axes.legend(loc="upper left", fontsize=8, frameon=False, ncol=4)
    axes.spines[["top", "right"]].set_visible(False)


def _lanes(labels: PourLabels, rule: str) -> list[tuple[str, str, np.ndarray]]:
    """Return name, colour and labels of each lane, from the top."""
    lanes = [
        (name, _RULES.get(name, "0.4"), labels.by_rule[name])
        for name in RULES
        if name in labels.by_rule
    ]
    if rule in labels.corrections:
        corrected = labels.labels(rule)
        assert corrected is not None
        lanes.append((f"{PERSON}, of {rule}", _PERSON, corrected))
    return lanes


def _draw_lanes(axes: Axes, labels: PourLabels, lanes: list[tuple[str, str, np.ndarray]]) -> None:
    time_s = labels.time_s
    for place, (_, colour, lane) in enumerate(lanes):
        floor = len(lanes) - 1 - place
        axes.axhline(floor + 0.4, color="0.9", lw=6, zorder=0)
        axes.fill_between(time_s, floor + 0.12, floor + 0.68, where=(lane > 0).tolist(),
                          color=colour, step="post", lw=0)  # fmt: skip
        onset = time_s[int(np.argmax(lane))] if lane.any() else None
        text = "stable throughout" if onset is None else f"{onset:.2f} s"
        axes.text(1.005, floor + 0.4, text, transform=axes.get_yaxis_transform(), va="center",
                  fontsize=8, color=colour)  # fmt: skip
    axes.set_yticks([len(lanes) - 0.6 - place for place in range(len(lanes))],
                    [name for name, _, _ in lanes], fontsize=8)  # fmt: skip
    axes.tick_params(axis="y", length=0)
    axes.set(xlabel="time after the first frame (s); filled: unstable", ylim=(0, len(lanes)))
    axes.spines[["top", "right", "left"]].set_visible(False)
