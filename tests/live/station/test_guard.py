"""The guard: the worst of all monitors is shown, silence stops, alarms wait for a person."""

from __future__ import annotations

from typing import Any

import pytest
from guard_rig import LIMIT_S, Rig, note

from taxel.actions.alarm import Level
from taxel.actions.interlock import InterlockState, OrderKind
from taxel.decisions.reasons import REASONS
from taxel.gel.slip_signal import Slip
from taxel.live.station.snapshots import guard_snapshot


def test_without_a_monitor_nothing_is_claimed():
    rig = Rig()
    rig.run(0.1)
    assert rig.guard.shown[0] == "NONE"


def test_a_monitor_that_has_said_nothing_is_unknown_never_stable():
    rig = Rig("left")
    rig.run(0.5)
    assert rig.guard.shown[:2] == ("UNKNOWN", "no input yet")


def test_a_score_and_a_probability_are_not_compared_with_each_other():
    rig = Rig("forecast", "head")
    rig.decide("forecast", note("STABLE", p=0.7, is_score=True))
    rig.decide("head", note("STABLE", p=0.2))
    rig.run(0.1)
    assert (rig.guard.score, rig.guard.probability) == (0.7, 0.2)
    assert guard_snapshot(rig.guard, rig.now_s)["score"] == 0.7


@pytest.mark.parametrize(
    ("states", "shown"),
    [
        (("STABLE", "STABLE"), "STABLE"),
        (("STABLE", "UNKNOWN"), "UNKNOWN"),
        (("WARNING", "UNKNOWN"), "WARNING"),
        (("UNSTABLE", "STABLE"), "UNSTABLE"),
        (("STABLE", "what?"), "UNKNOWN"),
        (("STABLE", "NO GRASP"), "UNKNOWN"),
    ],
)
def test_the_worst_of_several_monitors_is_shown(states: tuple[str, str], shown: str):
    rig = Rig("one", "two")
    for name, state in zip(rig.names, states, strict=True):
        rig.decide(name, note(state))
    rig.run(0.01)
    assert rig.guard.shown[0] == shown


def test_between_two_grasps_an_armed_gripper_holds_and_nothing_is_alarmed():
    """NO GRASP is no fault and no good news: no STOP, no raise, no lowering, no arming of trust."""
    rig = Rig("one")
    rig.decide("one", note("STABLE"))
    rig.run(0.2)
    assert rig.guard.interlock.arm(rig.now_s) == ()
    rig.run(0.01)
    assert rig.guard.interlock.release(30.0)
    before_n = rig.guard.interlock.force_n
    rig.decide("one", note("NO_GRASP", reason="the grasp has ended: nothing is held"))
    for _ in range(30):
        order = rig.run(0.1)
        assert (order.kind, order.force_n) == (OrderKind.HOLD, before_n)
        assert rig.guard.interlock.state is InterlockState.HOLDING
        assert not rig.guard.interlock.release(20.0)
    assert rig.guard.shown[:2] == ("NO GRASP", "the grasp has ended: nothing is held")
    assert rig.guard.alarms.alarms == ()


def test_no_grasp_hides_no_fault_of_another_monitor():
    rig = Rig("one", "two")
    for other, shown in (("UNKNOWN", "UNKNOWN"), ("UNSTABLE", "UNSTABLE"), ("STABLE", "NO GRASP")):
        rig.decide("one", note("NO_GRASP"))
        rig.decide("two", note(other))
        rig.run(0.01)
        assert rig.guard.shown[0] == shown


def test_a_silent_monitor_stops_within_the_limit_and_alarms_although_it_said_stable():
    rig = Rig("one", "two")
    for name in rig.names:
        rig.decide(name, note("STABLE"))
    rig.run(0.2)
    assert rig.guard.interlock.arm(rig.now_s) == ()
    rig.silent.add("two")
    order = rig.run(LIMIT_S + 0.002)
    assert rig.guard.shown[:2] == ("STOP", "two has not answered for 0.06 s")
    assert order.kind is OrderKind.STOP
    assert rig.guard.interlock.state is InterlockState.STOPPED
    assert [a.kind for a in rig.guard.alarms.alarms if a.kind == "monitor"] == ["monitor"]


def test_while_any_input_is_lost_nothing_is_called_stable_however_sure_the_monitors_are():
    """An input alarm may be raised by others too, such as who watches a cable."""
    rig = Rig("one")
    rig.decide("one", note("STABLE"))
    rig.run(0.1)
    rig.guard.alarms.set("cable", Level.DANGER, "a cable is out", rig.now_s, input=True)
    rig.run(0.01)
    assert rig.guard.shown[:2] == ("UNKNOWN", REASONS["alarm"].say())
    rig.guard.alarms.clear("cable", rig.now_s)
    rig.run(0.01)
    assert rig.guard.shown[:2] == ("STABLE", "")


def test_a_dead_monitor_stops_at_the_next_tick():
    rig = Rig("one")
    rig.decide("one", note("STABLE"))
    rig.run(0.1)
    rig.guard.died("one")
    rig.run(0.001)
    assert rig.guard.shown[:2] == ("STOP", "one has ended")


def test_decisions_that_stop_coming_stop_within_a_tick_of_their_life_while_beats_go_on():
    rig = Rig("one", "two")
    for name in rig.names:
        rig.decide(name, note("STABLE"))
    rig.run(0.2)
    assert rig.guard.interlock.arm(rig.now_s) == ()
    rig.mute.add("two")
    life_s = rig.guard.interlock.config.decision_s
    assert rig.run(life_s - 0.001).kind is OrderKind.HOLD
    assert rig.run(0.003).kind is OrderKind.STOP
    assert rig.guard.shown[:2] == ("STOP", "two lives and decides nothing")
    assert [a.kind for a in rig.guard.alarms.alarms if a.kind == "monitor"] == ["monitor"]


@pytest.mark.parametrize("decided_s", [None, "now", float("nan"), float("inf"), 99.0, 1e9])
def test_a_decision_without_a_time_of_its_own_keeps_nothing_alive(decided_s: object):
    """Neither one without a time, nor an old one that is told again, nor one from the future."""
    rig = Rig("one")
    rig.decide("one", note("STABLE"))
    rig.run(0.2)
    assert rig.guard.interlock.arm(rig.now_s) == ()
    rig.mute.add("one")
    for _ in range(350):
        rig.guard.decide("one", note("STABLE", decided_s=decided_s))
        order = rig.run(0.001)
    assert order.kind is OrderKind.STOP


def test_in_a_long_step_that_was_announced_the_guard_says_unknown_and_never_raises():
    rig = Rig("one")
    rig.decide("one", note("WARNING"))
    rig.run(0.2)
    rig.guard.interlock.arm(rig.now_s)
    rig.run(0.1)
    rig.silent.add("one")
    rig.guard.beat("one", rig.now_s, patience_s=1.0)
    order = rig.run(0.9)
    assert rig.guard.shown[:2] == ("UNKNOWN", "one is in a step that takes long")
    assert order.kind is OrderKind.HOLD


def test_a_warning_is_shown_although_another_monitor_is_in_a_long_step():
    rig = Rig("one", "two")
    rig.decide("one", note("WARNING"))
    rig.run(0.2)
    rig.silent.add("two")
    rig.guard.beat("two", rig.now_s, patience_s=1.0)
    rig.run(0.5)
    assert rig.guard.shown[0] == "WARNING"


def test_a_stall_of_the_supervisor_stops_alarms_and_raises_nothing_afterwards():
    """Monitors live on and call the grasp unstable: nobody has heard them for a second."""
    rig = Rig("one")
    rig.decide("one", note("STABLE"))
    rig.run(0.2)
    rig.guard.interlock.arm(rig.now_s)
    rig.decide("one", note("UNSTABLE"))
    held_n = rig.run(0.05).force_n
    rig.now_s += 1.0
    order = rig.run(0.001)
    assert (order.kind, order.force_n) == (OrderKind.STOP, held_n)
    (alarm,) = [a for a in rig.guard.alarms.alarms if a.kind == "supervisor"]
    assert alarm.text == "the supervisor stood still for 1.00 s: nobody watched the grasp"
    assert rig.run(2.0).kind is OrderKind.STOP
    (alarm,) = [a for a in rig.guard.alarms.alarms if a.kind == "supervisor"]
    assert (alarm.on, alarm.acknowledged) == (False, False)


def test_a_raise_begins_at_the_force_that_the_robot_took_over_with_although_less_than_before():
    rig = Rig("one")
    rig.decide("one", note("STABLE"))
    rig.run(0.1)
    rig.guard.interlock.arm(rig.now_s)
    rig.decide("one", note("UNSTABLE"))
    assert rig.run(0.5).force_n == 50.0
    rig.decide("one", note("STABLE"))
    rig.run(0.1)
    assert rig.guard.interlock.release(20.0)
    rig.run(0.1)
    rig.decide("one", note("WARNING"))
    assert rig.run(0.25).force_n == 30.0


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
    rig.decide("one", note("STABLE"))
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
    rig.decide("one", note("STABLE"))
    rig.run(0.1)
    rig.guard.interlock.arm(rig.now_s)
    rig.decide("one", note("WARNING"))
    order = rig.run(0.2)
    assert order.kind is OrderKind.GRIP
    raised_n = order.force_n
    assert 15.0 < raised_n <= 50.0
    rig.decide("one", note("STABLE"))
    order = rig.run(0.2)
    assert order.kind is OrderKind.HOLD
    assert order.force_n == raised_n


def test_the_alarm_of_an_unstable_grasp_waits_for_a_person_when_it_is_over():
    rig = Rig("one")
    rig.decide("one", note("UNSTABLE"))
    rig.run(0.01)
    rig.decide("one", note("STABLE"))
    rig.run(0.01)
    (alarm,) = rig.guard.alarms.alarms
    assert (alarm.kind, alarm.on, alarm.acknowledged) == ("grasp", False, False)


def test_a_strong_gripper_is_raised_to_its_own_limit():
    rig = Rig("one", least_n=60.0, most_n=300.0)
    rig.decide("one", note("STABLE"))
    rig.run(0.1)
    rig.guard.interlock.arm(rig.now_s)
    rig.decide("one", note("UNSTABLE"))
    order = rig.run(5.0)
    assert (order.kind, order.force_n) == (OrderKind.GRIP, 300.0)


def test_a_raise_begins_at_the_force_that_the_robot_has_set():
    rig = Rig("one")
    rig.decide("one", note("STABLE"))
    rig.run(0.1)
    assert rig.guard.interlock.release(30.0)
    rig.guard.interlock.arm(rig.now_s)
    rig.decide("one", note("WARNING"))
    order = rig.run(0.25)
    assert order.kind is OrderKind.GRIP
    assert order.force_n == 40.0


def test_warnings_before_arming_raise_nothing_afterwards():
    rig = Rig("one")
    rig.decide("one", note("WARNING"))
    rig.run(3.0)
    rig.decide("one", note("STABLE"))
    rig.run(0.1)
    rig.guard.interlock.arm(rig.now_s)
    rig.decide("one", note("WARNING"))
    assert rig.run(0.25).force_n == 25.0


def slip(mm: float, seen: bool = True) -> dict[str, Any]:
    return Slip(mm, 0.3, 0.5, 0.01, 0.03, 0.1, seen).as_dict()


def test_the_largest_slip_of_all_monitors_is_reported_with_the_decision():
    rig = Rig("one", "two", "three")
    rig.decide("one", note("STABLE", slip=slip(0.25)))
    rig.decide("two", note("WARNING", slip=slip(0.12)))
    rig.decide("three", note("STABLE"))
    rig.run(0.01)

    assert rig.guard.decision.state.name == "WARNING"
    assert rig.guard.decision.slip is not None
    assert rig.guard.decision.slip.words == "slip 0.25 mm, 0.3 mm/s"


def test_slip_that_was_not_followed_never_hides_slip_that_was():
    rig = Rig("one", "two")
    rig.decide("one", note("STABLE", slip=slip(0.9, seen=False)))
    rig.decide("two", note("STABLE", slip=slip(0.1)))
    rig.run(0.01)

    assert rig.guard.slip is not None
    assert rig.guard.slip.distance_mm == 0.1


@pytest.mark.parametrize("broken", [{}, {"slip_mm": "far"}, None, 3])
def test_a_note_whose_slip_cannot_be_read_reports_none_and_stops_nothing(broken: Any):
    rig = Rig("one")
    rig.decide("one", note("STABLE", slip=broken))
    rig.run(0.01)

    assert rig.guard.slip is None
    assert rig.guard.shown[0] == "STABLE"


def armed_rig(*names: str) -> Rig:
    """Return a rig whose monitors have said STABLE and whose gripper is armed."""
    rig = Rig(*names)
    for name in names:
        rig.decide(name, note("STABLE"))
    rig.run(0.2)
    assert rig.guard.interlock.arm(rig.now_s) == ()
    return rig


def test_slip_that_one_monitor_measures_softens_nothing_that_another_warns_of():
    """The monitor of slip asks for a step, the other for the large one: the larger is given."""
    for other, least_n in ((None, 25.0), (note("UNSTABLE"), 50.0)):
        rig = armed_rig("one", "two")
        rig.decide("one", note("UNSTABLE", slip=slip(0.3)))
        if other is not None:
            rig.decide("two", other)
        assert rig.run(0.5).force_n == least_n


def test_a_still_slip_of_one_monitor_hides_no_advancing_slip_of_another():
    rig = armed_rig("one", "two")
    rig.decide("one", note("UNSTABLE", slip=slip(0.9)))
    for number in range(6):
        rig.decide("two", note("WARNING", slip=slip(0.12 * number)))
        order = rig.run(0.2)
    assert order.force_n == 50.0
