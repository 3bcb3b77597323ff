"""Leads, delays and false alarms, on runs that can be counted by hand."""

import json
import math

import numpy as np
import pytest

from taxel.decisions.stability import Stability
from taxel.errors import BadInput
from taxel.evaluation.early_warning.events import (
    RunOutcome,
    StateTrack,
    alarms,
    by_group,
    judge,
    poisson_interval,
    summarise,
)

TIME = np.arange(61) / 10


def track(
    *stretches: tuple[float, float], onset: float | None, event: float | None, **groups: str
) -> StateTrack:
    """A run of 6 s that warns in the stretches given."""
    state = np.zeros(61, np.int8)
    early = TIME + 1e-9
    for start, stop in stretches:
        state[(early > start) & (early < stop)] = Stability.WARNING
    return StateTrack(states=state, time_s=TIME, onset_s=onset, event_s=event, groups=groups)


def test_lead_and_delay_of_a_warning() -> None:
    found = judge(track((3.2, 6.1), onset=3.0, event=3.5))

    assert found.warned_s == pytest.approx(3.2)
    assert found.delay_s == pytest.approx(0.2)
    assert found.lead_s == pytest.approx(0.3)
    assert (found.missed, found.early, found.false_alarms) == (False, False, 0)
    assert found.judged_s == pytest.approx(0.6)


def test_a_warning_after_the_event_is_a_miss_with_a_negative_lead() -> None:
    found = judge(track((4.0, 6.1), onset=3.0, event=3.5))

    assert found.missed
    assert found.lead_s == pytest.approx(-0.5)


def test_no_warning_is_a_miss() -> None:
    found = judge(track(onset=3.0, event=3.5))

    assert (found.missed, found.lead_s, found.delay_s) == (True, None, None)


def test_a_cleared_warning_long_before_the_onset_is_false() -> None:
    found = judge(track((0.5, 0.8), (3.1, 6.1), onset=3.0, event=3.5))

    assert found.false_alarms == 1
    assert found.lead_s == pytest.approx(0.4)


def test_a_warning_that_is_always_on_earns_no_more_than_the_early_limit() -> None:
    found = judge(track((0.0, 6.1), onset=4.0, event=4.5))

    assert found.early
    assert found.false_alarms == 0
    assert found.lead_s == pytest.approx(2.5)


def test_every_alarm_of_a_run_that_holds_is_false() -> None:
    found = judge(track((1.0, 2.0), (4.0, 6.1), onset=2.0, event=None))

    assert (found.event, found.missed, found.false_alarms) == (False, False, 2)
    assert found.judged_s == pytest.approx(5.6)


def test_nothing_before_the_settled_start_counts() -> None:
    assert judge(track((0.0, 0.3), onset=None, event=None)).false_alarms == 0
    late = judge(track((0.0, 1.0), onset=None, event=0.6))
    assert late.warned_s == pytest.approx(0.4)


def test_unknown_neither_ends_nor_starts_an_alarm() -> None:
    states = np.array([0, 1, 3, 3, 2, 0, 3, 0], np.int8)

    assert alarms(states, np.arange(8.0), 0.0) == [(1.0, 5.0)]
    assert alarms(np.full(3, 3, np.int8), np.arange(3.0), 0.0) == []
    assert alarms(np.array([0, 1], np.int8), np.arange(2.0), 0.0) == [(1.0, math.inf)]


def outcomes() -> list[RunOutcome]:
    """Three cups: leads 0.1, 0.3 and 0.5, one missed, one false alarm in 4 × 5.6 s."""
    hold = [track(onset=None, event=None, cup=cup, force_n="15") for cup in "abc"]
    cries = track((2.0, 3.0), onset=None, event=None, cup="c", force_n="100")
    warned = [
        track((3.5 - lead, 6.1), onset=3.0, event=3.5, cup=cup, force_n="15")
        for cup, lead in zip("abc", (0.1, 0.3, 0.5), strict=True)
    ]
    missed = track(onset=3.0, event=3.5, cup="a", force_n="100")
    return [judge(grasp) for grasp in [*hold, cries, *warned, missed]]


def test_scores_in_closed_form() -> None:
    scores = summarise(outcomes())

    assert (scores.runs, scores.events, scores.clusters) == (8, 4, 3)
    assert scores.lead_median_s == pytest.approx(0.3)
    assert scores.lead_p5_s == pytest.approx(0.12)
    assert scores.lead_p95_s == pytest.approx(0.48)
    assert scores.delay_median_s == pytest.approx(0.2)
    assert scores.missed_share == 0.25
    assert scores.false_alarms == 1
    assert scores.hold_min == pytest.approx(4 * 5.6 / 60)
    assert scores.false_alarms_per_min == pytest.approx(60 / (4 * 5.6))
    assert scores.false_alarms_per_min_all == pytest.approx(60 / (4 * 5.6 + 4 * 0.6))


def test_intervals_hold_the_value_and_repeat_with_the_seed() -> None:
    scores = summarise(outcomes())

    assert scores.lead_interval_s == pytest.approx((0.1, 0.5))
    assert scores.missed_interval == (0.0, 0.5)
    assert scores.false_alarms_interval[0] == 0.0
    assert summarise(outcomes()) == scores


def test_one_cup_gives_no_interval() -> None:
    scores = summarise([outcome for outcome in outcomes() if outcome.groups["cup"] == "a"])

    assert np.isnan(scores.lead_interval_s).all()
    assert scores.as_dict()["lead_interval_s"] == [None, None]
    assert "NaN" not in json.dumps(scores.as_dict())


def test_runs_that_all_hold_have_no_lead() -> None:
    scores = summarise([judge(track(onset=None, event=None, cup=cup)) for cup in "ab"])

    assert math.isnan(scores.lead_median_s)
    assert math.isnan(scores.missed_share)
    assert scores.false_alarms_per_min == 0.0


def test_groups_are_scored_apart_in_natural_order() -> None:
    found = by_group(outcomes(), "force_n")

    assert list(found) == ["15", "100"]
    assert found["100"].missed_share == 1.0
    assert found["15"].false_alarms == 0
    with pytest.raises(BadInput, match="'colour'"):
        by_group(outcomes(), "colour")


def test_poisson_intervals_match_the_tables() -> None:
    """Garwood's limits: 0 gives 0 to 3.689, 5 gives 1.623 to 11.668."""
    assert poisson_interval(0, 1.0) == pytest.approx((0.0, 3.689), abs=1e-3)
    assert poisson_interval(5, 1.0) == pytest.approx((1.623, 11.668), abs=1e-3)
    assert np.isnan(poisson_interval(0, 0.0)).all()


def test_nothing_to_judge_is_refused() -> None:
    with pytest.raises(BadInput, match="at least one run"):
        summarise([])
    with pytest.raises(BadInput, match="at least two"):
        StateTrack(states=np.zeros(1, np.int8), time_s=np.zeros(1), onset_s=None, event_s=None)
