"""The interlock raises within limits, never lowers, and stops when it hears nothing."""

import math
from collections.abc import Callable

import pytest
from interlock_rig import (
    DISARMED,
    GRIP,
    HAND,
    HOLD,
    HOLDING,
    NONE,
    RAISED,
    READY,
    STOP,
    STOPPED,
    Rig,
)

from taxel.actions.interlock import InterlockConfig, InterlockState, Order, OrderKind
from taxel.errors import BadInput

TABLE = [
    (DISARMED, "STABLE", DISARMED, NONE),
    (DISARMED, "WARNING", DISARMED, NONE),
    (DISARMED, "UNSTABLE", DISARMED, NONE),
    (DISARMED, "UNKNOWN", DISARMED, NONE),
    (READY, "STABLE", READY, HOLD),
    (READY, "WARNING", RAISED, GRIP),
    (READY, "UNSTABLE", RAISED, GRIP),
    (READY, "UNKNOWN", HOLDING, HOLD),
    (RAISED, "STABLE", READY, HOLD),
    (RAISED, "WARNING", RAISED, GRIP),
    (RAISED, "UNSTABLE", RAISED, GRIP),
    (RAISED, "UNKNOWN", HOLDING, HOLD),
    (HOLDING, "STABLE", READY, HOLD),
    (HOLDING, "WARNING", RAISED, GRIP),
    (HOLDING, "UNSTABLE", RAISED, GRIP),
    (HOLDING, "UNKNOWN", HOLDING, HOLD),
    (STOPPED, "STABLE", STOPPED, STOP),
    (STOPPED, "WARNING", STOPPED, STOP),
    (STOPPED, "UNSTABLE", STOPPED, STOP),
    (STOPPED, "UNKNOWN", STOPPED, STOP),
]


@pytest.mark.parametrize(("start", "word", "end", "kind"), TABLE)
def test_every_decision_in_every_state(
    start: InterlockState, word: str, end: InterlockState, kind: OrderKind
) -> None:
    rig = Rig().into(start)

    assert rig.step(word).kind is kind
    assert rig.lock.state is end


CAUSES: dict[str, Callable[[Rig], None]] = {
    "a fault": lambda rig: rig.lock.fault("the bus broke", rig.now),
    "a device that is not well": lambda rig: rig.lock.device(False, rig.now),
    "over-current": lambda rig: rig.lock.contact_current(900.0, rig.now),
    "a negative over-current": lambda rig: rig.lock.contact_current(-900.0, rig.now),
    "a current that is NaN": lambda rig: rig.lock.contact_current(math.nan, rig.now),
    "an infinite current": lambda rig: rig.lock.contact_current(math.inf, rig.now),
    "a tick at NaN": lambda rig: void(rig.lock.tick(math.nan)),
    "a clock that steps back": lambda rig: void(rig.lock.tick(rig.now - 1.0)),
}


def void(_: Order) -> None:
    pass


@pytest.mark.parametrize("start", [READY, RAISED, HOLDING])
@pytest.mark.parametrize("cause", CAUSES)
def test_every_cause_stops_from_every_armed_state(cause: str, start: InterlockState) -> None:
    rig = Rig(HAND).into(start)
    CAUSES[cause](rig)

    assert rig.lock.state is STOPPED
    rig.beating = True
    assert rig.step("WARNING").kind is STOP


@pytest.mark.parametrize("start", [READY, RAISED, HOLDING])
def test_silence_of_the_decision_maker_stops_within_one_tick_of_the_watchdog(
    start: InterlockState,
) -> None:
    """It decides until the end; only its heart stands still: 80 ms pass, at 90 ms it stops."""
    rig = Rig().into(start)
    last = rig.now
    rig.beating = False
    while rig.step().kind is not STOP:
        assert rig.now - last < 0.085
    assert rig.now - last == pytest.approx(0.09)
    assert rig.lock.reason == "no word from the decision maker for 0.08 s"


def test_decisions_that_stop_coming_stop_although_the_heart_beats() -> None:
    """0.3 s are a decision's life; the tick after it stops."""
    rig = Rig().into(READY)
    last = rig.now
    rig.word = None
    while rig.step().kind is HOLD:
        assert rig.now - last < 0.305
    assert rig.now - last == pytest.approx(0.31)
    assert (rig.lock.state, rig.lock.reason) == (STOPPED, "no decision for 0.3 s")
    assert rig.lock.arm(rig.now) == ("no decision for 0.3 s",)


def test_a_decision_that_is_reported_again_and_again_keeps_its_own_time() -> None:
    rig = Rig().into(READY)
    decided = rig.now
    rig.word = None
    for _ in range(31):
        rig.lock.decision("WARNING", decided)
        order = rig.step()
    assert order.kind is STOP


def test_before_the_first_decision_it_holds() -> None:
    rig = Rig()
    rig.word = None
    rig.armed()
    assert rig.step(n=100).kind is HOLD


@pytest.mark.parametrize("start", [READY, RAISED, HOLDING])
@pytest.mark.parametrize("gap_s", [0.081, 0.2, 0.45, 1.0, 3.0])
def test_a_gap_between_ticks_stops_and_nothing_is_raised_until_armed_again(
    start: InterlockState, gap_s: float
) -> None:
    """Everybody else lived on: only the caller of the interlock stood still."""
    rig = Rig().into(start)
    held = rig.lock.force_n
    rig.now += gap_s - 0.01
    assert rig.step("UNSTABLE").kind is STOP
    assert rig.lock.reason == f"the program stood still for {gap_s:.2f} s"
    assert rig.step(n=300).kind is STOP
    assert rig.lock.force_n == held
    assert rig.lock.arm(rig.now) == ()
    assert rig.step().kind is GRIP


def test_a_late_tick_counts_for_no_more_than_the_largest_step() -> None:
    """100 N/s and 20 ms: 2 N, although 75 ms have passed."""
    rig = Rig().into(RAISED)
    before = rig.lock.force_n
    rig.now += 0.065
    assert rig.step("UNSTABLE").force_n == pytest.approx(before + 2.0)


def test_a_key_that_was_pressed_during_a_stall_does_not_undo_the_stop() -> None:
    rig = Rig().into(RAISED)
    rig.now += 1.0
    rig.step()
    assert rig.lock.arm(rig.now) == ("ticks stood still less than 0.5 s ago",)
    rig.step(n=51)
    assert rig.lock.arm(rig.now) == ()


def test_nor_does_one_pressed_during_a_second_stall_after_the_first_had_stopped() -> None:
    rig = Rig().into(RAISED)
    rig.now += 1.0
    rig.step(n=100)
    rig.now += 3.0
    assert rig.step("STABLE").kind is STOP
    assert rig.lock.arm(rig.now) == ("ticks stood still less than 0.5 s ago",)
    rig.step(n=51)
    assert rig.lock.arm(rig.now) == ()


def test_the_stall_is_the_cause_where_it_is_looked_for_before_the_actuator_is_heard() -> None:
    rig = Rig().into(READY)
    rig.now += 1.0
    assert rig.lock.wake(rig.now) == pytest.approx(1.0)
    rig.lock.device(False, rig.now)
    assert rig.lock.reason == "the program stood still for 1.00 s"
    assert rig.lock.tick(rig.now).reason == "the program stood still for 1.00 s"


@pytest.mark.parametrize(
    ("silent", "reason"),
    [
        ("device", "nothing from the actuator for 0.5 s"),
        ("current", "no current reading for 0.2 s"),
    ],
)
def test_an_actuator_or_a_current_not_heard_of_stops(silent: str, reason: str) -> None:
    rig = Rig(HAND).into(READY)
    for _ in range(60):
        rig.now += 0.01
        rig.lock.beat(rig.now)
        rig.lock.decision("STABLE", rig.now)
        if silent != "device":
            rig.lock.device(True, rig.now)
        if silent != "current":
            rig.lock.contact_current(0.0, rig.now)
        rig.lock.tick(rig.now)

    assert (rig.lock.state, rig.lock.reason) == (STOPPED, reason)


def test_contact_stops_only_once_it_has_lasted() -> None:
    rig = Rig(HAND).into(READY)
    rig.lock.contact_current(350.0, rig.now)
    rig.lock.contact_current(100.0, rig.now + 0.01)  # a start-up peak
    rig.lock.contact_current(350.0, rig.now + 0.02)
    rig.lock.contact_current(350.0, rig.now + 0.03)
    assert rig.lock.state is READY
    rig.lock.contact_current(350.0, rig.now + 0.04)

    assert (rig.lock.state, rig.lock.reason) == (STOPPED, "contact: 350 mA for 0.02 s")


def test_arming_is_refused_while_each_cause_persists_and_works_afterwards() -> None:
    rig = Rig(HAND)
    assert rig.lock.arm(rig.now) == (
        "the actuator is not well",
        "no current reading for 0.2 s",
        "no word from the decision maker for 0.08 s",
    )
    rig.armed()
    rig.lock.fault("the bus broke", rig.now)
    rig.lock.contact_current(950.0, rig.now)
    assert rig.lock.arm(rig.now) == ("the bus broke", "over-current")
    rig.lock.fault_gone("the bus broke")
    assert rig.lock.arm(rig.now) == ("over-current",)
    rig.lock.contact_current(0.0, rig.now)
    assert rig.lock.state is STOPPED
    assert rig.lock.arm(rig.now) == ()
    assert rig.step("WARNING").kind is GRIP


def test_a_stop_is_not_undone_by_disarming_and_its_order_does_not_expire() -> None:
    rig = Rig().into(STOPPED)
    rig.lock.disarm(rig.now)
    order = rig.step()

    assert (order.kind, rig.lock.state) == (STOP, STOPPED)
    assert order.valid(1e9)


def test_a_stop_that_a_broken_clock_caused_can_be_armed_again() -> None:
    rig = Rig().into(READY)
    rig.lock.tick(rig.now + 1e6)
    assert rig.lock.state is STOPPED
    rig.step()

    assert rig.lock.arm(rig.now) == ()


@pytest.mark.parametrize("start", [READY, RAISED, HOLDING])
def test_disarming_ends_all_orders(start: InterlockState) -> None:
    rig = Rig().into(start)
    rig.lock.disarm(rig.now, "a person")

    assert rig.step("UNSTABLE").kind is NONE
    assert rig.lock.reason == "disarmed by a person"


def test_disarming_before_it_was_armed_is_counted_once_and_a_stop_stays() -> None:
    rig = Rig()
    for _ in range(3):
        rig.lock.disarm(rig.now, "a person")
    assert (rig.lock.disarms, rig.lock.reason) == (1, "disarmed by a person")
    rig.into(STOPPED)
    rig.lock.disarm(rig.now, "a person")
    assert (rig.lock.disarms, rig.lock.state) == (1, STOPPED)


def test_the_force_rises_by_the_slew_to_the_largest_and_no_further() -> None:
    """100 N/s from 10 N: 1 N a tick of 10 ms, 40 N after 30 ticks."""
    rig = Rig().into(READY)

    assert rig.step("WARNING").force_n == pytest.approx(11.0)
    assert rig.step(n=28).force_n == pytest.approx(39.0)
    assert rig.step(n=20).force_n == 40.0


def test_stable_keeps_the_raised_force_until_the_robot_releases_it() -> None:
    rig = Rig().into(READY)
    rig.step("WARNING", n=10)
    assert rig.step("STABLE", n=50).force_n == pytest.approx(20.0)
    assert rig.lock.release(12.0)
    assert rig.step().force_n == 12.0


@pytest.mark.parametrize("word", ["WARNING", "UNSTABLE", "UNKNOWN"])
def test_no_release_below_what_is_held_in_doubt(word: str) -> None:
    rig = Rig().into(READY)
    rig.step("WARNING", n=10)
    rig.step(word)
    held = rig.lock.force_n

    assert not rig.lock.release(held - 5.0)
    assert rig.lock.force_n == held


def test_a_policy_may_ask_for_less_than_the_largest_force_and_nonsense_gives_the_largest() -> None:
    rig = Rig().into(READY)
    for asked, given_n in ((15.0, 15.0), (12.0, 15.0), (math.nan, 40.0), (1e9, 40.0)):
        for _ in range(40):
            rig.now += 0.01
            rig.hear()
            rig.lock.decision("WARNING", rig.now, asked)
            order = rig.lock.tick(rig.now)
        assert order.force_n == pytest.approx(given_n)


def test_orders_expire() -> None:
    order = Rig().into(RAISED).step()

    assert order.valid(order.expires_s - 1e-6)
    assert not order.valid(order.expires_s)
    assert order.expires_s == pytest.approx(100.0 + 0.02 + 0.1)


def test_beats_stamped_in_the_future_do_not_stretch_the_watchdog() -> None:
    rig = Rig().into(READY)
    rig.beating = False
    rig.lock.beat(rig.now + 5.0)

    assert rig.step().kind is STOP


@pytest.mark.parametrize(
    "bad",
    [
        {"min_n": 5.0, "max_n": 4.0},
        {"min_n": math.nan, "max_n": 4.0},
        {"min_n": 0.0, "max_n": math.inf},
        {"min_n": 0.0, "max_n": 4.0, "watchdog_s": 0.0},
        {"min_n": 0.0, "max_n": 4.0, "slew_n_s": math.nan},
        {"min_n": 0.0, "max_n": 4.0, "stall_s": 0.0},
        {"min_n": 0.0, "max_n": 4.0, "step_s": math.inf},
        {"min_n": 0.0, "max_n": 4.0, "over_ma": -1.0},
    ],
)
def test_limits_that_make_no_sense_are_refused(bad: dict[str, float]) -> None:
    with pytest.raises(BadInput):
        InterlockConfig(**bad)
