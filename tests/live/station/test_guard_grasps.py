"""Several grasps under one guard: each alarms by itself."""

import pytest
from guard_rig import Rig, note

from taxel.actions.alarm import Level


def test_a_grasp_that_slips_beside_one_whose_alarm_was_acknowledged_is_a_new_alarm():
    """Both are one state: the second slipped without a sound while the first was still unstable."""
    rig = Rig("monitor 1/0", "monitor 2/0")
    rig.decide("monitor 1/0", note("UNSTABLE"))
    rig.decide("monitor 2/0", note("STABLE"))
    rig.run(0.05)
    rig.guard.alarms.acknowledge_seen(None, rig.now_s)
    rig.run(0.05)
    (first,) = rig.guard.alarms.alarms
    assert first.acknowledged
    for state in ("WARNING", "UNSTABLE"):
        rig.decide("monitor 2/0", note(state))
        rig.run(0.05)
        (alarm,) = rig.guard.alarms.alarms
        assert (alarm.kind, alarm.level, alarm.acknowledged) == ("grasp", Level.DANGER, False)
        rig.guard.alarms.acknowledge_seen(None, rig.now_s)
    rig.run(0.05)
    (alarm,) = rig.guard.alarms.alarms
    assert alarm.acknowledged  # as long as nothing gets worse


def test_a_grasp_that_is_unknown_between_two_words_that_it_slips_alarms_once():
    rig = Rig("monitor 1/0", "monitor 2/0")
    rig.decide("monitor 2/0", note("STABLE"))
    for state in ("UNSTABLE", "UNKNOWN", "WARNING", "UNSTABLE"):
        rig.decide("monitor 1/0", note(state, reason="no frame for 120 ms"))
        rig.run(0.05)
        rig.guard.alarms.acknowledge_seen(None, rig.now_s)
    assert rig.guard.alarms.counts.raised == 1


def test_two_monitors_of_one_grasp_raise_one_alarm():
    rig = Rig("monitor/0", "monitor/1")
    rig.decide("monitor/1", note("STABLE"))
    rig.decide("monitor/0", note("UNSTABLE"))
    rig.run(0.05)
    rig.guard.alarms.acknowledge_seen(None, rig.now_s)
    rig.decide("monitor/1", note("UNSTABLE"))
    rig.run(0.05)
    assert rig.guard.alarms.counts.raised == 1


@pytest.mark.parametrize("who", ["monitor 1/0", ""])
def test_a_new_grasp_that_slips_beside_one_that_alarms_is_a_new_alarm(who: str):
    """It was as bad as the grasp before, which was never calm: it slipped without a sound."""
    rig = Rig("monitor 1/0", "monitor 2/0")
    for name in rig.names:
        rig.decide(name, note("UNSTABLE"))
    rig.run(0.05)
    rig.guard.alarms.acknowledge_seen(None, rig.now_s)
    rig.guard.new_grasp(who)
    rig.run(0.05)
    assert rig.guard.alarms.sounding is None  # what is heard is still of the grasp before
    rig.decide("monitor 1/0", note("UNKNOWN", reason="settling"))
    rig.run(0.05)
    assert rig.guard.alarms.sounding is None
    rig.decide("monitor 1/0", note("WARNING"))
    rig.run(0.05)
    (alarm,) = rig.guard.alarms.alarms
    assert (alarm.kind, alarm.level, alarm.acknowledged) == ("grasp", Level.DANGER, False)


def test_a_new_grasp_of_another_pair_of_cameras_renews_no_alarm():
    rig = Rig("monitor 1/0", "monitor 2/0")
    for name in rig.names:
        rig.decide(name, note("UNSTABLE"))
    rig.run(0.05)
    rig.guard.alarms.acknowledge_seen(None, rig.now_s)
    rig.guard.new_grasp("monitor 1/0")
    for state in ("UNKNOWN", "UNSTABLE"):
        rig.decide("monitor 2/0", note(state, reason="no frame for 120 ms"))
        rig.run(0.05)
    assert rig.guard.alarms.sounding is None
