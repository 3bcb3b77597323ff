"""Claims about the simulated gripper, against closed forms."""

import math

import numpy as np
import pytest

from taxel.errors import BadInput
from taxel.sim.pour.cup_pour import CupPourConfig, list_runs, simulate_pour
from taxel.sim.pour.grip_response import GrippedPour, GripResponse, GripResponseConfig

DT = 1 / 480


def forces(gripper: GripResponse, seconds: float) -> np.ndarray:
    return np.array([gripper.step(DT) for _ in range(round(seconds / DT))])


def test_without_a_command_the_force_does_not_move_by_a_bit() -> None:
    assert set(forces(GripResponse(15.3), 2.0).tolist()) == {15.3}


def test_a_command_does_nothing_before_its_latency() -> None:
    gripper = GripResponse(15.0, GripResponseConfig(latency_s=0.05))
    gripper.command(50.0, after_s=0.02)
    track = forces(gripper, 0.2)
    assert np.all(track[: round(0.07 / DT)] == 15.0)
    assert track[round(0.07 / DT) + 1] > 15.0


def test_a_small_step_follows_the_first_order_law() -> None:
    """A step of 5 N at 30 ms needs 167 N/s at most, so that the slew limit says nothing."""
    gripper = GripResponse(20.0, GripResponseConfig(latency_s=0.0, time_constant_s=0.03))
    gripper.command(25.0)
    gripper.step(DT)  # the command works from this step's end
    track = forces(gripper, 0.15)
    time_s = np.arange(1, len(track) + 1) * DT
    np.testing.assert_allclose(track, 25.0 - 5.0 * np.exp(-time_s / 0.03), atol=1e-9)


def test_a_large_step_is_limited_by_the_slew() -> None:
    gripper = GripResponse(15.0, GripResponseConfig(slew_n_s=300.0))
    gripper.command(50.0)
    track = forces(gripper, 1.0)
    assert np.diff(track).max() <= 300.0 * DT + 1e-9
    assert np.diff(track).max() == pytest.approx(300.0 * DT)
    assert track[-1] == pytest.approx(50.0)


@pytest.mark.parametrize(("asked", "held"), [(500.0, 50.0), (1.0, 15.0)])
def test_commands_are_cut_to_the_limits(asked: float, held: float) -> None:
    gripper = GripResponse(30.0)
    gripper.command(asked)
    assert forces(gripper, 2.0)[-1] == pytest.approx(held)


def test_a_later_command_never_overtakes_an_earlier_one() -> None:
    gripper = GripResponse(15.0)
    gripper.command(50.0, after_s=0.1)
    gripper.command(20.0)
    assert forces(gripper, 2.0)[-1] == pytest.approx(20.0)


@pytest.mark.parametrize(("force_n", "after_s"), [(math.nan, 0.0), (math.inf, 0.0), (20.0, -1.0)])
def test_a_command_that_is_no_number_is_refused(force_n: float, after_s: float) -> None:
    with pytest.raises(BadInput):
        GripResponse(15.0).command(force_n, after_s)


@pytest.mark.parametrize(
    "wrong", [{"latency_s": -1.0}, {"slew_n_s": 0.0}, {"least_n": 60.0}, {"most_n": math.inf}]
)
def test_wrong_parameters_are_refused(wrong: dict[str, float]) -> None:
    with pytest.raises(BadInput):
        GripResponseConfig(**wrong)


def test_a_pour_without_commands_is_the_open_loop_to_the_last_bit() -> None:
    run = list_runs(CupPourConfig(cups=1, first_cup=4001, forces_n=(15.0,)))[0]
    track = simulate_pour(run, 120.0, 1.2)
    pour, found = GrippedPour(run), []
    for _ in track.time_s:
        found.append(pour.sim.state)
        pour.step(1 / 120.0)
    np.testing.assert_array_equal(np.array(found), track.truth)


def test_a_raise_in_time_saves_a_cup_that_is_dropped_without_it() -> None:
    run = next(
        run
        for run in list_runs(CupPourConfig(cups=1, first_cup=4008, forces_n=(15.0,)))
        if run.position == "lower"
    )

    def dropped(raise_s: float) -> bool:
        pour = GrippedPour(run)
        for index in range(360):
            if index == round(raise_s * 120):
                pour.gripper.command(50.0)
            pour.step(1 / 120)
        return pour.sim.dropped

    assert dropped(raise_s=99.0)
    assert not dropped(raise_s=2.0)
