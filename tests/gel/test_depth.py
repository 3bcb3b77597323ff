"""Slopes integrate to the surface they came from; colours give slopes back."""

import numpy as np
import pytest

from taxel.errors import BadDataset, BadSource
from taxel.gel.colour_change import colour_change
from taxel.gel.depth import DepthModel
from taxel.gel.integration import depth_from_gradients, normals_of
from taxel.gel.presses import Press

MM_PER_PX = 0.06
LAMPS = np.array([[0.45, 0.1], [-0.3, 0.35], [0.1, -0.45]])
"""How much each colour brightens with slope along x and y: a made-up gel."""


def ball_press(seed, shape=(240, 320)):
    rng = np.random.default_rng(seed)
    centre, radius_px = (rng.uniform(80, 240), rng.uniform(80, 160)), rng.uniform(16, 26)
    flat = np.broadcast_to(np.array([100, 110, 90], np.uint8), (*shape, 3))
    empty = Press(
        image=flat,
        background=flat,
        centre_px=centre,
        radius_px=radius_px,
        ball_radius_mm=2.4,
        mm_per_px=MM_PER_PX,
    )
    slope = np.stack(empty.gradient(), axis=-1)
    image = flat * (1 + slope @ LAMPS.T) + rng.normal(0, 1.0, flat.shape)
    return Press(
        image=np.clip(np.rint(image), 0, 255).astype(np.uint8),
        background=flat,
        centre_px=centre,
        radius_px=radius_px,
        ball_radius_mm=2.4,
        mm_per_px=MM_PER_PX,
    )


@pytest.mark.parametrize("shape", [(240, 320), (121, 163)])
def test_a_sphere_comes_back_from_its_slopes(shape):
    y, x = np.mgrid[: shape[0], : shape[1]].astype(float)
    x_mm, y_mm = (x - shape[1] / 2) * MM_PER_PX, (y - shape[0] / 2) * MM_PER_PX
    radius_mm, rim_mm = 6.0, 2.5
    r2 = np.minimum(x_mm**2 + y_mm**2, rim_mm**2)
    true = np.sqrt(radius_mm**2 - r2) - np.sqrt(radius_mm**2 - rim_mm**2)
    inside = x_mm**2 + y_mm**2 < rim_mm**2
    slope = np.where(inside, -1 / np.sqrt(radius_mm**2 - r2), 0.0)

    depth = depth_from_gradients(
        (slope * x_mm).astype(np.float32), (slope * y_mm).astype(np.float32), MM_PER_PX
    )

    assert depth.shape == shape
    assert np.abs(depth - true).max() < 0.02 * true.max()


def test_slopes_of_two_shapes_are_refused():
    with pytest.raises(BadSource, match="one shape"):
        depth_from_gradients(np.zeros((4, 6), np.float32), np.zeros((4, 8), np.float32), 0.06)


def test_flat_gel_has_upright_normals_and_slopes_lean_them():
    normals = normals_of(np.array([[0.0, 1.0]], np.float32), np.array([[0.0, 0.0]], np.float32))

    assert normals[0, 0].tolist() == [0.0, 0.0, 1.0]
    assert normals[0, 1] == pytest.approx([np.sqrt(0.5), 0.0, np.sqrt(0.5)], abs=1e-6)


def test_a_model_fitted_on_balls_says_the_slope_of_balls_not_seen():
    model = DepthModel.fit([ball_press(seed) for seed in range(6)])

    check = model.check([ball_press(seed) for seed in range(20, 24)])

    assert check.r2_x > 0.95
    assert check.r2_y > 0.95
    assert check.depth_error_mm < 0.05 * check.depth_mm


def test_a_mark_that_is_off_is_put_right():
    model = DepthModel.fit([ball_press(seed) for seed in range(4)])
    true = ball_press(9)
    marked = Press(
        image=true.image,
        background=true.background,
        centre_px=(true.centre_px[0] + 3, true.centre_px[1] - 2),
        radius_px=true.radius_px,
        ball_radius_mm=true.ball_radius_mm,
        mm_per_px=MM_PER_PX,
    )

    assert model.centred(marked).centre_px == pytest.approx(true.centre_px, abs=1.01)


def test_one_press_is_too_few():
    with pytest.raises(BadDataset, match="at least 2"):
        DepthModel.fit([ball_press(0)])


def test_exposure_alone_is_no_slope(paint, dot_grid):
    dots = dot_grid(31.5)

    change = colour_change(paint(dots, exposure=0.75), paint(dots))

    assert np.abs(change).mean() < 0.02


def test_frames_of_two_sizes_are_refused_by_the_model():
    with pytest.raises(BadSource, match="as the reference"):
        DepthModel.shipped().gradients(
            np.zeros((24, 32, 3), np.uint8), np.zeros((24, 30, 3), np.uint8)
        )


def test_the_shipped_model_is_its_own_text_and_says_where_it_comes_from():
    model = DepthModel.shipped()

    assert "taxim" in model.provenance
    assert model.weights.shape == (19, 2)
    assert f"{model.weights[0, 0]:.4f}" in model.to_json()


def test_the_shipped_model_fits_real_ball_presses():
    """Marked middles are up to 0.35 mm off; put right, the slope is told to R² 0.75."""
    taxim = pytest.importorskip("taxim", reason="taxim carries the real presses; not installed")
    from pathlib import Path

    from taxel.gel.presses import read_presses

    archive = Path(taxim.__file__).parent / "calib" / "gelsight_mini" / "dataPack.npz"
    presses, model = read_presses(archive)[::4], DepthModel.shipped()

    marked = model.check(presses)
    centred = model.check([model.centred(press) for press in presses])

    assert min(marked.r2_x, marked.r2_y) > 0.6
    assert min(centred.r2_x, centred.r2_y) > 0.72
    assert centred.depth_error_mm < 0.06
