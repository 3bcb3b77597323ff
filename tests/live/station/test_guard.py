"""The guard: the worst of all monitors is shown, silence stops, alarms wait for a person."""

from __future__ import annotations

from typing import Any

import pytest

from taxel.actions.grip_policy import GripPolicy, GripPolicyConfig
from taxel.actions.interlock import Interlock, InterlockConfig, InterlockState, OrderKind
from taxel.live.station.guard import Guard, GuardConfig

LIMIT_S = GuardConfig().silent_s


def note(state: str, **more: Any) -> dict[str, Any]:
    return {"kind": "grasp", "state": state, "reason": "", "since_s": 0.0, "p": 0.1, **more}


class Rig:
    """A guard with monitors that beat every millisecond unless told otherwise."""

    def __init__(self, *names: str, least_n: float = 15.0, most_n: float = 50.0) -> None:
        interlock = Interlock(InterlockConfig(min_n=least_n, max_n=most_n))
        policy = GripPolicy(least_n, GripPolicyConfig(most_n=most_n))
        self.guard = Guard(interlock, policy=policy)
        self.now_s = 100.0
        self.silent: set[str] = set()
        self.names = names
        for name in names:
            self.guard.expect(name, self.now_s)

    def run(self, seconds: float) -> Any:
        order = None
        for _ in range(round(seconds * 1000)):
            self.now_s += 0.001
            for name in self.names:
                if name not in self.silent:
                    self.guard.beat(name, self.now_s)
            self.guard.interlock.device(True, self.now_s)
            order = self.guard.tick(self.now_s)
        return order


def test_without_a_monitor_nothing_is_claimed():
    rig = Rig()
    rig.run(0.1)
    assert rig.guard.shown[0] == "NONE"


def test_a_monitor_that_has_said_nothing_is_unknown_never_stable():
    rig = Rig("left")
    rig.run(0.5)
    assert rig.guard.shown[:2] == ("UNKNOWN", "no input yet")


@pytest.mark.parametrize(
    ("states", "shown"),
    [
        (("STABLE", "STABLE"), "STABLE"),
        (("STABLE", "UNKNOWN"), "UNKNOWN"),
        (("WARNING", "UNKNOWN"), "WARNING"),
        (("UNSTABLE", "STABLE"), "UNSTABLE"),
        (("STABLE", "what?"), "UNKNOWN"),
    ],
)
def test_the_worst_of_several_monitors_is_shown(states: tuple[str, str], shown: str):
    rig = Rig("one", "two")
    for name, state in zip(rig.names, states, strict=True):
        rig.guard.decide(name, note(state))
    rig.run(0.01)
    assert rig.guard.shown[0] == shown


def test_a_silent_monitor_stops_within_the_limit_and_alarms_although_it_said_stable():
    rig = Rig("one", "two")
    for name in rig.names:
        rig.guard.decide(name, note("STABLE"))
    rig.run(0.2)
    assert rig.guard.interlock.arm(rig.now_s) == ()
    rig.silent.add("two")
    order = rig.run(LIMIT_S + 0.002)
    assert rig.guard.shown[:2] == ("STOP", "two gives no sign of life")
    assert order.kind is OrderKind.STOP
    assert rig.guard.interlock.state is InterlockState.STOPPED
    assert [a.kind for a in rig.guard.alarms.alarms if a.kind == "monitor"] == ["monitor"]


def test_a_dead_monitor_stops_at_the_next_tick():
    rig = Rig("one")
    rig.guard.decide("one", note("STABLE"))
    rig.run(0.1)
    rig.guard.died("one")
    rig.run(0.001)
    assert rig.guard.shown[:2] == ("STOP", "one has ended")


def test_a_monitor_in_a_long_step_that_it_announced_is_left_alone_that_long():
    rig = Rig("one")
    rig.silent.add("one")
    rig.guard.beat("one", rig.now_s, patience_s=0.5)
    rig.run(0.49)
    assert rig.guard.shown[0] == "UNKNOWN"
    rig.run(0.02)
    assert rig.guard.shown[0] == "STOP"


def test_after_a_stop_only_a_person_arms_again_and_not_while_the_monitor_is_silent():
    rig = Rig("one")
    rig.guard.decide("one", note("STABLE"))
    rig.run(0.1)
    rig.guard.interlock.arm(rig.now_s)
    rig.silent.add("one")
    rig.run(0.2)
    assert rig.guard.interlock.arm(rig.now_s) != ()
    rig.silent.clear()
    rig.run(0.5)
    assert rig.guard.shown[0] == "STOP"
    assert rig.guard.interlock.arm(rig.now_s) == ()
    rig.run(0.01)
    assert rig.guard.shown[0] == "STABLE"


def test_a_warning_raises_the_grip_within_its_limits_and_stable_does_not_lower_it():
    rig = Rig("one")
    rig.guard.decide("one", note("STABLE"))
    rig.run(0.1)
    rig.guard.interlock.arm(rig.now_s)
    rig.guard.decide("one", note("WARNING"))
    order = rig.run(0.2)
    assert order.kind is OrderKind.GRIP
    raised_n = order.force_n
    assert 15.0 < raised_n <= 50.0
    rig.guard.decide("one", note("STABLE"))
    order = rig.run(0.2)
    assert order.kind is OrderKind.HOLD
    assert order.force_n == raised_n


def test_the_alarm_of_an_unstable_grasp_waits_for_a_person_when_it_is_over():
    rig = Rig("one")
    rig.guard.decide("one", note("UNSTABLE"))
    rig.run(0.01)
    rig.guard.decide("one", note("STABLE"))
    rig.run(0.01)
    (alarm,) = rig.guard.alarms.alarms
    assert (alarm.kind, alarm.on, alarm.acknowledged) == ("grasp", False, False)


def test_a_strong_gripper_is_raised_to_its_own_limit():
    rig = Rig("one", least_n=60.0, most_n=300.0)
    rig.guard.decide("one", note("STABLE"))
    rig.run(0.1)
    rig.guard.interlock.arm(rig.now_s)
    rig.guard.decide("one", note("UNSTABLE"))
    order = rig.run(5.0)
    assert (order.kind, order.force_n) == (OrderKind.GRIP, 300.0)


def test_a_raise_begins_at_the_force_that_the_robot_has_set():
    rig = Rig("one")
    rig.guard.decide("one", note("STABLE"))
    rig.run(0.1)
    assert rig.guard.interlock.release(30.0)
    rig.guard.interlock.arm(rig.now_s)
    rig.guard.decide("one", note("WARNING"))
    order = rig.run(0.25)
    assert order.kind is OrderKind.GRIP
    assert order.force_n == 40.0


def test_warnings_before_arming_raise_nothing_afterwards():
    rig = Rig("one")
    rig.guard.decide("one", note("WARNING"))
    rig.run(3.0)
    rig.guard.decide("one", note("STABLE"))
    rig.run(0.1)
    rig.guard.interlock.arm(rig.now_s)
    rig.guard.decide("one", note("WARNING"))
    assert rig.run(0.25).force_n == 25.0
