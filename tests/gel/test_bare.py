"""From one frame in touch, the gel without touch."""

import numpy as np
import pytest

from taxel.errors import BadSource
from taxel.gel.bare import bare_gel
from taxel.gel.contact import contact_mask
from taxel.sim.gelsight.mini import GelCamera, draw_sensor
from taxel.sim.pour.state import GelMotion, HandleShape


def seen(depth_mm: float) -> np.ndarray:
    still = np.zeros((1, 2))
    shape = HandleShape(
        radius_across_mm=4.0, radius_along_mm=60.0, width_mm=6.0, axis_rad=0.4,
        texture_um=0.0, texture_mm=1.0, texture_along=0.0, texture_seed=0,
    )  # fmt: skip
    motion = GelMotion(
        depth_mm=np.array([depth_mm]), object_mm=still, object_rad=np.zeros(1), gel_mm=still,
        gel_rad=np.zeros(1), patch_mm=np.array([[2.0, 6.0]]),
    )  # fmt: skip
    return GelCamera(shape, draw_sensor(3, 0), 3).frame(motion, 0, 3.0)


def test_the_light_under_an_imprint_is_found() -> None:
    pressed, free = seen(1.0), seen(0.0)
    guess = bare_gel(pressed)

    assert guess.shape == free.shape
    apart = np.abs(guess.astype(float) - free).mean(axis=2)
    assert np.median(apart) < 3  # grey levels; the larger part of the image is no dot
    by_guess, by_truth = contact_mask(pressed, guess), contact_mask(pressed, free)
    assert by_truth.any()
    assert (by_guess & by_truth).sum() > 0.85 * (by_guess | by_truth).sum()


def test_an_untouched_gel_has_hardly_any_contact_with_its_guess() -> None:
    free = seen(0.0)

    assert contact_mask(free, bare_gel(free)).mean() < 0.02


@pytest.mark.parametrize("level", [0, 90, 255])
def test_an_even_image_is_its_own_guess(level: int) -> None:
    even = np.full((60, 80, 3), level, np.uint8)

    np.testing.assert_allclose(bare_gel(even).astype(int), level, atol=1)


def test_a_grey_image_is_refused() -> None:
    with pytest.raises(BadSource):
        bare_gel(np.zeros((24, 32), np.uint8))
