"""Each limit, word and time of the interlock alone: what mutants of it survived without (0049)."""

import math

import pytest

from taxel.actions.interlock import Interlock, InterlockConfig, InterlockState, OrderKind
from taxel.errors import BadInput

LIMITS = InterlockConfig(min_n=10.0, max_n=40.0)
CONTACT = InterlockConfig(min_n=0.0, max_n=1.0, contact_ma=300.0)
OVER = InterlockConfig(min_n=0.0, max_n=1.0, over_ma=900.0)


def armed(config: InterlockConfig = LIMITS, now_s: float = 100.0) -> Interlock:
    """Return an interlock that hears from everybody and was armed and ticked."""
    lock = Interlock(config)
    hear(lock, now_s)
    assert lock.arm(now_s) == ()
    lock.tick(now_s)
    return lock


def hear(lock: Interlock, now_s: float, word: str = "STABLE") -> None:
    lock.beat(now_s)
    lock.device(True, now_s)
    lock.contact_current(0.0, now_s)
    lock.decision(word, now_s)


def test_the_times_and_limits_are_those_that_decisions_0016_and_0030_name() -> None:
    named = {name: getattr(LIMITS, name) for name in (
        "slew_n_s", "expires_s", "watchdog_s", "decision_s", "stall_s", "step_s", "device_s",
        "contact_ma", "contact_s", "over_ma", "current_s",
    )}  # fmt: skip

    assert named == {
        "slew_n_s": 200.0, "expires_s": 0.1, "watchdog_s": 0.08, "decision_s": 0.3,
        "stall_s": 0.08, "step_s": 0.02, "device_s": 0.5, "contact_ma": None, "contact_s": 0.02,
        "over_ma": None, "current_s": 0.2,
    }  # fmt: skip


@pytest.mark.parametrize(
    "bad", [{"min_n": -0.5}, {"contact_s": -0.5}, {"contact_s": math.inf}, {"contact_ma": 0.0}]
)
def test_a_limit_below_zero_or_without_end_is_refused(bad: dict[str, float]) -> None:
    with pytest.raises(BadInput):
        InterlockConfig(**{"min_n": 0.0, "max_n": 4.0} | bad)


def test_equal_least_and_largest_forces_and_a_contact_that_counts_at_once_are_allowed() -> None:
    lock = armed(InterlockConfig(min_n=4.0, max_n=4.0, contact_ma=300.0, contact_s=0.0))
    lock.contact_current(300.0, 100.0)

    assert lock.reason == "contact: 300 mA for 0 s"


def test_a_fresh_interlock_is_disarmed_and_says_so() -> None:
    lock = Interlock(LIMITS)
    order = lock.tick(5.0)

    assert (lock.state, lock.reason, lock.disarms) == (InterlockState.DISARMED, "not armed", 0)
    assert (order.kind, order.reason, order.expires_s) == (OrderKind.NONE, "not armed", 5.1)
    assert math.isnan(order.force_n)
    assert lock.config is LIMITS


def test_an_order_without_a_usable_time_was_never_valid() -> None:
    assert Interlock(LIMITS).tick(math.nan).expires_s == -math.inf


@pytest.mark.parametrize(("word", "reason"), [
    ("STABLE", "the grasp is stable"), ("UNKNOWN", "the state of the grasp is unknown"),
    ("WARNING", "the grasp is WARNING"), ("UNSTABLE", "the grasp is UNSTABLE"),
])  # fmt: skip
def test_an_order_says_why(word: str, reason: str) -> None:
    lock = armed()
    hear(lock, 100.01, word)

    assert lock.tick(100.01).reason == reason


@pytest.mark.parametrize("word", ["stable", "", "NO_GRASP", "RAISE"])
def test_any_other_word_holds_the_force(word: str) -> None:
    lock = armed()
    hear(lock, 100.01, word)

    assert lock.tick(100.01).kind is OrderKind.HOLD
    assert lock.state is InterlockState.HOLDING


@pytest.mark.parametrize("word", ["STABLE", "WARNING"])
def test_a_decision_without_a_finite_time_is_unknown_and_is_none_that_came(word: str) -> None:
    lock = armed()
    hear(lock, 100.01, "STABLE")
    lock.decision(word, math.nan)

    assert lock.tick(100.01).kind is OrderKind.HOLD
    assert lock.state is InterlockState.HOLDING
    for now_s in (100.08, 100.15, 100.22, 100.29):
        lock.beat(now_s)
        lock.device(True, now_s)
        lock.decision(word, math.inf)
        assert lock.tick(now_s).kind is OrderKind.HOLD
    lock.beat(100.35)
    lock.device(True, 100.35)
    assert lock.tick(100.35).reason == "no decision for 0.3 s"


def test_contact_forbids_arming_until_the_current_falls_below_its_limit() -> None:
    lock = armed(CONTACT)
    lock.contact_current(300.0, 100.01)
    lock.contact_current(300.0, 100.03)
    assert lock.reason == "contact: 300 mA for 0.02 s"
    hear_all_but_current(lock, 100.04)
    assert lock.arm(100.04) == ("contact",)
    lock.contact_current(299.9, 100.05)
    hear_all_but_current(lock, 100.05)
    assert lock.arm(100.05) == ()


def hear_all_but_current(lock: Interlock, now_s: float) -> None:
    lock.beat(now_s)
    lock.device(True, now_s)
    lock.decision("STABLE", now_s)


def test_an_over_current_names_its_size_and_forbids_arming() -> None:
    lock = armed(OVER)
    lock.contact_current(899.9, 100.01)
    assert lock.state is InterlockState.READY
    lock.contact_current(-900.0, 100.02)
    assert lock.reason == "over-current: 900 mA"
    hear_all_but_current(lock, 100.02)
    assert lock.arm(100.02) == ("over-current",)


@pytest.mark.parametrize("config", [CONTACT, OVER])
def test_a_current_that_is_measured_must_be_read_in_time(config: InterlockConfig) -> None:
    """Each of the two limits alone wants readings; without either nobody waits for one."""
    for own, silent in ((config, "no current reading for 0.2 s"), (LIMITS, None)):
        lock = Interlock(own)
        hear_all_but_current(lock, 100.0)
        assert lock.arm(100.0) == (() if silent is None else (silent,))


def test_a_reading_at_no_finite_time_is_none_and_a_device_s_neither() -> None:
    lock = armed(OVER)
    lock.contact_current(0.0, math.nan)
    assert lock.tick(100.01).reason == "no current reading for 0.2 s"
    lock = armed()
    lock.device(True, math.nan)
    assert lock.tick(100.01).reason == "nothing from the actuator for 0.5 s"


@pytest.mark.parametrize(("ahead_s", "fine"), [(0.004, True), (0.006, False), (0.5, False)])
def test_a_beat_counts_up_to_5_ms_ahead_of_the_tick(ahead_s: float, fine: bool) -> None:
    lock = armed()
    hear(lock, 100.01)
    lock.beat(100.01 + ahead_s)

    assert (lock.tick(100.01).kind is OrderKind.HOLD) is fine


def test_a_beat_at_no_finite_time_is_not_heard() -> None:
    lock = armed()
    for now_s in (100.04, 100.08):
        lock.beat(math.nan)
        assert lock.tick(now_s).kind is OrderKind.HOLD
    assert lock.tick(100.09).reason == "no word from the decision maker for 0.08 s"


@pytest.mark.parametrize("now_s", [math.nan, math.inf, 99.0])
def test_a_clock_that_cannot_be_used_is_the_cause_that_is_reported(now_s: float) -> None:
    lock = armed()
    lock.tick(now_s)

    assert lock.reason == "the clock cannot be used"
    assert lock.arm(math.nan) == ("the clock cannot be used",)


def test_waking_in_time_is_no_stall_and_a_disarmed_stall_stops_nothing() -> None:
    lock = armed()
    assert lock.wake(100.08) == 0.0
    assert lock.state is InterlockState.READY
    lock.disarm(100.08)
    assert lock.wake(101.0) == 1.0
    assert (lock.state, lock.reason) == (InterlockState.DISARMED, "not armed")
    hear(lock, 101.0)
    assert lock.arm(101.0) == ()


def test_a_stall_whose_time_lies_ahead_of_the_clock_does_not_forbid_arming() -> None:
    lock = armed()
    assert lock.wake(101.0) == 1.0
    hear(lock, 100.0)

    assert lock.arm(100.0) == ()


def test_a_key_counts_again_half_a_second_after_a_stall() -> None:
    lock = armed()
    lock.tick(101.0)
    for now_s, causes in ((101.49, ("ticks stood still less than 0.5 s ago",)), (101.5, ())):
        hear(lock, now_s)
        assert lock.arm(now_s) == causes


def test_arming_twice_changes_nothing_and_hears_of_causes() -> None:
    lock = armed()
    hear(lock, 100.01, "WARNING")
    lock.tick(100.01)
    assert lock.arm(100.02) == ()
    assert lock.state is InterlockState.RAISED
    lock.beat(99.0)
    assert lock.arm(100.02) == ("no word from the decision maker for 0.08 s",)


def test_each_person_who_disarms_is_counted_once() -> None:
    lock = Interlock(LIMITS)
    for by in ("ann", "bob", "bob", "ann"):
        lock.disarm(1.0, by)

    assert (lock.disarms, lock.reason) == (3, "disarmed by ann")


@pytest.mark.parametrize("ticked", ["WARNING", "UNSTABLE", "UNKNOWN"])
def test_force_is_released_only_where_state_and_newest_decision_are_calm(ticked: str) -> None:
    """READY that has heard of danger, and danger that has heard of calm, both keep the force."""
    lock = armed()
    assert lock.release(30.0)
    lock.decision(ticked, 100.01)
    assert not lock.release(20.0)
    hear(lock, 100.02, ticked)
    lock.tick(100.02)
    lock.decision("STABLE", 100.03)
    assert not lock.release(20.0)
    hear(lock, 100.03)
    lock.tick(100.03)
    assert lock.release(20.0)
    assert lock.force_n == 20.0


def test_a_release_is_kept_within_the_limits_and_a_disarmed_one_is_taken() -> None:
    lock = Interlock(LIMITS)
    assert (lock.release(99.0), lock.force_n) == (True, 40.0)
    assert (lock.release(1.0), lock.force_n) == (True, 10.0)


@pytest.mark.parametrize("force_n", [math.nan, math.inf, -math.inf])
def test_a_release_to_no_finite_force_is_refused(force_n: float) -> None:
    lock = armed()
    assert not lock.release(force_n)
    assert lock.force_n == 10.0


def test_a_stopped_interlock_takes_no_release_at_all() -> None:
    lock = armed()
    lock.fault("a test", 100.01)

    assert not lock.release(20.0)
    assert lock.force_n == 10.0


def test_the_first_fault_is_reported_and_each_must_go_before_arming() -> None:
    lock = armed()
    lock.fault("a", 100.0)
    lock.fault("b", 100.0)
    assert lock.reason == "a"
    assert lock.arm(100.0) == ("a", "b")
    lock.fault_gone("b")
    lock.fault_gone("never heard of")
    assert lock.arm(100.0) == ("a",)


def test_a_stopped_order_keeps_the_force_and_an_armed_one_expires() -> None:
    lock = armed()
    lock.release(30.0)
    hear(lock, 100.01)
    held = lock.tick(100.01)
    assert (held.kind, held.force_n) == (OrderKind.HOLD, 30.0)
    assert held.expires_s == pytest.approx(100.11)
    lock.fault("a test", 100.02)
    stopped = lock.tick(100.02)
    assert (stopped.kind, stopped.force_n, stopped.expires_s) == (OrderKind.STOP, 30.0, math.inf)
