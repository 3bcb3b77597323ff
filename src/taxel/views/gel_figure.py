"""A figure of one gel image against its reference: contact, shear, depth and normals.

Knows nothing about sources, files or models of grasps.
"""

from __future__ import annotations

import io
from typing import Literal

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from numpy.typing import NDArray

from taxel.gel.contact import contact_mask, contact_shape
from taxel.gel.depth import DepthModel
from taxel.gel.integration import depth_from_gradients, normals_of
from taxel.gel.markers import MarkerFlow, MarkerTracker, Rgb
from taxel.gel.motion import dots_in, summarise_flow

matplotlib.use("Agg")
from matplotlib import pyplot as plt

MM_PER_PX = 0.059
"""Of a 320-pixel row where the camera does not say: Taxim's 0.0295 at 640 (PHYSICS.md: 0.059
to 0.071)."""
_DPI = 110
_LONGEST_PX = 22.0
"""Length to which arrows are magnified at most, px of a 320-pixel row."""
_SCALES = (1, 2, 5, 10, 20)
"""Magnifications of arrows that are offered."""
_LEAST_STILL_PX = 0.15
"""Movement under which a dot is drawn without an arrow: tracking noise."""
_CONTACT, _ARROW = "#ffd60a", "#ffffff"
_DEEPEST_AT_LEAST_MM = 0.1
"""Span of the depth's colours where nothing is deeper, so that noise stays pale."""


def gel_figure(
    rgb: Rgb,
    reference: Rgb,
    title: str,
    mm_per_px: float | None = None,
    model: DepthModel | None = None,
    kind: Literal["png", "svg"] = "png",
) -> bytes:
    """Return a picture of what a gel image says against its reference.

    Args:
        rgb: Shape (height, width, 3), red first.
        reference: The same gel untouched or settled, same shape.
        title: What is shown.
        mm_per_px: Size of a pixel on the gel, mm; None takes a GelSight Mini's.
        model: From colour to slope; None takes the one that is shipped.
        kind: Of picture.

    Raises:
        BadSource: Shapes differ, or are none of colour images.
    """
    height, width = rgb.shape[:2]
    size_mm = mm_per_px or MM_PER_PX * 320 / width
    mask = contact_mask(rgb, reference)
    flow = MarkerTracker(reference).track(rgb)
    gx, gy = (model or DepthModel.shipped()).gradients(rgb, reference)
    depth = depth_from_gradients(gx, gy, size_mm)
    figure, axes = plt.subplots(
        2, 2, figsize=(9.6, 7.4 * height / width * 4 / 3 + 0.6), layout="constrained"
    )
    _draw_frame(axes[0, 0], rgb, mask)
    _draw_flow(axes[0, 1], rgb, flow, mask)
    picture = _draw_depth(axes[1, 0], depth, mask)
    bar = figure.colorbar(picture, ax=axes[1, 0], shrink=0.85, pad=0.02)
    bar.set_label("depth (mm)", fontsize=8)
    bar.ax.tick_params(labelsize=7)
    _draw_normals(axes[1, 1], normals_of(gx, gy), mask)
    figure.suptitle(
        f"{title}\n{_facts(flow, mask, depth, size_mm)}", fontsize=10, x=0.01, ha="left"
    )
    raw = io.BytesIO()
    figure.savefig(raw, format=kind, dpi=_DPI)
    plt.close(figure)
    return raw.getvalue()


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
        cmap="plasma",
        angles="xy",
        scale_units="xy",
        scale=1,
        width=0.008,
        clim=(0, max(longest, 0.5)),
    )
    axes.plot(*at[still].T, ".", color=_ARROW, ms=3)
    axes.plot(*at[~flow.seen].T, "x", color="#c1121f", ms=5)
    bar = axes.figure.colorbar(colour, ax=axes, shrink=0.85, pad=0.02)
    bar.set_label("movement (px)", fontsize=8)
    bar.ax.tick_params(labelsize=7)
    lost = f"; {(~flow.seen).sum()} lost (×)" if not flow.seen.all() else ""
    _finish(axes, f"dots' movement, arrows {times}× as long{lost}")


def _draw_depth(
    axes: Axes, depth: NDArray[np.float32], mask: NDArray[np.bool_]
) -> matplotlib.image.AxesImage:
    deepest = max(float(np.percentile(depth, 99.8)), _DEEPEST_AT_LEAST_MM)
    picture = axes.imshow(np.maximum(depth, 0), cmap="magma", vmin=0, vmax=deepest)
    _outline(axes, mask, _ARROW)
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


def _magnification(longest_px: float, scale: float) -> int:
    fitting = [times for times in _SCALES if times * longest_px <= _LONGEST_PX * scale]
    return max(fitting, default=1)


def _facts(
    flow: MarkerFlow, mask: NDArray[np.bool_], depth: NDArray[np.float32], mm_per_px: float
) -> str:
    shape = contact_shape(mask)
    if not shape.area_px:
        return f"no contact against the reference; {len(flow.seen)} dots"
    moved = summarise_flow(flow, dots_in(flow.reference, mask))
    shear_mm = float(np.hypot(*moved.shear_px)) * mm_per_px
    shear = f"shear {shear_mm:.2f} mm" if moved.inside.dots else "no dots in it to tell shear"
    return (
        f"contact {shape.area_px * mm_per_px**2:.0f} mm², "
        f"deepest {float(np.percentile(depth, 99.8)):.2f} mm, {shear}, {len(flow.seen)} dots"
    )
