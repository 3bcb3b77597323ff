"""Claims about stepping, grip changes, lost cups and pours that are meant to hold."""

from dataclasses import replace

import numpy as np
import pytest

from taxel.sim.pour.brush_contact import BrushField, elliptic_patch
from taxel.sim.pour.cup_pour import (
    CupPourConfig,
    PourSim,
    list_runs,
    simulate_pour,
)
from taxel.sim.pour.cups import draw_cup, draw_run
from taxel.sim.pour.grip_limits import half_axes, load_ratio, pour_less


def test_frame_by_frame_equals_the_whole() -> None:
    """Steps of a frame that is no whole number of integration steps keep time."""
    run = draw_run(0, draw_cup(0, 1), "middle", 25.0)
    track = simulate_pour(run, frame_hz=25.0, duration_s=1.2)
    sim = PourSim(run)
    for _ in range(29):
        sim.step(run.force_n, 1.0 / 25.0)
    np.testing.assert_array_equal(sim.state, track.truth[29])
    assert sim.time_s == pytest.approx(29 / 25.0, abs=1 / 480.0)


def test_a_pad_that_gives_way_keeps_its_surface_and_loses_force() -> None:
    pads = BrushField(elliptic_patch(5.0, 8.0, 0.0), 0.1, np.array([5.0, 5.0]), 1.0)
    pads.move(0.0, 0.05, 0.01, 40.0, 0.01)
    (moved, turn), force = pads.surface_motion(), pads.forces()
    pads.yield_by(0.2)
    np.testing.assert_allclose(pads.surface_motion()[0], moved)
    np.testing.assert_allclose(pads.surface_motion()[1], turn)
    np.testing.assert_allclose(pads.forces(), np.array(force) * 0.8, atol=1e-12)


def test_a_patch_that_grows_keeps_its_force_and_becomes_stiffer() -> None:
    pads = BrushField(elliptic_patch(5.0, 8.0, 0.0), 0.1, np.array([5.0, 5.0]), 1.0)
    pads.move(0.0, 0.05, 0.0, 40.0, 0.01)
    (moved, _), force, line = pads.surface_motion(), pads.forces()[1], pads.stiffness()[0]
    pads.resize(elliptic_patch(5.5, 8.8, 0.0))
    assert pads.forces()[1] == pytest.approx(force)
    assert pads.stiffness()[0] == pytest.approx(1.21 * line)
    np.testing.assert_allclose(pads.surface_motion()[0], moved)


def test_creep_alone_never_parts_gel_and_object() -> None:
    run = replace(draw_run(0, draw_cup(0, 0), "middle", 40.0), creep=0.2, vibration_n=0.0)
    run = replace(run, cup=replace(run.cup, friction=30.0), side_friction=(1.0, 1.0))
    motion = simulate_pour(run, duration_s=4.0).motions[0]
    np.testing.assert_allclose(motion.gel_mm, motion.object_mm, atol=1e-3)
    np.testing.assert_allclose(motion.gel_rad, motion.object_rad, atol=1e-3)


def test_a_firmer_grip_widens_the_patch() -> None:
    sim = PourSim(draw_run(0, draw_cup(0, 1), "middle", 25.0))
    before = sim.patch_mm
    sim.step(50.0, 0.2)
    assert sim.patch_mm[0] * sim.patch_mm[1] > 1.1 * before[0] * before[1]
    assert sim.patch_mm == pytest.approx(half_axes(sim.run, sim.state[5]), rel=0.01)


def test_a_lost_cup_leaves_the_images_and_the_gels_spring_back() -> None:
    sim = PourSim(draw_run(0, draw_cup(0, 1), "middle", 25.0))
    sim.step(0.0, 1.0)
    place, moved, twist, depth_mm = sim.gel()
    assert sim.dropped
    assert place[1] > 15.0
    assert depth_mm < 1e-3
    assert sim.state[4] == sim.state[5] == 0.0
    start = PourSim(sim.run)._surface
    np.testing.assert_allclose(moved, -start[0], atol=1e-3)  # back to where nothing pulls
    np.testing.assert_allclose(twist, -start[1], atol=1e-3)


def test_a_pour_that_is_meant_to_hold_stays_below_the_limit() -> None:
    for force_n in (15.0, 25.0, 50.0):
        run = pour_less(draw_run(0, draw_cup(0, 2), "upper", force_n, "no-slip pour"))
        assert load_ratio(run, run.amount_g) <= max(0.6, load_ratio(run, 5.0)) + 1e-9


def test_slip_starts_where_the_limit_surface_says() -> None:
    """A load of 0.7 holds, one of 1.3 slips, without unrest."""
    run = replace(draw_run(0, draw_cup(0, 1), "middle", 40.0), vibration_n=0.0, creep=0.0)
    slips = []
    for ratio in (0.7, 1.3):
        friction = run.cup.friction * load_ratio(run, run.amount_g) / ratio
        held = replace(run, cup=replace(run.cup, friction=friction))
        slips.append(simulate_pour(held).truth[-1, 0])
    assert slips[0] < 300.0 < slips[1]


def test_an_empty_cup_holds_at_the_weakest_grip() -> None:
    runs = [run for run in list_runs(CupPourConfig(cups=30)) if run.force_n == 15.0]
    assert max(load_ratio(run, 0.0) for run in runs) < 0.85
