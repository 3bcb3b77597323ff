"""Claims about when a grasp begins, by images alone."""

from collections.abc import Iterator

import numpy as np
import pytest
from numpy.typing import NDArray

from taxel.errors import BadInput
from taxel.labels.grasp_start import GraspFinder, GraspStartConfig, Hold, find_starts

Rgb = NDArray[np.uint8]
HZ = 25.0
RANDOM = np.random.default_rng(5)


def image(depth: float, side: int = 0) -> Rgb:
    """Return a grey gel with a bright disc, as deep as it is bright."""
    y, x = np.mgrid[0:48, 0:64]
    disc = np.hypot(x - 32 - 4 * side, y - 24) < 16
    grey = 110 + 60 * depth * disc + RANDOM.normal(0, 1.5, (48, 64))
    return np.repeat(grey.clip(0, 255).astype(np.uint8)[..., None], 3, axis=2)


def video(left: list[float], right: list[float]) -> Iterator[tuple[list[Rgb], float]]:
    for number, depths in enumerate(zip(left, right, strict=True)):
        yield [image(depth, side) for side, depth in enumerate(depths)], number / HZ


def ramp(*parts: tuple[float, float, int]) -> list[float]:
    return [float(v) for a, b, n in parts for v in np.linspace(a, b, n)]


GRASP = ramp((0, 0, 25), (0, 1, 10), (1, 1, 20), (1, 0, 10), (0, 0, 10))


def test_a_grasp_begins_once_both_gels_stand_still_and_ends_once_one_is_free() -> None:
    """Closing ends after 35 images; four still ones later it is told."""
    ((began_s, over_s),) = find_starts(video(GRASP, GRASP), 2)
    assert began_s - 35 / HZ == pytest.approx(0.16, abs=0.05)
    assert over_s is not None
    assert 55 / HZ < over_s < 65 / HZ


def test_a_touch_of_one_gel_alone_is_no_grasp() -> None:
    idle = [0.0] * len(GRASP)
    assert list(find_starts(video(GRASP, idle), 2)) == []
    assert len(list(find_starts(video(GRASP, GRASP), 2))) == 1


def test_a_grasp_that_goes_on_changing_slowly_stays_one_grasp() -> None:
    pour = ramp((0, 0, 20), (0, 1, 10), (1, 1, 10), (1, 1.5, 60))
    ((_, over_s),) = find_starts(video(pour, pour), 2)
    assert over_s is None


def test_a_frozen_camera_never_begins_a_grasp() -> None:
    """The same image again and again stands still, and says nothing."""
    finder = GraspFinder(2)
    for images, time_s in video(GRASP[:31], GRASP[:31]):
        state = finder.push(images, time_s)
    for number in range(50):
        state = finder.push(images, time_s + (number + 1) / HZ)
    assert state is Hold.TOUCHED


def test_slow_drift_of_an_untouched_gel_is_followed() -> None:
    """A change that would be a touch if it came at once, over twelve seconds."""
    drift = ramp((0, 0, 20), (0, 0.5, 300))
    finder = GraspFinder(1, GraspStartConfig(follow_s=1.0))
    states = {finder.push([images[0]], time_s) for images, time_s in video(drift, drift)}
    assert states == {Hold.OPEN}
    at_once = ramp((0, 0, 20), (0.5, 0.5, 20))
    finder = GraspFinder(1)
    states = {finder.push([images[0]], time_s) for images, time_s in video(at_once, at_once)}
    assert Hold.HELD in states


def test_a_grasp_that_somebody_announces_needs_no_untouched_gel() -> None:
    finder = GraspFinder(1)
    finder.hold()
    states = [finder.push([images[0]], time_s) for images, time_s in video(GRASP, GRASP)]
    assert set(states) == {Hold.HELD}


def test_settings_that_mean_nothing_are_refused() -> None:
    with pytest.raises(BadInput, match="3 images"):
        GraspStartConfig(rest_images=2)


@pytest.mark.parametrize("back_s", [9.0, 3600.0])
def test_a_clock_that_is_set_back_does_not_spoil_the_untouched_gel(back_s: float) -> None:
    """Before, the reference ran away, and no grasp was found any more: none could alarm."""
    finder = GraspFinder(1)
    rest = ramp((0, 0, 25))
    grasp = ramp((0, 1, 10), (1, 1, 20))
    for images, time_s in video([*rest, *rest, *grasp], [0.0] * 80):
        later = time_s >= len(rest) / HZ
        state = finder.push(images[:1], 4000.0 + time_s - (back_s if later else 0.0))
    assert state is Hold.HELD
