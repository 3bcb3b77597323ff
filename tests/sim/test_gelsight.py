"""The simulated sensor: what moves, what stays, and how it is lit."""

from dataclasses import replace
from itertools import pairwise

import cv2
import numpy as np
import pytest

from taxel.gel.shading import Shading
from taxel.sim.gelsight.camera import exposure, lamp_light
from taxel.sim.gelsight.mini import GelCamera, SensorNuisance, camera_times, draw_sensor
from taxel.sim.pour.state import GelMotion, HandleShape

SHAPE = HandleShape(
    radius_across_mm=12.0,
    radius_along_mm=float("inf"),
    width_mm=10.0,
    axis_rad=0.1,
    texture_um=6.0,
    texture_mm=0.8,
    texture_along=0.0,
    texture_seed=3,
)
QUIET = replace(
    draw_sensor(7, 0),
    noise=0.0,
    scratches=0,
    dust=0,
    transient=0.0,
    drift=0.0,
    flicker=0.0,
    mm_per_px=0.065,
)


WITHOUT_MARKERS = replace(QUIET, marker_spacing_px=1000.0, marker_offset_px=(400.0, 400.0))


def _motion(
    depth_mm: float = 1.6,
    object_mm: tuple[float, float] = (0.0, 0.0),
    gel_mm: tuple[float, float] = (0.0, 0.0),
    object_rad: float = 0.0,
    gel_rad: float = 0.0,
    n: int = 1,
) -> GelMotion:
    return GelMotion(
        depth_mm=np.full(n, depth_mm),
        object_mm=np.tile(np.array(object_mm), (n, 1)),
        object_rad=np.full(n, object_rad),
        gel_mm=np.tile(np.array(gel_mm), (n, 1)),
        gel_rad=np.full(n, gel_rad),
        patch_mm=np.tile(np.array([4.5, 6.0]), (n, 1)),
    )


def _image(sensor: SensorNuisance = QUIET, **moved: object) -> np.ndarray:
    return GelCamera(SHAPE, sensor, 5).frame(_motion(**moved), 0, 0.0)  # type: ignore[arg-type]


def _markers(image: np.ndarray) -> np.ndarray:
    """Return the middles (n, 2) of whole markers: darkness-weighted, subpixel."""
    grey = image.astype(np.float32).mean(axis=2)
    around = cv2.GaussianBlur(cv2.dilate(grey, np.ones((25, 25))), (0, 0), 8)
    dark = np.maximum(0.85 - grey / around, 0)
    found, places = cv2.connectedComponents((dark > 0.2).astype(np.uint8))
    middles = []
    for number in range(1, found):
        blob = cv2.dilate((places == number).astype(np.uint8), np.ones((3, 3))) > 0
        rows, columns = np.nonzero(blob)
        whole = columns.min() > 1 and columns.max() < 318 and rows.min() > 1 and rows.max() < 238
        if whole and len(rows) > 50:
            weight = dark[rows, columns]
            middles.append((columns @ weight / weight.sum(), rows @ weight / weight.sum()))
    return np.array(middles)


def _near(points: np.ndarray, centre_px: tuple[float, float], reach: float) -> np.ndarray:
    return np.asarray(np.hypot(*(points - centre_px).T) < reach)


def test_the_same_seeds_give_the_same_frames_and_others_do_not():
    motion = _motion(n=3)
    sensor = draw_sensor(1, 0)
    frames = [GelCamera(SHAPE, sensor, seed).frame(motion, 2, 0.1) for seed in (5, 5, 6)]
    assert np.array_equal(frames[0], frames[1])
    assert not np.array_equal(frames[0], frames[2])
    assert frames[0].shape == (240, 320, 3)
    assert frames[0].dtype == np.uint8


def test_frames_do_not_depend_on_the_order_in_which_they_are_asked_for():
    motion = _motion(n=3)
    camera = GelCamera(SHAPE, draw_sensor(1, 0), 5)
    first = camera.frame(motion, 0, 0.0)
    camera.frame(motion, 2, 0.1)
    assert np.array_equal(camera.frame(motion, 0, 0.0), first)


@pytest.mark.parametrize("shift_px", [(0.5, 0.0), (0.3, -0.7), (2.25, 1.5), (-4.4, 3.3)])
def test_markers_under_the_patch_move_by_what_the_gel_moves(shift_px: tuple[float, float]):
    """Without slip, middles shift by the commanded fraction of a pixel, within 0.1 px."""
    camera = GelCamera(SHAPE, QUIET, 5, Shading(np.zeros((20, 3)), 0.7))
    moved_mm = (shift_px[0] * QUIET.mm_per_px, shift_px[1] * QUIET.mm_per_px)
    before = _markers(camera.frame(_motion(), 0, 0.0))
    after = _markers(camera.frame(_motion(gel_mm=moved_mm, object_mm=moved_mm), 0, 0.0))
    inner = before[_near(before, (159.5, 119.5), 50)]
    nearest = after[np.argmin(np.hypot(*(after[None] - inner[:, None] - shift_px).T), axis=0)]
    assert len(inner) >= 3
    assert np.abs((nearest - inner).mean(axis=0) - shift_px).max() < 0.1


def test_the_gel_far_from_the_patch_moves_less():
    camera = GelCamera(replace(SHAPE, texture_um=0.0), QUIET, 5)
    before = _markers(camera.frame(_motion(), 0, 0.0))
    after = _markers(camera.frame(_motion(gel_mm=(0.0, 0.3)), 0, 0.0))
    shift = np.array([np.hypot(*(after - point).T).min() for point in before])
    near = _near(before, (159.5, 119.5), 45)
    assert shift[near].min() > 4.0
    assert shift[np.abs(before[:, 0] - 159.5) > 135].max() < 2.0


def test_the_gel_twists_clockwise_as_seen():
    """A marker to the right of the middle moves down when the gel turns clockwise."""
    camera = GelCamera(replace(SHAPE, texture_um=0.0), QUIET, 5)
    before = _markers(camera.frame(_motion(), 0, 0.0))
    after = _markers(camera.frame(_motion(gel_rad=0.06), 0, 0.0))
    inner = before[_near(before, (159.5, 119.5), 60)]
    for point in inner:
        moved = after[np.argmin(np.hypot(*(after - point).T))] - point
        expected = 0.06 * np.array([-(point[1] - 119.5), point[0] - 159.5])
        assert np.hypot(*(moved - expected)) < 0.5


def test_the_texture_moves_with_the_handle_while_markers_stay():
    """Slip: the imprint's pattern shifts by the handle's movement, the markers do not."""
    step_mm = (0.0, 10 * QUIET.mm_per_px)
    before, after = (_image(WITHOUT_MARKERS, object_mm=move) for move in ((0.0, 0.0), step_mm))
    window = (slice(80, 160), slice(130, 190))
    pattern, later = (image[window].astype(np.float32).mean(axis=2) for image in (before, after))
    detail = [image - cv2.GaussianBlur(image, (0, 0), 8) for image in (pattern, later)]
    (x, y), _ = cv2.phaseCorrelate(*detail)
    assert (x, y) == (pytest.approx(0, abs=0.6), pytest.approx(10, abs=0.6))
    kept, moved = (_markers(_image(object_mm=move)) for move in ((0.0, 0.0), step_mm))
    near = kept[_near(kept, (159.5, 119.5), 50)]
    assert max(np.hypot(*(moved - point).T).min() for point in near) < 0.7


def test_without_contact_the_gel_shows_its_own_light():
    assert np.abs(_image(WITHOUT_MARKERS, depth_mm=0.0) - lamp_light(QUIET)).max() <= 0.51


def test_letting_go_leaves_no_jump():
    pressed = [_image(depth_mm=depth).astype(float) for depth in (0.0, 0.001, 0.02, 0.04)]
    steps = [np.abs(b - a).mean() for a, b in pairwise(pressed)]
    assert max(steps) < 2.5
    assert steps[0] < 0.5


def test_only_grain_differs_between_two_moments_of_the_same_state():
    sensor = replace(QUIET, noise=1.0)
    camera = GelCamera(SHAPE, sensor, 5)
    motion = _motion(n=2)
    difference = camera.frame(motion, 0, 0.0).astype(float) - camera.frame(motion, 1, 0.0)
    assert difference.std() / np.sqrt(2) == pytest.approx(0.65, abs=0.2)
    assert abs(difference.mean()) < 0.02


def test_extreme_states_stay_within_the_images_range():
    """No wrap-around: a huge indentation and slope saturate instead."""
    sharp = replace(SHAPE, radius_across_mm=0.5, width_mm=1.0, texture_um=100.0)
    camera = GelCamera(sharp, replace(QUIET, drift=4.0), 5)
    image = camera.frame(_motion(depth_mm=4.0), 0, 6.0).astype(float)
    flat = cv2.medianBlur(image.astype(np.uint8), 5).astype(float)
    assert np.abs(image - flat).max() < 200
    assert np.isfinite(image).all()


def test_sensors_differ_and_stay_within_what_was_measured():
    drawn = [draw_sensor(seed, index) for seed in range(200) for index in (0, 1)]
    assert draw_sensor(3, 1) == draw_sensor(3, 1)
    assert draw_sensor(3, 0) != draw_sensor(3, 1)
    for sensor in drawn:
        assert 0.85 <= min(sensor.gain) <= max(sensor.gain) <= 1.16
        assert np.abs(sensor.tilt).max() <= 0.12
        assert 0.059 <= sensor.mm_per_px <= 0.071
        assert 10 <= sensor.marker_diameter_px <= 18
        assert 0.3 <= sensor.marker_darkness <= 0.5
        assert 0.7 <= sensor.noise <= 1.6
        assert 1.0 <= abs(sensor.drift) <= 4.0
    assert 0.2 <= np.mean([sensor.transient != 0 for sensor in drawn]) <= 0.3
    spacing = np.array([sensor.marker_spacing_px for sensor in drawn])
    assert ((np.abs(spacing - 31.5) < 1) | (np.abs(spacing - 43.5) < 1.4)).all()


def test_images_look_like_those_of_real_sensors():
    """Means of 16 sensors lie within the 5th to 95th percentile of real frames."""
    images = [
        GelCamera(SHAPE, draw_sensor(s, 0), s).frame(_motion(), 0, 1.0).astype(np.float32)
        for s in range(16)
    ]
    red, green, blue = np.mean(images, axis=(0, 1, 2))
    assert 55 < red < 94
    assert 89 < green < 117
    assert 101 < blue < 131
    assert 23 < np.mean([image.mean(axis=2).std() for image in images]) < 27.2
    residue = [np.median(np.abs(i - cv2.GaussianBlur(i, (0, 0), 1.0))) * 1.4826 for i in images]
    assert 0.65 < np.mean(residue) < 1.45


def test_an_exposure_transient_settles_and_brightness_drifts():
    sensor = replace(QUIET, transient=0.1, transient_s=0.2, drift=3.0)
    assert exposure(sensor, 0.0, 0.0) == (pytest.approx(1.1), 0.0)
    assert exposure(sensor, 6.0, 0.0) == (pytest.approx(1.0), pytest.approx(3.0))


def test_a_25_hz_camera_repeats_frames_in_a_60_hz_video():
    times = camera_times(25.0, 60.0, 6.0, 1, skew_frames=0)
    assert times.shown.shape == (360,)
    assert (np.diff(times.shown) >= 0).all()
    assert np.array_equal(np.unique(times.shown), np.arange(len(times.taken_s)))
    runs = np.bincount(times.shown)[1:-1]
    assert set(np.unique(runs)) <= {1, 2, 3, 4, 5, 6}
    assert 1.9 < runs.mean() < 3.0


def test_a_video_frame_never_shows_the_future():
    for seed in range(20):
        times = camera_times(60.0, 60.0, 2.0, seed)
        moments = np.arange(120) / 60.0
        late = moments - times.taken_s[times.shown]
        assert late.min() >= -1e-9
        assert np.array_equal(camera_times(60.0, 60.0, 2.0, seed).shown, times.shown)


def test_skew_delays_what_is_seen():
    lags = []
    for skew in (0, 2):
        times = camera_times(60.0, 60.0, 6.0, 4, skew_frames=skew, jitter=0.0)
        lags.append(np.median(np.arange(360) / 60.0 - times.taken_s[times.shown]))
    assert lags[1] - lags[0] == pytest.approx(2 / 60, abs=1e-6)


def test_few_videos_repeat_many_frames_of_a_60_hz_camera():
    """Median of a few in a thousand, some videos with a quarter: as measured."""
    shares = [
        (np.diff(camera_times(60.0, 60.0, 6.0, seed, jitter=0.0).shown) == 0).mean()
        for seed in range(200)
    ]
    assert np.median(shares) < 0.02
    assert 0.08 < np.percentile(shares, 95) < 0.45


def test_a_clock_that_cannot_run_is_refused():
    with pytest.raises(ValueError, match="above 0"):
        camera_times(0.0, 60.0, 6.0, 1)
