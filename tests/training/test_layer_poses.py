"""The exact poses on a layer are those that a follower finds in its images."""

import numpy as np
import pytest

from taxel.sim.gelsight.shear import ShearView, face_moved, face_place
from taxel.sim.pour.cup_pour import simulate_pour
from taxel.sim.pour.views import LayerView
from taxel.training.slip.cups import paper_runs, seen_pour
from taxel.training.slip.layer_poses import layer_pours
from taxel.training.slip.pose_noise import settle

CUP = 31_000
"""Neither a training nor a test cup."""


@pytest.fixture(scope="module")
def turned():
    """One gel's face while a cup turns in the gripper."""
    track = simulate_pour(paper_runs(CUP)[0], 60.0, 2.0, 2)
    return LayerView(track.layer, 60.0, 0).at(1.9)


def test_a_place_of_the_face_moves_as_the_camera_sees_it(turned):
    view = ShearView(0.065)
    right, down, *_ = view.look(turned)
    seen = view._places.reshape(-1, 2).astype(float)
    moved = face_moved(turned, face_place(turned, seen)).reshape(*right.shape, 2)

    assert np.hypot(right, down).max() > 0.1
    assert moved[..., 0] == pytest.approx(right, abs=2e-3)
    assert moved[..., 1] == pytest.approx(down, abs=2e-3)


def test_a_place_that_is_seen_is_where_it_was_and_how_far_it_moved(turned):
    seen = np.array([[0.0, 0.0], [1.5, -2.0], [-3.0, 4.0]])
    before = face_place(turned, seen)

    assert before + face_moved(turned, before) == pytest.approx(seen, abs=5e-3)
    assert face_moved(turned, np.zeros((0, 2))).shape == (0, 2)


@pytest.mark.slow
def test_the_follower_finds_the_gel_where_the_exact_poses_say():
    """Without any fit of errors: the gain of a turn is one, whereas the face weighed by load
    turns by two thirds of it."""
    run = paper_runs(CUP)[0]
    (exact,) = layer_pours([run])
    followed = seen_pour(run, gel=2)

    for own, mine in zip(exact.gels, followed.gels, strict=True):
        count = len(mine.taken_s)
        held = np.interp(mine.taken_s, exact.time_s, exact.slip_um) < 500.0
        true = settle(own).gel[:count][held]
        found = settle(mine).gel[held]
        assert np.ptp(true[:, 2]) > 0.05
        gain = float(np.polyfit(true[:, 2], found[:, 2], 1)[0])
        assert gain == pytest.approx(1.0, abs=0.05)
        assert np.sqrt(((found - true)[:, 2] ** 2).mean()) < 0.006
