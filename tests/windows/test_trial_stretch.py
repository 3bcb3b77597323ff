"""The part of a camera trial in which something moves, on trials whose touch is known (0041)."""

import numpy as np
import pytest
from numpy.testing import assert_array_equal

from taxel.windows.trial_layout import Layout, choose_layout
from taxel.windows.trial_stretch import Changes, changes_of, moving_part, part_of

FRAMES, FIRST, BEHIND = 200, 60, 120


def touch(
    noise: float, first: int = FIRST, behind: int = BEHIND, *, leaves: bool = True
) -> list[np.ndarray]:
    """A square that moves by two pixels an image from `first` to `behind`, and is seen then alone,
    or, if it does not leave, until the end.
    """
    rng = np.random.default_rng(0)
    images = []
    for number in range(FRAMES):
        image = np.full((48, 160, 3), 90.0)
        at = 2 * min(number, behind) - 2 * first
        if first <= number and (number <= behind or not leaves):
            image[8:40, at : at + 32] += 80.0
        image += rng.normal(0.0, noise, image.shape)
        images.append(np.clip(image, 0, 255).astype(np.uint8))
    return images


@pytest.mark.parametrize("noise", [0.0, 4.0])
def test_crops_come_from_where_something_moves(noise: float) -> None:
    part = moving_part(changes_of((image,) for image in touch(noise)), least=20)
    assert abs(part.start - FIRST) <= 4
    assert abs(part.stop - BEHIND) <= 4


def test_where_the_touch_remains_a_crop_of_both_ends_is_kept() -> None:
    """Either may show what is touched: nobody knows which of both ends is at rest."""
    changes = np.array(changes_of((image,) for image in touch(0.0, leaves=False)))
    part = moving_part(changes, least=20)
    assert abs(part.start - (FIRST - 20)) <= 4
    assert abs(part.stop - (BEHIND + 20)) <= 4
    assert moving_part(changes, least=100) == range(FRAMES)


def test_how_long_the_rest_lasts_changes_nothing() -> None:
    """A touch that begins 40 frames later has its part 40 frames later."""
    early, late = (
        moving_part(changes_of((image,) for image in touch(0.0, at, at + 50)), least=20)
        for at in (30, 70)
    )
    assert (late.start - early.start, late.stop - early.stop) == (40, 40)


def test_how_bright_the_images_are_changes_nothing() -> None:
    changes = np.array(changes_of((image,) for image in touch(0.0)))
    assert moving_part(changes, 20) == moving_part(3.0 * changes, 20)


def test_where_nothing_moves_all_frames_are_taken_and_of_noise_nearly_all() -> None:
    assert moving_part(np.zeros((100, 3)), 20) == range(100)
    assert moving_part(np.ones((100, 3)), 20) == range(100)
    noise = moving_part(np.random.default_rng(1).normal(1.0, 0.1, (300, 3)), 20)
    assert len(noise) > 260


@pytest.mark.parametrize(
    ("at", "expected"), [(4, range(20)), (50, range(40, 60)), (97, range(80, 100))]
)
def test_a_short_part_grows_to_a_crop_and_stays_within_the_trial(at: int, expected: range) -> None:
    changes = np.zeros((100, 3))
    changes[at : at + 2] = 1.0
    part = moving_part(changes, least=20)
    assert 20 <= len(part) <= 26
    assert abs(part.start - expected.start) <= 6
    assert part.start >= 0
    assert part.stop <= 100


def test_a_trial_of_a_crop_s_length_is_taken_whole() -> None:
    assert moving_part(np.arange(60.0).reshape(20, 3), least=20) == range(20)


def test_changes_are_summed_over_cameras_and_go_back_by_the_step() -> None:
    levels = (10, 13, 19, 20, 40, 41)
    grey = [np.full((16, 160, 3), level, np.uint8) for level in levels]
    near, far, first = (0, 3, 6, 1, 20, 1), (0, 0, 9, 7, 21, 21), (0, 0, 0, 0, 20, 21)
    alone = changes_of((image,) for image in grey)
    assert alone == list(zip(near, far, first, strict=True))
    both = changes_of((image, image) for image in grey)
    assert_array_equal(both, 2 * np.array(alone))
    slow = changes_of(((image,) for image in grey), step=2)
    assert [change for change, _, _ in slow] == list(far)
    live = Changes(step=2)
    for image in grey:
        live.push([image])
    assert live.values == slow


@pytest.mark.parametrize("at", [0, 1, 25, 199])
def test_a_flash_or_a_black_image_is_no_touch(at: int) -> None:
    """Cameras often begin with black images, or lose one on its way."""
    images = touch(2.0)
    images[at] = np.zeros_like(images[at])
    part = moving_part(changes_of((image,) for image in images), least=20)
    assert abs(part.start - FIRST) <= 4
    assert abs(part.stop - BEHIND) <= 4


def test_a_touch_that_comes_from_one_image_to_the_next_counts() -> None:
    changes = changes_of((image,) for image in touch(1.0, 60, 60, leaves=False))
    assert 60 in moving_part(changes, least=20)
    assert len(moving_part(changes, least=20)) < 70


def test_changes_are_only_looked_at_where_crops_depend_on_them() -> None:
    def never() -> np.ndarray:
        raise AssertionError

    assert part_of(Layout(10, 3), 90, never) == range(90)
    assert part_of(Layout(10, 1, moving=True), 90, never) == range(90)
    changes = np.zeros((90, 3))
    changes[40:42] = 1.0
    assert len(part_of(Layout(10, 3, moving=True), 90, lambda: changes)) < 30


def test_fast_cameras_are_seen_at_25_images_a_second_as_far_as_the_shortest_trial_allows() -> None:
    """At 100 images a second 48 of them are half a second."""
    assert choose_layout([500, 900], rate_hz=100.0, moving=True) == Layout(
        48, 3, moving=True, step=4
    )
    assert choose_layout([100, 900], rate_hz=100.0, moving=True) == Layout(
        48, 3, moving=True, step=2
    )
    assert choose_layout([60, 900], rate_hz=500.0, moving=True) == Layout(48, 3, moving=True)
    assert choose_layout([500, 900], rate_hz=30.0, moving=True) == Layout(48, 3, moving=True)
    assert choose_layout([500, 900], rate_hz=100.0) == Layout(48, 3), "unless asked for"
    assert choose_layout([40, 40], rate_hz=500.0, moving=True) == Layout(40, 1)
    layout = Layout(48, 3, moving=True, step=4)
    assert (layout.span, layout.every) == (189, 94)
    assert layout.starts(range(10, 210)) == [10, 15, 21]
    assert layout.words == "48 images, one in 4 of 189 frames"
    assert Layout(1, 3).words == "1 frame"
