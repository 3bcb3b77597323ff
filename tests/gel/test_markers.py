"""Dots are found where they are, and none is mistaken for its neighbour."""

import cv2
import numpy as np
import pytest

from taxel.errors import BadSource
from taxel.gel.markers import MarkerTracker, find_markers

SPACINGS = [(31.5, 10.0), (31.5, 18.0), (43.5, 12.0), (43.5, 18.0)]


def worst(found, true):
    apart = np.linalg.norm(found[:, None] - true[None], axis=2)
    return apart.min(axis=1).max()


@pytest.mark.parametrize(("spacing", "diameter"), SPACINGS)
def test_every_whole_dot_is_found_within_a_tenth_of_a_pixel(paint, dot_grid, spacing, diameter):
    true = dot_grid(spacing) + np.random.default_rng(1).uniform(-2, 2, (len(dot_grid(spacing)), 2))

    found = find_markers(paint(true, diameter_px=diameter, noise=1.5))

    assert len(found) == len(true)
    assert worst(found, true) < 0.1


def test_dots_that_the_border_cuts_are_left_out(paint, dot_grid):
    inner = dot_grid(31.5)
    cut = np.array([[1.0, 60.0], [318.0, 100.0], [100.0, -1.0], [200.0, 239.0]])

    found = find_markers(paint(np.vstack([inner, cut])))

    assert len(found) == len(inner)


@pytest.mark.parametrize(
    "image",
    [
        np.zeros((240, 320, 3), np.uint8),
        np.full((240, 320, 3), 120, np.uint8),
        np.full((240, 320, 3), 255, np.uint8),
        np.random.default_rng(0).integers(0, 255, (240, 320, 3)).astype(np.uint8),
    ],
    ids=["black", "even", "white", "noise"],
)
def test_an_image_without_dots_gives_none_and_an_empty_flow(image):
    assert find_markers(image).shape == (0, 2)

    flow = MarkerTracker(image).track(image)

    assert flow.reference.shape == flow.moved.shape == (0, 2)
    assert flow.seen.shape == (0,)


@pytest.mark.parametrize("bad", [np.zeros((240, 320), np.uint8), np.zeros((240, 320, 3))])
def test_what_is_no_colour_image_is_refused_in_one_line(bad):
    with pytest.raises(BadSource, match="needed frames of shape"):
        find_markers(bad)


def test_a_frame_of_another_size_is_refused(paint, dot_grid):
    tracker = MarkerTracker(paint(dot_grid(31.5)))

    with pytest.raises(BadSource, match="new tracker"):
        tracker.track(np.zeros((120, 160, 3), np.uint8))


@pytest.mark.parametrize(("spacing", "diameter"), SPACINGS)
def test_small_shifts_are_measured_within_a_tenth_of_a_pixel(paint, dot_grid, spacing, diameter):
    true = dot_grid(spacing)
    tracker = MarkerTracker(paint(true, diameter_px=diameter, noise=1.0))

    for step in range(1, 9):
        shift = np.array([0.37, -0.23]) * step
        frame = paint(true + shift, diameter_px=diameter, noise=1.0, seed=step)
        flow = tracker.track(frame)

        assert flow.seen.all()
        assert np.abs(flow.shift - shift).max() < 0.1


@pytest.mark.parametrize("share", [0.25, 0.35, 0.45])
@pytest.mark.parametrize("spacing", [31.5, 43.5])
def test_a_jump_of_nearly_half_a_spacing_swaps_no_dots(paint, dot_grid, spacing, share):
    true = dot_grid(spacing)
    shift = spacing * share * np.array([0.8, 0.6])
    tracker = MarkerTracker(paint(true))

    flow = tracker.track(paint(true + shift))

    inside = ((true + shift) < (310, 230)).all(axis=1)
    assert flow.seen[inside].mean() > 0.95
    assert np.abs(flow.shift - shift)[flow.seen].max() < 0.2


def test_a_walk_further_than_a_spacing_keeps_each_dot_its_own(paint, dot_grid):
    true = dot_grid(31.5)
    tracker = MarkerTracker(paint(true))

    for step in range(1, 11):
        flow = tracker.track(paint(true + np.array([4.0 * step, 0.0])))

    assert flow.seen.sum() > 0.7 * len(true)
    assert np.abs(flow.shift - (40.0, 0.0))[flow.seen].max() < 0.2


@pytest.mark.parametrize("turn", [0.1, -0.2, 0.3])
def test_a_turn_in_one_frame_swaps_no_dots(paint, dot_grid, turn):
    """The outer dots move by more than half a spacing; those that leave the image are lost."""
    dots = dot_grid(36.0)
    tracker = MarkerTracker(paint(dots))
    middle = dots.mean(axis=0)
    cos, sin = np.cos(turn), np.sin(turn)
    moved = (dots - middle) @ np.array([[cos, sin], [-sin, cos]]) + middle + (1.5, -1.0)

    flow = tracker.track(paint(moved))

    away = np.linalg.norm(flow.moved[:, None] - moved[None], axis=2)
    before = np.linalg.norm(flow.reference[:, None] - dots[None], axis=2).argmin(axis=1)
    assert flow.seen.mean() > 0.6
    assert np.array_equal(away.argmin(axis=1)[flow.seen], before[flow.seen])
    assert away.min(axis=1)[flow.seen].max() < 0.3


def test_a_dot_that_is_covered_is_lost_guessed_from_its_neighbours_and_found_again(paint, dot_grid):
    true = dot_grid(43.5)
    tracker = MarkerTracker(paint(true))
    gone, shift = 12, np.array([3.0, 1.0])

    covered = tracker.track(paint(np.delete(true, gone, axis=0) + shift))
    back = tracker.track(paint(true + shift))

    order = np.linalg.norm(covered.reference - true[gone], axis=1).argmin()
    assert not covered.seen[order]
    assert covered.seen.sum() == len(true) - 1
    assert np.allclose(covered.moved[order], true[gone] + shift, atol=0.3)
    assert back.seen.all()


def test_exposure_does_not_move_dots(paint, dot_grid):
    true = dot_grid(31.5)
    tracker = MarkerTracker(paint(true))

    for exposure in (0.8, 0.6, 1.3, 1.6):
        flow = tracker.track(paint(true, exposure=exposure))

        assert flow.seen.all()
        assert np.abs(flow.shift).max() < 0.1


def test_black_frames_lose_all_dots_and_the_next_good_frame_finds_them(paint, dot_grid):
    true = dot_grid(31.5)
    tracker = MarkerTracker(paint(true))

    dark = tracker.track(np.zeros((240, 320, 3), np.uint8))
    back = tracker.track(paint(true + 1.0))

    assert not dark.seen.any()
    assert np.isfinite(dark.moved).all()
    assert back.seen.all()
    assert np.abs(back.shift - 1.0).max() < 0.1


@pytest.mark.real
def test_dots_of_real_trials_stay_found_and_end_where_a_fresh_search_finds_them(gel_trials):
    for name in ("wallet/exp_num_1", "jute_basket/exp_num_2", "blue_mug/exp_num_6"):
        video = cv2.VideoCapture(str(gel_trials / name / "camera_0.avi"))
        frames = []
        while len(frames) < 90 and (read := video.read())[0]:
            frames.append(cv2.cvtColor(read[1], cv2.COLOR_BGR2RGB))
        tracker = MarkerTracker(frames[10])
        flows = [tracker.track(frame) for frame in frames[10:]]
        last = flows[-1]

        assert np.mean([flow.seen.mean() for flow in flows]) > 0.95
        fresh = find_markers(frames[-1])
        apart = np.linalg.norm(last.moved[last.seen][:, None] - fresh[None], axis=2)
        assert (apart.min(axis=1) < 0.5).mean() > 0.9
        assert len(set(apart.argmin(axis=1))) > 0.9 * last.seen.sum()
