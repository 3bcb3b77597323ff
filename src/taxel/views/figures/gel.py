"""A figure of gel images against their reference: contact, dots' movement, depth and normals.

Knows nothing about sources, files or models of grasps.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Literal

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import FigureBase
from numpy.typing import NDArray

from taxel.gel.markers import MarkerFlow, Rgb
from taxel.plotting import drawn_name, finished, plt
from taxel.views.gel_moment import GelTouch

_LONGEST_PX = 36.0
"""Length to which arrows are magnified at most, px of a 320-pixel row: dots are 45 apart."""
_SCALES = (1, 1.5, 2, 3, 4, 5, 7, 10, 15, 20)
"""Magnifications of arrows that are offered."""
_LEAST_STILL_PX = 0.15
"""Movement under which a dot is drawn without an arrow: tracking noise."""
_CONTACT, _ARROW = "#ffd60a", "#ffffff"
_DEEPEST_AT_LEAST_MM = 0.5
"""Span of the depth's colours where nothing is deeper, so that noise stays pale."""
_ROW_INCHES = 16.0
"""Width of a row of four pictures."""

Kind = Literal["png", "svg"]


def gels_figure(touches: Mapping[str, GelTouch], title: str, kind: Kind = "png") -> bytes:
    """Return a picture with a row a camera: the frame, its dots, depth and normals.

    Args:
        touches: By the camera's name, at least one.
        title: What is shown.
        kind: Of picture.
    """
    heights = [
        _ROW_INCHES / 4 * 0.93 * touch.rgb.shape[0] / touch.rgb.shape[1] + 0.5
        for touch in touches.values()
    ]
    figure = plt.figure(figsize=(_ROW_INCHES, sum(heights) + 0.35), layout="constrained")
    parts = figure.subfigures(len(touches), 1, height_ratios=heights, squeeze=False)[:, 0]
    for part, (name, touch) in zip(parts, touches.items(), strict=True):
        _draw(part, part.subplots(1, 4), touch)
        part.suptitle(f"{drawn_name(name)}: {touch.words()}", fontsize=10, x=0.005, ha="left")
    figure.suptitle(drawn_name(title), fontsize=11, fontweight="bold", x=0.005, ha="left")
    return finished(figure, kind)


def _draw(figure: FigureBase, axes: NDArray[np.object_], touch: GelTouch) -> None:
    """Draw the four pictures of a gel."""
    _draw_frame(axes[0], touch.rgb, touch.mask)
    _draw_flow(axes[1], touch.rgb, touch.flow, touch.mask)
    picture = _draw_depth(axes[2], touch)
    bar = figure.colorbar(picture, ax=axes[2], shrink=0.85, pad=0.02)
    bar.set_label("depth (mm)" if touch.calibrated else "depth (mm, uncalibrated)", fontsize=8)
    bar.ax.tick_params(labelsize=7)
    _draw_normals(axes[3], touch.normals, touch.mask)


def _draw_frame(axes: Axes, rgb: Rgb, mask: NDArray[np.bool_]) -> None:
    axes.imshow(rgb)
    _outline(axes, mask, _CONTACT)
    _finish(axes, "the frame; contact outlined" if mask.any() else "the frame; no contact found")


def _draw_flow(axes: Axes, rgb: Rgb, flow: MarkerFlow, mask: NDArray[np.bool_]) -> None:
    """Draw each dot's movement as an arrow that starts where it was, magnified."""
    grey = 0.1 + 0.7 * rgb.astype(np.float32).mean(axis=2) / 255
    axes.imshow(grey, cmap="gray", vmin=0, vmax=1)
    _outline(axes, mask, _CONTACT)
    if not len(flow.seen):
        _finish(axes, "no dots on this gel")
        return
    shift = flow.shift
    length = np.linalg.norm(shift, axis=1)
    longest = float(np.percentile(length[flow.seen], 98)) if flow.seen.any() else 0.0
    times = _magnification(longest, rgb.shape[1] / 320)
    moved = flow.seen & (length > _LEAST_STILL_PX)
    still = flow.seen & ~moved
    at = flow.reference
    colour = axes.quiver(
        at[moved, 0],
        at[moved, 1],
        shift[moved, 0] * times,
        shift[moved, 1] * times,
        length[moved],
        cmap="cool",
        angles="xy",
        scale_units="xy",
        scale=1,
        width=0.009,
        headwidth=3.6,
        headlength=3.8,
        headaxislength=3.4,
        clim=(0, max(longest, 0.5)),
    )
    axes.plot(*at[still].T, ".", color=_ARROW, ms=3)
    axes.plot(*at[~flow.seen].T, "x", color="#c1121f", ms=5)
    bar = axes.figure.colorbar(colour, ax=axes, shrink=0.85, pad=0.02)
    bar.set_label("movement (px)", fontsize=8)
    bar.ax.tick_params(labelsize=7)
    lost = f"; {(~flow.seen).sum()} lost (×)" if not flow.seen.all() else ""
    _finish(axes, f"dots' movement, arrows {times:g}× as long{lost}")


def _draw_depth(axes: Axes, touch: GelTouch) -> matplotlib.image.AxesImage:
    deepest = max(touch.deepest_mm, _DEEPEST_AT_LEAST_MM)
    picture = axes.imshow(np.maximum(touch.depth_mm, 0), cmap="magma", vmin=0, vmax=deepest)
    _outline(axes, touch.mask, _ARROW)
    _finish(axes, "depth of the imprint")
    return picture


def _draw_normals(axes: Axes, normals: NDArray[np.float32], mask: NDArray[np.bool_]) -> None:
    axes.imshow(np.clip(0.5 + 0.5 * normals, 0, 1))
    _outline(axes, mask, _ARROW)
    _finish(axes, "normals: x, y, z as red, green, blue")


def _outline(axes: Axes, mask: NDArray[np.bool_], colour: str) -> None:
    if mask.any() and not mask.all():
        axes.contour(mask.astype(float), levels=[0.5], colors=[colour], linewidths=1.1)


def _finish(axes: Axes, title: str) -> None:
    axes.set_title(title, fontsize=9, loc="left")
    axes.set_xticks([])
    axes.set_yticks([])


def _magnification(longest_px: float, scale: float) -> float:
    fitting = [times for times in _SCALES if times * longest_px <= _LONGEST_PX * scale]
    return max(fitting, default=1)
