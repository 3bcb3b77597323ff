"""Claims about the cup's dynamics: friction's closed forms, protocol, and what never happens."""

from dataclasses import replace

import numpy as np
import pytest

from taxel.sim.pour.brush_contact import BrushField, elliptic_patch
from taxel.sim.pour.cup_pour import (
    CupPourConfig,
    PourSim,
    PourTrack,
    list_runs,
    simulate_pour,
)
from taxel.sim.pour.cups import PourRun, draw_cup, draw_run
from taxel.sim.pour.grip_limits import indentation

MU, NORMAL_N = 0.8, 20.0


def field(stiffness: float = 0.1) -> BrushField:
    patch = elliptic_patch(5.0, 8.0, 0.0)
    return BrushField(patch, stiffness, np.array([MU, MU]), 1.0)


def push(pads: BrushField, x: float, y: float, turn: float, steps: int = 400) -> None:
    for _ in range(steps):
        pads.move(x / steps, y / steps, turn / steps, NORMAL_N, 1.0 / steps)


@pytest.fixture(scope="module")
def tracks() -> list[tuple[PourRun, PourTrack]]:
    runs = list_runs(CupPourConfig(cups=5))
    return [(run, simulate_pour(run, duration_s=6.0)) for run in runs[::2]]


def test_pure_translation_holds_friction_times_normal_force_on_each_side() -> None:
    pads = field()
    push(pads, 0.0, 30.0, 0.0)
    x, y, moment = pads.forces()
    assert y == pytest.approx(2 * MU * NORMAL_N, rel=1e-6)
    assert (x, moment) == pytest.approx((0.0, 0.0), abs=1e-9)


def test_small_loads_are_elastic() -> None:
    """Force is stiffness times movement, and nothing slides, but for the unloaded rim."""
    pads = field()
    line, turn = pads.stiffness()
    push(pads, 0.0, 1e-5, 1e-6)
    _, y, moment = pads.forces()
    assert y == pytest.approx(line * 1e-5, rel=1e-3)
    assert moment == pytest.approx(turn * 1e-6, rel=1e-3)
    assert pads.path.sum() == 0.0


def test_rotation_and_translation_together_lie_on_the_limit_ellipsoid() -> None:
    """(f / μN)² + (m / μNe)² is 1 within a few per cent, whatever the mixture."""
    spin = field()
    push(spin, 0.0, 0.0, 6.0)
    most_moment = spin.forces()[2]
    for reach_mm in (2.0, 4.0, 6.0, 10.0):
        pads = field()
        push(pads, 0.0, 40.0, 40.0 / reach_mm, steps=4000)
        _, y, moment = pads.forces()
        total = (y / (2 * MU * NORMAL_N)) ** 2 + (moment / most_moment) ** 2
        assert total == pytest.approx(1.0, abs=0.06)


def test_the_rim_slides_before_the_middle() -> None:
    pads = field()
    push(pads, 0.0, 1.2, 0.0)
    radius = np.hypot(pads.patch.x_mm / 5.0, pads.patch.y_mm / 8.0)
    slid = pads.path[0] > 0
    assert 0 < slid.sum() < len(slid)
    assert radius[slid].min() > radius[~slid].max() - 0.05


def test_nothing_is_gained_by_pushing_and_letting_go() -> None:
    """Work done on the pads over a closed path is never negative."""
    pads, work = field(), 0.0
    random = np.random.default_rng(0)
    path = np.cumsum(random.normal(0.0, 0.05, (300, 3)) * [1, 1, 0.1], axis=0)
    path = np.concatenate([path, path[-1] * np.linspace(1, 0, 100)[1:, None]])
    before = np.zeros(3)
    for place in path:
        step = place - before
        held = np.array(pads.forces())
        pads.move(*step, NORMAL_N, 0.01)
        work += float((held + np.array(pads.forces())) @ step) / 2
        before = place
    elastic = 0.5 * 0.1 * pads.patch.area_mm2 * float((pads.shear_x**2 + pads.shear_y**2).sum())
    assert work >= elastic - 1e-9


def test_before_anything_slips_gel_and_object_move_together() -> None:
    run = replace(list_runs(CupPourConfig())[3], creep=0.0, vibration_n=0.0)
    run = replace(run, cup=replace(run.cup, friction=30.0), side_friction=(1.0, 1.0))
    track = simulate_pour(run)
    for motion in track.motions:
        np.testing.assert_allclose(motion.gel_rad, motion.object_rad, atol=2e-3)
        np.testing.assert_allclose(motion.gel_mm, motion.object_mm, atol=5e-3)
    assert track.truth[-1, 2] > 0.5  # it did turn, elastically


def test_in_gross_slip_the_object_leaves_the_gel_behind(
    tracks: list[tuple[PourRun, PourTrack]],
) -> None:
    slipped = [track for _, track in tracks if track.truth[-1, 0] > 1000]
    assert slipped
    for track in slipped:
        motion = track.motions[0]
        assert abs(motion.object_rad[-1] - motion.gel_rad[-1]) > 0.1


def test_indentation_is_the_published_one() -> None:
    assert indentation(15.0) == pytest.approx((1.4, 124.0))
    assert indentation(50.0) == pytest.approx((2.4, 168.0), rel=0.01)


def test_the_papers_set(tracks: list[tuple[PourRun, PourTrack]]) -> None:
    """60 runs of 360 frames; a third to a half ends in gross slip, more at weak grips."""
    assert len(list_runs(CupPourConfig())) == 60
    assert all(len(track.time_s) == 360 for _, track in tracks)
    gross = {
        force: np.mean([t.truth[-1, 0] > 300 for run, t in tracks if run.force_n in force])
        for force in ((15.0, 25.0), (40.0, 50.0))
    }
    weak, strong = gross.values()
    assert weak > strong
    assert 0.2 <= (weak + strong) / 2 <= 0.5
    starts = [track.pour_start_s for run, track in tracks if run.kind == "pour"]
    assert 0.1 < np.mean([run.kind == "still" for run, _ in tracks]) < 0.5
    assert 0.4 <= min(starts) < max(starts) <= 2.2


def test_micro_slip_comes_before_gross_slip(tracks: list[tuple[PourRun, PourTrack]]) -> None:
    leads = []
    for _, track in tracks:
        slip = track.truth[:, 0]
        if slip[-1] > 300:
            leads.append(track.time_s[np.argmax(slip > 300)] - track.time_s[np.argmax(slip > 20)])
    assert min(leads) > 0
    assert 0.2 < np.median(leads) < 3.0


def test_step_by_step_equals_the_whole(tracks: list[tuple[PourRun, PourTrack]]) -> None:
    run, track = tracks[0]
    sim = PourSim(run)
    sim.step(run.force_n, 2.0)
    np.testing.assert_array_equal(sim.state, track.truth[120])


def test_a_firmer_grip_slips_less() -> None:
    run = draw_run(0, draw_cup(0, 1), "middle", 15.0)
    slips = []
    for grip_n in (15.0, 25.0, 40.0):
        sim = PourSim(run)
        sim.step(grip_n, 4.0)
        slips.append(sim.state[0])
    assert slips == sorted(slips, reverse=True)


def test_a_person_who_stops_pours_no_more() -> None:
    sim = PourSim(draw_run(0, draw_cup(0, 1), "middle", 50.0))
    sim.step(50.0, 2.5)
    poured_g = sim.poured_g
    assert poured_g > 0
    sim.pour(False)
    sim.step(50.0, 0.5)
    assert sim.poured_g == poured_g


def test_a_cup_is_the_same_in_every_set() -> None:
    few, many = list_runs(CupPourConfig(cups=2)), list_runs(CupPourConfig(cups=9))
    assert [run for run in many if run.cup.index < 2] == few
    late = list_runs(CupPourConfig(cups=1, first_cup=1))
    assert late == [run for run in few if run.cup.index == 1]


@pytest.mark.parametrize("kind", ["no-slip pour", "bump", "grip drop", "late slip"])
def test_every_other_kind_runs(kind: str) -> None:
    run = draw_run(0, draw_cup(0, 0), "middle", 40.0, kind)  # type: ignore[arg-type]
    track = simulate_pour(run, duration_s=2.0)
    assert np.isfinite(track.truth).all()
    assert kind.replace(" ", "-") in run.name
