"""Contact is where colours changed, whatever the exposure and wherever dots went."""

import numpy as np
import pytest

from taxel.errors import BadSource
from taxel.gel.contact import contact_mask, contact_shape, imprint_mask


def pressed(image, at, radius_px, strength=0.35):
    """Lay a ball's coloured imprint upon an image."""
    y, x = np.mgrid[: image.shape[0], : image.shape[1]].astype(float)
    dx, dy = (x - at[0]) / radius_px, (y - at[1]) / radius_px
    inside = dx**2 + dy**2 < 1
    change = np.stack([dx, -dx, dy], axis=-1) * strength * inside[..., None]
    return np.clip(image * (1 + change), 0, 255).astype(np.uint8)


def overlap(a, b):
    return (a & b).sum() / (a | b).sum()


def disc(at, radius_px, shape=(240, 320)):
    y, x = np.mgrid[: shape[0], : shape[1]]
    return np.hypot(x - at[0], y - at[1]) < radius_px


@pytest.mark.parametrize("exposure", [1.0, 0.7, 1.4])
def test_a_press_is_outlined_at_any_exposure(paint, dot_grid, exposure):
    dots = dot_grid(43.5)
    reference = paint(dots, noise=1.0)
    frame = pressed(paint(dots, noise=1.0, seed=2, exposure=exposure), (170, 110), 55)

    mask = contact_mask(frame, reference)

    assert mask.shape == (240, 320)
    assert overlap(mask, disc((170, 110), 55)) > 0.75


def test_dots_that_move_are_no_contact(paint, dot_grid):
    dots = dot_grid(31.5)

    assert contact_mask(paint(dots + 3.0), paint(dots)).mean() < 0.005


def test_noise_and_black_frames_are_no_contact(paint, dot_grid):
    dots = dot_grid(31.5)
    black = np.zeros((240, 320, 3), np.uint8)

    assert not contact_mask(paint(dots, noise=1.5, seed=1), paint(dots, noise=1.5)).any()
    assert not contact_mask(black, black).any()


def test_frames_of_two_sizes_are_refused(paint, dot_grid):
    with pytest.raises(BadSource, match="as the reference"):
        contact_mask(np.zeros((120, 160, 3), np.uint8), paint(dot_grid(31.5)))


def test_area_middle_and_axes_of_an_ellipse_come_back():
    y, x = np.mgrid[:240, :320]
    turn = 0.4
    u = (x - 150) * np.cos(turn) + (y - 120) * np.sin(turn)
    v = -(x - 150) * np.sin(turn) + (y - 120) * np.cos(turn)

    shape = contact_shape((u / 60) ** 2 + (v / 30) ** 2 < 1)

    assert shape.area_px == pytest.approx(np.pi * 60 * 30, rel=0.01)
    assert shape.centre_px == pytest.approx([150, 120], abs=0.3)
    assert shape.axes_px == pytest.approx([60, 30], abs=0.5)
    assert shape.angle_rad == pytest.approx(turn, abs=0.01)


def test_no_contact_has_no_size():
    assert contact_shape(np.zeros((24, 32), np.bool_)).area_px == 0.0


def test_one_frame_alone_shows_its_imprint(paint, dot_grid):
    bare = paint(dot_grid(43.5), noise=1.0)

    assert imprint_mask(bare).mean() < 0.01
    assert overlap(imprint_mask(pressed(bare, (160, 120), 45)), disc((160, 120), 45)) > 0.5
