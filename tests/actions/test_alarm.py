"""An alarm stays until a person has acknowledged it, and hides behind nothing."""

import json
import math

from hypothesis import given
from hypothesis import strategies as st

from taxel.actions.alarm import BEGINNING_S, EARLIER, GRASP, INPUT, AlarmLatch, Level
from taxel.decisions.reasons import REASONS
from taxel.decisions.stability import Stability, StabilityDecision

STABLE, WARNING, UNSTABLE, UNKNOWN, NO_GRASP = Stability


def decided(state: Stability, reason: str = "") -> StabilityDecision:
    return StabilityDecision(state, reason, 0.0, 0.5)


def test_an_alarm_whose_condition_goes_stays_until_it_is_acknowledged() -> None:
    latch = AlarmLatch()
    alarm = latch.set("heat", Level.WARNING, "motor at 80 °C", 1.0)
    latch.clear("heat", 2.0)

    (left,) = latch.alarms
    assert (left.state, left.since_s, left.gone_s) == ("gone, not acknowledged", 1.0, 2.0)
    assert latch.acknowledge(alarm.number, 3.0)
    assert latch.alarms == ()


def test_an_acknowledged_alarm_that_is_still_on_stays_visible_and_silent() -> None:
    latch = AlarmLatch()
    alarm = latch.set("heat", Level.DANGER, "motor at 120 °C", 1.0)
    latch.acknowledge(alarm.number, 2.0)
    latch.set("heat", Level.DANGER, "motor at 121 °C", 3.0)

    (left,) = latch.alarms
    assert (left.state, left.text, left.number) == (
        "acknowledged, still on",
        "motor at 121 °C",
        alarm.number,
    )
    assert latch.sounding is None


def test_a_condition_that_goes_and_returns_after_acknowledgement_alarms_again() -> None:
    latch = AlarmLatch()
    first = latch.set("heat", Level.WARNING, "hot", 1.0)
    latch.acknowledge(first.number, 2.0)
    latch.clear("heat", 3.0)
    assert latch.alarms == ()
    second = latch.set("heat", Level.WARNING, "hot", 4.0)

    assert second.number == first.number + 1
    assert latch.sounding is Level.WARNING
    assert latch.counts.raised == 2


def test_an_acknowledged_warning_that_becomes_danger_alarms_again() -> None:
    latch = AlarmLatch()
    latch.acknowledge(latch.set("heat", Level.WARNING, "hot", 1.0).number, 2.0)
    worse = latch.set("heat", Level.DANGER, "very hot", 3.0)

    assert not worse.acknowledged
    assert latch.sounding is Level.DANGER


def test_an_alarm_keeps_its_worst_level_until_a_person_has_seen_it() -> None:
    latch = AlarmLatch()
    latch.set("heat", Level.DANGER, "very hot", 1.0)

    assert latch.set("heat", Level.WARNING, "hot", 2.0).level is Level.DANGER


def test_a_flapping_condition_is_one_alarm_until_acknowledged() -> None:
    latch = AlarmLatch()
    for i in range(10):
        latch.set("heat", Level.WARNING, "hot", float(i))
        latch.clear("heat", i + 0.5)

    assert latch.counts.raised == 1


def test_a_person_cannot_acknowledge_what_they_did_not_see() -> None:
    """The number on the page belongs to the old alarm; the new one keeps sounding."""
    latch = AlarmLatch()
    old = latch.set("heat", Level.WARNING, "hot", 1.0)
    latch.acknowledge(old.number, 2.0)
    latch.clear("heat", 3.0)
    latch.set("heat", Level.DANGER, "very hot", 4.0)

    assert not latch.acknowledge(old.number, 5.0)
    assert latch.sounding is Level.DANGER


def test_alarms_that_wait_come_first_then_the_worst_then_the_newest() -> None:
    latch = AlarmLatch()
    seen = latch.set("seen", Level.DANGER, "seen", 1.0)
    latch.acknowledge(seen.number, 1.0)
    latch.set("old", Level.DANGER, "old", 2.0)
    latch.set("mild", Level.WARNING, "mild", 3.0)
    latch.set("new", Level.DANGER, "new", 4.0)

    assert [alarm.kind for alarm in latch.alarms] == ["new", "old", "mild", "seen"]


def test_input_lost_is_an_alarm_only_while_armed() -> None:
    latch = AlarmLatch()
    latch.watch(decided(UNKNOWN, "the newest input is 0.30 s old"), armed=False, now_s=1.0)
    assert latch.alarms == ()
    latch.watch(decided(UNKNOWN, "the newest input is 0.30 s old"), armed=True, now_s=1.0)

    (alarm,) = latch.alarms
    assert (alarm.kind, alarm.level) == (INPUT, Level.DANGER)
    assert alarm.text == "no decision: the newest input is 0.30 s old"


def test_the_first_moments_of_each_grasp_are_no_alarm() -> None:
    """While armed each new cup raised an alarm that a person had to acknowledge."""
    latch = AlarmLatch()
    for grasp_s in (0.0, 10.0, 20.0):
        for step in range(4):
            reason = REASONS["settling"].say(left_s=0.4 - 0.1 * step)
            latch.watch(decided(UNKNOWN, reason), True, grasp_s + 0.1 * step)
        latch.watch(decided(UNKNOWN, REASONS["window"].say(left_s=0.1)), True, grasp_s + 0.5)
        latch.watch(decided(STABLE), True, grasp_s + 0.6)

    assert latch.alarms == ()


def test_a_grasp_that_does_not_get_beyond_its_first_moments_is_an_alarm() -> None:
    latch = AlarmLatch()
    reason = REASONS["settling"].say(left_s=0.4)
    for now_s in (1.0, 2.0, 1.0 + BEGINNING_S):
        latch.watch(decided(UNKNOWN, reason), True, now_s)
        assert latch.alarms == ()
    latch.watch(decided(UNKNOWN, reason), True, 1.1 + BEGINNING_S)

    (alarm,) = latch.alarms
    assert (alarm.kind, alarm.level, alarm.on) == (INPUT, Level.DANGER, True)


def test_input_that_is_lost_again_and_again_stays_an_alarm() -> None:
    latch = AlarmLatch()
    latch.watch(decided(UNKNOWN, "the left camera is gone"), True, 1.0)
    latch.watch(decided(UNKNOWN, REASONS["settling"].say(left_s=0.4)), True, 1.5)
    assert [alarm.state for alarm in latch.alarms] == ["gone, not acknowledged"]
    latch.watch(decided(UNKNOWN, "the left camera is gone"), True, 2.0)

    assert [alarm.state for alarm in latch.alarms] == ["on"]


def test_unknown_does_not_clear_the_alarm_of_a_slipping_grasp() -> None:
    latch = AlarmLatch()
    latch.watch(decided(UNSTABLE), True, 1.0)
    latch.watch(decided(UNKNOWN), True, 2.0)

    assert {alarm.kind: alarm.on for alarm in latch.alarms} == {GRASP: True, INPUT: True}


def test_stable_is_never_shown_while_an_input_alarm_is_on_even_acknowledged() -> None:
    latch = AlarmLatch()
    alarm = latch.set("camera left", Level.DANGER, "the left camera is gone", 1.0, input=True)
    latch.acknowledge(alarm.number, 2.0)

    assert latch.shown(STABLE) is UNKNOWN
    assert latch.shown(WARNING) is WARNING
    latch.clear("camera left", 3.0)
    assert latch.shown(STABLE) is STABLE


def test_a_broken_clock_loses_no_alarm_and_no_json() -> None:
    latch = AlarmLatch()
    latch.set("heat", Level.WARNING, "hot", 7.0)
    latch.set("cold", Level.DANGER, "cold", math.nan)

    page = json.loads(json.dumps(latch.as_json(), allow_nan=False))
    assert [(alarm["kind"], alarm["since_s"]) for alarm in page["alarms"]] == [
        ("cold", 7.0),
        ("heat", 7.0),
    ]
    assert page["sounding"] == "danger"
    assert page["counts"] == {"raised": 2, "acknowledged": 0, "waiting": 2, "on": 2}


EVENTS = st.one_of(
    st.tuples(st.just("watch"), st.sampled_from(Stability), st.booleans()),
    st.tuples(st.just("acknowledge"), st.integers(1, 12), st.none()),
)


@given(st.lists(EVENTS, max_size=60))
def test_counts_add_up_and_no_danger_leaves_unacknowledged(events: list[tuple]) -> None:  # type: ignore[type-arg]
    """Whatever comes in whatever order: raised ≥ acknowledged + waiting, and only a person takes
    an alarm away, or lessens what the worst of them is."""
    latch = AlarmLatch()
    for i, (kind, one, two) in enumerate(events):
        if kind == "watch":
            before, loud = latch.counts.waiting, latch.sounding
            if two:
                latch.new_grasp()
            latch.watch(decided(one), two, float(i))
            assert latch.counts.waiting >= before
            assert loud is not Level.DANGER or latch.sounding is loud
            if one is UNKNOWN and two:
                assert latch.shown(STABLE) is UNKNOWN
        else:
            latch.acknowledge(one, float(i))
        counts = latch.counts
        assert counts.raised >= counts.acknowledged + counts.waiting
        assert counts.waiting == sum(a.count for a in latch.alarms if not a.acknowledged)
        assert len(latch.alarms) <= 3
        assert (latch.sounding is None) == (counts.waiting == 0)


def test_a_grasp_s_acknowledged_alarm_does_not_silence_the_next_grasp_s() -> None:
    """Between the two nothing was STABLE: the first ended while it slipped."""
    latch = AlarmLatch()
    latch.watch(decided(UNSTABLE), armed=True, now_s=1.0)
    latch.acknowledge(latch.alarms[0].number, 2.0)
    latch.watch(decided(NO_GRASP), armed=True, now_s=3.0)
    assert latch.alarms == ()
    latch.watch(decided(UNSTABLE), armed=True, now_s=4.0)
    assert latch.sounding is Level.DANGER


def test_an_alarm_that_nobody_acknowledged_outlives_its_grasp() -> None:
    latch = AlarmLatch()
    latch.watch(decided(UNSTABLE), armed=True, now_s=1.0)
    latch.watch(decided(NO_GRASP), armed=True, now_s=3.0)
    assert [alarm.state for alarm in latch.alarms] == ["gone, not acknowledged"]
    assert latch.sounding is Level.DANGER


def test_each_grasp_has_an_alarm_of_its_own_also_where_nobody_acknowledged_the_last() -> None:
    """Four grasps slipped and one alarm was counted, with the first one's time on the page."""
    latch = AlarmLatch()
    for grasp_s in (10.0, 20.0, 30.0, 40.0):
        for step_s, state in ((1.0, STABLE), (2.0, WARNING), (3.0, UNSTABLE), (4.0, NO_GRASP)):
            latch.watch(decided(state), armed=False, now_s=grasp_s + step_s)
            if (grasp_s, state) == (40.0, UNSTABLE):
                now, earlier = latch.alarms
                assert (now.kind, now.text, now.since_s) == (GRASP, "the grasp is unstable", 42.0)
                assert earlier.text == "3 earlier grasps alarmed: not acknowledged"
                assert (earlier.kind, earlier.since_s, earlier.count) == (EARLIER, 12.0, 3)

    assert latch.counts.raised == latch.counts.waiting == 4
    (left,) = latch.alarms
    assert latch.acknowledge(left.number, 50.0)
    assert latch.alarms == ()
    assert latch.counts.acknowledged == 4


def test_of_one_grasp_that_is_over_the_line_says_how_bad_it_was() -> None:
    latch = AlarmLatch()
    latch.watch(decided(WARNING), armed=False, now_s=1.0)
    latch.watch(decided(NO_GRASP), armed=False, now_s=2.0)
    (alarm,) = latch.alarms
    assert alarm.text == "an earlier grasp began to slip: not acknowledged"
    assert (alarm.level, alarm.on, alarm.gone_s) == (Level.WARNING, False, 2.0)


def test_a_grasp_that_is_announced_has_an_alarm_of_its_own_once_it_was_calm() -> None:
    """The first words after the announcement may still be about the grasp before."""
    latch = AlarmLatch()
    latch.watch(decided(UNSTABLE), armed=False, now_s=1.0)
    latch.new_grasp()
    latch.watch(decided(UNSTABLE), armed=False, now_s=1.1)
    assert latch.counts.raised == 1
    latch.watch(decided(UNKNOWN, REASONS["settling"].say(left_s=0.4)), armed=False, now_s=1.2)
    assert [alarm.kind for alarm in latch.alarms] == [EARLIER]
    latch.watch(decided(WARNING), armed=False, now_s=2.0)
    assert [(a.kind, a.since_s, a.on) for a in latch.alarms] == [
        (GRASP, 2.0, True), (EARLIER, 1.0, False),
    ]  # fmt: skip
    assert latch.counts.raised == 2


def test_an_acknowledged_alarm_of_a_grasp_before_an_announced_one_is_over() -> None:
    latch = AlarmLatch()
    latch.watch(decided(UNSTABLE), armed=False, now_s=1.0)
    latch.acknowledge(latch.alarms[0].number, 1.5)
    latch.new_grasp()
    latch.watch(decided(UNKNOWN), armed=False, now_s=2.0)
    assert latch.alarms == ()
