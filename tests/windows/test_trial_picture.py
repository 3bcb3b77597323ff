"""A plain picture: colour and its spread by cell, whatever the image's size."""

from __future__ import annotations

import numpy as np
import pytest

from taxel.windows import trial_picture
from taxel.windows.trial_crops import FAMILIES, Scene, look_at, row_of
from taxel.windows.trial_picture import CELLS, COLUMNS, ROWS, look_at_picture


def by_cell(row: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Means and standard deviations of a row, shape (8, 8, 3) each."""
    mean, spread = row.reshape(2, *CELLS, 3)
    return mean, spread


def cells(seed: int, height: int = 120, width: int = 160) -> np.ndarray:
    """An image of 64 even cells of drawn colours."""
    colours = np.random.default_rng(seed).integers(0, 256, (*CELLS, 3), np.uint8)
    return colours.repeat(height // 8, axis=0).repeat(width // 8, axis=1)


def test_even_cells_have_their_colour_and_no_spread() -> None:
    image = cells(0)
    shown = look_at_picture([image] * 9)
    assert shown.shape == (ROWS, COLUMNS)
    mean, spread = by_cell(shown[0])
    np.testing.assert_allclose(mean, image[::15, ::20], atol=1e-3)
    np.testing.assert_allclose(spread, 0.0, atol=0.2)
    assert not shown[3:, : COLUMNS // 2].any()


def test_stripes_within_a_cell_are_spread_of_their_colour_alone() -> None:
    """Red of 100 ± 30 in one cell: mean 100, deviation 30, there only."""
    image = np.full((120, 160, 3), 100, np.uint8)
    image[30:45, 40:60:2, 0], image[30:45, 41:60:2, 0] = 70, 130
    mean, spread = by_cell(look_at_picture([image] * 8)[0])
    np.testing.assert_allclose(mean, 100.0, atol=1e-3)
    assert spread[2, 2, 0] == pytest.approx(30.0, abs=0.01)
    spread[2, 2, 0] = 0.0
    np.testing.assert_allclose(spread, 0.0, atol=0.2)


def test_changes_are_first_to_middle_first_to_last_and_middle_to_last() -> None:
    images = [np.full((48, 64, 3), 10 * n, np.uint8) for n in range(9)]
    shown = look_at_picture(images)
    half = COLUMNS // 2
    assert shown[:, :half].mean(axis=1).tolist() == [0.0, 40.0, 80.0, 40.0, 80.0, 40.0]
    np.testing.assert_allclose(shown[:, half:], 0.0, atol=0.2)


@pytest.mark.parametrize("size", [(240, 320), (480, 640), (400, 300), (40, 40)])
def test_an_image_of_another_size_gives_the_same_numbers(size: tuple[int, int]) -> None:
    usual = look_at_picture([cells(1)] * 8)[:, : COLUMNS // 2]
    found = look_at_picture([cells(1, *size)] * 8)[:, : COLUMNS // 2]
    np.testing.assert_allclose(found, usual, atol=12.0)
    assert np.abs(found - usual).mean() < 2.0


def test_two_cameras_give_the_largest_and_the_least() -> None:
    scenes = [Scene([np.full((60, 80, 3), level, np.uint8)] * 8, 25.0, 0.065) for level in (9, 50)]
    row = row_of(look_at(["picture"], scenes))["picture"]
    assert len(row) == 2 * ROWS * FAMILIES["picture"].columns
    assert (row[0], row[ROWS * COLUMNS]) == (50.0, 9.0)


@pytest.mark.parametrize("level", [0.1, 0.3, 0.7, 33.3, 101.7, 200.9])
def test_rounding_makes_no_spread_of_an_even_cell_that_is_no_number(level: float) -> None:
    """The mean of squares may come out a hair below the square of the mean."""
    picture = np.full((123, 157, 3), level, np.float32)
    assert np.isfinite(trial_picture._by_cell(picture)).all()
