"""The picture of docs/explanation/gel-shear.md, in some seconds.

    python -m taxel.bench.transitions.gel_shear_picture docs/pictures/gel-shear.png

One pour at three moments: while the contact sticks, while its rim slips, and in full slip. Rows:
what gels of version 1 and 2 show, and what the layer does. Knows nothing about rows.
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from numpy.typing import NDArray

from taxel.plotting import plt
from taxel.sim.gelsight.mini import GelCamera, draw_sensor
from taxel.sim.gelsight.shear import ShearView
from taxel.sim.pour.cup_pour import Gel, PourTrack, simulate_pour
from taxel.sim.pour.cups import PourRun, draw_cup, draw_run
from taxel.sim.pour.views import LayerView

RUN = draw_run(0, draw_cup(0, 0), "middle", 15.0)
"""A pour that ends in gross slip."""
SLIPS_UM = (2.0, 100.0, 1000.0)
TITLES = ("it sticks", "the rim slips", "full slip")
_ARROW_PX = 16


def draw(path: Path, run: PourRun = RUN) -> None:
    """Write the picture.

    Args:
        path: The file to write.
        run: A pour that slips by at least a millimetre.
    """
    tracks: dict[Gel, PourTrack] = {1: simulate_pour(run), 2: simulate_pour(run, gel=2)}
    slip_um = tracks[2].truth[:, 0]
    moments = [int(np.argmax(slip_um > least)) for least in SLIPS_UM]
    figure, rows = plt.subplots(3, 3, figsize=(10, 7.9), layout="constrained")
    for column, (moment, title) in enumerate(zip(moments, TITLES, strict=True)):
        for row, (gel, track) in enumerate(tracks.items()):
            axes = rows[row, column]
            axes.imshow(_image(run, track, moment, gel))
            axes.set_title(f"{title}: {slip_um[moment]:.0f} µm" if row == 0 else "", fontsize=11)
            rows[row, 0].set_ylabel(f"gel {gel}", fontsize=11)
        _draw_layer(rows[2, column], run, tracks[2], moment)
    rows[2, 0].set_ylabel("layer: movement × 3\nred: friction's limit", fontsize=11)
    for axes in rows.flat:
        axes.set(xticks=[], yticks=[])
    figure.savefig(path, dpi=72)
    plt.close(figure)


def _image(run: PourRun, track: PourTrack, moment: int, gel: Gel) -> NDArray[np.uint8]:
    camera = GelCamera(track.shapes[0], draw_sensor(run.seed, 0), run.seed * 2)
    shear = LayerView(track.layer, 60.0, 0).at(moment / 60.0) if gel == 2 else None
    return camera.frame(track.motions[0], moment, moment / 60.0, shear)


def _draw_layer(axes: Axes, run: PourRun, track: PourTrack, moment: int) -> None:
    """Draw how the face has moved, and which cells of the contact friction no longer holds."""
    mm_per_px = draw_sensor(run.seed, 0).mm_per_px
    shear = LayerView(track.layer, 60.0, 0).at(moment / 60.0)
    right, down, *_ = ShearView(mm_per_px).look(shear)
    y, x = np.mgrid[0:240:_ARROW_PX, 0:320:_ARROW_PX] + 3.5
    step = (slice(None, None, 2), slice(None, None, 2))
    length = 3.0 / mm_per_px
    axes.quiver(x, y, right[step] * length, down[step] * length, angles="xy", scale_units="xy",
                scale=1, width=0.003, headwidth=4, color="#1f4e8c")  # fmt: skip
    patch = shear.patch
    angle = shear.angle_rad + float(track.layer[moment].turn_rad[0])
    cos, sin = np.cos(angle), np.sin(angle)
    middle = track.motions[0].object_mm[moment]
    at_x = (cos * patch.x_mm - sin * patch.y_mm + middle[0]) / mm_per_px + 159.5
    at_y = (sin * patch.x_mm + cos * patch.y_mm + middle[1]) / mm_per_px + 119.5
    slips = track.layer[moment].limited[0]
    axes.scatter(at_x, at_y, s=14, c=np.where(slips, "#c0281c", "#999999"), alpha=0.6, lw=0)
    axes.set(xlim=(0, 320), ylim=(240, 0), aspect="equal")


if __name__ == "__main__":
    draw(Path(sys.argv[1]))
