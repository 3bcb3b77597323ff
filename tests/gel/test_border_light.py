"""The light at an image's borders shows whether it is still the gel of this grasp."""

import cv2
import numpy as np
import pytest

from taxel.gel.border_light import BorderLight

STEP_S = 0.04


def gel(seed: int = 0, tilt: float = 0.4) -> np.ndarray:
    """Light that falls off to one side and from the middle, with dots and grain."""
    rows, columns = np.mgrid[-1:1:240j, -1:1:320j]
    fall = np.exp(-0.3 * (rows**2 + columns**2))
    lamps = [1 + tilt * columns, 1 + 0.3 * rows, 1 - tilt * columns]
    image = np.stack([110 * fall * lamp for lamp in lamps], axis=2)
    for x in range(20, 320, 40):
        for y in range(20, 240, 40):
            cv2.circle(image, (x, y), 8, (20, 20, 20), -1)
    return as_image(image + np.random.default_rng(seed).normal(0, 2, image.shape))


def as_image(image: np.ndarray) -> np.ndarray:
    return np.clip(image, 0, 255).astype(np.uint8)


def mirrored(seed: int = 0) -> np.ndarray:
    return np.ascontiguousarray(gel(seed)[:, ::-1])


def took(light: BorderLight, images: list[np.ndarray], begin: int = 0) -> list[bool]:
    found = []
    for number, image in enumerate(images, begin):
        light.take(image, number * STEP_S)
        found.append(light.exchanged)
    return found


@pytest.fixture
def light() -> BorderLight:
    settled = BorderLight([gel(seed) for seed in range(5)])
    assert not any(took(settled, [gel(seed) for seed in range(5)]))
    return settled


def test_another_picture_is_noticed_at_its_third_image_and_so_is_its_end(light):
    assert took(light, [mirrored(seed) for seed in range(9)], 5) == [False] * 2 + [True] * 7
    assert took(light, [gel(seed) for seed in range(5)], 14) == [True] * 2 + [False] * 3


def test_what_shows_in_two_images_is_an_object_that_falls(light):
    images = [mirrored(), mirrored(), gel(), mirrored(), mirrored(), gel()]

    assert not any(took(light, images, 5))
    assert not light.doubted


def test_a_quick_camera_needs_more_images(light):
    found = []
    for number in range(8):
        light.take(mirrored(number), 0.2 + number / 60)
        found.append(light.exchanged)

    assert found == [False] * 5 + [True] * 3


def test_it_is_doubted_until_it_is_clear(light):
    took(light, [mirrored()], 5)
    assert light.doubted
    took(light, [mirrored(), mirrored()], 6)
    assert not light.doubted


def test_two_images_of_the_earlier_picture_do_not_bring_it_back(light):
    took(light, [mirrored()] * 3, 5)

    assert all(took(light, [gel(), gel(), mirrored(), gel(), gel()], 8))


@pytest.mark.parametrize("factors", [(0.5, 0.5, 0.5), (1.4, 1.4, 1.4), (0.9, 1.1, 1.25)])
def test_even_brightness_and_even_colours_do_not_count(light, factors):
    assert not any(took(light, [as_image(gel(seed) * factors) for seed in range(5)], 5))
    assert not light.doubted


def test_an_image_without_light_changes_nothing(light):
    assert not any(took(light, [as_image(gel() * 0.05)] * 5, 5))
    took(light, [mirrored()] * 3, 10)
    assert all(took(light, [as_image(gel() * 0.05)] * 5, 13))


def test_an_imprint_over_the_middle_and_part_of_the_border_does_not_count(light):
    image = gel().astype(float)
    image[70:120, :] += (60, -40, 20)  # a handle that lies across

    assert not any(took(light, [as_image(image)] * 5, 5))


def test_slow_changes_are_followed(light):
    images = [gel(number, 0.4 - 0.02 * number) for number in range(30)]

    assert not any(took(light, images, 5))


def test_images_that_are_further_apart_may_differ_more(light):
    image = gel(1, 0.4 - 0.04)
    for number in range(5):
        light.take(image, 0.2 + number * STEP_S)
    assert light.exchanged

    patient = BorderLight([gel()])
    patient.take(gel(), 0.0)
    for number in range(5):
        patient.take(image, 5.0 + number * STEP_S)
    assert not patient.exchanged


@pytest.mark.parametrize("taken_s", [-100.0, 0.16, float("nan")])
def test_a_clock_that_was_set_back_or_stands_still_hides_nothing(light, taken_s):
    for _ in range(3):
        light.take(mirrored(), taken_s)

    assert light.exchanged
