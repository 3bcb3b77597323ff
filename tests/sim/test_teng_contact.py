"""Claims about how an object presses the pads."""

import numpy as np
import pytest

from taxel.sim.teng.constants import MATERIALS, SHAPES
from taxel.sim.teng.contact import contact_over_time, draw_grasp, pad_pressure

FORCE_N = (0.5, 5.0)


@pytest.mark.parametrize("shape", SHAPES)
def test_the_pressure_is_shared_out_and_not_made(shape: str):
    """Whatever the object, the twelve pads carry 1 on average and none pulls."""
    for size_mm in (28.0, 34.0, 40.0):
        pressure = pad_pressure(shape, size_mm, across_mm=2.0, turned_rad=0.05)
        assert pressure.shape == (12,)
        assert pressure.mean() == pytest.approx(1.0)
        assert pressure.min() > 0


def test_a_sphere_falls_away_from_the_outer_fingers_and_a_cylinder_does_not():
    sphere, cylinder = (pad_pressure(s, 34.0).reshape(4, 3) for s in ("sphere", "cylinder"))
    assert np.all(sphere[[0, 3]] < sphere[[1, 2]])
    np.testing.assert_allclose(cylinder, cylinder[:1].repeat(4, axis=0))


def test_the_middle_phalanx_bridges_a_flat_face_and_leans_on_a_round_one():
    rectangle, cylinder = (pad_pressure(s, 34.0).reshape(4, 3) for s in ("rectangle", "cylinder"))
    assert np.all(rectangle[:, 1] < rectangle[:, 0])
    assert np.all(cylinder[:, 1] > cylinder[:, 0])


def test_the_hand_is_open_before_and_after_the_grasp():
    grasp = draw_grasp(np.random.default_rng(3), "sphere", "glass", FORCE_N, moving=0.0)
    time_s = np.arange(round(grasp.duration_s * 1000)) / 1000
    contact = contact_over_time(grasp, time_s)
    assert contact[time_s < grasp.rest_s].max() == 0.0
    assert contact[-1].max() == 0.0
    held = contact.max(axis=0)
    np.testing.assert_allclose(held, grasp.pressure)


def test_a_moving_object_modulates_the_contact():
    grasps = [
        draw_grasp(np.random.default_rng(3), "sphere", "glass", FORCE_N, moving=share)
        for share in (0.0, 1.0)
    ]
    assert [grasp.moving_hz > 0 for grasp in grasps] == [False, True]
    time_s = np.arange(round(grasps[0].duration_s * 1000)) / 1000
    still, moved = (contact_over_time(grasp, time_s) for grasp in grasps)
    held = still == still.max(axis=0)
    share = moved[held] / still[held]
    assert share.min() < 0.8
    assert share.max() > 1.2


def test_nothing_drawn_for_a_grasp_but_its_pads_and_rise_depends_on_the_class():
    """The same draw for all nine classes: force, size, period, presses and rest are equal.

    So a grasp's length, its time and its force say nothing about its label.
    """
    grasps = [
        draw_grasp(np.random.default_rng(7), shape, material, FORCE_N, moving=0.5)
        for shape in SHAPES
        for material in MATERIALS
    ]
    for name in (
        "size_mm",
        "force_n",
        "period_s",
        "hold_share",
        "presses",
        "rest_s",
        "moving_hz",
        "moving_phase",
        "duration_s",
    ):
        assert len({getattr(grasp, name) for grasp in grasps}) == 1, name
    for grasp in grasps:
        np.testing.assert_array_equal(grasp.delay_s, grasps[0].delay_s)
