"""The stability monitor warns in time, holds its word, and never calls silence stable."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from taxel.decisions.reasons import REASONS
from taxel.decisions.stability import (
    Stability,
    StabilityConfig,
    StabilityDecision,
    StabilityMonitor,
    states,
)
from taxel.errors import BadInput

STABLE, WARNING, UNSTABLE, UNKNOWN, NO_GRASP = Stability
CONFIG = StabilityConfig(
    warn=0.5, clear=0.3, unstable=0.8, raise_s=0.2, clear_s=0.3, largest_age_s=0.15
)


def run(probabilities: list[float], config: StabilityConfig = CONFIG) -> list[Stability]:
    """States at one probability every 0.1 s."""
    time = np.arange(len(probabilities)) / 10
    return [Stability(s) for s in states(np.array(probabilities), time, config)]


def calm() -> StabilityMonitor:
    """A monitor that has been stable from 0 to 0.2 s."""
    monitor = StabilityMonitor(CONFIG)
    for i in range(3):
        decision = monitor.push(0.1 + i * 1e-3, i / 10)
    assert decision.state is STABLE
    return monitor


def test_stable_is_earned() -> None:
    assert run([0.1, 0.11, 0.12, 0.13]) == [UNKNOWN, UNKNOWN, STABLE, STABLE]


def test_what_a_monitor_weighs_is_a_probability_unless_somebody_says_that_it_is_a_score() -> None:
    assert not calm().push(0.1, 0.3).is_score


def test_a_probability_at_the_warning_limit_is_not_calm() -> None:
    """Stable needs 0.2 s below 0.5: at 0.5 the calm stretch has ended."""
    assert run([0.4, 0.41, 0.5, 0.42, 0.43]) == [UNKNOWN] * 5
    assert run([0.4, 0.41, 0.49, 0.42, 0.43])[2:] == [STABLE] * 3


def test_raising_waits_for_the_debounce() -> None:
    """0.2 s at or above 0.5, one glitch does not count."""
    assert run([0.1, 0.1, 0.1, 0.9, 0.1, 0.5, 0.6, 0.5])[3:] == [
        STABLE, STABLE, STABLE, STABLE, WARNING,
    ]  # fmt: skip


def test_a_high_probability_is_unstable() -> None:
    assert run([0.1, 0.1, 0.1, 0.6, 0.9, 0.9, 0.9])[3:] == [STABLE, STABLE, WARNING, UNSTABLE]


def test_an_alarm_holds_until_it_is_cleared() -> None:
    """Between clear and warn nothing changes; 0.3 s below clear clears."""
    rise = [0.9, 0.9, 0.9]
    assert run([*rise, 0.4, 0.4, 0.2, 0.2, 0.4, 0.2, 0.2, 0.2, 0.2])[2:] == [
        UNSTABLE, UNSTABLE, UNSTABLE, UNSTABLE, UNSTABLE, UNSTABLE,
        UNSTABLE, UNSTABLE, UNSTABLE, STABLE,
    ]  # fmt: skip


def test_without_debounce_it_answers_at_once() -> None:
    quick = StabilityConfig(raise_s=0.0, clear_s=0.0)

    assert run([0.1, 0.6, 0.1, 0.9], quick) == [STABLE, WARNING, STABLE, UNSTABLE]


@pytest.mark.parametrize(
    ("probability", "time_s", "usable", "now_s", "reason"),
    [
        (math.nan, 0.3, True, 0.3, "NaN"),
        (1.5, 0.3, True, 0.3, "no number within 0 and 1"),
        (-0.1, 0.3, True, 0.3, "no number within 0 and 1"),
        (0.1, 0.3, False, 0.3, "images"),
        (0.1, 0.3, True, 0.5, "0.20 s old"),
        (0.1, math.nan, True, 0.3, "no time"),
        (0.1, 0.3, True, math.nan, "nan s old"),
        (0.1, 0.1, True, 0.2, "stepped back"),
        (0.1, 0.2, True, 0.4, "0.20 s old"),
    ],
)
def test_bad_input_is_unknown_with_its_reason(
    probability: float, time_s: float, usable: bool, now_s: float, reason: str
) -> None:
    decision = calm().push(probability, time_s, usable, now_s)

    assert decision.state is UNKNOWN
    assert reason in decision.reason
    assert math.isnan(decision.probability)


def test_silence_is_unknown() -> None:
    monitor = calm()

    assert monitor.at(0.3).state is STABLE
    assert monitor.at(0.36).state is UNKNOWN
    assert StabilityMonitor(CONFIG).at(0.0).state is UNKNOWN


def test_a_gap_takes_stable_away() -> None:
    """After 0.2 s without input the next good input is not yet STABLE."""
    assert calm().push(0.1, 0.4).state is UNKNOWN


def test_an_alarm_outlives_lost_input() -> None:
    """A warning comes back with the input until evidence clears it."""
    monitor = StabilityMonitor(CONFIG)
    for i in range(3):
        monitor.push(0.6, i / 10)
    lost = monitor.push(math.nan, 0.3)
    back = monitor.push(0.1, 0.4)

    assert (lost.state, back.state) == (UNKNOWN, WARNING)


def test_frozen_input_is_unknown() -> None:
    found = run([0.1] * 14)

    assert found[2:11] == [STABLE] * 9
    assert found[11:] == [UNKNOWN] * 3


def test_a_saturated_or_alarming_probability_is_not_called_frozen() -> None:
    assert run([0.0] * 20)[-1] is STABLE
    assert run([0.7] * 20)[-1] is WARNING


def test_it_says_since_when() -> None:
    monitor = calm()

    assert monitor.push(0.15, 0.3).since_s == pytest.approx(0.2)
    assert StabilityMonitor(CONFIG).push(math.nan, 0.3).since_s == pytest.approx(0.3)


def test_a_reset_monitor_knows_nothing() -> None:
    monitor = calm()
    monitor.reset()

    assert monitor.push(0.1, 0.3) == StabilityDecision(
        UNKNOWN, REASONS["evidence"].say(left_s=CONFIG.raise_s), 0.3, 0.1
    )


def test_a_clock_set_back_is_noticed_behind_unusable_input_and_twice_in_a_row() -> None:
    """An alarm stands meanwhile, so that what is shown says whether it was noticed."""
    monitor = StabilityMonitor(CONFIG)
    for i in range(3):
        monitor.push(1.0, i / 10)
    monitor.push(math.nan, 0.6, usable=False)

    back = [monitor.push(0.0, time_s) for time_s in (0.4, 0.2)]

    assert [decision.state for decision in back] == [UNKNOWN, UNKNOWN]
    assert all(decision.reason == REASONS["time stepped back"].say() for decision in back)
    assert monitor.push(0.0, 0.3).state is UNSTABLE


def test_input_that_froze_before_the_clock_was_set_back_is_never_stable_for_long() -> None:
    monitor = StabilityMonitor(CONFIG)
    for i in range(3):
        monitor.push(0.1 + i * 1e-3, 1000 + i / 10)
    back = [monitor.push(0.102, 400 + i / 10).state for i in range(20)]

    assert back[0] is UNKNOWN
    assert back[-1] is UNKNOWN


@given(
    st.lists(
        st.tuples(
            st.one_of(st.floats(0, 1), st.just(math.nan)),
            st.sampled_from([0.0, 0.1, 0.1, 0.1, 0.4, -0.2]),
            st.booleans(),
        ),
        max_size=60,
    )
)
def test_stable_never_stands_beside_bad_or_alarming_input(
    inputs: list[tuple[float, float, bool]],
) -> None:
    """Whatever comes: unusable input is UNKNOWN with a reason, and a probability that has stood
    at or above `warn` for the debounce time is never STABLE."""
    monitor = StabilityMonitor(CONFIG)
    time, high_since = 0.0, math.inf
    for probability, step, usable in inputs:
        time += step
        decision = monitor.push(probability, time, usable)
        if step == 0:
            continue
        good = usable and not math.isnan(probability) and step > 0
        gap = step > CONFIG.largest_age_s
        high = good and probability >= CONFIG.warn
        high_since = (time if gap else min(high_since, time)) if high else math.inf
        assert good or decision.state is UNKNOWN
        assert not (gap and decision.state is STABLE)
        assert (decision.state is UNKNOWN) == bool(decision.reason)
        if time - high_since >= CONFIG.raise_s:
            assert decision.alarm


def test_thresholds_out_of_order_are_refused() -> None:
    with pytest.raises(BadInput, match="clear ≤ warn"):
        StabilityConfig(warn=0.2, clear=0.3)
    with pytest.raises(BadInput, match="at least 0 s"):
        StabilityConfig(raise_s=-1.0)
    with pytest.raises(BadInput, match="one time"):
        states(np.zeros(3), np.zeros(2), CONFIG)


def test_states_have_words_for_a_person() -> None:
    assert [state.word for state in Stability] == [
        "STABLE", "WARNING", "UNSTABLE", "UNKNOWN", "NO GRASP",
    ]  # fmt: skip


def test_the_thresholds_and_times_are_those_of_decision_0013() -> None:
    config = StabilityConfig()

    assert (config.warn, config.clear, config.unstable) == (0.5, 0.3, 0.8)
    assert (config.raise_s, config.clear_s) == (0.05, 0.3)
    assert (config.largest_age_s, config.frozen_s) == (0.2, 1.0)


def test_thresholds_may_be_equal_and_lie_at_both_ends() -> None:
    assert StabilityConfig(clear=0.0, warn=0.0, unstable=0.0).unstable == 0.0
    assert StabilityConfig(clear=1.0, warn=1.0, unstable=1.0).clear == 1.0
    for bad in ({"unstable": 1.1}, {"clear": -0.1}, {"unstable": 0.4}, {"frozen_s": -0.1}):
        with pytest.raises(BadInput):
            StabilityConfig(**bad)


@pytest.mark.parametrize(("probability", "state"), [(1.0, UNSTABLE), (0.0, STABLE)])
def test_certainty_is_a_probability(probability: float, state: Stability) -> None:
    assert run([probability] * 4)[-1] is state


def test_evidence_names_the_time_that_it_still_needs() -> None:
    """0.2 s must pass, whichever side of the threshold the evidence lies on."""
    monitor = StabilityMonitor(CONFIG)
    left = [monitor.push(p, t).reason for p, t in ((0.1, 0.0), (0.11, 0.1), (0.6, 0.15))]

    assert left == [REASONS["evidence"].say(left_s=s) for s in (0.2, 0.1, 0.2)]


def test_a_flag_for_each_probability_is_needed() -> None:
    with pytest.raises(BadInput, match="3 and 2 for 3"):
        states(np.zeros(3), np.arange(3.0), CONFIG, np.ones(2, bool))


def test_a_grasp_that_is_over_is_no_grasp_since_then() -> None:
    monitor = calm()
    over = monitor.over(0.25)

    assert (over.state, over.since_s, over.alarm) == (NO_GRASP, 0.25, False)
    assert monitor.at(9.0) == over
    assert monitor.over(0.5).since_s == 0.25


def test_silence_is_unknown_from_the_moment_that_it_was_noticed() -> None:
    monitor = calm()
    lost = monitor.at(0.36)

    assert (lost.state, lost.since_s, lost.reason) == (
        UNKNOWN, 0.36, REASONS["old"].say(age_s=0.36 - 0.2),
    )  # fmt: skip
    assert monitor.at(0.5).since_s == 0.36


def test_the_same_moment_again_is_no_evidence() -> None:
    monitor = StabilityMonitor(CONFIG)
    for _ in range(9):
        decision = monitor.push(0.9, 0.0)
    assert decision.state is UNKNOWN
    assert monitor.push(0.9, 0.0, now_s=0.151).reason == REASONS["old"].say(age_s=0.151)


def test_the_numbers_of_states_are_those_that_arrays_hold() -> None:
    assert [int(state) for state in Stability] == [0, 1, 2, 3, 4]


def test_a_second_frame_of_the_same_moment_is_no_clock_that_was_set_back() -> None:
    """Also where the first could not be used."""
    monitor = StabilityMonitor(CONFIG)
    monitor.push(0.1, 5.0, usable=False)
    assert monitor.push(0.1, 5.0).reason != REASONS["time stepped back"].say()
