"""Slip is the imprint parting from the dots; shear is the dots parting from the frame."""

import cv2
import numpy as np
import pytest

from taxel.errors import BadSource
from taxel.gel.slip_features import SLIP_FEATURES, SlipFeatures, median_frame

COLUMN = {name: i for i, name in enumerate(SLIP_FEATURES)}


@pytest.fixture(scope="module")
def world(paint, dot_grid):
    """Return a function: an image with dots and a textured imprint, each shifted."""
    dots = dot_grid(31.5)
    rng = np.random.default_rng(3)
    fine = cv2.GaussianBlur(rng.normal(0, 1, (400, 480)), (0, 0), 3.0)
    fine *= 0.15 / fine.std()
    y, x = np.mgrid[:240, :320]
    held = np.hypot((x - 160) / 110, (y - 120) / 80) < 1

    def image(dots_x=0.0, object_x=0.0, seed=0):
        grid = np.float32([[1, 0, -80 + object_x], [0, 1, -80]])
        shade = cv2.warpAffine(fine, grid, (320, 240), flags=cv2.INTER_CUBIC)
        gel = paint(dots + np.array([dots_x, 0.0]), noise=0.0).astype(float)
        lit = gel * (1 + (shade * held)[..., None] * np.array([1.0, 0.2, -0.8]))
        lit += np.random.default_rng(seed).normal(0, 1.0, lit.shape)
        return np.clip(np.rint(lit), 0, 255).astype(np.uint8)

    return image


@pytest.mark.slow
def test_gel_and_object_together_are_shear_without_slip(world):
    stream = SlipFeatures([world(seed=s) for s in range(3)])
    for step in range(1, 13):
        row = stream.push(world(dots_x=0.5 * step, object_x=0.5 * step, seed=10 + step))

    assert row[COLUMN["gel_x"]] == pytest.approx(6.0, abs=0.3)
    assert row[COLUMN["object_x"]] == pytest.approx(6.0, abs=0.9)
    assert row[COLUMN["slip"]] < 0.9


def test_an_object_that_slides_over_still_dots_is_slip(world):
    stream = SlipFeatures([world(seed=s) for s in range(3)])
    for step in range(1, 13):
        row = stream.push(world(object_x=0.5 * step, seed=10 + step))

    assert abs(row[COLUMN["gel_x"]]) < 0.1
    assert row[COLUMN["slip_x"]] == pytest.approx(6.0, abs=1.0)
    assert row[COLUMN["slip_rate"]] == pytest.approx(0.5, abs=0.2)
    assert row[COLUMN["slipping_share"]] > 0.5


def test_nothing_moves_where_nothing_moves(world):
    stream = SlipFeatures([world(seed=s) for s in range(3)])
    rows = np.stack([stream.push(world(seed=20 + s)) for s in range(8)])

    assert rows[:, COLUMN["slip"]].max() < 0.15
    assert rows[:, COLUMN["shear"]].max() < 0.1
    assert rows[:, COLUMN["texture_share"]].min() > 0.3


def test_the_same_frames_give_the_same_rows(world):
    reference = [world(seed=s) for s in range(2)]
    frames = [world(dots_x=0.3 * i, object_x=0.5 * i, seed=i) for i in range(6)]
    stream = SlipFeatures(reference)

    rows = np.stack([stream.push(frame) for frame in frames])
    again = SlipFeatures(reference)

    assert rows.dtype == np.float32
    assert np.array_equal(rows, np.stack([again.push(frame) for frame in frames]))


@pytest.mark.parametrize("level", [0, 128, 255])
def test_an_empty_image_gives_a_finite_row(level):
    image = np.full((240, 320, 3), level, np.uint8)

    row = SlipFeatures([image]).push(image)

    assert np.isfinite(row).all()
    assert row[COLUMN["slip"]] == 0.0


def test_black_frames_in_between_leave_finite_rows(world):
    stream = SlipFeatures([world()])
    rows = [stream.push(np.zeros((240, 320, 3), np.uint8)), stream.push(world(seed=1))]

    assert np.isfinite(np.stack(rows)).all()


def test_bad_references_are_refused():
    with pytest.raises(BadSource, match="at least one"):
        SlipFeatures([])
    with pytest.raises(BadSource, match="one shape"):
        median_frame([np.zeros((4, 4, 3), np.uint8), np.zeros((4, 5, 3), np.uint8)])
    with pytest.raises(BadSource, match="colour frames"):
        SlipFeatures([np.zeros((240, 320), np.uint8)])


@pytest.mark.real
def test_real_slip_shows_more_slip_than_a_real_hold(gel_trials):
    slips = []
    for name in ("blue_mug/exp_num_6", "rubber_pear/exp_num_1"):
        video = cv2.VideoCapture(str(gel_trials / name / "camera_0.avi"))
        frames = []
        while len(frames) < 100 and (read := video.read())[0]:
            frames.append(cv2.cvtColor(read[1], cv2.COLOR_BGR2RGB))
        stream = SlipFeatures(frames[8:13])
        rows = np.stack([stream.push(frame) for frame in frames[13:]])
        assert np.isfinite(rows).all()
        slips.append(rows[:, COLUMN["slip"]].max())

    assert slips[0] > 3 * slips[1]
