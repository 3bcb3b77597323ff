"""Shading: fitted on presses, right on presses it has not seen, clamped beyond them."""

from importlib.util import find_spec
from pathlib import Path

import numpy as np
import pytest

from taxel.errors import BadTable
from taxel.gel.presses import Press, read_presses
from taxel.gel.shading import Shading, clamped_normal, read_shading, save_shading, terms
from taxel.gel.shading_fit import fit_shading, held_out_r2

BALL_MM, MM_PER_PX = 2.0, 0.05


def _known_shading() -> Shading:
    coefficients = np.zeros((20, 3))
    coefficients[:2] = [[5.0, -60.0, 40.0], [70.0, 10.0, -30.0]]
    return Shading(coefficients, 0.6)


def _press(centre: tuple[float, float], radius: float, annotated: tuple[float, float]) -> Press:
    background = np.full((96, 128, 3), 110, np.uint8)
    truth = Press(
        image=background,
        background=background,
        centre_px=centre,
        radius_px=radius,
        ball_radius_mm=BALL_MM,
        mm_per_px=MM_PER_PX,
    )
    change = terms(*clamped_normal(*truth.gradient())) @ _known_shading().coefficients
    return Press(
        image=(background + change).round().astype(np.uint8),
        background=background,
        centre_px=annotated,
        radius_px=radius,
        ball_radius_mm=BALL_MM,
        mm_per_px=MM_PER_PX,
    )


def _presses() -> list[Press]:
    places = [(60.0, 45.0), (64.0, 50.0), (70.0, 40.0), (55.0, 52.0)]
    shifts = [(0, 0), (3, -2), (-2, 0), (0, 2)]
    return [
        _press(place, 24.0, (place[0] + shift[0], place[1] + shift[1]))
        for place, shift in zip(places, shifts, strict=True)
    ]


def test_a_known_shading_is_found_although_middles_are_annotated_wrongly():
    """Central slopes of the known polynomial come back within its own rounding."""
    fitted = fit_shading(_presses())
    gx, gy = np.meshgrid(np.linspace(-0.3, 0.3, 9), np.linspace(-0.3, 0.3, 9))
    difference = fitted.render(gx, gy) - _known_shading().render(gx, gy)
    assert np.abs(difference).max() < 4.0


def test_a_flat_gel_keeps_its_colour():
    assert np.abs(read_shading().render(np.zeros((4, 5)), np.zeros((4, 5)))).max() < 1e-3


def test_slopes_beyond_the_calibrated_ones_keep_the_limits_colour():
    shading = read_shading()
    steep = np.array([[1.5, 5.0, 500.0]])
    colours = shading.render(steep, np.zeros_like(steep))
    assert np.abs(np.diff(colours, axis=1)).max() < 1e-3
    assert np.abs(colours).max() < 160


def test_opposite_slopes_get_different_colours():
    """Three lamps: each direction has its own colour."""
    shading = read_shading()
    angles = np.arange(8) * np.pi / 4
    colours = shading.render(0.3 * np.cos(angles)[None], 0.3 * np.sin(angles)[None])[0]
    apart = np.linalg.norm(colours[:, None] - colours[None], axis=2)
    assert apart[~np.eye(8, dtype=bool)].min() > 10


def test_a_saved_shading_reads_back_the_same(tmp_path: Path):
    save_shading(_known_shading(), tmp_path / "own.json")
    again = read_shading(tmp_path / "own.json")
    assert np.array_equal(again.coefficients, _known_shading().coefficients)
    assert [p.name for p in tmp_path.iterdir()] == ["own.json"]


def test_the_shipped_shading_says_where_it_comes_from():
    assert "dataPack.npz" in read_shading().provenance


@pytest.mark.parametrize("text", ["", "[]", '{"coefficients": [[1]], "steepest": 1}', "{}"])
def test_a_damaged_shading_is_refused(tmp_path: Path, text: str):
    (tmp_path / "own.json").write_text(text)
    with pytest.raises(BadTable):
        read_shading(tmp_path / "own.json")


def test_too_few_presses_are_refused():
    with pytest.raises(BadTable, match="3 or more"):
        fit_shading(_presses()[:2])


def test_ones_own_presses_are_read_in_either_order_of_colours(tmp_path: Path):
    press = _presses()[0]
    for order, step in (("rgb", 1), ("bgr", -1)):
        np.savez(
            tmp_path / f"{order}.npz",
            imgs=press.image[None, ..., ::step],
            f0=press.background[..., ::step],
            touch_center=np.array([press.centre_px]),
            touch_radius=np.array([press.radius_px]),
            ball_radius_mm=3.0,
            mm_per_px=0.07,
            order=order,
        )
    both = read_presses(tmp_path)
    assert len(both) == 2
    for read in both:
        assert np.array_equal(read.image, press.image)
        assert (read.ball_radius_mm, read.mm_per_px) == (3.0, 0.07)


def test_an_archive_without_middles_is_refused(tmp_path: Path):
    np.savez(tmp_path / "bad.npz", imgs=np.zeros((1, 4, 4, 3)), f0=np.zeros((4, 4, 3)))
    with pytest.raises(BadTable, match="touch_center"):
        read_presses(tmp_path / "bad.npz")
    with pytest.raises(BadTable, match="nothing at"):
        read_presses(tmp_path / "none.npz")


def test_the_slope_is_that_of_the_depth():
    """The analytic slope of a press equals its depth's finite difference."""
    press = _presses()[0]
    inner = press.offsets_mm()[0] ** 2 + press.offsets_mm()[1] ** 2 < 0.8**2
    down, right = np.gradient(press.depth_mm(), press.mm_per_px)
    gx, gy = press.gradient()
    assert np.abs(right - gx)[inner].max() < 0.01
    assert np.abs(down - gy)[inner].max() < 0.01


@pytest.mark.slow
@pytest.mark.skipif(
    find_spec("taxim") is None, reason="needs taxim's ball presses: pip install taxim==1.4.1"
)
def test_presses_of_a_real_mini_that_were_left_out_are_explained():
    """R² of at least 0.75 a channel over whole presses left out."""
    spec = find_spec("taxim")
    assert spec is not None
    assert spec.origin is not None
    archive = Path(spec.origin).parent / "calib" / "gelsight_mini" / "dataPack.npz"
    r2 = held_out_r2(read_presses(archive), folds=3)
    assert r2.min() > 0.75
