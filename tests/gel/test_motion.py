"""A similarity of dots is recovered exactly, and outliers do not pull it."""

import numpy as np
import pytest

from taxel.gel.markers import MarkerFlow
from taxel.gel.motion import dots_in, fit_motion, summarise_flow


def moved_by(before, turn, grow, shift):
    middle = before.mean(axis=0)
    matrix = (1 + grow) * np.array([[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)]])
    return ((before - middle) @ matrix.T + middle + shift).astype(np.float32)


def flow_of(before, moved, seen=None):
    all_seen = np.ones(len(before), np.bool_) if seen is None else seen
    return MarkerFlow(before.astype(np.float32), moved.astype(np.float32), all_seen)


@pytest.fixture
def before():
    return np.stack(np.meshgrid(np.arange(40, 300, 40.0), np.arange(30, 220, 40.0)), -1).reshape(
        -1, 2
    )


def test_shift_turn_and_stretch_come_back(before):
    motion = fit_motion(flow_of(before, moved_by(before, 0.05, 0.02, (2.0, -1.5))))

    assert motion.translation_px == pytest.approx([2.0, -1.5], abs=1e-3)
    assert motion.rotation_rad == pytest.approx(0.05, abs=1e-4)
    assert motion.dilation == pytest.approx(0.02, abs=1e-4)
    assert motion.residual_px < 1e-3
    assert motion.at(before) == pytest.approx(
        moved_by(before, 0.05, 0.02, (2.0, -1.5)) - before, abs=1e-2
    )


def test_a_few_wrong_dots_and_unseen_ones_do_not_pull(before):
    moved = moved_by(before, 0.03, 0.0, (1.0, 0.0))
    moved += np.random.default_rng(0).normal(0, 0.05, moved.shape).astype(np.float32)
    moved[:3] += 20.0
    moved[3] = np.nan
    seen = np.arange(len(before)) != 3

    motion = fit_motion(flow_of(before, np.nan_to_num(moved), seen))

    assert motion.translation_px == pytest.approx([1.0, 0.0], abs=0.15)
    assert motion.rotation_rad == pytest.approx(0.03, abs=2e-3)


def test_fewer_than_two_dots_do_not_move(before):
    motion = fit_motion(flow_of(before[:1], before[:1] + 3.0))

    assert motion.dots == 0
    assert motion.translation_px.tolist() == [0.0, 0.0]
    assert fit_motion(flow_of(before[:0], before[:0])).dots == 0


def test_shear_is_the_contact_against_its_surroundings(before):
    inside = (np.abs(before - (160, 110)) < 60).all(axis=1)
    moved = before + np.where(inside[:, None], (3.0, 1.0), (0.5, 0.0))

    summary = summarise_flow(flow_of(before, moved), inside)

    assert summary.shear_px == pytest.approx([2.5, 1.0], abs=1e-3)
    assert summary.inside.dots == inside.sum()


def test_places_outside_the_image_count_as_its_border():
    mask = np.zeros((10, 20), np.bool_)
    mask[:, -1] = True

    assert dots_in(np.array([[50.0, 5.0], [3.0, 3.0]]), mask).tolist() == [True, False]
