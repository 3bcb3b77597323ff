"""Miniatures: the colours of a crop's middle frame, and nothing else."""

from __future__ import annotations

import numpy as np
import pytest

from taxel.windows.trial_crops import Scene, look_at, row_of
from taxel.windows.trial_miniature import COLUMNS, SIDE, look_at_miniature


def test_a_miniature_is_the_mean_colour_by_pixel_red_first() -> None:
    small = np.random.default_rng(0).integers(0, 256, (SIDE, SIDE, 3), np.uint8)
    large = small.repeat(4, axis=0).repeat(5, axis=1)
    shown = look_at_miniature([large] * 8)
    assert shown.shape == (1, COLUMNS)
    np.testing.assert_allclose(shown[0], small.ravel(), atol=1e-3)


def test_it_is_of_the_middle_frame() -> None:
    images = [np.full((48, 64, 3), (n, 0, 255 - n), np.uint8) for n in range(9)]
    found = look_at_miniature(images).reshape(SIDE * SIDE, 3)
    np.testing.assert_allclose(found, np.tile([4, 0, 251], (SIDE * SIDE, 1)), atol=1e-3)


@pytest.mark.parametrize("size", [(20, 30), (33, 31), (480, 640), (8, 400)])
def test_any_size_of_image_gives_as_many_numbers(size: tuple[int, int]) -> None:
    shown = look_at_miniature([np.full((*size, 3), 77, np.uint8)])
    np.testing.assert_allclose(shown, np.full((1, COLUMNS), 77.0), atol=1e-3)


def test_two_cameras_give_the_largest_and_the_least() -> None:
    scenes = [Scene([np.full((60, 80, 3), level, np.uint8)] * 8, 25.0, 0.065) for level in (9, 50)]
    row = row_of(look_at(["miniature"], scenes))["miniature"]
    np.testing.assert_allclose(row, np.repeat([50.0, 9.0], COLUMNS), atol=1e-3)
