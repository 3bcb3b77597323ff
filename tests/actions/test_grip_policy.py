"""Claims about the policies that turn a grasp's state into a grip force."""

import math

import numpy as np
import pytest

from taxel.actions.grip_policy import (
    GripPolicy,
    GripPolicyConfig,
    PixelDifference,
    PixelDifferenceConfig,
)
from taxel.decisions.stability import Stability, StabilityDecision
from taxel.errors import BadInput
from taxel.gel.slip_signal import Slip

STEPS = GripPolicyConfig(most_n=50, warning_step_n=10, unstable_step_n=20, hold_s=0.3)


def decided(state: Stability) -> StabilityDecision:
    return StabilityDecision(state, "", 0.0, 0.5)


def test_nothing_is_raised_while_the_grasp_is_stable_or_unknown() -> None:
    policy = GripPolicy(15.0, STEPS)
    for index, state in enumerate([Stability.UNKNOWN, Stability.STABLE, Stability.UNKNOWN]):
        assert policy.push(decided(state), index * 1.0) == 15.0
    assert policy.raised_s is None


def test_a_warning_raises_by_its_step_and_again_only_after_the_hold_time() -> None:
    policy = GripPolicy(15.0, STEPS)
    forces = [policy.push(decided(Stability.WARNING), t) for t in (1.0, 1.1, 1.29, 1.31, 1.4)]
    assert forces == [25.0, 25.0, 25.0, 35.0, 35.0]
    assert policy.raised_s == 1.0


def test_a_warning_that_worsens_does_not_wait() -> None:
    policy = GripPolicy(15.0, STEPS)
    policy.push(decided(Stability.WARNING), 1.0)
    assert policy.push(decided(Stability.UNSTABLE), 1.02) == 45.0
    assert policy.push(decided(Stability.UNSTABLE), 1.04) == 45.0
    assert policy.push(decided(Stability.UNSTABLE), 1.40) == 50.0


def slipped(
    mm: float, *, seen: bool = True, state: Stability = Stability.UNSTABLE, sd: float = 0.01
) -> StabilityDecision:
    slip = Slip(
        distance_mm=mm, rate_mm_s=0.0, compliance=0.0, distance_sd_mm=sd, rate_sd_mm_s=0.1,
        compliance_sd=0.1, seen=seen,
    )  # fmt: skip
    return StabilityDecision(state, "", 0.0, 0.95, slip, is_score=True)


def test_where_slip_is_measured_the_grip_is_raised_only_while_the_object_slips_further() -> None:
    policy = GripPolicy(15.0)
    moments = [(1.0, 0.25), (1.3, 0.27), (2.0, 0.34), (2.1, 0.36), (2.15, 0.50), (2.21, 0.50)]
    forces = [policy.push(slipped(mm), t) for t, mm in moments]
    assert forces == [25.0, 25.0, 25.0, 35.0, 35.0, 45.0]


def test_an_object_that_is_nearly_lost_gets_all_there_is_at_once() -> None:
    policy = GripPolicy(15.0)
    assert policy.push(slipped(1.0, state=Stability.WARNING), 1.0) == 50.0


def test_an_object_that_slides_back_or_a_monitor_that_begins_anew_holds_no_raise_up() -> None:
    policy = GripPolicy(15.0)
    forces = [policy.push(slipped(mm), t) for t, mm in ((1.0, 0.6), (1.2, 0.55), (1.4, 0.48))]
    assert forces == [25.0, 25.0, 35.0]
    assert policy.push(slipped(0.02), 2.0) == 45.0


def test_each_alarm_raises_at_once_although_nothing_slipped_since_the_one_before() -> None:
    policy = GripPolicy(15.0)
    assert policy.push(slipped(0.2), 1.0) == 25.0
    assert policy.push(slipped(0.2, state=Stability.STABLE), 2.0) == 25.0
    assert policy.push(slipped(0.2), 3.0) == 35.0


@pytest.mark.parametrize("time_s", [0.2, math.nan])
def test_a_clock_set_back_or_broken_holds_no_raise_by_slip_up(time_s: float) -> None:
    policy = GripPolicy(15.0)
    policy.push(slipped(0.2), 1.0)
    assert policy.push(slipped(0.31), time_s) == 35.0


@pytest.mark.parametrize(
    "lost", [slipped(0.3, seen=False), slipped(math.nan), slipped(0.2, sd=math.inf)]
)
def test_slip_that_cannot_be_followed_softens_nothing(lost: StabilityDecision) -> None:
    policy = GripPolicy(15.0)
    assert policy.push(slipped(0.2), 1.0) == 25.0
    assert policy.push(lost, 1.4) == 50.0


@pytest.mark.parametrize("after", [Stability.STABLE, Stability.UNKNOWN])
def test_the_force_never_falls_within_a_grasp(after: Stability) -> None:
    policy = GripPolicy(15.0, STEPS)
    policy.push(decided(Stability.WARNING), 1.0)
    assert [policy.push(decided(after), t) for t in (1.1, 2.0, 9.0)] == [25.0] * 3


def test_the_limit_is_never_passed_and_then_nothing_can_change_the_force() -> None:
    policy = GripPolicy(40.0, STEPS)
    assert not policy.exhausted
    forces = [policy.push(decided(Stability.UNSTABLE), t * 1.0) for t in range(5)]
    assert max(forces) == 50.0
    assert policy.exhausted


def test_a_grasp_above_the_limit_keeps_its_force() -> None:
    policy = GripPolicy(60.0, STEPS)
    assert policy.push(decided(Stability.UNSTABLE), 1.0) == 60.0
    assert policy.raised_s is None


@pytest.mark.parametrize("time_s", [0.2, math.nan])
def test_a_clock_that_is_set_back_or_broken_holds_no_raise_up(time_s: float) -> None:
    policy = GripPolicy(15.0, STEPS)
    policy.push(decided(Stability.WARNING), 1.0)
    assert policy.push(decided(Stability.WARNING), time_s) == 25.0 + 10.0


def test_a_new_grasp_starts_at_its_own_force() -> None:
    policy = GripPolicy(15.0, STEPS)
    policy.push(decided(Stability.UNSTABLE), 1.0)
    policy.reset(25.0)
    assert policy.force_n == 25.0
    assert policy.raised_s is None
    assert policy.push(decided(Stability.WARNING), 1.1) == 35.0


@pytest.mark.parametrize(
    "wrong",
    [
        {"warning_step_n": 0.0},
        {"unstable_step_n": 5.0},
        {"hold_s": -1.0},
        {"slip_hold_s": -1.0},
        {"slip_step_n": 0.0},
        {"slip_advance_mm": math.nan},
        {"lost_mm": math.inf},
        {"most_n": math.inf},
        {"most_n": math.nan},
    ],
)
def test_wrong_limits_are_refused(wrong: dict[str, float]) -> None:
    with pytest.raises(BadInput):
        GripPolicyConfig(**wrong)


def test_a_force_that_is_no_number_is_refused() -> None:
    for wrong in (0.0, math.nan, math.inf):
        with pytest.raises(BadInput):
            GripPolicy(wrong)


def pictures(shift: float, count: int) -> list[list[np.ndarray]]:
    """Return `count` moments of two cameras; the second one's left half is darker by `shift`."""
    still = np.full((48, 64, 3), 100, np.uint8)
    other = still.copy()
    other[:, :32] = round(100 * (1 - shift))
    return [[still.copy(), other.copy()] for _ in range(count)]


def test_a_difference_of_pixels_raises_once_it_has_lasted() -> None:
    config = PixelDifferenceConfig(threshold=5.0, raise_s=0.05, most_n=50.0)
    policy = PixelDifference(15.0, 2, 60.0, config)
    moments = pictures(0.0, 30) + pictures(0.4, 30)
    forces = [policy.push(images, i / 60) for i, images in enumerate(moments)]
    assert forces[:33] == [15.0] * 33
    assert forces[33:] == [50.0] * 27
    assert policy.raised_s == pytest.approx(33 / 60)
    assert policy.exhausted


def test_a_small_difference_of_pixels_raises_nothing() -> None:
    policy = PixelDifference(15.0, 2, 60.0, PixelDifferenceConfig(threshold=5.0))
    for i, images in enumerate(pictures(0.0, 30) + pictures(0.04, 30)):
        assert policy.push(images, i / 60) == 15.0
