"""Newtons become percent, orders reach a gripper, and the simulated one behaves like mechanics."""

import math
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from taxel.actions.gripper import ForceRange, GripperStatus, Motion, obey
from taxel.actions.interlock import Order, OrderKind
from taxel.actions.sim_gripper import FingersConfig, SimGripper
from taxel.clock import ManualClock
from taxel.errors import BadInput

PGE_50 = ForceRange(max_n=50.0)
MEASURED = ForceRange(max_n=48.0, table=((20.0, 9.0), (50.0, 26.0), (100.0, 48.0)))


@pytest.mark.parametrize(("force_n", "register"), [(15.0, 30), (25.0, 50), (40.0, 80), (50.0, 100)])
def test_the_papers_four_forces_are_its_four_settings(force_n: float, register: int) -> None:
    """30, 50, 80 and 100 % are 15, 25, 40 and 50 N. Source: the grasp paper, section 3.2."""
    assert PGE_50.pct(force_n) == pytest.approx(register)


def test_the_setting_stays_within_what_the_register_takes() -> None:
    assert (PGE_50.pct(0.0), PGE_50.pct(1e9)) == (20.0, 100.0)
    assert PGE_50.least_n == 10.0
    assert math.isnan(PGE_50.pct(math.nan))


def test_a_measured_table_takes_the_place_of_the_proportion() -> None:
    assert [MEASURED.pct(n) for n in (9.0, 26.0, 37.0, 48.0)] == [20.0, 50.0, 75.0, 100.0]
    assert MEASURED.newtons(35.0) == pytest.approx(17.5)


@given(st.floats(10.0, 50.0), st.sampled_from([PGE_50, MEASURED]))
def test_newtons_survive_the_way_through_percent(force_n: float, force: ForceRange) -> None:
    held_n = min(force_n, force.max_n)
    assert force.newtons(force.pct(held_n)) == pytest.approx(held_n)


@pytest.mark.parametrize(
    "wrong",
    [
        {"max_n": 0.0},
        {"max_n": math.nan},
        {"max_n": 50.0, "table": ((20.0, 10.0), (50.0, 9.0), (100.0, 50.0))},
        {"max_n": 50.0, "table": ((30.0, 10.0), (100.0, 50.0))},
        {"max_n": 50.0, "table": ((20.0, 10.0),)},
        {"max_n": 50.0, "table": ((20.0, 10.0), (100.0, 45.0))},
    ],
)
def test_ranges_that_make_no_sense_are_refused(wrong: dict[str, Any]) -> None:
    with pytest.raises(BadInput):
        ForceRange(**wrong)


class Heard:
    """A gripper that writes down what it is asked for."""

    def __init__(self) -> None:
        self.calls: list[tuple[object, ...]] = []
        self.set_pct = math.nan

    def connect(self) -> None: ...

    def close(self) -> None: ...

    def status(self) -> GripperStatus:
        return GripperStatus(force_pct=self.set_pct)

    def grip(self, force_pct: float, expires_s: float = math.inf) -> None:
        self.calls.append(("grip", force_pct, expires_s))

    def hold(self) -> None:
        self.calls.append(("hold",))

    def stop(self) -> None:
        self.calls.append(("stop",))


@pytest.mark.parametrize(
    ("kind", "asked"),
    [
        (OrderKind.NONE, []),
        (OrderKind.GRIP, [("grip", 60.0, 2.0)]),
        (OrderKind.HOLD, [("hold",)]),
        (OrderKind.STOP, [("stop",)]),
    ],
)
def test_each_kind_of_order_asks_for_one_thing(kind: OrderKind, asked: list[object]) -> None:
    gripper = Heard()
    obey(gripper, Order(kind, 30.0, "", 2.0), PGE_50, 1.9)
    assert gripper.calls == asked
    obey(gripper, Order(kind, 30.0, "", 2.0), PGE_50, 2.0)
    assert gripper.calls == asked  # expired: nothing more


def test_an_order_never_lowers_the_force_that_is_set() -> None:
    gripper = Heard()
    gripper.set_pct = 80.0
    obey(gripper, Order(OrderKind.GRIP, 30.0, "", 2.0), PGE_50, 1.0)
    assert gripper.calls == []
    gripper.set_pct = 59.0
    obey(gripper, Order(OrderKind.GRIP, 30.0, "", 2.0), PGE_50, 1.0)
    assert gripper.calls == [("grip", 60.0, 2.0)]


def caught(config: FingersConfig | None = None) -> tuple[SimGripper, ManualClock]:
    """A gripper that has closed on its object with 20 %, its force settled."""
    clock = ManualClock(5.0)
    gripper = SimGripper(config or FingersConfig(), clock)
    gripper.connect()
    gripper.grip(20.0)
    clock.advance(1.5)
    assert gripper.status().motion is Motion.CAUGHT
    return gripper, clock


def test_the_fingers_stop_at_the_object() -> None:
    gripper, _ = caught()

    assert gripper.status().position_permille == pytest.approx(1000 * 10 / 26)
    assert gripper.fingers.force_n == pytest.approx(10.0, abs=1e-3)


def test_without_an_object_the_fingers_reach_the_end() -> None:
    clock = ManualClock()
    gripper = SimGripper(FingersConfig(width_mm=0.0), clock)
    gripper.connect()
    gripper.grip(50.0)
    clock.advance(0.3)
    assert gripper.status().motion is Motion.MOVING
    clock.advance(0.3)
    assert gripper.status() == GripperStatus(
        initialised=True,
        motion=Motion.REACHED,
        position_permille=0.0,
        force_pct=50.0,
        read_s=pytest.approx(0.6),
    )


def test_the_force_waits_then_follows_first_order_within_its_slope() -> None:
    """20 ms of nothing; then at most 300 N/s: 2 N after 30 ms would be 3 N without limit."""
    gripper, clock = caught(FingersConfig(slew_n_s=200.0))
    gripper.grip(100.0)
    clock.advance(0.0195)
    gripper.hold()
    assert gripper.fingers.force_n == pytest.approx(10.0, abs=1e-3)
    clock.advance(0.0105)
    gripper.hold()
    assert gripper.fingers.force_n == pytest.approx(12.0, abs=0.25)
    clock.advance(1.0)
    gripper.hold()
    assert gripper.fingers.force_n == pytest.approx(50.0, abs=1e-3)


def test_an_unlimited_step_is_an_exponential() -> None:
    """After one time constant 1 − 1/e of the way is done."""
    gripper, clock = caught(FingersConfig(slew_n_s=1e6, latency_s=0.0))
    gripper.grip(100.0)
    clock.advance(0.05)
    gripper.hold()

    assert gripper.fingers.force_n == pytest.approx(50 - 40 / math.e, rel=0.01)


def test_an_object_that_pulls_harder_than_friction_drops_and_says_so() -> None:
    """2 · 0.5 · 10 N hold 9 N and not 11 N."""
    gripper, clock = caught()
    gripper.fingers.load_n = 9.0
    clock.advance(0.5)
    assert gripper.status().motion is Motion.CAUGHT
    gripper.fingers.load_n = 11.0
    clock.advance(0.01)
    assert gripper.status().motion is Motion.DROPPED
    assert gripper.fingers.force_n == 0.0


def test_a_grip_raised_in_time_keeps_the_object() -> None:
    gripper, clock = caught()
    gripper.grip(40.0)
    clock.advance(0.5)
    gripper.hold()
    gripper.fingers.load_n = 19.0
    clock.advance(0.5)

    assert gripper.status().motion is Motion.CAUGHT


def test_stop_halts_moving_fingers_and_leaves_a_caught_object_held() -> None:
    clock = ManualClock()
    gripper = SimGripper(FingersConfig(width_mm=0.0, latency_s=0.0), clock)
    gripper.connect()
    gripper.grip(50.0)
    clock.advance(0.25)
    gripper.stop()
    there = gripper.status().position_permille
    clock.advance(1.0)
    assert gripper.status().position_permille == pytest.approx(there, abs=5)

    holding, clock = caught()
    holding.stop()
    clock.advance(1.0)
    assert holding.fingers.force_n == pytest.approx(10.0, abs=1e-3)
    assert holding.status().motion is Motion.CAUGHT


def test_an_expired_or_senseless_grip_is_not_obeyed() -> None:
    gripper, clock = caught()
    gripper.grip(100.0, expires_s=clock.now_s())
    gripper.grip(math.nan)
    clock.advance(0.5)

    assert gripper.status().force_pct == 20.0


def test_nothing_that_a_guard_may_call_opens_the_fingers() -> None:
    gripper, clock = caught()
    for call in (gripper.hold, gripper.stop, gripper.close, lambda: gripper.grip(1.0)):
        before = gripper.status().position_permille
        call()
        clock.advance(0.5)
        assert gripper.status().position_permille <= before


@pytest.mark.parametrize(
    "bad", [{"lag_s": 0.0}, {"width_mm": 26.0}, {"latency_s": -1.0}, {"friction": math.nan}]
)
def test_mechanics_that_make_no_sense_are_refused(bad: dict[str, float]) -> None:
    with pytest.raises(BadInput):
        FingersConfig(**bad)
