"""A crop through an image network: which images it is given, and what a crop has of them."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from taxel.windows.trial_crops import Scene, look_at, row_of
from taxel.windows.trial_network import FEATURES, IMAGES, SIDE_PX, look_through_network


class _Asked:
    """Gives each image's brightness, and keeps what it was given."""

    def __init__(self) -> None:
        self.images: list[NDArray[np.uint8]] = []

    def __call__(self, images: NDArray[np.uint8]) -> NDArray[np.float32]:
        self.images.extend(images)
        found = np.zeros((len(images), FEATURES), np.float32)
        found[:, 0] = images.mean(axis=(1, 2, 3))
        return found


def _grey(level: int, shape: tuple[int, int] = (60, 80)) -> NDArray[np.uint8]:
    return np.full((*shape, 3), level, np.uint8)


def test_eight_images_evenly_apart_are_looked_at_and_a_crop_has_their_mean() -> None:
    asked = _Asked()
    found = look_through_network([_grey(level) for level in range(16)], asked)
    assert [int(image[0, 0, 0]) for image in asked.images] == [0, 2, 4, 6, 8, 10, 12, 14]
    assert len(asked.images) == IMAGES
    assert {image.shape for image in asked.images} == {(SIDE_PX, SIDE_PX, 3)}
    assert found.shape == (1, FEATURES)
    assert found[0, 0] == 7


def test_an_image_that_stands_still_passes_once() -> None:
    asked = _Asked()
    shown = look_at(("network",), [Scene([_grey(9)], 25.0, 0.065, asked)])
    assert len(asked.images) == 1
    assert row_of(shown)["network"][0] == 9


def test_of_two_cameras_a_crop_has_the_largest_and_the_least() -> None:
    scenes = [Scene([_grey(level)], 25.0, 0.065, _Asked()) for level in (3, 5)]
    for own in (scenes, scenes[::-1]):
        row = row_of(look_at(("network",), own))["network"]
        assert row.shape == (2 * FEATURES,)
        assert (row[0], row[FEATURES]) == (5, 3)


def test_a_texture_finer_than_the_networks_pixels_is_smoothed_not_aliased() -> None:
    """Rows of 0 and 200 in turn, shrunk 2.5 times, are near 100, beside a side that grows, too."""
    for width in (560, 90):
        asked = _Asked()
        stripes = _grey(0, (560, width))
        stripes[::2] = 200
        look_through_network([stripes], asked)
        assert np.abs(asked.images[0].astype(int) - 100).max() <= 25


def test_without_a_network_there_is_no_such_view() -> None:
    with pytest.raises(ValueError, match="network"):
        look_at(("network",), [Scene([_grey(1)], 25.0, 0.065)])
