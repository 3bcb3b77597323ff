"""Claims about grasps that move: the frame's forces in closed form, and truth that adds up."""

from dataclasses import replace

import numpy as np
import pytest

from taxel.sim.pour.cup_pour import CupPourConfig, PourSim, list_runs, simulate_pour
from taxel.sim.pour.cups import MOVING_KINDS, PourRun, draw_cup, draw_run
from taxel.sim.pour.grip_limits import GRAVITY_M_S2, force_of, indentation
from taxel.sim.pour.gripper_path import PEAK_ACCELERATION, ArmStop, GripperPath, Move
from taxel.sim.pour.pours_at_once import simulate_pours
from taxel.sim.pour.scene_draws import draw_grasp
from taxel.sim.pour.scenes import Person, Scene
from taxel.sim.pour.state import MOTION_CHANNELS, TRUTH_CHANNELS, GraspPhase, truth_columns
from taxel.sim.pour.surroundings import Surroundings

CUP = draw_cup(0, 31_500)
COLUMN = {name: place for place, name in enumerate(TRUTH_CHANNELS + MOTION_CHANNELS)}


def run_with(scene: Scene) -> PourRun:
    """Return a still grasp of 50 N with a scene, without the hand's unrest."""
    run = draw_run(0, CUP, "middle", 50.0, "still")
    return replace(run, scene=scene, vibration_n=0.0, relaxation=0.0, creep=0.0)


def load(scene: Scene, time_s: float) -> tuple[np.ndarray, float]:
    around = Surroundings(run_with(scene))
    found = around.load(time_s, np.zeros(3), np.zeros(3), CUP.mass_kg, np.zeros(2))
    return found.force_n, found.moment_n_mm


def test_a_move_of_minimum_jerk_ends_where_it_should_and_is_fastest_in_its_middle() -> None:
    path = GripperPath(moves=(Move(start_s=1.0, duration_s=0.5, x_mm=100.0, up_mm=20.0),))
    assert path.world(3.0)[:, 0] == pytest.approx([100.0, -20.0, 0.0])
    times = np.linspace(1.0, 1.5, 4001)
    along = np.array([path.world(float(t))[0] for t in times])
    assert along[:, 1].max() == pytest.approx(1.875 * 100.0 / 0.5, rel=1e-6)
    assert along[:, 2].max() == pytest.approx(PEAK_ACCELERATION * 100.0 / 0.25, rel=1e-5)
    np.testing.assert_allclose(np.gradient(along[:, 0], times)[1:-1], along[1:-1, 1], atol=0.01)
    np.testing.assert_allclose(np.gradient(along[:, 1], times)[1:-1], along[1:-1, 2], atol=0.5)


def test_an_arm_that_stops_brakes_evenly_and_stays() -> None:
    move = Move(start_s=0.0, duration_s=1.0, x_mm=300.0)
    path = GripperPath(moves=(move,), stop=ArmStop(at_s=0.5, brake_m_s2=10.0))
    speed_mm_s = path.world(0.5)[0, 1]
    brakes_s = speed_mm_s / 10_000.0
    assert path.world(0.5 + brakes_s / 2)[0, 2] == pytest.approx(-10_000.0)
    assert path.world(5.0)[0] == pytest.approx([150.0 + speed_mm_s * brakes_s / 2, 0.0, 0.0])


def test_gravity_turns_with_the_gripper() -> None:
    """Tilted by a right angle clockwise, the weight pulls to the right, through the handle."""
    move = Move(start_s=0.0, duration_s=1.0, tilt_rad=np.pi / 2)
    force_n, moment = load(Scene(path=GripperPath(moves=(move,))), 2.0)
    assert force_n == pytest.approx([CUP.mass_kg * GRAVITY_M_S2, 0.0], abs=1e-9)
    assert moment == pytest.approx(0.0, abs=1e-9)


def test_a_gripper_that_is_lifted_feels_more_than_the_weight() -> None:
    move = Move(start_s=0.0, duration_s=1.0, up_mm=200.0)
    path = GripperPath(moves=(move,))
    up_m_s2 = -path.world(0.2)[1, 2] / 1000.0
    assert up_m_s2 > 0.5
    force_n, moment = load(Scene(path=path), 0.2)
    weight_n = CUP.mass_kg * (GRAVITY_M_S2 + up_m_s2)
    assert force_n == pytest.approx([0.0, weight_n])
    assert moment == pytest.approx(weight_n * CUP.lever_mm)


def test_a_tilt_that_speeds_up_turns_the_cup_back_by_its_inertia() -> None:
    """About the pads: moment of inertia times angular acceleration, and the centrifugal pull."""
    move = Move(start_s=0.0, duration_s=1.0, tilt_rad=0.6)
    path = GripperPath(moves=(move,))
    _, rate, change = path.world(0.3)[2]
    tilted = path.world(0.3)[2, 0]
    force_n, moment = load(Scene(path=path), 0.3)
    inertia = CUP.mass_kg * (CUP.lever_mm**2 + CUP.gyration_mm**2)
    static = CUP.mass_kg * GRAVITY_M_S2 * np.cos(tilted) * CUP.lever_mm
    assert moment == pytest.approx(static - inertia * change / 1000.0)
    outwards = force_n[0] - CUP.mass_kg * GRAVITY_M_S2 * np.sin(tilted)
    assert outwards == pytest.approx(CUP.mass_kg * rate**2 * CUP.lever_mm / 1000.0)


def test_who_bears_the_cup_leaves_nothing_to_the_gels() -> None:
    person = Person(start_s=1.0, duration_s=0.5, bears_from=1.0, bears_to=0.0)
    force_n, moment = load(Scene(person=person), 0.5)
    assert (*force_n, moment) == pytest.approx((0.0, 0.0, 0.0), abs=1e-9)
    force_n, _ = load(Scene(person=person), 2.0)
    assert force_n[1] == pytest.approx(CUP.mass_kg * GRAVITY_M_S2)


def test_a_lifted_cup_loads_the_gels_with_its_weight_and_leaves_the_table() -> None:
    move = Move(start_s=0.5, duration_s=0.8, up_mm=60.0)
    run = run_with(Scene(path=GripperPath(moves=(move,)), on_table=True))
    truth = simulate_pour(run, duration_s=2.5).truth
    weight_n = CUP.mass_kg * GRAVITY_M_S2
    assert truth[0, COLUMN["load"]] == pytest.approx(0.0, abs=0.02)
    assert truth[0, COLUMN["outside_y"]] == pytest.approx(-weight_n, rel=0.02)
    assert truth[-1, COLUMN["outside_y"]] == 0.0
    assert truth[-1, COLUMN["load"]] == pytest.approx(weight_n, rel=0.05)
    assert truth[-1, COLUMN["lift"]] == pytest.approx(60.0)


@pytest.mark.parametrize("kind", MOVING_KINDS)
def test_each_kind_moves_holds_or_slips_and_says_so(kind: str) -> None:
    """Stronger grips never slip further; truth is finite and has its own columns."""
    slipped = []
    for force_n in (15.0, 400.0):
        run = draw_grasp(3, CUP, "upper", 15.0, kind)  # type: ignore[arg-type]
        track = simulate_pour(replace(run, force_n=force_n), duration_s=3.0)
        assert np.isfinite(track.truth).all()
        assert track.truth.shape[1] == len(truth_columns(1, scene=True)[0])
        slipped.append(track.truth[-1, 0])
    assert slipped[1] < 100.0
    assert slipped[1] <= slipped[0]


def test_a_collision_stops_the_arm_and_pushes_the_cup() -> None:
    runs = [draw_grasp(0, draw_cup(0, cup), "middle", 50.0, "collision") for cup in range(9)]
    hit = [run.scene for run in runs if run.scene is not None and run.scene.hit is not None]
    assert 0 < len(hit) < len(runs), "either the cup or the arm is hit"
    for scene in hit:
        assert scene.hit is not None and scene.path.stop is not None  # noqa: PT018
        speed_m_s = scene.path.world(scene.hit.at_s)[0, 1] / 1000.0
        impulse = abs(scene.hit.force_n) * scene.hit.duration_s * 2 / np.pi
        mass_kg = impulse / (2 * speed_m_s)  # what meets a spring comes back as fast as it came
        assert 0.05 < mass_kg < 0.85
        assert scene.path.world(scene.hit.at_s + 2.0)[0, 1] == pytest.approx(0.0)


def test_jaws_close_on_a_cup_that_stands_and_nothing_slips_before() -> None:
    run = draw_grasp(0, CUP, "middle", 25.0, "still", 0, approach=True)
    approach = run.approach
    assert approach is not None
    track = simulate_pour(run, duration_s=approach.settled_s + 0.5)
    time_s, truth = track.time_s, track.truth
    phase = truth[:, COLUMN["grasp"]]
    assert set(phase[time_s < approach.contact_s]) == {GraspPhase.OPEN}
    assert set(phase[time_s >= approach.settled_s + 0.02]) == {GraspPhase.HELD}
    open_jaws = time_s < approach.contact_s
    for motion in track.motions:
        assert not motion.depth_mm[open_jaws].any()
    first = track.motions[approach.first].depth_mm
    alone = (time_s > approach.contact_s + 0.02) & (time_s < approach.contact_s + approach.lag_s)
    assert (first[alone] > track.motions[1 - approach.first].depth_mm[alone]).all()
    assert truth[-1, COLUMN["grip"]] == pytest.approx(25.0, rel=0.1)
    assert truth[time_s < approach.settled_s, COLUMN["slip"]].max() == 0.0


@pytest.mark.parametrize("number", [0, 1, 2, 3])
def test_a_cup_that_somebody_holds_out_stands_still_until_it_is_grasped(number: int) -> None:
    run = draw_grasp(0, CUP, "middle", 25.0, "hand-over", number, approach=True)
    assert run.approach is not None
    track = simulate_pour(run, duration_s=run.approach.contact_s)
    assert np.abs(track.motions[0].object_mm).max() < 0.05


def test_force_is_the_inverse_of_indentation() -> None:
    for force_n in (0.5, 15.0, 50.0):
        assert force_of(indentation(force_n)[0]) == pytest.approx(force_n)


def test_a_set_of_kinds_has_them_all_and_the_papers_set_is_untouched() -> None:
    kinds = list_runs(CupPourConfig(cups=1, forces_n=(25.0,), kinds=MOVING_KINDS))
    assert [run.kind for run in kinds[:5]] == list(MOVING_KINDS)
    assert len({run.name for run in kinds}) == 15
    assert all(run.scene is None for run in list_runs(CupPourConfig(cups=2, negatives=1.0)))


def test_a_moving_run_without_its_scene_is_refused() -> None:
    with pytest.raises(ValueError, match="draw_grasp"):
        PourSim(draw_run(0, CUP, "middle", 25.0, "lift"))
    with pytest.raises(ValueError, match="scene"):
        simulate_pours([draw_grasp(0, CUP, "middle", 25.0, "lift")])
    with pytest.raises(ValueError, match="gel 1"):
        CupPourConfig(approach=True, gel=2)


def test_gels_that_shear_as_layers_carry_the_motions_columns_last() -> None:
    run = draw_grasp(0, CUP, "middle", 40.0, "carry")
    track = simulate_pour(run, duration_s=0.5, gel=2)
    channels, units = truth_columns(2, scene=True)
    assert track.truth.shape[1] == len(channels) == len(units)
    assert channels[-1] == "grasp"
    assert set(track.truth[:, -1]) == {GraspPhase.HELD}
